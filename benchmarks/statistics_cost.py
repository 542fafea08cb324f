"""Processor time and memory of the statistics of runs in memory, beside another commit.

    python benchmarks/statistics_cost.py --base main --output costs.csv
    python benchmarks/statistics_cost.py --base main --output costs.csv --only outputs-300
    python benchmarks/statistics_cost.py --from costs.csv --markdown docs/performance.md

A table as `seed_table.py` makes it, whose seeds are repeats. Each measurement is a process of its
own, by turns with the other commit. The runs are of a formula; only `analyze` and
`analyze_failures` are timed. Memory is the peak of the process, with its libraries
and the runs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from statistics import median
from typing import NamedTuple

from seed_table import Row, SeedTable, lines
from start import ROOT, checkout_of


class Case(NamedTuple):
    """Numbers of inputs, outputs and runs."""

    inputs: int
    outputs: int
    runs: int


CASES = {
    "million": Case(4, 3, 1_000_000),
    "hundred-thousand": Case(4, 3, 100_000),
    "wide-outputs-150": Case(4, 150, 1_000),
    "wide-outputs-300": Case(4, 300, 1_000),
    "wide-inputs-250": Case(250, 1, 2_000),
    "wide-inputs-500": Case(500, 1, 2_000),
}

# Runs in both commits, so it names nothing that only one of them has.
_MEASURED = """
import json, resource, sys, time
import numpy as np, xarray as xr
from uqpen.core.labels import ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Output
from uqpen.statistics.analyze import analyze, analyze_failures
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold

inputs, outputs, runs = map(int, sys.argv[1:])

def made(size):
    generator = np.random.default_rng(1)
    columns = {f"x{i}": (RUN, generator.standard_normal(size), {ROLE: "input"})
               for i in range(inputs)}
    weights = generator.standard_normal((outputs, inputs)) / np.arange(1, inputs + 1)
    for number, own in enumerate(weights):
        columns[f"y{number}"] = RUN, np.zeros(size)
        for each, weight in enumerate(own):
            x = columns[f"x{each}"][1]
            columns[f"y{number}"][1][:] += weight * x + 0.3 * (weight * x) ** 2
    columns[STATUS] = RUN, np.zeros(size, dtype=np.int8)
    return xr.Dataset(columns, attrs={SAMPLING: "independent"})

quantities = [QuantityOfInterest(Output(f"y{i}", "m"), "m", (Threshold("1 m", 1.0),))
              for i in range(outputs)]
analyze(made(max(2**18 // inputs + 1, 300)), quantities[:1])  # imports, and compiles
whole = made(runs)
begun = time.process_time()
analyze(whole, quantities)
analyze_failures(whole)
seconds = time.process_time() - begun
print(json.dumps([seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024]))
"""


def _rows(case: str, commit: str, seeds: Sequence[int], base: str) -> Iterator[Row]:
    """Yield processor time in s, and the peak of memory in bytes."""
    for _ in seeds:
        with (
            tempfile.TemporaryDirectory() as scratch,
            checkout_of(base, Path(scratch)) if commit == "base" else nullcontext(ROOT) as checkout,
        ):
            done = subprocess.run(
                [sys.executable, "-c", _MEASURED, *map(str, CASES[case])],
                cwd=checkout,  # which comes before all other places of modules
                env={**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"},
                stdout=subprocess.PIPE,
                text=True,
                check=True,
            )
        yield dict(zip(("seconds", "memory"), json.loads(done.stdout), strict=True))


def page(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the table: medians, and the ratios of each repeat with their range."""
    head = ["inputs", "outputs", "runs", "before, s", "now, s", "ratio (range)", "before, MB"]
    found = [[*case[:2], f"{case.runs:_}", *_cells(rows, name)] for name, case in CASES.items()]
    yield from lines([*head, "now, MB"], found)


def _cells(rows: Sequence[Row], name: str) -> list[str]:
    base, here = (
        {row["first"]: row for row in rows if (row["case"], row["commit"]) == (name, commit)}
        for commit in ("base", "here")
    )
    both = sorted(base.keys() & here.keys())
    if not both:
        return ["not measured", "", "", "", ""]
    ratios = [here[each]["seconds"] / base[each]["seconds"] for each in both]
    ends = f"{min(ratios):.2f} to {max(ratios):.2f}" if len(both) > 1 else "one repeat"

    def middle(of: Mapping[int, Row], key: str) -> float:
        return median(of[each][key] for each in both)

    return [
        *(f"{middle(of, 'seconds'):.3g}" for of in (base, here)),
        f"{median(ratios):.2f} ({ends})",
        *(f"{middle(of, 'memory') / 1e6:.0f}" for of in (base, here)),
    ]


TABLE = SeedTable(
    {"case": CASES, "commit": ("base", "here")},
    _rows,
    {"statistics": page},
    seeds=3,
    options={"--base": {"metavar": "COMMIT", "help": "what to compare this checkout with"}},
)

if __name__ == "__main__":
    TABLE.main(__doc__)
