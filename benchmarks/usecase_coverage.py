"""How often intervals cover where the use cases of OpenTURNS are the models.

Tables of docs/coverage/use_cases.md as `seed_table.py` makes them, with OpenTURNS installed.

`samples`: intervals of samples. Each output, design and seed has points of its own, so the
intervals of a cell (a statistic of a design) are independent. A cell fails if so few of its
intervals would cover with a probability below 0.001, were the coverage of each 95 %. All cells
together fail below 94.5 %.

`surrogates`: corrected estimates, and what goes without a word. Each seed is a whole study:
independent runs, and a surrogate of the kind under test, with the settings of a user who states
nothing. A figure is off if its interval misses the true value. It goes without a word if it has no
note either. At most 2 % of all figures may.
"""

from __future__ import annotations

import importlib
import inspect
import math
import pkgutil
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from interval_coverage import first_answers
from scipy import special, stats
from seed_table import Row, SeedTable, lines, main, per_cent, totals
from skewed_coverage import DESIGNS as DESIGNS_OF_SKEWED
from skewed_coverage import OUTPUT, Design

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import BOUND, INPUT, NOTE, PROBABILITY, SURROGATE_ESTIMATE
from uqpen.core.streams import Stream
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import exceedance_probabilities
from uqpen.statistics.distribution_function.quantiles import quantile_estimates
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity.correlations import correlations
from uqpen.statistics.sensitivity.given_data import first_order

NOMINAL = 0.95
# Smallest probability of a cell, and smallest coverage of all cells together.
SMALLEST_PROBABILITY = 0.001
LOWEST_OF_ALL = 0.945

# Independent scrambled Sobol' sets, whose scatter gives the error of each true value.
REFERENCE_SETS = 16
REFERENCE_POINTS = 2**16
REFERENCE_SEED = 20_011
# Bins of an input, in each of which a parabola follows the conditional mean of the output.
REFERENCE_BINS = 256

# The water height is Ks^-0.6 times a factor. Ks is a normal variable truncated at 0, where its
# density is positive. So the tails of these outputs have the index 5/3: there is no variance.
INFINITE_VARIANCE = {"FloodModel, H", "FloodModel, S"}

QUANTILES = (0.05, 0.5, 0.95)
THRESHOLD_AT = 0.95

STATISTICS = {
    "mean": "mean",
    "std": "standard deviation",
    "half_spread": "half the 16–84 % range",
    "quantile 0.05": "quantile 0.05",
    "quantile 0.5": "quantile 0.5",
    "quantile 0.95": "quantile 0.95",
    "exceedance": "exceedance of the 95 % point",
    "spearman": "rank correlation (Spearman)",
    "first_order": "first-order index",
}

_HYPERCUBE = "latin-hypercube 10 × 100"
_SKEWED = DESIGNS_OF_SKEWED | {
    _HYPERCUBE: DESIGNS_OF_SKEWED["latin-hypercube 10 × 20"]._replace(points=100)
}
DESIGNS: dict[str, Design] = {
    name: _SKEWED[name]
    for name in (
        *("monte-carlo 200", "monte-carlo 2 000", "latin-hypercube 10 × 20", _HYPERCUBE),
        *("sobol-sequence 1 024", "sobol-sequence 8 192", "halton 1 024"),
    )
}


@dataclass(frozen=True)
class UseCase:
    """A model of OpenTURNS under the distribution of its inputs, by the name of its class."""

    name: str
    distribution: Any  # openturns.Distribution
    inputs: Callable[[FloatArray], Any]  # from points of the unit cube to an openturns.Sample
    model: Any  # openturns.Function

    @property
    def outputs(self) -> list[str]:
        """The outputs' names on the page; those of a single output say nothing."""
        named = [str(name) for name in self.model.getOutputDescription()]
        return [f"{self.name}, {name}" for name in named] if len(named) > 1 else [self.name]

    @property
    def dimension(self) -> int:
        """Number of inputs."""
        return int(self.distribution.getDimension())

    @property
    def dependence(self) -> str:
        """How the inputs depend on each other; empty where they do not."""
        if self.distribution.hasIndependentCopula():
            return ""
        return str(self.distribution.getCopula().getImplementation().getClassName())


