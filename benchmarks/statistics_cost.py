"""Processor time and memory of the statistics of runs in memory, beside another commit.

    python benchmarks/statistics_cost.py --base main --output costs.csv
    python benchmarks/statistics_cost.py --base main --output costs.csv --only wide-outputs-300
    python benchmarks/statistics_cost.py --from costs.csv --markdown docs/performance.md

Each measurement is a process of its own, by turns with the other commit. What a file has already is
not measured again, so an interrupted command goes on. The runs are of a formula; only
`analyze` and `analyze_failures` are timed. Memory is the peak of the process, with its libraries
and the runs.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from seed_table import fill
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


class Measured(NamedTuple):
    """Cost of a case: processor time in s, and peak of memory in bytes."""

    case: str
    repeat: int
    commit: str
    seconds: float
    memory: float


def main() -> None:
    """Measure what is missing, and write the table."""
    options = _options()
    known = [each for path in options.files for each in _read(path)]
    if options.base:
        known += _measure(options)
    lines = list(_lines(known))
    print("\n".join(lines))
    if options.markdown:
        fill(options.markdown, "statistics", "\n".join(lines))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--base", metavar="COMMIT", help="what to compare this checkout with")
    parser.add_argument("--only", action="append", choices=CASES)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--output", type=Path, default=Path("costs.csv"), metavar="FILE.csv")
    parser.add_argument("--from", dest="files", nargs="+", type=Path, default=[])
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")
    return parser.parse_args()


def _measure(options: argparse.Namespace) -> list[Measured]:
    """Measure both commits by turns, and add each result to the file at once."""
    known = list(_read(options.output)) if options.output.exists() else []
    done = {(each.case, each.repeat, each.commit) for each in known}
    with (
        tempfile.TemporaryDirectory() as scratch,
        checkout_of(options.base, Path(scratch)) as base,
    ):
        for repeat in range(options.repeats):
            for case in options.only or CASES:
                for commit, checkout in (("base", base), ("here", ROOT)):
                    if (case, repeat, commit) not in done:
                        seconds, memory = _cost(checkout, CASES[case])
                        known.append(Measured(case, repeat, commit, seconds, memory))
                        with options.output.open("w", newline="", encoding="utf-8") as file:
                            csv.writer(file).writerows([Measured._fields, *known])
    return known


def _cost(checkout: Path, case: Case) -> tuple[float, float]:
    done = subprocess.run(
        [sys.executable, "-c", _MEASURED, *map(str, case)],
        cwd=checkout,  # which comes before all other places of modules
        env={**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    seconds, memory = json.loads(done.stdout)
    return seconds, memory


def _read(path: Path) -> Iterator[Measured]:
    with path.open(newline="", encoding="utf-8") as file:
        for case, repeat, commit, seconds, memory in list(csv.reader(file))[1:]:
            yield Measured(case, int(repeat), commit, float(seconds), float(memory))


def _lines(measured: Sequence[Measured]) -> Iterator[str]:
    """Yield the lines of the table: medians, and the ratios of each repeat with their range."""
    yield "| inputs | outputs | runs | before, s | now, s | ratio (range) | before, MB | now, MB |"
    yield "|---|---|---|---|---|---|---|---|"
    for name, case in CASES.items():
        by_commit = {
            commit: {m.repeat: m for m in measured if (m.case, m.commit) == (name, commit)}
            for commit in ("base", "here")
        }
        both = sorted(by_commit["base"].keys() & by_commit["here"].keys())
        if not both:
            yield f"| {case.inputs} | {case.outputs} | {case.runs:_} | not measured | | | | |"
            continue
        base, here = ([by_commit[commit][each] for each in both] for commit in ("base", "here"))
        ratios = [new.seconds / old.seconds for old, new in zip(base, here, strict=True)]
        yield (
            f"| {case.inputs} | {case.outputs} | {case.runs:_} "
            f"| {statistics.median(each.seconds for each in base):.3g} "
            f"| {statistics.median(each.seconds for each in here):.3g} "
            f"| {statistics.median(ratios):.2f} {_range(ratios)} "
            f"| {statistics.median(each.memory for each in base) / 1e6:.0f} "
            f"| {statistics.median(each.memory for each in here) / 1e6:.0f} |"
        )


def _range(ratios: Sequence[float]) -> str:
    return "(one repeat)" if len(ratios) == 1 else f"({min(ratios):.2f} to {max(ratios):.2f})"


if __name__ == "__main__":
    main()
