"""How often intervals of rare events cover, over seeds, on events of known probability.

Tables of docs/rare_events.md as `seed_table.py` makes them.
The probabilities are exact, or by quadrature. OpenTURNS, where it can be imported, answers the same
questions by its own subset simulation, and by importance sampling around its own design point; its
interval is that of its stated coefficient of variation.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from problems import runs_of, standard_normals, with_output
from scipy import special, stats
from scipy.special import ndtr
from seed_table import Row, SeedTable, grouped, lines

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.rare_events.importance_sampling import ImportanceSampling
from uqpen.designs.rare_events.subset_simulation import SubsetSimulation
from uqpen.statistics.joint_probability import joint_probabilities
from uqpen.surrogates.active_learning import ActiveLearning

EVENT = "g < 0"
LEVEL = 0.95
RUNS = 10_000


class Problem(NamedTuple):
    """A limit-state function of standard normal inputs, and the probability that it is below 0.

    The numbers of states at a level spend about 10 000 runs in five replicates, or are the default.
    """

    title: str
    dimension: int
    probability: float
    samples: int
    function: Callable[[FloatArray], FloatArray]


def four_branches(u: FloatArray) -> FloatArray:
    """Return the series system of Waarts (2000) with 7/√2: four distant most probable points."""
    x, y = u.T
    curved, total = 3 + 0.1 * (x - y) ** 2, (x + y) / math.sqrt(2)
    flat = 7 / math.sqrt(2) - np.abs(x - y)
    return np.minimum.reduce([curved - total, curved + total, flat])


def convex(u: FloatArray) -> FloatArray:
    """Return the parabolic limit state of Borri and Speranzini (1997)."""
    x, y = u.T
    return 0.1 * (x - y) ** 2 - (x + y) / math.sqrt(2) + 2.5


def corner(u: FloatArray) -> FloatArray:
    """Return RP33 of the black-box reliability challenge (TNO, 2019)."""
    return np.minimum(3 * math.sqrt(3) - u.sum(axis=1), 3 - u[:, 2])


PROBLEMS = {
    "four": Problem("four branches", 2, 2.222795066194392e-3, 720, four_branches),
    "convex": Problem("convex", 2, 4.2073055e-3, 720, convex),
    "product": Problem("x·y > 3", 2, 9.81929872154689e-3, 1000, lambda u: 3 - u[:, 0] * u[:, 1]),
    "sum": Problem(
        "Σ of ten normals > 5√10",
        10,
        2.86651571879e-7,
        310,
        lambda u: 5 * math.sqrt(10) - u.sum(axis=1),
    ),
    "corner": Problem("min(3√3 − Σx, 3 − x₃) < 0", 3, 2.5755978e-3, 720, corner),
}


def far_sides(u: FloatArray) -> FloatArray:
    """Return two half-spaces on opposite sides, at different distances."""
    return np.minimum(3 - u[:, 0], 4 + u[:, 0])


def both_sides(u: FloatArray) -> FloatArray:
    """Return two half-spaces by an absolute value, of the sum of all inputs."""
    return 4 * math.sqrt(u.shape[1]) - np.abs(u.sum(axis=1))


def failing(u: FloatArray) -> FloatArray:
    """Return a half-space of which a part makes the model fail."""
    return np.where((u[:, 0] > 2.5) & (u[:, 1] > 1), np.nan, 3 - u[:, 0])


def jump(u: FloatArray) -> FloatArray:
    """Return a half-space without a gradient."""
    return np.where(u.sum(axis=1) > 4 * math.sqrt(2), -1.0, 1.0)


PROBLEMS |= {
    "far": Problem("a > 3 or a < −4", 2, float(ndtr(-3) + ndtr(-4)), 720, far_sides),
    "both": Problem("\\|Σ of ten normals\\| > 4√10", 10, float(2 * ndtr(-4)), 400, both_sides),
    "failing": Problem("a > 3, fails in a part of it", 2, float(ndtr(-3)), 720, failing),
    "jump": Problem("a jump at a + b = 4√2", 2, float(ndtr(-4)), 450, jump),
    "sphere": Problem("radius > 4 of two", 2, math.exp(-8), 550, lambda u: 4 - np.hypot(*u.T)),
    "many": Problem(
        "Σ of fifty normals > 5√50",
        50,
        2.86651571879e-7,
        310,
        lambda u: 5 * math.sqrt(50) - u.sum(axis=1),
    ),
}


def _of_many_inputs(dimension: int) -> dict[str, Problem]:
    """Return events of probabilities that are the same in any number of inputs."""
    rare, samples = 1e-4, 1000
    radius = float(stats.chi2.isf(rare, dimension))
    # x₁ + a - 0.1 Σx² > 0 where (x₁ - 5)² + the other squares are below 10 a + 25.
    offset = float(stats.ncx2.ppf(rare, dimension, 25.0) - 25.0) / 10

    def linear(u: FloatArray) -> FloatArray:
        return 4 * math.sqrt(dimension) - u.sum(axis=1)

    def squares(u: FloatArray) -> FloatArray:
        return radius - np.einsum("ij,ij->i", u, u)

    def mixed(u: FloatArray) -> FloatArray:
        return 0.1 * np.einsum("ij,ij->i", u, u) - u[:, 0] - offset

    return {
        f"linear{dimension}": Problem(
            f"Σx > 4√{dimension}", dimension, float(ndtr(-4)), samples, linear
        ),
        f"squares{dimension}": Problem(
            f"Σx² > {radius:.5g}, {dimension} inputs", dimension, rare, samples, squares
        ),
        f"mixed{dimension}": Problem(
            f"x₁ {'−' if offset < 0 else '+'} {abs(offset):.4g} − 0.1 Σx² > 0, {dimension} inputs",
            dimension,
            rare,
            samples,
            mixed,
        ),
    }


PROBLEMS_OF_MANY = {
    name: each
    for dimension in (2, 10, 20, 50, 80, 90, 100, 1000)
    for name, each in _of_many_inputs(dimension).items()
}
ALL = PROBLEMS | PROBLEMS_OF_MANY


def answer(problem: Problem, design: Design, seed: int) -> tuple[int, FloatArray]:
    """Return the number of runs of a design, and its estimate with both bounds."""
    names = [f"x{number}" for number in range(problem.dimension)]

    def make(points: xr.Dataset) -> xr.Dataset:
        values = problem.function(np.column_stack([points[name].values for name in names]))
        return with_output(points, values, "g")

    stream = Stream(seed, "designs", "rare")
    runs = runs_of(design, standard_normals(problem.dimension), stream, make)
    found = joint_probabilities(runs, (), LEVEL)["joint_probability"]
    return runs.sizes[RUN], found.values[0]


def openturns_answer(
    problem: Problem, seed: int, algorithm_of: Callable[[Problem, Any, Callable[[], int]], Any]
) -> tuple[int, FloatArray]:
    """Return what an algorithm of OpenTURNS answers, by the stated error of its estimate.

    The algorithm is made from the problem, its event, and a function for the runs so far.
    """
    import openturns as ot

    ot.RandomGenerator.SetSeed(seed)
    made = 0

    def function(x: Any) -> FloatArray:
        nonlocal made
        made += len(x)
        return problem.function(np.array(x))[:, np.newaxis]

    limit_state = ot.PythonFunction(problem.dimension, 1, func_sample=function)
    output = ot.CompositeRandomVector(limit_state, ot.RandomVector(ot.Normal(problem.dimension)))
    algorithm = algorithm_of(problem, ot.ThresholdEvent(output, ot.Less(), 0.0), lambda: made)
    algorithm.run()
    result = algorithm.getResult()
    estimate = result.getProbabilityEstimate()
    half = result.getConfidenceLength(LEVEL) / 2
    return made, np.array([estimate, estimate - half, estimate + half])


def openturns_subset(problem: Problem, event: Any, _: Callable[[], int]) -> Any:
    """Return subset simulation with as many runs a level in all."""
    import openturns as ot

    algorithm = ot.SubsetSampling(event)
    algorithm.setMaximumOuterSampling(5 * problem.samples // 10)
    algorithm.setBlockSize(10)
    return algorithm


def openturns_importance(problem: Problem, event: Any, made: Callable[[], int]) -> Any:
    """Return draws around the design point that OpenTURNS finds."""
    import openturns as ot

    start = [0.1] * problem.dimension  # the gradient of a product is 0 at the median
    search = ot.FORM(ot.AbdoRackwitz(), event, start)
    search.run()
    nearest = search.getResult().getStandardSpaceDesignPoint()
    around = ot.Normal(nearest, ot.CovarianceMatrix(problem.dimension))
    algorithm = ot.ProbabilitySimulationAlgorithm(
        ot.StandardEvent(event), ot.ImportanceSamplingExperiment(around)
    )
    algorithm.setBlockSize(100)
    algorithm.setMaximumOuterSampling(max(1, (RUNS - made()) // 100))
    algorithm.setMaximumCoefficientOfVariation(0.0)
    return algorithm


def methods(problem: Problem) -> dict[str, Callable[[int], tuple[int, FloatArray]]]:
    """Return the methods by name, each a function of the seed."""
    designs = {
        "active-learning": ActiveLearning(EVENT),
        "subset-simulation": SubsetSimulation(EVENT, samples=problem.samples),
        "importance-sampling": ImportanceSampling(EVENT, samples=RUNS // 5),
    }
    found = {name: partial(answer, problem, each) for name, each in designs.items()}
    if importlib.util.find_spec("openturns"):
        for name, each in (("subset", openturns_subset), ("importance", openturns_importance)):
            found[f"OpenTURNS {name}"] = partial(openturns_answer, problem, algorithm_of=each)
    return found


def _rows(problem: str, method: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the answers of a method."""
    for seed in seeds:
        runs, (estimate, lower, upper) = methods(ALL[problem])[method](seed)
        yield {"runs": runs, "estimate": estimate, "lower": lower, "upper": upper}