@dataclass(frozen=True)
class Truth:
    """True values of an output's statistics, with the standard errors of these."""

    values: Mapping[str, float]  # infinite, or NaN, where a statistic does not exist
    errors: Mapping[str, float]
    threshold: float  # its 95 % point
    driver: int  # the input with the largest rank correlation, whose measures are looked at


class Cell(NamedTuple):
    """An interval compared with the truth."""

    covers: bool
    half_width: float
    note: str


def use_cases() -> Iterator[UseCase]:
    """Every use case whose model has scalar outputs and whose inputs have a distribution."""
    try:
        import openturns as ot
        from openturns import usecases
    except ImportError:
        sys.exit("OpenTURNS is not installed: python -m pip install openturns")
    ot.Log.Show(ot.Log.NONE)
    for module in pkgutil.iter_modules(usecases.__path__, f"{usecases.__name__}."):
        loaded = importlib.import_module(module.name)
        for name, found in inspect.getmembers(loaded, inspect.isclass):
            if found.__module__ == module.name:
                case = _use_case(ot, name, found())
                if isinstance(case, UseCase):
                    yield case
                else:
                    print(f"{name} is left out: {case}", flush=True)


def _use_case(ot: Any, name: str, found: Any) -> UseCase | str:
    """A use case, or the reason why it is none of ours."""
    distribution, model = getattr(found, "distribution", None), getattr(found, "model", None)
    if distribution is None and hasattr(found, "lowerbound"):
        bounds = zip(found.lowerbound, found.upperbound, strict=True)
        distribution = ot.JointDistribution([ot.Uniform(*each) for each in bounds])
    if distribution is None or model is None:
        return "its inputs have no distribution"
    if hasattr(model, "getOutputMesh"):
        return "its output is a field"
    if distribution.getDimension() != model.getInputDimension():
        return "its model takes a field"
    transform = distribution.getInverseIsoProbabilisticTransformation()
    return UseCase(name, distribution, lambda u: transform(ot.Sample(special.ndtri(u))), model)


def true_values(case: UseCase) -> Iterator[Truth]:
    """The true values of each output's statistics, from reference sets."""
    inputs, outputs = [], []
    for number in range(REFERENCE_SETS):
        rng = Stream(REFERENCE_SEED, "reference", case.name).generator(number)
        points = case.inputs(sobol_points(rng, REFERENCE_POINTS, case.dimension))
        inputs.append(np.asarray(points))
        outputs.append(np.asarray(case.model(points)))
        assert np.isfinite(outputs[-1]).all(), case.name
    for number, name in enumerate(case.outputs):
        truth = _truth(inputs, [each[:, number] for each in outputs])
        if name in INFINITE_VARIANCE:
            changed = {"std": math.inf, "first_order": math.nan}
            errors = {**truth.errors, **dict.fromkeys(changed, 0.0)}
            truth = replace(truth, values={**truth.values, **changed}, errors=errors)
        yield truth


def _truth(inputs: Sequence[FloatArray], outputs: Sequence[FloatArray]) -> Truth:
    strengths = [_rank_correlation(column, outputs[0]) for column in inputs[0].T]
    driver = int(np.nanargmax(np.abs(strengths)))
    threshold = float(np.mean([np.quantile(values, THRESHOLD_AT) for values in outputs]))
    found = [
        _statistics(each[:, driver], values, threshold)
        for each, values in zip(inputs, outputs, strict=True)
    ]
    by_statistic = {name: [each[name] for each in found] for name in found[0]}
    values = {name: float(np.mean(each)) for name, each in by_statistic.items()}
    errors = {name: float(stats.sem(each)) for name, each in by_statistic.items()}
    columns = np.concatenate([each[:, driver] for each in inputs])
    index, error = _first_order(columns, np.concatenate(outputs))
    return Truth(
        values | {"first_order": index}, errors | {"first_order": error}, threshold, driver
    )


