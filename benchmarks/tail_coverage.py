"""How often the intervals of statistics of a tail cover, over seeds, where the truth is known.

A table as `seed_table.py` makes it.

The sensitivities are those of P(x₁ + x₂ > c), where both variables are normal and an input follows
from the first one. The replicates are ten Latin hypercubes. Expected shortfall and return levels
are those of functions of one normal variable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy import special
from seed_table import Row, SeedTable, grouped, lines

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.univariate import Lognormal, Normal, Uniform
from uqpen.statistics.distribution_function.quantiles import expected_shortfalls
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.event_sensitivity.sample_sensitivity import InputScores, sample_sensitivities
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.tails import return_levels

REPLICATES = 10


class Drawn(NamedTuple):
    """Draws of two normal variables, and how a sample was drawn."""

    normal: FloatArray
    sampling: Sampling
    replicates: IntArray

    def sample(self, values: FloatArray, columns: InputColumns) -> Sample:
        """Return a sample of values, in which no run failed."""
        used = np.arange(len(values))
        return Sample(values, used, used[:0], columns, self.replicates, self.sampling)


def draw(design: str, runs: int, seed: int) -> Drawn:
    """Draw two variables independently, or by replicated Latin hypercubes."""
    rng = np.random.default_rng([seed, runs])
    if design == "monte-carlo":
        unit, replicates = rng.random((runs, 2)), np.zeros(runs, dtype=np.int64)
        return Drawn(special.ndtri(unit), Sampling.INDEPENDENT, replicates)
    size = runs // REPLICATES
    sets = [
        np.stack([(rng.permutation(size) + rng.random(size)) / size for _ in range(2)], axis=1)
        for _ in range(REPLICATES)
    ]
    replicates = np.repeat(np.arange(REPLICATES), size)
    return Drawn(special.ndtri(np.concatenate(sets)), Sampling.STRATIFIED, replicates)


DESIGNS = ("monte-carlo", "latin-hypercube")
Asked = tuple[str, Sequence[int], Callable[[Drawn], Iterator[tuple[str, float, Estimate]]]]

_NODES = np.linspace(-8.2, 8.2, 20_001)
_SHARES = np.exp(-(_NODES**2) / 2) / np.exp(-(_NODES**2) / 2).sum()


def _sensitivity_case(distribution: Distribution, limit: float, runs: Sequence[int]) -> Asked:
    scores = InputScores.of(distribution)
    if scores is None:
        raise ValueError("an input whose mean cannot move")
    values = _transformed(distribution, _NODES)
    beyond = special.ndtr(_NODES - limit) * _SHARES
    probability = float(beyond.sum())
    changes = (scores(values) * beyond).sum(axis=1)
    exact = [*changes.tolist(), *(changes / probability).tolist()]
    titles = ("σ ∂P/∂μ", "σ ∂P/∂σ", "(σ/P) ∂P/∂μ", "(σ/P) ∂P/∂σ")

    def ask(drawn: Drawn) -> Iterator[tuple[str, float, Estimate]]:
        occurs = drawn.normal.sum(axis=1) > limit
        points = _transformed(distribution, drawn.normal[:, :1])
        columns = InputColumns.from_matrix(("x",), points)
        found = sample_sensitivities(drawn.sample(occurs * 1.0, columns), occurs, "x", scores)
        estimates = (*found.changes, *found.relative_changes)
        yield from zip(titles, exact, estimates, strict=True)

    name = type(distribution).__name__.lower()
    return f"{name} input, P = {probability:.3g}", runs, ask


def _transformed(distribution: Distribution, normal: FloatArray) -> FloatArray:
    below, above = special.ndtr(normal), special.ndtr(-normal)
    return np.where(normal < 0, distribution.ppf(below), distribution.isf(above))


OUTPUTS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "normal": lambda z: z,
    "lognormal": np.exp,
    "Pareto 3.3": lambda z: special.ndtr(-z) ** (-1 / 3.3),
    "uniform": special.ndtr,
}
LEVELS = (0.95, 0.99, 0.999)
PERIODS = (50.0, 1e2, 1e3, 1e4, 1e5)
SIZES = (200, 1000, 10_000)


def _shortfall(function: Callable[[FloatArray], FloatArray], level: float) -> float:
    """Return the mean beyond a quantile, by an integral over the probability beyond."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    # A power puts the nodes close to 0, where the function is steepest.
    unit = (nodes + 1) / 2
    beyond = (1 - level) * unit**6
    return float((weights / 2 * 6 * unit**5 * function(-special.ndtri(beyond))).sum())


