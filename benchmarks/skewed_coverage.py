"""How often intervals of means and standard deviations cover, for skewed and heavy outputs.

A table as `seed_table.py` makes it, of docs/coverage/samples.md. The functions have few inputs that
matter, most of them unbounded. All of them are evaluated at common points: the first inputs of a
set of many inputs are a set of few. A cell fails if its intervals without a note cover in less than
92 %.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from scipy import integrate, special
from seed_table import FEWEST, LOWEST, Row, SeedTable, cross_table, per_cent, totals

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import NOTE
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence, sobol_points
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

OUTPUT = Output("y", "1")
QUANTITY = QuantityOfInterest(OUTPUT, "1")
STATISTICS = {"mean": "mean", "std": "standard deviation"}
# Intervals without a note and with one, and how many of them cover.
COUNTS = ("plain", "plain_covers", "noted", "noted_covers")


class Function(NamedTuple):
    """A function of uniform inputs, with its exact mean and standard deviation."""

    inputs: int
    values: Callable[[FloatArray], FloatArray]
    mean: float
    std: float


def _peak(inputs: int) -> Function:
    """Genz's product peak with its top inside the cube."""

    def factor(u: Any) -> Any:
        return 1 / (1 + 25 * (u - 0.5) ** 2)

    first, second = (integrate.quad(lambda u, k=k: factor(u) ** k, 0, 1)[0] for k in (1, 2))
    std = math.sqrt(second**inputs - first ** (2 * inputs))
    return Function(inputs, lambda u: np.prod(factor(u), axis=-1), first**inputs, std)


def _corner_peak(inputs: int) -> Function:
    """Genz's corner peak (1 + x̄ · 5)^-(d + 1), by the alternating sum over the cube's corners."""
    slope, power = 5 / inputs, inputs + 1

    def moment(power: int) -> float:
        left = np.prod([slope * (power - each) for each in range(1, inputs + 1)])
        corners = (
            (-1) ** k * math.comb(inputs, k) * (1 + slope * k) ** (inputs - power)
            for k in range(inputs + 1)
        )
        return math.fsum(corners) / float(left)

    mean, second = moment(power), moment(2 * power)
    return Function(
        inputs, lambda u: (1 + slope * u.sum(axis=-1)) ** -power, mean, math.sqrt(second - mean**2)
    )


def _pareto(index: float) -> Function:
    mean, second = index / (index - 1), index / (index - 2)
    return Function(1, lambda u: (1 - u[..., 0]) ** (-1 / index), mean, math.sqrt(second - mean**2))


def _exponential(inputs: int, slope: float) -> Function:
    variance = inputs * slope**2
    mean = math.exp(variance / 2)
    return Function(
        inputs,
        lambda u: np.exp(slope * special.ndtri(u).sum(axis=-1)),
        mean,
        mean * math.sqrt(math.expm1(variance)),
    )


def _normal(u: FloatArray, position: int) -> FloatArray:
    return np.asarray(special.ndtri(u[..., position]))


FUNCTIONS: dict[str, Function] = {
    "x₁² + x₂³": Function(
        2,
        lambda u: (1 + 9 * u[..., 0]) ** 2 + (2 + _normal(u, 1)) ** 3,
        51.0,
        # Of a power of U(1, 10): (10⁵ - 1) / 45 - 37²; of (2 + z)³: 2⁶ + 15·2⁴ + 45·2² + 15 - 14².
        math.sqrt((10**5 - 1) / 45 - 37**2 + 499 - 14**2),
    ),
    "z⁴": Function(1, lambda u: _normal(u, 0) ** 4, 3.0, math.sqrt(96)),
    "exp z": _exponential(1, 1.0),
    "(1 + z₁/2)(1 + z₂/2)": Function(
        2, lambda u: (1 + _normal(u, 0) / 2) * (1 + _normal(u, 1) / 2), 1.0, 0.75
    ),
    "peak, 2 inputs": _peak(2),
    "peak, 5 inputs": _peak(5),
    "corner peak, 5 inputs": _corner_peak(5),
    "exp of a sum, 20 inputs": _exponential(20, 0.1),
    "sum, 20 inputs": Function(20, lambda u: special.ndtri(u).sum(axis=-1), 0.0, math.sqrt(20)),
    "Pareto 3.3": _pareto(3.3),
    "Pareto 2.5": _pareto(2.5),
}


