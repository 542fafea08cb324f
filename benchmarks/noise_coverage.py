"""How often intervals of statistics of models with noise of their own cover.

A table as `seed_table.py` makes it, of docs/coverage/noise.md. Mean m(x) and variance v(x) of each
model are known exactly, and so are all shares: integrals over the inputs, by Gauss's rule. A cell
fails if its intervals cover in less than 92 %, unless it has fewer than 100 points or a kurtosis
above 4.5, which have a note or no interval. Predictions of Gaussian processes are in no cell that
fails: the deviation of the mean is not certified, and that of a run supposes normal noise.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, lru_cache
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from seed_table import FEWEST, LOWEST, Row, SeedTable, cross_table, per_cent, totals

import uqpen
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_of
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import SobolSequence, sobol_points
from uqpen.designs.repeated import RepeatedDesign
from uqpen.designs.saltelli import BlockLayout
from uqpen.distributions.univariate import Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.models.known_functions import Ishigami
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.moments.sample_moments import mean_estimate
from uqpen.statistics.noise import ENOUGH_POINTS, RepeatedSample
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import DOUBTFUL_KURTOSIS, Sample
from uqpen.statistics.sensitivity.sobol_indices import BlockVariable, PickFreezeBlocks
from uqpen.statistics.surrogate.corrected_statistics import correct_statistics, correction_evidence
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.fitting import cross_fit, fit_surrogate
from uqpen.surrogates.gaussian_process import GaussianProcess
from uqpen.surrogates.gaussian_process_fit import StandardisedInputs

Function = Callable[..., FloatArray]

QUANTITY = QuantityOfInterest(Output("y", "1"), "1")
COUNTS = ("intervals", "covers", "noted", "hidden", "heavy")
NODES, TINY = 48, 1e-12


class Truth(NamedTuple):
    """What a model's statistics are of."""

    mean: float
    std: float
    noise_share: float
    noise_std: float
    mean_given_inputs_std: float
    mean_first_order: tuple[float, ...]
    mean_total_order: tuple[float, ...]

    @property
    def first_order(self) -> tuple[float, ...]:
        """Indices of the whole output."""
        return tuple((1 - self.noise_share) * each for each in self.mean_first_order)


