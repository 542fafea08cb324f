"""Record of a benchmark: the estimates of all methods, their errors, and the archive of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array, pack
from uqpen.benchmark.methods import (
    BenchmarkMethod,
    BenchmarkSettings,
    BenchmarkStatistic,
    Estimates,
    MethodCost,
    SurrogateMethod,
)
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.catalogue import COMPARISON_STATISTICS, METHOD_STATISTICS, STD
from uqpen.core.labels import (
    BOUNDS,
    BUDGET,
    COMPARISON_GROUP,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    NOTE,
    REFERENCE,
    REPEAT,
    REPLICATED,
    REPLICATES_OF_BUDGET,
    RUNS_OF_BUDGET,
    RUNS_SPENT,
    SINGLE,
    SOURCE,
    SOURCE_KIND,
    STATISTICS_GROUP,
    VARIANT,
    VARIANTS,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.digits import grouped_number, range_text
from uqpen.results.texts import join_names
from uqpen.statistics.estimate import LEVEL, NamedArrays
from uqpen.statistics.intervals import student_quantile

# Accuracy of methods: errors, rates, and which method leads.
#
# All formulas use logarithms of root mean square errors, because methods differ by factors. The
# errors of estimates are usually far from normal, so their squares do not follow a chi-square
# distribution. The standard error of a logarithm is estimated by the jackknife over repeats.

# With a kurtosis of the errors above this, too few repeats dominate their mean square for a
# reliable interval; for normally distributed errors the kurtosis is 3.
_HEAVY_KURTOSIS = 6.0


@dataclass(frozen=True)
class Accuracy:
    """Root mean square errors."""

    # Natural logarithm of each; minus infinity where no repeat has an error, NaN where some repeat
    # has no estimate.
    logarithm: FloatArray
    error: FloatArray  # standard error of each logarithm; NaN where it cannot be estimated
    # True where a few of the repeats dominate it, so that rarer ones may make it larger.
    is_heavy: BoolArray
    repeats: int  # number of repeats

    def __getitem__(self, at: Any) -> Accuracy:
        return Accuracy(self.logarithm[at], self.error[at], self.is_heavy[at], self.repeats)

    @property
    def reliable_error(self) -> FloatArray:
        """Standard error of each logarithm; NaN where a few of the repeats decide."""
        return np.where(self.is_heavy, np.nan, self.error)

    @property
    def bounds(self) -> FloatArray:
        """Root mean squares and their `reliable_error` bounds, along a last axis."""
        half = student_quantile(self.repeats - 1, LEVEL) * self.reliable_error
        ends = [self.logarithm, self.logarithm - half, self.logarithm + half]
        return np.asarray(np.exp(np.stack(ends, axis=-1)))


@dataclass(frozen=True)
class ErrorRatio:
    """Factor by which one method's error is below another's, and its interval."""

    factor: float
    lower: float
    upper: float

    @property
    def is_significant(self) -> bool:
        """True if the interval lies above 1."""
        return self.lower > 1


def root_mean_square_errors(errors: FloatArray) -> Accuracy:
    """Return root mean squares over repeats, with the jackknife's errors of their logarithms.

    `errors` are estimates less the reference, shape (..., repeat).

    References
    ----------
    Efron, B. & Stein, C. (1981). Ann. Stat. 9, 586-596.
    """
    repeats = errors.shape[-1]
    squares = errors**2
    total = squares.sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(total / repeats) / 2
        # The differences of large numbers may come out below zero by rounding.
        others = np.maximum(total[..., np.newaxis] - squares, 0.0)
        without = np.log(others / (repeats - 1)) / 2
        deviations = without - without.mean(axis=-1, keepdims=True)
        variance = (deviations**2).sum(axis=-1) * (repeats - 1) / repeats
        # Over the largest, as the squares of squares of what is small vanish.
        scaled = squares / squares.max(axis=-1, keepdims=True)
        kurtosis = repeats * (scaled**2).sum(axis=-1) / scaled.sum(axis=-1) ** 2
    error = np.sqrt(np.where(np.isfinite(variance), variance, np.nan))
    return Accuracy(logarithm, error, kurtosis > _HEAVY_KURTOSIS, repeats)


def convergence_slope(
    logarithm: FloatArray, error: FloatArray, runs: FloatArray, repeats: int
) -> FloatArray:
    """Return the slope of the straight line through logarithms of errors over those of runs.

    The line is fitted by least squares to what `Accuracy` has, shape (budget, ...). The interval
    covers the noise of the errors only: it is the interval of the line through these budgets, even
    if the errors do not lie on a line. The last axis is the estimate with its bounds, NaN with
    fewer than two budgets.
    """
    distance = np.log(runs) - np.log(runs).mean()
    square = float((distance**2).sum())
    if not square > 0:
        return np.full((*logarithm.shape[1:], 3), np.nan)
    weights = distance / square
    with np.errstate(invalid="ignore"):
        estimate = np.einsum("b,b...", weights, logarithm)
    half = student_quantile(repeats - 1, LEVEL) * np.sqrt(np.einsum("b,b...", weights**2, error**2))
    estimate = np.where(np.isfinite(estimate), estimate, np.nan)
    return np.stack([estimate, estimate - half, estimate + half], axis=-1)


def error_ratio(
    ahead: tuple[float, float], behind: tuple[float, float], repeats: int
) -> ErrorRatio:
    """Estimate the factor between two errors whose repeats are independent of each other.

    Each is given by its logarithm and the standard error of that.

    References
    ----------
    Welch, B. L. (1947). Biometrika 34, 28-35.
    """
    if ahead[0] == behind[0]:  # both may be minus infinity
        return ErrorRatio(1.0, math.nan, math.nan)
    difference = behind[0] - ahead[0]
    if math.isinf(difference):
        return ErrorRatio(math.inf, math.inf, math.inf)
    variance = ahead[1] ** 2 + behind[1] ** 2
    if not variance > 0:
        certain = math.exp(difference) if variance == 0 else math.nan
        return ErrorRatio(math.exp(difference), certain, certain)
    freedom = (repeats - 1) * variance**2 / (ahead[1] ** 4 + behind[1] ** 4)
    half = student_quantile(freedom, LEVEL) * math.sqrt(variance)
    return ErrorRatio(
        math.exp(difference), math.exp(difference - half), math.exp(difference + half)
    )


# Verdicts: the best method at each budget, for each statistic, and its significance.

# Largest half-width of the reference's own 95 % interval, relative to an error, without a remark:
# the error is then wrong by a few per cent at most.
_COARSE = 0.5

_FEW_DECIDE = "few of the repeats decide that"
_UNRESOLVED = "its errors are no larger than the reference's own"

NO_VERDICT = "no two methods have figures to compare"


@dataclass(frozen=True)
class Verdict:
    """Verdict of one comparison of methods."""

    winner: str  # the method with the smallest errors
    runner_up: str  # the one with the next
    lead: ErrorRatio  # the lead of the winner over the runner-up
    # The methods, the winner first, whose errors do not differ significantly from its own.
    level: tuple[str, ...]
    # Reason why the lead may not be real; empty for none. A few bad scrambles dominate the mean
    # square error of scrambled points on a smooth function. So where a few repeats dominate, or all
    # errors are as small as the reference's own, rarer repeats may change the order.
    doubt: str = ""


def find_verdict(
    names: Sequence[str], accuracies: Accuracy, resolution: float = 0.0
) -> Verdict | None:
    """Return the verdict of one comparison; None with fewer than two methods with estimates.

    `accuracies` have shape (method,); `resolution` is the error of the reference, NaN for unknown.
    """
    logarithm, error = accuracies.logarithm.tolist(), accuracies.error.tolist()
    order = [i for i in np.argsort(logarithm, kind="stable") if not math.isnan(logarithm[i])]
    if len(order) < 2:
        return None
    best = order[0]
    leads = {
        i: error_ratio((logarithm[best], error[best]), (logarithm[i], error[i]), accuracies.repeats)
        for i in order[1:]
    }
    # A method whose error a few repeats dominate is not level: it is behind, or ahead in doubt.
    is_heavy = accuracies.is_heavy
    level = [best, *(i for i, over in leads.items() if not (over.is_significant or is_heavy[i]))]
    ahead = leads[order[1]]
    is_decided = ahead.is_significant or len(level) > 1
    doubt = "" if is_decided and not is_heavy[best] else _FEW_DECIDE
    if math.exp(logarithm[best]) < resolution:
        doubt = _UNRESOLVED
    return Verdict(
        winner=names[best],
        runner_up=names[order[1]],
        lead=ErrorRatio(ahead.factor, math.nan, math.nan) if doubt else ahead,
        level=tuple(names[i] for i in level),
        doubt=doubt,
    )


def verdict_sentence(verdict: Verdict | None, budget: int) -> str:
    """Return a verdict in words.

    >>> close = ErrorRatio(1.1, 0.8, 1.5)
    >>> verdict_sentence(Verdict("sobol", "halton", close, ("sobol", "halton")), 128)
    'at 128 runs sobol and halton are level'
    """
    where = f"at {grouped_number(budget)} runs"
    if verdict is None:
        return f"{where} {NO_VERDICT}"
    if len(verdict.level) > 1:
        return f"{where} {join_names(verdict.level)} are level"
    over = verdict.lead
    if math.isinf(over.factor):
        return f"{where} {verdict.winner} alone is exact"
    if verdict.doubt:
        seen = f"{verdict.winner} is ahead of {verdict.runner_up}"
        return f"{where} {seen} by a factor of {_factor_text(over.factor)}, but {verdict.doubt}"
    factor, lower, upper = map(_factor_text, (over.factor, over.lower, over.upper))
    lead = f"{verdict.winner} leads {verdict.runner_up} by a factor of {factor}"
    return f"{where} {lead} ({range_text(lower, upper)})"


def reference_remark(error: float, half_width: float) -> str:
    """Return a remark on the half-width of the reference's interval, which may be NaN.

    It is compared with the smallest error that was measured against the reference.
    """
    if math.isnan(error):
        return ""
    if math.isnan(half_width):
        return "the reference has no interval here, so how far it is off is not known"
    if half_width > error:
        return "the smallest error is no larger than the reference's own"
    if half_width > _COARSE * error:
        return "the reference's own error is a good part of the smallest: take a larger --reference"
    return ""


def _factor_text(value: float) -> str:
    """Return a factor in two or three digits."""
    if value < 10:
        return f"{value:.2g}" if value < 1 else f"{value:.1f}"
    return f"{value:.0f}" if value < 1e5 else f"{value:.1g}"


# The record.

_VARIANTS = (SINGLE, REPLICATED)

# Methods of the intervals.
_INTERVALS = {
    "error": "Student t on the logarithm, jackknife over repeats",
    "slope": "Student t on a line by least squares, jackknife over repeats",
    "lead": "Welch's t on the logarithm, jackknife over repeats",
}
_INTERVAL_NOTE = (
    "none where a few of the repeats decide an error; a tail that none has met cannot show"
)


class EstimateRecord:
    """Estimates along method, budget, repeat, entry and bound; NaN where there is none.

    Parameters
    ----------
    methods : tuple of BenchmarkMethod
        In the order of the first axis.
    settings : BenchmarkSettings
        Budgets and repeats.
    statistics : sequence of BenchmarkStatistic
        Those that methods are compared by, output by output.
    reference : mapping of str to mapping
        The reference's estimate arrays, by output and statistic.
    """

    def __init__(
        self,
        methods: tuple[BenchmarkMethod, ...],
        settings: BenchmarkSettings,
        statistics: Sequence[BenchmarkStatistic],
        reference: Estimates,
    ) -> None:
        self._methods, self._settings, self._reference = methods, settings, reference
        # Along entry and bound, and the scales of the relative errors along entry.
        self._reference_values = {each: each.estimates(reference) for each in statistics}
        self._scales = {
            each: each.error_scale(values[:, 0], float(reference[each.output][STD.name].values[0]))
            for each, values in self._reference_values.items()
        }
        shape = (len(methods), len(settings.budgets), settings.repeats)
        self._estimates = {
            each: np.full((*shape, *values.shape), np.nan)
            for each, values in self._reference_values.items()
        }

    def add(self, method: int, budget: int, repeat: int, estimates: Estimates) -> None:
        """Take the estimates of a method from one repeat, all given by their positions."""
        for statistic, found in self._estimates.items():
            found[method, budget, repeat] = statistic.estimates(estimates)

    def accuracy(self, statistic: BenchmarkStatistic) -> Accuracy:
        """Return the relative errors, of shape (method, budget, entry)."""
        values = np.moveaxis(self._estimates[statistic][..., 0], 2, -1)
        reference = self._reference_values[statistic][:, :1]
        return root_mean_square_errors(
            (values - reference) / self._scales[statistic][:, np.newaxis]
        )

    def coverage(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Return the share of the intervals that contain the reference; NaN for no intervals.

        Its shape is (method, budget, entry).
        """
        lower, upper = np.moveaxis(self._estimates[statistic][..., 1:], -1, 0)
        reference = self._reference_values[statistic][:, 0]
        has_interval = ~(np.isnan(lower) | np.isnan(upper))
        held = (has_interval & (lower <= reference) & (reference <= upper)).sum(axis=2)
        with np.errstate(invalid="ignore"):
            share: FloatArray = held / has_interval.sum(axis=2)
        return share

    def slopes(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Return convergence rates over the usable budgets, of shape (method, entry, bound)."""
        errors = self.accuracy(statistic)
        slopes = []
        for position in range(len(self._methods)):
            runs = np.array([cost.runs for cost in self._costs(position)])
            used = errors[position, runs > 0]
            runs = runs[runs > 0].astype(np.float64)
            error = used.reliable_error
            slopes.append(convergence_slope(used.logarithm, error, runs, errors.repeats))
        return np.stack(slopes)

    def groups(self, reference_runs: int) -> Iterator[tuple[str, xr.Dataset]]:
        """Yield the groups of an archive: the reference and each method, then the verdicts."""
        by_output = {
            output: list(found)
            for output, found in groupby(self._reference_values, lambda statistic: statistic.output)
        }
        of_methods = {
            statistic: {
                statistic.name: self._estimates[statistic][..., 0],
                f"{statistic.name}_error": self.accuracy(statistic).bounds,
                f"{statistic.name}_coverage": self.coverage(statistic),
                f"{statistic.name}_slope": self.slopes(statistic),
            }
            for statistic in self._reference_values
        }
        taken = {method.source for method in self._methods}
        place = f"/{STATISTICS_GROUP}/{_free_name(REFERENCE, taken)}"
        yield place, xr.Dataset(attrs={SOURCE_KIND: REFERENCE, RUNS_SPENT: reference_runs})
        for output, arrays in self._reference.items():
            yield f"{place}/{output}", pack(arrays)
        for position, method in enumerate(self._methods):
            runs = sum(cost.runs for cost in self._costs(position)) * self._settings.repeats
            name = method.source
            if SINGLE not in method.variants:
                name = _free_name(f"{name}_{REPLICATED}", taken)
            attributes = {
                SOURCE_KIND: "surrogate" if isinstance(method, SurrogateMethod) else "design",
                SOURCE: method.source,
                VARIANTS: " ".join(method.variants),
                RUNS_SPENT: runs,
            }
            yield f"/{STATISTICS_GROUP}/{name}", xr.Dataset(attrs=attributes)
            for output, statistics in by_output.items():
                arrays = {
                    key: self._method_array(position, each, key, values[position])
                    for each in statistics
                    for key, values in of_methods[each].items()
                }
                yield f"/{STATISTICS_GROUP}/{name}/{output}", pack(arrays)
        for output, statistics in by_output.items():
            arrays = dict(pair for each in statistics for pair in self._comparison_arrays(each))
            quantity = statistics[0].quantity
            described = {
                "long_name": quantity.output.title,
                "units": quantity.output.unit,
                "display_units": quantity.display_unit,
            }
            yield f"/{COMPARISON_GROUP}/{output}", pack(arrays).assign_attrs(described)

    def _costs(self, method: int) -> list[MethodCost]:
        return [self._methods[method].cost(budget) for budget in self._settings.budgets]

    def _method_array(
        self, method: int, statistic: BenchmarkStatistic, name: str, values: FloatArray
    ) -> xr.DataArray:
        runs, replicates = zip(*self._costs(method), strict=True)
        beside = {
            RUNS_OF_BUDGET: (BUDGET, np.array(runs), "runs that are made"),
            REPLICATES_OF_BUDGET: (BUDGET, np.array(replicates), "replicates"),
        }
        return self._array(METHOD_STATISTICS[name], statistic, values, beside)

    def _comparison_arrays(self, statistic: BenchmarkStatistic) -> NamedArrays:
        """Yield what errors are relative to, and the verdicts along variant, budget and entry."""
        errors, budgets = self.accuracy(statistic), self._settings.budgets
        shape = (len(_VARIANTS), len(budgets), len(statistic.entries))
        found: dict[str, Any] = {
            name: np.full(shape, "", dtype=object)
            for name in ("winner", "runner_up", "level", "verdict", "remark")
        }
        found["lead"] = np.full((*shape, len(BOUNDS)), np.nan)
        for at in np.ndindex(shape):
            variant, budget, entry = at
            inside = [
                i for i, each in enumerate(self._methods) if _VARIANTS[variant] in each.variants
            ]
            compared = errors[inside, budget, entry]
            _, lower, upper = self._reference_values[statistic][entry]
            own = float((upper - lower) / 2 / self._scales[statistic][entry])
            verdict = find_verdict([self._methods[i].source for i in inside], compared, own)
            found["verdict"][at] = verdict_sentence(verdict, budgets[budget])
            if verdict is None:
                continue
            found["winner"][at], found["runner_up"][at] = verdict.winner, verdict.runner_up
            found["level"][at] = " ".join(verdict.level)
            found["lead"][at] = verdict.lead.factor, verdict.lead.lower, verdict.lead.upper
            if not verdict.doubt:
                least = float(np.nanmin(compared.bounds[:, 0]))
                found["remark"][at] = reference_remark(least, own)
        for said, values in {"scale": self._scales[statistic], **found}.items():
            name = f"{statistic.name}_{said}"
            yield name, self._array(COMPARISON_STATISTICS[name], statistic, values, {})

    def _array(
        self,
        described: Statistic,
        statistic: BenchmarkStatistic,
        values: Any,
        beside: Mapping[str, tuple[str, Any, str]],
    ) -> xr.DataArray:
        """Return a variable of a statistic with its coordinates.

        The values lie along its dimensions, the statistic's entries being the last, and the bounds.
        """
        if not statistic.dimension:  # a single entry has no dimension in the archive
            values = np.take(values, 0, axis=len(described.dims))
        known = {
            VARIANT: (VARIANT, np.array(_VARIANTS, dtype=object), "how the points are taken"),
            BUDGET: (BUDGET, np.array(self._settings.budgets), "runs that a method may make"),
            REPEAT: (REPEAT, np.arange(self._settings.repeats), "number of the repeat"),
        }
        along = {name: known[name] for name in described.dims if name in known}
        along |= beside if BUDGET in described.dims else {}
        coordinates: dict[str, Any] = {name: _coordinate(*each) for name, each in along.items()}
        # The labels of the entries are those that the reference has.
        coordinates |= {
            str(name): coordinate.variable
            for name, coordinate in self._reference[statistic.output][statistic.name].coords.items()
            if coordinate.dims == (statistic.dimension,) and name not in INTERVAL_TEXTS
        }
        attributes = {"long_name": f"{described.title} of {statistic.quantity.output.title}"}
        if described.kind != "text":
            has_unit = described.unit is not UnitRule.NONE
            attributes["units"] = statistic.units if has_unit else DIMENSIONLESS
        if not described.has_bounds:
            return xr.DataArray(values, coordinates, described.dims, attrs=attributes)
        return estimate_array(
            values,
            dict(zip(described.dims, values.shape[:-1], strict=True)),
            {
                INTERVAL: _INTERVALS[described.name.rpartition("_")[2]],
                INTERVAL_LABEL: "nominal",
                NOTE: _INTERVAL_NOTE,
            },
            **attributes,
            attributes={INTERVAL_LEVEL: LEVEL},
            coordinates=coordinates,
        )


def _free_name(name: str, taken: set[str]) -> str:
    """Return a name that is not yet taken, which it is from then on."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _coordinate(dimension: str, labels: Any, long_name: str) -> tuple[str, Any, dict[str, str]]:
    units = {} if labels.dtype == object else {"units": DIMENSIONLESS}
    return dimension, labels, {**units, "long_name": long_name}