def _statistics(driver: FloatArray, values: FloatArray, threshold: float) -> dict[str, float]:
    low, high, *quantiles = np.quantile(values, [0.16, 0.84, *QUANTILES]).tolist()
    return {
        "mean": float(values.mean()),
        "std": float(values.std()),
        "half_spread": (high - low) / 2,
        **{f"quantile {p}": value for p, value in zip(QUANTILES, quantiles, strict=True)},
        "exceedance": float((values > threshold).mean()),
        "spearman": _rank_correlation(driver, values),
    }


def _rank_correlation(x: FloatArray, y: FloatArray) -> float:
    """Spearman's coefficient; NaN for an input that does not vary."""
    if np.ptp(x) == 0:
        return math.nan
    return float(np.corrcoef(stats.rankdata(x), stats.rankdata(y))[0, 1])


def _first_order(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """First-order index with the limit of its error, from residuals about parabolas in bins.

    Parabolas take up to three degrees of freedom from the residuals of a bin: fewer where points
    avoid each other. The middle is taken.
    """
    order = np.argsort(x, kind="stable")
    bins, values = (each[order].reshape(REFERENCE_BINS, -1) for each in (x, y))
    span = np.ptp(bins, axis=1, keepdims=True)
    position = (bins - bins.mean(axis=1, keepdims=True)) / span
    basis, _ = np.linalg.qr(np.stack([position**0, position, position**2], axis=-1))
    fitted = basis @ (basis.transpose(0, 2, 1) @ values[..., None])
    residual = float(((values - fitted[..., 0]) ** 2).mean() / y.var())
    correction = residual * basis.shape[2] / bins.shape[1] / 2
    return 1 - residual - correction, correction


def _cells(
    case: UseCase, output: int, design: str, truth: Truth, seed: int
) -> dict[str, Cell | None]:
    """Every interval of one seed's runs compared with the truth; None where one of both is not."""
    rng = Stream(seed, "coverage", case.outputs[output], design).generator()
    unit, sample = DESIGNS[design].sample(rng, case.dimension)
    points = case.inputs(unit)
    driver = np.asarray(points)[:, [truth.driver]]
    sample = replace(
        sample,
        values=np.asarray(case.model(points))[:, output].copy(),
        columns=InputColumns.from_matrix(("driver",), driver),
        dependence=case.dependence,
    )
    estimates = _estimates(sample, truth.threshold)
    return {name: _cell(estimates[name], value) for name, value in truth.values.items()}


def _estimates(sample: Sample, threshold: float) -> dict[str, xr.DataArray]:
    """The estimates of all statistics, each along ``bound``."""
    quantity = QuantityOfInterest(OUTPUT, "1", quantiles=QUANTILES)
    found = first_answers(sample_moments(sample, quantity), "mean", "std", "half_spread")
    quantiles = first_answers(quantile_estimates(sample, quantity), "quantile")["quantile"]
    found |= {f"quantile {p}": each for p, each in zip(QUANTILES, quantiles, strict=True)}
    found["spearman"] = first_answers(correlations(sample, quantity), "spearman")["spearman"][0]
    found["first_order"] = first_answers(first_order(sample, quantity), "first_order")[
        "first_order"
    ][0]
    exceeding = replace(quantity, thresholds=(Threshold("", threshold),))
    array = first_answers(exceedance_probabilities(sample, exceeding), "exceedance")["exceedance"]
    return found | {"exceedance": array[0]}


def _cell(estimate: xr.DataArray, truth: float) -> Cell | None:
    _, lower, upper = estimate.values.tolist()
    if any(math.isnan(value) for value in (lower, upper, truth)):
        return None
    return Cell(lower <= truth <= upper, (upper - lower) / 2, interval_text(estimate, NOTE))


@cache
def _use_cases() -> dict[str, UseCase]:
    return {case.name: case for case in use_cases()}


@cache
def _truths(name: str) -> list[Truth]:
    return list(true_values(_use_cases()[name]))


def _rows(name: str, design: str, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the numbers of intervals by note, and of those that cover, by output and statistic."""
    case, truths = _use_cases()[name], _truths(name)
    for number, (output, truth) in enumerate(zip(case.outputs, truths, strict=True)):
        found = [_cells(case, number, design, truth, seed) for seed in seeds]
        for statistic in STATISTICS:
            cells = [cell for each in found if (cell := each[statistic]) is not None]
            row: dict[str, Any] = {"output": output, "statistic": statistic}
            for note, has_note in NOTES.items():
                of = [cell for cell in cells if has_note(cell.note)]
                row |= {note: len(of), f"{note}_covers": sum(cell.covers for cell in of)}
            widths = [cell.half_width for cell in cells]
            # The truth's standard error over the interval's half-width.
            error = truth.errors[statistic] / np.median(widths) if widths else 0.0
            yield row | {"relative_error": error}


NOTES: dict[str, Callable[[str], bool]] = {
    "plain": lambda text: not text,
    "tail": lambda text: text == texts.DOUBTFUL_TAIL,
    "other": lambda text: text not in ("", texts.DOUBTFUL_TAIL),
}
TITLES = {
    "plain": "without a note",
    "tail": "with the sentence on tails",
    "other": "with another note",
}


def _count(rows: Sequence[Row], *notes: str) -> tuple[int, int]:
    """Return the number of intervals with some notes in some rows, and how many cover."""
    intervals = sum(row[note] for row in rows for note in notes)
    return intervals, sum(row[f"{note}_covers"] for row in rows for note in notes)


def _text(intervals: int, covers: int) -> str:
    """Coverage, number of intervals, and the probability that so few of these cover by chance."""
    if not intervals:
        return "none"
    probability = stats.binom.cdf(covers, intervals, NOMINAL)
    return f"{per_cent(covers, intervals)} of {intervals}, {probability:.2g}"


def _failing(every: Sequence[Row]) -> Iterator[str]:
    rows = _that_exist(every)
    for note, statistic, design in product(NOTES, STATISTICS, DESIGNS):
        intervals, covers = _count(_select(rows, statistic, design), note)
        if intervals and stats.binom.cdf(covers, intervals, NOMINAL) < SMALLEST_PROBABILITY:
            where = f"{design}, {STATISTICS[statistic]}, {TITLES[note]}"
            yield f"{where}: {_text(intervals, covers)}"
    intervals, covers = _count(rows, *NOTES)
    if covers < LOWEST_OF_ALL * intervals:
        yield f"all together: {_text(intervals, covers)}"


def _that_exist(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of statistics that have a true value, which an interval can contain."""
    return [row for row in rows if not _is_infinite(row)]


def _is_infinite(row: Row) -> bool:
    return row["output"] in INFINITE_VARIANCE and row["statistic"] == "std"


def _select(rows: Sequence[Row], statistic: str, design: str) -> list[Row]:
    return [row for row in rows if (row["statistic"], row["design"]) == (statistic, design)]


def _page(every: Sequence[Row]) -> Iterator[str]:
    rows = _that_exist(every)
    for note, title in TITLES.items():
        of = {}
        for statistic in STATISTICS:
            found = [_count(_select(rows, statistic, design), note) for design in DESIGNS]
            if any(intervals for intervals, _ in found):
                of[STATISTICS[statistic]] = [_text(*each) for each in found]
        if of:
            yield from lines([title, *DESIGNS], ([name, *texts] for name, texts in of.items()))
            yield ""
    groups = [(title, (note,)) for note, title in TITLES.items()]
    for title, notes in [*groups, ("all together", tuple(NOTES))]:
        intervals, covers = _count(rows, *notes)
        if intervals:
            yield f"- {title}: {100 * covers / intervals:.2f} % of {intervals} intervals"
    yield ""
    failures = list(_failing(every))
    yield "Cells that fail:" if failures else "No cell fails."
    yield ""
    if failures:
        yield from (f"- {failure}" for failure in failures)
        yield ""
    yield from _of_infinite_variances([row for row in every if _is_infinite(row)])
    largest = max(row["relative_error"] for row in rows)
    seeds = totals(rows, "output", "design", "statistic")
    outputs = len({output for output, _, _ in seeds})
    most = max(cell.count for cell in seeds.values())
    yield (
        f"{outputs} outputs, {most} seeds each. The standard error of a true value is"
        f" at most {100 * largest:.1f} % of the intervals' median half-width."
    )


def _of_infinite_variances(rows: Sequence[Row]) -> Iterator[str]:
    """State how many samples get an interval of a standard deviation that is infinite."""
    if not rows:
        return
    given = {design: _count(_select(rows, "std", design), *NOTES)[0] for design in DESIGNS}
    samples = sum(row["count"] for row in rows) // len(DESIGNS)
    texts_of = ", ".join(f"{count} with {design}" for design, count in given.items())
    yield (
        f"The standard deviation of {' and '.join(sorted(INFINITE_VARIANCE))} is infinite. Of"
        f" {samples} samples with each design, these get an interval of it: {texts_of}."
    )
    yield ""


TABLE = SeedTable(
    ("case", "design"),
    _rows,
    {"use cases": _page},
    _failing,
    seeds=20,
    at_once=20,
    cases=lambda: product(_use_cases(), DESIGNS),
)


MOST_WITHOUT_A_WORD = 0.02
RUNS = (60, 200)
KINDS: dict[str, Any] = {
    "polynomial-chaos": uqpen.PolynomialChaos(design="runs"),
    "gaussian-process": uqpen.GaussianProcess(design="runs"),
}
SURROGATE_STATISTICS = {
    "mean": "mean",
    "std": "standard deviation",
    "half_spread": "half the 16–84 % range",
    "quantile": "quantiles 0.05, 0.5, 0.95",
    "exceedance": "exceedance of the 95 % point",
    "first_order": "first-order index",
}
COUNTS = {
    "figures": "figures",
    "refused": "without an interval",
    "off": "off",
    "silent": "off, without a word",
    "surrogate_off": "surrogate's own figure off by more than the interval",
    "surrogate_silent": "of these inside an interval without a note",
}
# Marginals of these classes have bounds; polynomials then are of uniform inputs.
_BOUNDED = ("Uniform", "Beta", "Triangular", "TruncatedNormal", "Dirac")


def _surrogate_rows(name: str, kind: str, runs: int, seeds: Sequence[int]) -> Iterator[Row]:
    """Yield the counts of the study of a seed, by output and statistic."""
    case, truths = _use_cases()[name], _truths(name)
    for seed in seeds:
        archive = uqpen.run(_study(case, truths, kind, runs, seed))
        for number, (output, truth) in enumerate(zip(case.outputs, truths, strict=True)):
            found = archive[f"statistics/surrogate/y{number}"].to_dataset()
            for statistic in SURROGATE_STATISTICS:
                is_infinite = statistic == "std" and output in INFINITE_VARIANCE
                if statistic in found and not is_infinite:
                    counts = _counts(found[statistic], statistic, truth)
                    yield {"output": output, "statistic": statistic, **counts}


def _study(case: UseCase, truths: Sequence[Truth], kind: str, runs: int, seed: int) -> uqpen.Study:
    """Return a study of a use case, whose inputs are standard normal or uniform from 0 to 1."""
    is_bounded = [
        case.distribution.getMarginal(number).getImplementation().getClassName() in _BOUNDED
        for number in range(case.dimension)
    ]

    def evaluate(**inputs: FloatArray) -> dict[str, FloatArray]:
        columns = [
            column if bounded else special.ndtr(column)
            for column, bounded in zip(inputs.values(), is_bounded, strict=True)
        ]
        found = np.asarray(case.model(case.inputs(np.stack(columns, axis=-1))))
        return {f"y{number}": values for number, values in enumerate(found.T)}

    names = [f"x{number}" for number in range(case.dimension)]
    return uqpen.Study(
        model=uqpen.PythonModel(
            evaluate,
            inputs=dict.fromkeys(names, "1"),
            outputs={f"y{number}": "1" for number in range(len(truths))},
            vectorized=True,
        ),
        inputs={
            name: uqpen.Uniform(0, 1) if bounded else uqpen.Normal(0, 1)
            for name, bounded in zip(names, is_bounded, strict=True)
        },
        outputs={
            f"y{number}": uqpen.OutputSpec(
                "1", exceeds=[repr(truth.threshold)], quantiles=list(QUANTILES)
            )
            for number, truth in enumerate(truths)
        },
        designs={"runs": uqpen.MonteCarlo(runs=runs)},
        surrogates={"surrogate": KINDS[kind]},
        seed=seed,
    )


def _counts(array: xr.DataArray, statistic: str, truth: Truth) -> dict[str, int]:
    """Return how many figures of a statistic are off, and how many of them without a word."""
    counts = dict.fromkeys(COUNTS, 0)
    for estimate, true in _figures(array, statistic, truth):
        _, lower, upper = estimate.transpose(..., BOUND).values.tolist()
        own = float(estimate[SURROGATE_ESTIMATE]) if SURROGATE_ESTIMATE in estimate.coords else None
        counts["figures"] += 1
        if math.isnan(upper - lower):
            counts["refused"] += 1
            continue
        has_note = NOTE in estimate.coords and bool(str(estimate.coords[NOTE].values))
        is_off = not lower <= true <= upper
        counts["off"] += is_off
        counts["silent"] += is_off and not has_note
        if own is not None and abs(own - true) > (upper - lower) / 2:
            counts["surrogate_off"] += 1
            counts["surrogate_silent"] += lower <= own <= upper and not has_note
    return counts


def _figures(
    array: xr.DataArray, statistic: str, truth: Truth
) -> Iterator[tuple[xr.DataArray, float]]:
    """Yield the estimates of a statistic that have a true value, with that."""
    values: Mapping[str, float] = truth.values
    if statistic == "quantile":
        for p in QUANTILES:
            yield array.sel({PROBABILITY: p}), values[f"quantile {p}"]
    elif statistic == "exceedance":
        yield array[0], values[statistic]
    elif statistic == "first_order":
        if not math.isnan(values[statistic]):
            yield array.sel({INPUT: f"x{truth.driver}"}), values[statistic]
    else:
        yield array, values[statistic]


def _surrogate_page(rows: Sequence[Row]) -> Iterator[str]:
    by_statistic = totals(rows, "kind", "runs", "statistic")
    by_size = totals(rows, "kind", "runs")
    for (kind, runs), whole in by_size.items():
        found = {
            SURROGATE_STATISTICS[each]: by_statistic.get((kind, runs, each))
            for each in SURROGATE_STATISTICS
        }
        of = [[title, *_numbers(cell)] for title, cell in found.items() if cell]
        head = [f"{kind}, {runs} runs", *COUNTS.values()]
        yield from lines(head, [*of, ["**all**", *_numbers(whole)]])
        yield ""
    outputs = len({row["output"] for row in rows})
    whole = totals(rows)[()]
    yield (
        f"{outputs} outputs. Of {whole.figures} figures, {whole.silent} are off without a"
        f" word: {100 * whole.silent / whole.figures:.2f} %."
    )


def _numbers(cell: SimpleNamespace) -> list[int]:
    return [getattr(cell, name) for name in COUNTS]


def _surrogate_failing(rows: Sequence[Row]) -> Iterator[str]:
    whole = totals(rows)[()]
    if whole.silent > MOST_WITHOUT_A_WORD * whole.figures:
        yield f"{whole.silent} of {whole.figures} figures"


SURROGATE_TABLE = SeedTable(
    ("case", "kind", "runs"),
    _surrogate_rows,
    {"surrogates of use cases": _surrogate_page},
    _surrogate_failing,
    seeds=20,
    cases=lambda: product(_use_cases(), KINDS, RUNS),
)

if __name__ == "__main__":
    main({"samples": TABLE, "surrogates": SURROGATE_TABLE}, __doc__)