class NoisyModel:
    """A model of uniform inputs with noise.

    Parameters
    ----------
    inputs : int
    mean, variance : callable
        Given each of the inputs.
    draw : callable
        Draws a run at each point, given a generator and each of the inputs.
    """

    def __init__(
        self, inputs: int, mean: Function, variance: Function, draw: Callable[..., FloatArray]
    ) -> None:
        self.inputs, self._mean, self._variance, self._draw = inputs, mean, variance, draw

    def mean(self, u: FloatArray) -> FloatArray:
        """Return the mean given the inputs, shape (..., input)."""
        return self._mean(*np.moveaxis(u, -1, 0))

    def variance(self, u: FloatArray) -> FloatArray:
        """Return the variance given the inputs, shape (..., input)."""
        return self._variance(*np.moveaxis(u, -1, 0))

    def draw(self, rng: np.random.Generator, u: FloatArray) -> FloatArray:
        """Return a run at each point."""
        return self._draw(rng, *np.moveaxis(u, -1, 0))

    @cached_property
    def truth(self) -> Truth:
        """By Gauss's rule over both halves of each input, where one of them has a kink."""
        nodes, weights = np.polynomial.legendre.leggauss(NODES // 2)
        u, w = np.concatenate([nodes + 1, nodes + 3]) / 4, np.tile(weights / 4, 2)
        grid = np.stack(np.meshgrid(*[u] * self.inputs, indexing="ij"), axis=-1)
        density = np.ones(grid.shape[:-1])
        for axis in range(self.inputs):
            shape = [1] * self.inputs
            shape[axis] = NODES
            density = density * w.reshape(shape)
        m, v = self.mean(grid), self.variance(grid)
        mean = float((density * m).sum())
        of_mean = float((density * (m - mean) ** 2).sum())
        noise = float((density * v).sum())
        first, total = [], []
        for axis in range(self.inputs):
            others = tuple(each for each in range(self.inputs) if each != axis)
            given = (density * m).sum(axis=others) / w
            first.append(float((w * (given - mean) ** 2).sum()) / of_mean)
            shape = [1] * self.inputs
            shape[axis] = NODES
            rest = density.sum(axis=axis)
            without = (m * w.reshape(shape)).sum(axis=axis)
            total.append(1 - float((rest * (without - mean) ** 2).sum()) / of_mean)
        return Truth(
            mean,
            math.sqrt(of_mean + noise),
            noise / (of_mean + noise),
            math.sqrt(noise),
            math.sqrt(of_mean),
            tuple(first),
            tuple(total),
        )

    @cached_property
    def kurtosis(self) -> float:
        """Of many runs."""
        rng = np.random.default_rng(1)
        y = self.draw(rng, rng.random((1_000_000, self.inputs)))
        deviations = y - y.mean()
        return float((deviations**4).mean() / (deviations**2).mean() ** 2)


def _gaussian(mean: Function, std: Function) -> NoisyModel:
    return NoisyModel(
        3,
        mean,
        lambda *u: std(*u) ** 2,
        lambda rng, *u: mean(*u) + std(*u) * rng.standard_normal(u[0].shape),
    )


def _compound_poisson() -> NoisyModel:
    """A Poisson number of exponential amounts, such as the claims of a year."""

    def draw(rng: np.random.Generator, a: FloatArray, b: FloatArray) -> FloatArray:
        number = rng.poisson(5 + 10 * a)
        total = rng.standard_gamma(np.maximum(number, 1e-9))
        return np.where(number > 0, total, 0.0) * (1 + 2 * b)

    def mean(a: FloatArray, b: FloatArray) -> FloatArray:
        return (5 + 10 * a) * (1 + 2 * b)

    return NoisyModel(2, mean, lambda a, b: 2 * (5 + 10 * a) * (1 + 2 * b) ** 2, draw)


def _brownian() -> NoisyModel:
    """Geometric Brownian motion after a time of 1, of a start, a drift and a volatility."""

    def mean(a: FloatArray, b: FloatArray, _: FloatArray) -> FloatArray:
        return (50 + 100 * a) * np.exp(0.1 * b)

    def draw(rng: np.random.Generator, *u: FloatArray) -> FloatArray:
        volatility = 0.1 + 0.2 * u[2]
        normal = rng.standard_normal(volatility.shape)
        return mean(*u) * np.exp(volatility * normal - volatility**2 / 2)

    return NoisyModel(3, mean, lambda *u: mean(*u) ** 2 * np.expm1((0.1 + 0.2 * u[2]) ** 2), draw)


def _galton_watson() -> NoisyModel:
    """Five generations; each of 10 to 30 ancestors has its own tree, and inputs are continuous."""
    generations = 5

    def mean(a: FloatArray, b: FloatArray) -> FloatArray:
        return (10 + 20 * a) * (0.8 + 0.3 * b) ** generations

    def variance(a: FloatArray, b: FloatArray) -> FloatArray:
        # The first generation is Poisson of start · growth, so it has that variance, as if each
        # ancestor had a Poisson number of children.
        return mean(a, b) * sum((0.8 + 0.3 * b) ** k for k in range(generations))

    def draw(rng: np.random.Generator, a: FloatArray, b: FloatArray) -> FloatArray:
        number = 10 + 20 * a
        for _ in range(generations):
            number = rng.poisson(number * (0.8 + 0.3 * b))
        return number.astype(np.float64)

    return NoisyModel(2, mean, variance, draw)


def _event() -> NoisyModel:
    def mean(a: FloatArray, b: FloatArray) -> FloatArray:
        return 0.1 + 0.5 * a + 0.3 * b

    return NoisyModel(
        2,
        mean,
        lambda a, b: mean(a, b) * (1 - mean(a, b)),
        lambda rng, a, b: (rng.random(a.shape) < mean(a, b)).astype(np.float64),
    )


def _queue() -> NoisyModel:
    """Mean number of those before 50 arrivals at a queue (M/M/1), times the cost of one.

    The queue starts in its stationary state, so the mean is exactly ρ/(1 - ρ). The variance follows
    from the chain of the numbers that arrivals meet: its transition matrix gives all covariances.
    """
    arrivals, most = 50, 250

    def variance_of_mean(load: float) -> float:
        number = np.arange(most)
        stationary = (1 - load) * load**number
        served = 1 / (1 + load)  # probability that a service ends before the next arrival
        below = number[:, None] + 1 - number[None, :]  # services from one arrival to the next
        matrix = np.where(below >= 0, served ** np.maximum(below, 0) * (1 - served), 0.0)
        matrix[:, 0] = served ** (number + 1)
        centred = number - load / (1 - load)
        moved, total = centred, 0.0
        for lag in range(arrivals):
            covariance = float((stationary * centred * moved).sum())
            total += covariance * (arrivals - lag) * (2 if lag else 1)
            moved = matrix @ moved
        return total / arrivals**2

    nodes = 0.45 + 0.25 * np.cos(np.pi * (np.arange(16) + 0.5) / 16)
    series = np.polynomial.Chebyshev.fit(
        nodes, [math.log(variance_of_mean(each)) for each in nodes], 15, domain=[0.2, 0.7]
    )

    def draw(rng: np.random.Generator, a: FloatArray, b: FloatArray) -> FloatArray:
        load = 0.2 + 0.5 * a
        number = rng.geometric(1 - load) - 1.0
        total = np.zeros(load.shape)
        for _ in range(arrivals):
            total += number
            services = rng.geometric(load / (1 + load)) - 1
            number = np.maximum(number + 1 - services, 0)
        return (0.5 + b) * total / arrivals

    return NoisyModel(
        2,
        lambda a, b: (0.5 + b) * (0.2 + 0.5 * a) / (1 - (0.2 + 0.5 * a)),
        lambda a, b: (0.5 + b) ** 2 * np.exp(series(0.2 + 0.5 * a)),
        draw,
    )


_A, _B = 2 * math.sqrt(3), 2 * 22.5**0.25
MODELS: dict[str, Callable[[], NoisyModel]] = {
    # Shares 0.25, 0.5, and 0.25 of the noise; the third input is idle.
    "light toy": lambda: _gaussian(
        lambda a, b, c: _A * a + (_B * (b - 0.5)) ** 2, lambda a, b, c: np.ones(a.shape)
    ),
    "g-function": lambda: _gaussian(
        lambda a, b, c: (
            np.abs(4 * a - 2) * ((np.abs(4 * b - 2) + 1) / 2) * ((np.abs(4 * c - 2) + 9) / 10)
        ),
        lambda a, b, c: 0.3 + 0.9 * c,
    ),
    "compound Poisson": _compound_poisson,
    "Ishigami": lambda: _gaussian(
        lambda *u: (
            Ishigami()
            .evaluate({f"x{k}": np.pi * (2 * each - 1) for k, each in enumerate(u, 1)})
            .outputs["y"]
        ),
        lambda a, b, c: 1 + 2 * a,
    ),
    "Brownian": _brownian,
    "Galton-Watson": _galton_watson,
    "event": _event,
    "queue": _queue,
}


@lru_cache
def model(name: str) -> NoisyModel:
    """Return a model by its name."""
    return MODELS[name]()


# Points and repeats; of blocks of points that share inputs, the number of blocks.
SIZES = ("60 × 2", "100 × 2", "200 × 2", "133 × 3", "1000 × 2", "200 × 10")
REPLICATED = ("16 × 64 × 2",)
BLOCKS = ("512", "2048")
DESIGNS = {
    **{f"monte-carlo {size}": size for size in SIZES},
    **{f"sobol-sequence {size}": size for size in REPLICATED},
    **{f"saltelli {size}": size for size in BLOCKS},
}
# Surrogates: expansions whose estimates runs correct, and processes that predict.
EXPANSION, PROCESS = "polynomial-chaos", "gaussian-process"
SURROGATES = {
    f"{EXPANSION} 200 × 4": "200 × 4",
    f"{PROCESS} 60 × 4": "60 × 4",
    f"{PROCESS} 60 × 10": "60 × 10",
}
SURROGATE_SEEDS, PREDICTED = 100, 300


def repeated_sample(
    of: NoisyModel, rng: np.random.Generator, size: str
) -> tuple[Sample, FloatArray]:
    """Return points, and the values of their repeats."""
    *sets, points, repeats = map(int, size.split(" × "))
    replicates = sets[0] if sets else 1
    if sets:
        draw = SobolSequence(runs=points).draw
        u = np.concatenate([draw(rng, points, of.inputs) for _ in range(replicates)])
    else:
        u = rng.random((points, of.inputs))
    everything = np.arange(len(u))
    names = tuple(f"x{number}" for number in range(of.inputs))
    sample = Sample(
        values=np.full(len(u), np.nan),
        used=everything,
        missing=everything[:0],
        columns=InputColumns.from_matrix(names, u),
        replicates=everything // points,
        sampling=Sampling.STRATIFIED if sets else Sampling.INDEPENDENT,
    )
    values = of.draw(rng, np.repeat(u[:, None, :], repeats, axis=1))
    return sample, values


def _estimates(of: NoisyModel, rng: np.random.Generator, size: str) -> Iterator[tuple[str, Any]]:
    """Yield the estimates of a sample, with what they are of."""
    found, truth = RepeatedSample.of(*repeated_sample(of, rng, size)), of.truth
    yield "mean", (mean_estimate(found.means, QUANTITY), truth.mean)
    yield "std", (found.std(), truth.std)
    yield "noise_share", (found.share_of_noise(), truth.noise_share)
    yield "noise_std", (found.root(found.noise), truth.noise_std)
    yield "mean_given_inputs_std", (found.root(found.of_mean), truth.mean_given_inputs_std)
    for column in range(of.inputs):
        for name in ("first_order", "mean_first_order"):
            own = found.first_order(column, is_of_mean=name != "first_order")
            yield f"{name} {column + 1}", (own, getattr(truth, name)[column])


@lru_cache
def study(inputs: int) -> ValidatedStudy:
    """Return a study of uniform inputs; its runs get the outputs of another model."""
    laws = {f"x{number}": uqpen.Uniform(0, 1) for number in range(inputs)}
    model = uqpen.PythonModel(
        lambda **x: {"y": 0 * x["x0"]}, dict.fromkeys(laws, "1"), {"y": "1"}, vectorized=True
    )
    return uqpen.Study(model, laws, designs={"runs": uqpen.MonteCarlo(10)}, seed=1)


def _surrogate_estimates(
    of: NoisyModel, stream: Stream, size: str
) -> Iterator[tuple[str, tuple[Estimate, Any]]]:
    """Yield the corrected estimates of an expansion, with what they are of."""
    points, repeats = map(int, size.split(" × "))
    made, truth = study(of.inputs), of.truth
    (variant,) = made.models.values()
    design = RepeatedDesign(MonteCarlo(runs=points), repeats)
    drawn = next(design.rounds(made.joint, stream.child("points")))
    runs = evaluate(Evaluator(variant.model, made.constraints), points_of(drawn), {})
    u = np.column_stack([runs[f"x{number}"].values for number in range(of.inputs)])
    runs = runs.assign(y=runs.y.copy(data=of.draw(stream.generator("runs"), u)))
    runs = runs.assign_attrs(sampling=str(design.sampling))
    surrogate = PolynomialChaos("runs", order=5)
    of_fit = ("pce", runs, variant.model, made.joint, stream)
    fitted, folds = fit_surrogate(surrogate, *of_fit), cross_fit(surrogate, *of_fit)
    draws = SurrogateDraws(fitted, made.joint, made.constraints, {}, stream)
    quantities = made.model_quantities(variant.model)
    evidence = correction_evidence(draws, folds, runs, None, quantities)
    own = surrogate_statistics(draws, quantities, only=["moments", "sensitivity"])
    found = correct_statistics(own.outputs, evidence, quantities)["y"]
    for name in ("mean", "std"):
        yield name, (Estimate.from_array(found[name]), getattr(truth, name))
    for order in ("first_order", "total_order"):
        of_mean = np.array(getattr(truth, f"mean_{order}"))
        for name, exact in (
            (f"mean_{order}", of_mean),
            # Without the noise that is left if all other inputs are known.
            (order, (1 - truth.noise_share) * of_mean),
        ):
            for column, each in enumerate(Estimate.from_array(found[name]).each()):
                yield f"{name} {column + 1}", (each, exact[column])


def _predictions(
    of: NoisyModel, rng: np.random.Generator, size: str
) -> Iterator[tuple[str, BoolArray]]:
    """Yield how often ± 1.96 deviations hold the mean and, by the noise, a run."""
    points, repeats = map(int, size.split(" × "))
    u, new = rng.random((points, of.inputs)), rng.random((PREDICTED, of.inputs))
    y = of.draw(rng, np.repeat(u[:, None, :], repeats, axis=1))
    runs, mean = of.draw(rng, new), of.mean(new)
    # Thirds of the points, from those with the least noise to those with most.
    third = np.argsort(np.argsort(of.variance(new))) * 3 // PREDICTED
    inputs = StandardisedInputs.of_runs([Uniform(0.0, 1.0)] * of.inputs, u)
    for noise in ("constant", "varying"):
        fit = GaussianProcess(design="runs", noise=noise).fit_values(inputs, u, y, rng)
        if isinstance(fit, str):
            continue
        found = fit.predict(new)
        holds = np.abs(runs - found.mean) <= 1.96 * found.std
        for number, name in enumerate(("least", "middle", "most")):
            yield f"run, {noise}, {name}", holds[third == number]
        yield f"mean, {noise}", np.abs(mean - found.mean) <= 1.96 * found.mean_std


def _estimated(
    name: str, design: str, seeds: Sequence[int]
) -> Iterator[tuple[str, tuple[Estimate, Any]]]:
    """Yield the estimates of some seeds, with what they are of."""
    of, size = model(name), (DESIGNS | SURROGATES)[design]
    if design.startswith("saltelli"):
        yield from block_estimates(of, int(size), seeds)
        return
    for seed in seeds:
        if design in SURROGATES:
            yield from _surrogate_estimates(of, Stream(seed, "noise", name, design), size)
        else:
            yield from _estimates(of, Stream(seed, "noise").generator(name, design), size)


def _rows(name: str, design: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the numbers of intervals of some seeds, and of those that cover."""
    if design in SURROGATES:
        seeds = [seed for seed in seeds if seed < SURROGATE_SEEDS]
    cells: defaultdict[str, Counter[str]] = defaultdict(Counter)
    if design.startswith(PROCESS):
        for seed in seeds:
            rng = Stream(seed, "noise").generator(name, design)
            for statistic, holds in _predictions(model(name), rng, SURROGATES[design]):
                cells[statistic]["intervals"] += len(holds)
                cells[statistic]["covers"] += int(holds.sum())
        seeds = []
    found = _estimated(name, design, seeds)
    for statistic, (estimates, truth) in found:
        for estimate in estimates.each():
            cell = cells[statistic]
            cell["hidden"] += texts.NOISE_HIDES_IT in estimate.note
            cell["heavy"] += "heavy tail" in estimate.note
            if math.isfinite(estimate.lower):
                cell["intervals"] += 1
                cell["noted"] += bool(estimate.note)
                # An index of 0 is one to rounding.
                cell["covers"] += estimate.lower - TINY <= truth <= estimate.upper + TINY
                cell["sum"] += estimate.value - truth
    for statistic, cell in cells.items():
        bias = cell["sum"] / max(cell["intervals"], 1)
        yield {"statistic": statistic} | {key: cell[key] for key in COUNTS} | {"bias": bias}


def block_estimates(
    of: NoisyModel, blocks: int, seeds: Sequence[int]
) -> Iterator[tuple[str, tuple[Estimate, float]]]:
    """Yield the estimates of blocks whose matrix A is run twice, of all seeds at once."""
    inputs = tuple(f"x{number}" for number in range(of.inputs))
    layout, replicates = BlockLayout(inputs, second_order=False, noise=True), 16
    values = []
    for seed in seeds:
        rng = Stream(seed, "noise").generator("blocks", str(blocks))
        each = [sobol_points(rng, blocks // replicates, 2 * of.inputs) for _ in range(replicates)]
        A, B = np.split(np.concatenate(each), 2, axis=1)
        values.append(of.draw(rng, layout.matrices(A, B)).T.ravel())
    rows = {
        number: part.first * blocks + np.arange(blocks) for number, part in layout.parts.items()
    }
    replicate = np.arange(blocks) // (blocks // replicates)
    found = PickFreezeBlocks(layout, rows, replicate, {})
    variable, truth = BlockVariable(found, np.array(values)), of.truth
    yield "noise_share", (variable.noise_share(), truth.noise_share)
    for order in ("first_order", "total_order"):
        mean, whole = variable.indices_of_mean(order), variable.indices(order)
        for column in range(of.inputs):
            exact = getattr(truth, f"mean_{order}")[column]
            yield f"mean_{order} {column + 1}", (_of_input(mean, column), exact)
            share = truth.noise_share
            exact = (1 - share) * exact + (share if order == "total_order" else 0)
            yield f"{order} {column + 1}", (_of_input(whole, column), exact)


def _of_input(found: Estimate, column: int) -> Estimate:
    """Return the estimates of an input, out of those of shape (seed, input)."""
    return Estimate(*(np.asarray(each)[:, column] for each in vars(found).values()))


def _cells(rows: Sequence[Row]) -> list[SimpleNamespace]:
    return [*totals(rows, "model", "design", "statistic").values()]


def _failing(rows: Sequence[Row]) -> Iterator[str]:
    for cell in _cells(rows):
        # A heavy tail is noted, or has no interval.
        size = (DESIGNS | SURROGATES)[cell.design].split(" × ")
        points = math.prod(map(int, size[:-1] if size[1:] else size))
        is_judged = points >= ENOUGH_POINTS and model(cell.model).kurtosis <= DOUBTFUL_KURTOSIS
        is_judged &= not cell.design.startswith(PROCESS)
        if is_judged and cell.intervals >= FEWEST and cell.covers < LOWEST * cell.intervals:
            share = per_cent(cell.covers, cell.intervals)
            yield f"{cell.model}, {cell.design}, {cell.statistic}: {share}"


def _page(rows: Sequence[Row]) -> Iterator[str]:
    """Lowest and highest coverage over the inputs of an index, by model and design."""
    cells = _cells([row for row in rows if row["design"] in DESIGNS])
    counts = {cell.design: cell.count for cell in cells}
    seeds = {design: counts[design] for design in DESIGNS if design in counts}
    for statistic in dict.fromkeys(cell.statistic.split()[0] for cell in cells):
        own = [cell for cell in cells if cell.statistic.split()[0] == statistic]
        yield from cross_table(own, statistic, _title, attrgetter("design"), _text, seeds)
        yield ""
    if seeds:
        yield f"Seeds: {', '.join(f'{count} of {design}' for design, count in seeds.items())}."


def _title(cell: SimpleNamespace) -> str:
    of = model(cell.model)
    return f"{cell.model} ({of.truth.noise_share:.2f}, {of.kurtosis:.1f})"


def _surrogates_page(rows: Sequence[Row]) -> Iterator[str]:
    """Coverage of corrected estimates by statistic, and of predictions by noise."""
    # The inputs of an index are in one column, and so are the thirds of the runs.
    ending = re.compile(r"( \d|, least|, middle|, most)$")
    cells = _cells([row for row in rows if row["design"] in SURROGATES])
    for design in dict.fromkeys(cell.design for cell in cells):
        own = [cell for cell in cells if cell.design == design]
        yield from cross_table(
            own, design, attrgetter("model"), lambda cell: ending.sub("", cell.statistic), _text
        )
        yield ""
    if cells:
        yield f"Seeds: {max(cell.count for cell in cells)} of each."


def _text(cells: Sequence[Any]) -> str:
    if not cells:
        return "–"
    known = [cell for cell in cells if cell.intervals >= FEWEST]
    if not known:
        return "none"
    shares = sorted({per_cent(each.covers, each.intervals) for each in known}, key=float)
    text = " to ".join(dict.fromkeys((shares[0], shares[-1])))
    whole = sum(each.intervals for each in cells) / sum(each.count for each in cells)
    return f"{text} of {100 * whole:.0f} %" if whole < 0.995 else text


TABLE = SeedTable(
    {"model": MODELS, "design": DESIGNS | SURROGATES},
    _rows,
    {"noise": _page, "surrogates of noise": _surrogates_page},
    _failing,
    seeds=500,
    at_once=100,
)

if __name__ == "__main__":
    TABLE.main(__doc__)
