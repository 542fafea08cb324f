"""How often the intervals of Sobol' indices cover along Campbell's curve, and of it as a whole.

Run it as ``python benchmarks/field_indices_coverage.py --markdown docs/coverage.md``, with uqpen
installed. The curve has nineteen angles, ten degrees apart. Five hundred seeds tell a coverage of
95 % to one point. A cell fails if an input's index of the whole curve covers in less than 92 %.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import campbell
import numpy as np
import numpy.typing as npt
import xarray as xr
from seed_table import fill

from uqpen.core.labels import INTERVAL_LABEL
from uqpen.core.model import Dimension
from uqpen.designs.design import Design
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.saltelli import Saltelli
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

FloatArray = npt.NDArray[np.float64]

LOWEST = 0.92
EVERY = 10
(ANGLES,) = campbell.CURVE.dims
CURVE = replace(
    campbell.CURVE, dims=(Dimension(ANGLES.name, ANGLES.unit, values=ANGLES.values[::EVERY]),)
)
DESIGNS: dict[str, Design] = {
    "monte-carlo, 1 000 runs": MonteCarlo(runs=1000),
    "latin-hypercube, 10 × 100 runs": LatinHypercube(runs=1000, replicates=10),
    "latin-hypercube, 1 × 1 000 runs": LatinHypercube(runs=1000, replicates=1),
    "saltelli, 16 × 64 blocks, 6 144 runs": Saltelli(base=1024),
}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")
    options = parser.parse_args()
    truths = dict(_truths())
    lines, worst = [], 1.0
    for name, design in DESIGNS.items():
        for statistic, (covered, label) in _coverage(design, truths, options.seeds).items():
            is_whole = covered.ndim == 1
            worst = min(worst, float(covered.min())) if is_whole else worst
            inputs = [
                f"{100 * each.min():.1f} … {100 * each.max():.1f}"
                if each.ndim
                else f"{100 * each:.1f}"
                for each in np.moveaxis(covered, -1, 0)
            ]
            title = statistic.replace("_", " ") + ("" if is_whole else ", at the angles")
            lines.append(f"| {name} | {title} | {' | '.join(inputs)} | {label} |")
            print(lines[-1], flush=True)
    head = "| design | index | x1 | x2 | x3 | x4 | label |\n|---|---|---|---|---|---|---|"
    if options.markdown:
        text = "\n".join([head, *lines, "", f"Seeds: {options.seeds}."])
        fill(options.markdown, "indices of fields", text)
    return 1 if worst < LOWEST else 0


def _truths() -> Iterator[tuple[str, FloatArray]]:
    """The indices at the angles, and those of the curve through them."""
    exact, weights = campbell.exact(), CURVE.dims[0].weights
    variance = weights * exact.std[::EVERY] ** 2
    for order in ("first_order", "total_order"):
        at_angles = getattr(exact, order)[::EVERY]
        yield order, at_angles
        yield f"generalized_{order}", variance @ at_angles / variance.sum()


def _coverage(
    design: Design, truths: Mapping[str, FloatArray], seeds: int
) -> dict[str, tuple[FloatArray, str]]:
    """The share of the intervals that contain the truth, by statistic, and the intervals' label."""
    found: dict[str, list[npt.NDArray[np.bool_]]] = {}
    labels: dict[str, set[str]] = {}
    for seed in range(seeds):
        runs = campbell.runs_of(design, seed)
        values = xr.Variable(("run", ANGLES.name), runs[CURVE.name].values[:, ::EVERY])
        runs = runs.drop_vars(CURVE.name).drop_dims(ANGLES.name, errors="ignore")
        quantity = QuantityOfInterest(CURVE, "1")
        arrays = analyze(runs.assign({CURVE.name: values}), [quantity], only=["sensitivity"])
        for name, array in arrays[CURVE.name].items():
            lower, upper = array.values[..., 1], array.values[..., 2]
            found.setdefault(name, []).append((lower <= truths[name]) & (truths[name] <= upper))
            labels.setdefault(name, set()).update(np.ravel(array[INTERVAL_LABEL].values))
    return {
        name: (np.mean(covered, axis=0), ", ".join(sorted(labels[name])))
        for name, covered in found.items()
    }


if __name__ == "__main__":
    raise SystemExit(main())
