"""How often the intervals of Sobol' indices cover along Campbell's curve, and of it as a whole.

A table of docs/coverage/fields.md as `seed_table.py` makes it. The curve has nineteen angles, ten
degrees apart. Five hundred seeds tell a coverage of 95 % to one point. A cell fails if an input's
index of the whole curve covers in less than 92 %.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import campbell
import numpy as np
import xarray as xr
from seed_table import LOWEST, Row, SeedTable, lines, totals

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LABEL
from uqpen.core.model import Dimension
from uqpen.designs.design import Design
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.saltelli import Saltelli
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

NAMES = ("x1", "x2", "x3", "x4")
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


@cache
def _truths() -> dict[str, FloatArray]:
    """The indices at the angles, and those of the curve through them."""
    exact, weights = campbell.exact(), CURVE.dims[0].weights
    variance = weights * exact.std[::EVERY] ** 2
    found = {}
    for order in ("first_order", "total_order"):
        found[order] = getattr(exact, order)[::EVERY]
        found[f"generalized_{order}"] = variance @ found[order] / variance.sum()
    return found


def _rows(design: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield how many intervals cover, by statistic, place and input; the place of a curve is 0."""
    quantity = QuantityOfInterest(CURVE, "1")
    found: defaultdict[tuple[str, str], list[FloatArray]] = defaultdict(list)
    for seed in seeds:
        runs = campbell.runs_of(DESIGNS[design], seed)
        values = xr.Variable(("run", ANGLES.name), runs[CURVE.name].values[:, ::EVERY])
        runs = runs.drop_vars(CURVE.name).drop_dims(ANGLES.name, errors="ignore")
        arrays = analyze(runs.assign({CURVE.name: values}), [quantity], only=["sensitivity"])
        for name, array in arrays[CURVE.name].items():
            _, lower, upper = np.moveaxis(array.values, -1, 0)
            truth, label = _truths()[name], ", ".join(np.unique(array[INTERVAL_LABEL].values))
            found[name, label].append(np.atleast_2d((lower <= truth) & (truth <= upper)))
    for (name, label), covers in found.items():
        for place, inputs in enumerate(np.sum(covers, axis=0)):
            row = {"statistic": name, "label": label, "place": place}
            yield row | dict(zip(NAMES, inputs, strict=True))


def _shares(rows: Sequence[Row]) -> Iterator[tuple[tuple[str, str, str], FloatArray]]:
    """Yield the share of intervals that cover, shape (place, input), by design and statistic."""
    cells = totals(rows, "design", "statistic", "label", "place")
    for key in dict.fromkeys(key[:3] for key in cells):
        own = [cell for each, cell in cells.items() if each[:3] == key]
        yield key, np.array([[getattr(c, name) / c.count for name in NAMES] for c in own])


def _page(rows: Sequence[Row]) -> Iterator[str]:
    of = []
    for (design, statistic, label), shares in _shares(rows):
        ends = 100 * shares.min(axis=0), 100 * shares.max(axis=0)
        is_whole = len(shares) == 1
        inputs = [
            f"{low:.1f}" if is_whole else f"{low:.1f} … {high:.1f}"
            for low, high in zip(*ends, strict=True)
        ]
        title = statistic.replace("_", " ") + ("" if is_whole else ", at the angles")
        of.append([design, title, *inputs, label])
    yield from lines(["design", "index", *NAMES, "label"], of)
    yield ""
    cells = totals(rows, "design", "statistic", "label", "place").values()
    yield f"Seeds: {max(cell.count for cell in cells)}."


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, shares in _shares(rows):
        if len(shares) == 1 and shares.min() < LOWEST:
            yield f"{', '.join(key)}: {100 * shares.min():.1f}"


TABLE = SeedTable(
    {"design": DESIGNS}, _rows, {"indices of fields": _page}, _failing, seeds=500, at_once=10
)

if __name__ == "__main__":
    TABLE.main(__doc__)