def _page(problems: Mapping[str, Problem], rows: Sequence[Row]) -> Iterator[str]:
    order = list(problems)
    own = [row for row in rows if row["problem"] in problems]
    groups = grouped(sorted(own, key=lambda row: order.index(row["problem"])), "problem", "method")
    if groups:
        columns = ("event", "method", "seeds", "runs", "bias", "variation seen", "stated")
        yield from lines((*columns, "upper/lower", "coverage"), ())
        yield from (_line(problems[key], method, found) for (key, method), found in groups.items())


def _line(problem: Problem, method: str, found: Sequence[Row]) -> str:
    names = ("runs", "estimate", "lower", "upper")
    numbers = np.array([[row[name] for name in names] for row in found], dtype=np.float64)
    runs, estimate, lower, upper = numbers.T
    title = f"| {problem.title} | {method} | {len(found)} | {runs.mean():.0f} "
    has_number = np.isfinite(estimate)
    if not has_number.any():
        return title + "| – | – | – | – | no number, with the reason |"
    exact = problem.probability
    relative = estimate[has_number] / exact - 1
    error = relative.std(ddof=1) / math.sqrt(len(relative)) if len(relative) > 1 else math.nan
    bias = f"{100 * relative.mean():+.1f} ± {100 * error:.1f} %"
    seen = np.sqrt(np.mean(relative**2))
    has_interval = np.isfinite(upper)
    if not has_interval.any():
        return f"{title}| {bias} | {100 * seen:.1f} % | – | – | no interval, with the reason |"
    lower, upper = lower[has_interval], upper[has_interval]
    covers = f"{100 * np.mean((lower <= exact) & (exact <= upper)):.1f} %"
    if not has_interval.all():
        covers += f" of {np.count_nonzero(has_interval)}"
    ratio = np.where(lower > 0, upper / np.maximum(lower, 1e-300), np.inf)
    stated = np.median(np.log(ratio)) / 2 / _quantile(method)
    texts = (f"{100 * each:.1f} %" if math.isfinite(each) else "–" for each in (seen, stated))
    seen_text, stated_text = texts
    width = np.median(ratio)
    width_text = f"{width:.3g}" if math.isfinite(width) else "–"
    return f"{title}| {bias} | {seen_text} | {stated_text} | {width_text} | {covers} |"


def _quantile(method: str) -> float:
    """Return how many standard errors an interval reaches to a side: of five replicates, or normal.

    An interval is from m / c to m * c, or nearly so.
    """
    has_replicates = method in ("importance-sampling", "subset-simulation")
    return float(special.stdtrit(4, 0.975) if has_replicates else special.ndtri(0.975))


TABLE = SeedTable(
    ("problem", "method"),
    _rows,
    {
        "rare events": partial(_page, PROBLEMS),
        "rare events of many inputs": partial(_page, PROBLEMS_OF_MANY),
    },
    seeds=500,
    cases=lambda: ((key, each) for key, problem in ALL.items() for each in methods(problem)),
)

if __name__ == "__main__":
    TABLE.main(__doc__)