def _shortfalls(
    function: Callable[[FloatArray], FloatArray], exact: Sequence[float], drawn: Drawn
) -> Iterator[tuple[str, float, Estimate]]:
    sample = drawn.sample(function(drawn.normal[:, 0]), InputColumns.none(len(drawn.normal)))
    quantity = QuantityOfInterest(Output("y", "1"), "1", expected_shortfall=LEVELS)
    array = dict(expected_shortfalls(sample, quantity))["expected_shortfall"]
    for level, truth, values in zip(LEVELS, exact, array.values.tolist(), strict=True):
        yield f"expected shortfall at {level:g}", truth, Estimate(*values, "", "")


def _return_levels(
    function: Callable[[FloatArray], FloatArray], drawn: Drawn
) -> Iterator[tuple[str, float, Estimate]]:
    sample = drawn.sample(function(drawn.normal[:, 0]), InputColumns.none(len(drawn.normal)))
    quantity = QuantityOfInterest(Output("y", "1"), "1", return_periods=PERIODS)
    array = dict(return_levels(sample, quantity))["return_level"]
    for period, values in zip(PERIODS, array.values.tolist(), strict=True):
        truth = float(function(-special.ndtri(np.array(1 / period))))
        yield f"return level of {period:g} cases", truth, Estimate(*values, "", "")


def _asked() -> Iterator[Asked]:
    """Yield the cases: sensitivities of a probability, and functions of one normal variable."""
    for distribution in (Normal(0.0, 1.0), Lognormal(1.0, 0.5), Uniform(0.0, 1.0)):
        for limit, runs in ((1.5, (200,)), (2.5, (1000,)), (3.2, (1000, 10_000))):
            title, *others = _sensitivity_case(distribution, limit, runs)
            yield f"sensitivity, {title}", *others
    for name, function in OUTPUTS.items():
        exact = [_shortfall(function, level) for level in LEVELS]
        yield f"shortfall, {name}", SIZES, partial(_shortfalls, function, exact)
    for name, function in OUTPUTS.items():
        yield f"return-level, {name}", SIZES[1:], partial(_return_levels, function)


CASES = {title: (sizes, ask) for title, sizes, ask in _asked()}


def _rows(title: str, runs: int, design: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the bounds of all statistics of a case."""
    for seed in seeds:
        for statistic, exact, found in CASES[title][1](draw(design, runs, seed)):
            _, lower, upper = found.bounds
            yield {"statistic": statistic, "exact": exact, "lower": lower, "upper": upper}


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ("statistic", "of", "design", "runs", "seeds", "without interval", "coverage", "width")
    named = [{**row, "of": row["case"].partition(", ")[2]} for row in rows]
    groups = grouped(named, "statistic", "of", "design", "runs")
    yield from lines(head, ([*key, *_texts(found)] for key, found in groups.items()))


def _texts(rows: Sequence[Row]) -> list[str]:
    names = ("exact", "lower", "upper")
    exact, lower, upper = np.array([[row[name] for name in names] for row in rows]).T
    has = np.isfinite(lower) & np.isfinite(upper)
    shown = ["–", "–"]
    if has.any():
        covers = ((lower <= exact) & (exact <= upper))[has]
        width = np.median((upper - lower)[has] / np.abs(exact[has]))
        shown = [f"{100 * covers.mean():.1f} %", f"± {50 * width:.3g} %"]
    return [str(len(rows)), f"{100 * np.mean(~has):.3g} %", *shown]


TABLE = SeedTable(
    ("case", "runs", "design"),
    _rows,
    {"": _page},
    seeds=400,
    at_once=10,
    cases=lambda: (
        (title, runs, design)
        for title, (sizes, _) in CASES.items()
        for runs, design in product(sizes, DESIGNS)
    ),
)

if __name__ == "__main__":
    TABLE.main(__doc__)
