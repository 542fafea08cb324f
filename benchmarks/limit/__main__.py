"""The rods of the plain study by uqpen and by a C++ program at the machine's limit, side by side.

Run it as ``python benchmarks/limit --markdown docs/walker_anderson.md``, with uqpen installed and
g++ or clang++ on the path. The program solves the same equations by the same pair of formulas, with
vectors of lanes, fused operations and all of the compiler's optimisation. Its tolerance is the
loosest at which its largest error is no larger than uqpen's. Both run on one processor, by turns in
one process; times are processor times. The exit code is 1 if uqpen takes more than 1.5 times as
long, and 0 where there is no compiler.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import median
from typing import NamedTuple
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from program import Erode, compile_limit, find_compiler
from reference import admissible_points, dop853, worst_error
from seed_table import fill, lines

from uqpen.core.arrays import FloatArray
from uqpen.models import walker_anderson
from uqpen.models.walker_anderson import DEFAULT_TOLERANCE, WalkerAnderson, erode

HEAD = ("", "tolerance", "largest error", "evaluations a run", "ns each", "µs a run")
CHECKED = 100
REPEATS = 21
ALLOWED = 1.5


class Measured(NamedTuple):
    """A way to integrate rods, at a tolerance."""

    erode: Erode
    tolerance: float
    error: float
    evaluations: float


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")
    options = parser.parse_args()
    os.environ["UQPEN_THREADS"] = "1"
    compiler = find_compiler()
    if compiler is None:
        print("not measured: there is neither g++ nor clang++ here")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        limit = compile_limit(compiler, Path(folder))
        rods, reference = _rods_and_reference()
        ways = _at_equal_error(limit, rods, reference)
        text, ratio = _table(ways, rods)
    print(text)
    if options.markdown:
        fill(options.markdown, "machine's limit", text)
    return int(ratio > ALLOWED)


def _rods_and_reference() -> tuple[FloatArray, FloatArray]:
    """The rods of the plain study, and their depths and residues at a tight tolerance."""
    batch = admissible_points()
    with mock.patch.object(walker_anderson, "erode", wraps=erode) as watched:
        WalkerAnderson(1e-12).evaluate(batch)
    (rods, _), _ = watched.call_args
    reference = _depth_and_residue(erode, rods, 1e-12)
    some = {name: values[:CHECKED] for name, values in batch.items()}
    other = dop853(some, 1e-13) / batch["projectile_length"][0]
    agreement = worst_error(reference[:, :CHECKED], other)
    print(f"reference: tolerance 1e-12; SciPy's DOP853 agrees to {agreement:.0e} in {CHECKED} runs")
    return rods, reference


def _depth_and_residue(erode: Erode, rods: FloatArray, tolerance: float) -> FloatArray:
    """Final depths and residues in lengths of the rod; see `WalkerAnderson.evaluate`."""
    u, _, L, z = erode(rods, tolerance)[:4]
    return np.array([z + (rods[0] * L + rods[6] / 2) * np.log1p(u**2 / rods[7]), L])


def _at_equal_error(limit: Erode, rods: FloatArray, reference: FloatArray) -> dict[str, Measured]:
    def error(erode: Erode, tolerance: float) -> float:
        return worst_error(_depth_and_residue(erode, rods, tolerance), reference)

    ours = error(erode, DEFAULT_TOLERANCE)
    # The error is no smooth function of the tolerance: the loosest of those that keep it.
    tolerances = DEFAULT_TOLERANCE * np.geomspace(3.0, 0.3, 41)
    loosest = next(each for each in tolerances.tolist() if error(limit, each) <= ours)
    counted = float((8 + 6 * erode(rods, DEFAULT_TOLERANCE)[5]).mean())
    return {
        "uqpen": Measured(erode, DEFAULT_TOLERANCE, ours, counted),
        "C++": Measured(limit, loosest, error(limit, loosest), limit(rods, loosest)[5].mean()),
    }


def _table(ways: Mapping[str, Measured], rods: FloatArray) -> tuple[str, float]:
    """The lines of the table and of what follows from it, and the ratio of times."""
    seconds = {name: np.empty(REPEATS) for name in ways}
    for repeat in range(REPEATS):
        for name, way in ways.items():
            began = time.process_time()
            way.erode(rods, way.tolerance)
            seconds[name][repeat] = time.process_time() - began
    ratios = seconds["uqpen"] / seconds["C++"]
    ratio = median(ratios.tolist())
    each_run = {name: median(found.tolist()) / rods.shape[1] for name, found in seconds.items()}
    low, high = np.quantile(ratios, (0.25, 0.75))
    said = f"Ratio of times, by turns: {ratio:.2f} (half of {REPEATS} in {low:.2f} to {high:.2f})."
    return "\n".join([*lines(HEAD, _rows(ways, each_run)), "", said]), ratio


def _rows(ways: Mapping[str, Measured], seconds: Mapping[str, float]) -> Iterator[list[str]]:
    for name, way in ways.items():
        each = seconds[name] / way.evaluations * 1e9
        numbers = f"{way.tolerance:.1e}", f"{way.error:.1e}", f"{way.evaluations:.0f}"
        yield [name, *numbers, f"{each:.1f}", f"{seconds[name] * 1e6:.2f}"]


if __name__ == "__main__":
    sys.exit(main())