class Design(NamedTuple):
    """Replicates of a number of points each; 0 replicates are independent draws."""

    draw: Callable[[np.random.Generator, int, int], FloatArray]
    replicates: int
    points: int

    def sample(self, rng: np.random.Generator, dimension: int) -> tuple[FloatArray, Sample]:
        """Points of the unit cube, and a sample at them whose values and inputs are to come."""
        sets = [self.draw(rng, self.points, dimension) for _ in range(max(self.replicates, 1))]
        points = np.concatenate(sets)
        everything = np.arange(len(points))
        return points, Sample(
            values=np.full(len(points), np.nan),
            used=everything,
            missing=everything[:0],
            columns=InputColumns.none(len(points)),
            replicates=everything // len(sets[0]),
            sampling=Sampling.STRATIFIED if self.replicates else Sampling.INDEPENDENT,
        )


def _blocks(rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
    """The matrices A and B of a replicate."""
    drawn = sobol_points(rng, points, 2 * dimension)
    return np.concatenate([drawn[:, :dimension], drawn[:, dimension:]])


_HYPERCUBE, _SOBOL, _HALTON = (
    LatinHypercube(runs=20, replicates=10),
    SobolSequence(runs=32),
    Halton(runs=32),
)
DESIGNS: dict[str, Design] = {
    "monte-carlo 200": Design(lambda rng, n, d: rng.random((n, d)), 0, 200),
    "monte-carlo 2 000": Design(lambda rng, n, d: rng.random((n, d)), 0, 2000),
    "latin-hypercube 10 × 20": Design(_HYPERCUBE.draw, 10, 20),
    "latin-hypercube 10 × 200": Design(_HYPERCUBE.draw, 10, 200),
    "sobol-sequence 1 024": Design(_SOBOL.draw, 16, 64),
    "sobol-sequence 8 192": Design(_SOBOL.draw, 16, 512),
    "halton 1 024": Design(_HALTON.draw, 16, 64),
    "saltelli 512": Design(_blocks, 16, 32),
}


def _rows(design: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the numbers of intervals that some seeds' points give, and of those that cover."""
    dimension = max(each.inputs for each in FUNCTIONS.values())
    cells: defaultdict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for seed in seeds:
        points, whole = DESIGNS[design].sample(Stream(seed, "coverage").generator(), dimension)
        for name, function in FUNCTIONS.items():
            sample = replace(whole, values=function.values(points[:, : function.inputs]))
            for statistic, array in islice(sample_moments(sample, QUANTITY), 2):
                _, lower, upper = array.values.tolist()
                cell = cells[name, statistic]
                if not math.isnan(lower):
                    kind = "noted" if str(array.coords[NOTE].values) else "plain"
                    cell[kind] += 1
                    cell[f"{kind}_covers"] += lower <= getattr(function, statistic) <= upper
    for (of, statistic), cell in cells.items():
        yield {"function": of, "statistic": statistic} | {n: cell[n] for n in COUNTS}


def _cells(rows: Sequence[Row]) -> dict[tuple[str, str, str], SimpleNamespace]:
    return totals(rows, "statistic", "function", "design")


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for key, cell in _cells(rows).items():
        if cell.plain >= FEWEST and cell.plain_covers < LOWEST * cell.plain:
            yield f"{', '.join(key)}: {per_cent(cell.plain_covers, cell.plain)}"


def _page(rows: Sequence[Row]) -> Iterator[str]:
    cells = _cells(rows).values()
    counts = {cell.design: cell.count for cell in cells}
    seeds = {design: counts[design] for design in DESIGNS if design in counts}
    for statistic, title in STATISTICS.items():
        own = [cell for cell in cells if cell.statistic == statistic]
        yield from cross_table(
            own, title, attrgetter("function"), attrgetter("design"), _text, seeds
        )
        yield ""
    yield f"Seeds: {', '.join(f'{count} for {design}' for design, count in seeds.items())}."


def _text(cells: Sequence[SimpleNamespace]) -> str:
    """Coverage in per cent: of intervals without a note, and of those with one in brackets."""
    if not cells:
        return "–"
    (cell,), texts = cells, []
    for found, covers, form in (
        (cell.plain, cell.plain_covers, "{}"),
        (cell.noted, cell.noted_covers, "({})"),
    ):
        if found >= FEWEST:
            of = f" of {100 * found / cell.count:.0f} %" if found < 0.995 * cell.count else ""
            texts.append(form.format(per_cent(covers, found)) + of)
    return ", ".join(texts) or "none"


TABLE = SeedTable({"design": DESIGNS}, _rows, {"skewed outputs": _page}, _failing, at_once=50)

if __name__ == "__main__":
    TABLE.main(__doc__)
