"""Statistics of a model with its stand-ins as control variates, in place of those of its runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import (
    BOUND,
    EQUIVALENT_RUNS,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    NOTE,
    ROUND,
)
from uqpen.core.statistic_dimensions import LOWER_THRESHOLD, PERCENT, PROBABILITY, THRESHOLD
from uqpen.statistics import texts
from uqpen.statistics.control_variates.group_runs import (
    GroupRuns,
    inadmissible_to_some,
    read_groups,
)
from uqpen.statistics.control_variates.linear_estimate import linear_estimate
from uqpen.statistics.control_variates.matched_threshold import MatchedThresholds
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample_shape import ENOUGH_RUNS_FOR_MEANS

__all__ = ["control_variate_statistics"]

# With fewer common runs, the covariances are too uncertain.
_FEWEST_COMMON = 20
# With a larger kurtosis of the model or of its closest stand-in, intervals of a standard deviation
# cover too seldom. Fewer runs may hide a heavy tail, which a stand-in as close as this would show.
_HEAVY_KURTOSIS, _ENOUGH_FOR_TAILS, _CLOSE = 4.5, 200, 0.9


def control_variate_statistics(
    runs: Mapping[str, xr.Dataset],
    quantity: QuantityOfInterest,
    plain: Mapping[str, xr.DataArray],
) -> dict[str, xr.DataArray]:
    """Estimate statistics of the first model from its runs and from those of its stand-ins.

    Parameters
    ----------
    runs : mapping of str to Dataset
        The runs of one design by model, the first one first, then its stand-ins. Those are left out
        that do not give the output, or have run no points but the first model's.
    quantity : QuantityOfInterest
        Of an output of the first model.
    plain : mapping of str to DataArray
        Estimate arrays from the first model's own runs, by statistic.

    Returns
    -------
    dict of str to DataArray
        The mean, standard deviation, quantiles, percentiles and probabilities among `plain`, with
        the coordinate ``equivalent_runs``: with as many runs of its own, the interval would be as
        wide. It is empty where no stand-in has runs of its own, or the output does not vary. Where
        the stand-ins cannot be used, it has the plain mean, with the reason as a note.
    """
    name = quantity.output.name
    if not quantity.output.is_number:
        return {}
    able = {model: each for model, each in runs.items() if name in each and ROUND in each.coords}
    if next(iter(runs)) not in able or len(able) < 2:
        return {}
    groups = read_groups(able, name)
    if len(groups) < 2 or not groups[0].models.all() or not np.ptp(groups[0].values[0]) > 0:
        return {}
    if reason := _reason_against(able, groups):
        return {"mean": _with_note(plain["mean"], reason)}
    estimators = _Estimators(groups, tuple(able), quantity.confidence_level)
    return {
        statistic: _replaced(array, [*estimate(estimators, array)], quantity.confidence_level)
        for statistic, estimate in _ESTIMATES.items()
        if (array := plain.get(statistic)) is not None
    }


def _reason_against(runs: Mapping[str, xr.Dataset], groups: Sequence[GroupRuns]) -> str:
    """Return why stand-ins cannot be used; empty where they can."""
    if inadmissible_to_some(runs):
        return texts.ADMITS_OTHER_POINTS
    if (common := groups[0].size) < _FEWEST_COMMON:
        return texts.FEW_COMMON_RUNS.format(runs=common)
    return ""


@dataclass(frozen=True, eq=False)
class _Estimators:
    """Estimators of the statistics of an output, from its runs by groups of models."""

    groups: tuple[GroupRuns, ...]
    names: tuple[str, ...]
    level: float

    def mean(self, plain: xr.DataArray) -> Iterator[Estimate]:
        """Yield the mean."""
        found = linear_estimate(self.groups)
        below, above = found.margins(self.level)
        ends = found.value - float(below), found.value + float(above)
        note = texts.DOUBTFUL_TAIL if self._own_runs < ENOUGH_RUNS_FOR_MEANS else ""
        yield Estimate(found.value, *ends, self._text(texts.CONTROL_VARIATES), "conservative", note)

    def standard_deviation(self, plain: xr.DataArray) -> Iterator[Estimate]:
        """Yield the standard deviation: the root of the mean of the squares about the mean."""
        mean = linear_estimate(self.groups)
        pooled = self._pooled()
        centres = np.array([mean.value, *(values.mean() for values in pooled[1:])])
        squares = [
            group.transformed((group.values - centres[:, np.newaxis]) ** 2) for group in self.groups
        ]
        found = linear_estimate(squares)
        # About a mean that the same runs give, squares are too small by the variance of that mean.
        variance = found.value + mean.error**2
        if not variance > 0:
            yield Estimate.without_bounds(math.nan, texts.NO_INTERVAL)
            return
        value = math.sqrt(variance)
        if reason := self._tail(pooled):
            yield Estimate.without_bounds(value, reason)
            return
        factors = [math.exp(float(each) / (2 * variance)) for each in found.margins(self.level)]
        method = self._text(texts.CONTROL_VARIATES_OF_LOGARITHM)
        note = texts.DOUBTFUL_TAIL if self._own_runs < ENOUGH_RUNS_FOR_MEANS else ""
        yield Estimate(value, value / factors[0], value * factors[1], method, "conservative", note)

    def quantiles(self, plain: xr.DataArray) -> Iterator[Estimate]:
        """Yield quantiles, at the probabilities of a plain estimate."""
        for probability in plain[PROBABILITY].values:
            yield self._quantile(float(probability))

    def percentiles(self, plain: xr.DataArray) -> Iterator[Estimate]:
        """Yield percentiles, at the per cent of a plain estimate."""
        for percent in plain[PERCENT].values:
            yield self._quantile(float(percent) / 100)

    def exceedance(self, plain: xr.DataArray) -> Iterator[Estimate]:
        """Yield probabilities of exceeding the thresholds of a plain estimate."""
        for threshold in plain[f"{THRESHOLD}_value"].values:
            value, lower, upper = self._thresholds.probability_below(threshold, is_strict=False)
            yield self._matched(1 - value, 1 - upper, 1 - lower)

    def below(self, plain: xr.DataArray) -> Iterator[Estimate]:
        """Yield probabilities of lying below the thresholds of a plain estimate."""
        for threshold in plain[f"{LOWER_THRESHOLD}_value"].values:
            yield self._matched(*self._thresholds.probability_below(threshold, is_strict=True))

    @property
    def _thresholds(self) -> MatchedThresholds:
        return MatchedThresholds.of(self.groups, self.level)

    @property
    def _own_runs(self) -> int:
        """Number of runs of the first model."""
        return sum(group.size for group in self.groups if group.models[0])

    def _quantile(self, probability: float) -> Estimate:
        found = self._matched(*self._thresholds.quantile(probability))
        missing = [
            text.format(too_few=texts.TOO_FEW_RUNS.format(runs=self._own_runs))
            for text, end in (
                (texts.NO_LOWER_BOUND, found.lower),
                (texts.NO_UPPER_BOUND, found.upper),
            )
            if math.isnan(end)
        ]
        return found.with_note(*missing)

    def _matched(self, value: float, lower: float, upper: float) -> Estimate:
        return Estimate(value, lower, upper, texts.MATCHED_THRESHOLD, "discrete")

    def _pooled(self) -> list[FloatArray]:
        """Return the values of each model at the points of all groups."""
        return [
            np.concatenate([group.values[model] for group in self.groups if group.models[model]])
            for model in range(len(self.names))
        ]

    def _tail(self, pooled: Sequence[FloatArray]) -> str:
        """Return why the tail allows no interval of the standard deviation; empty if it does."""
        values = self.groups[0].values
        varying = np.flatnonzero(np.ptp(values, axis=1) > 0)
        squares = np.atleast_2d(np.corrcoef(values[varying]))[0] ** 2
        # The closest stand-in, or the model itself where none varies.
        closest = 1 + int(np.argmax(squares[1:])) if len(varying) > 1 else 0
        kurtosis = max(_kurtosis(pooled[0]), _kurtosis(pooled[varying[closest]]))
        if kurtosis > _HEAVY_KURTOSIS:
            return texts.NO_INTERVAL_AS.format(reason=texts.HEAVY_AMONG.format(kurtosis=kurtosis))
        is_close = closest > 0 and squares[closest] >= _CLOSE
        is_seen = len(pooled[0]) >= _ENOUGH_FOR_TAILS or is_close
        return "" if is_seen else texts.HIDDEN_TAIL.format(runs=_ENOUGH_FOR_TAILS)

    def _text(self, method: str) -> str:
        return method.format(models=", ".join(self.names[1:]))


_ESTIMATES: Mapping[str, Callable[[_Estimators, xr.DataArray], Iterator[Estimate]]] = {
    "mean": _Estimators.mean,
    "std": _Estimators.standard_deviation,
    "quantile": _Estimators.quantiles,
    "percentile": _Estimators.percentiles,
    "exceedance": _Estimators.exceedance,
    "below": _Estimators.below,
}


def _kurtosis(values: FloatArray) -> float:
    """Return the fourth standardized moment; that of a normal distribution without any spread."""
    deviations = values - values.mean()
    variance = float((deviations**2).mean())
    return float((deviations**4).mean()) / variance**2 if variance > 0 else 3.0


def _with_note(array: xr.DataArray, reason: str) -> xr.DataArray:
    note = "; ".join(filter(None, [str(array.coords[NOTE].values), reason]))
    return array.assign_coords({NOTE: ((), np.asarray(note, dtype=object))})


def _replaced(plain: xr.DataArray, estimates: Sequence[Estimate], level: float) -> xr.DataArray:
    """Return an estimate array with other estimates, and the runs that they are worth."""
    values = np.array([each.bounds for each in estimates]).reshape(plain.shape)
    kept = {k: each.variable for k, each in plain.coords.items() if k not in INTERVAL_TEXTS}
    attributes = {**plain.attrs, INTERVAL_LEVEL: level}
    equivalent = _equivalent_runs(plain.values, values, int(plain.attrs["runs_used"]))
    notes = [each.note for each in estimates]
    if plain.ndim == 1 and np.isfinite(equivalent):
        worth = texts.AS_NARROW_AS.format(runs=int(float(f"{equivalent:.2g}")))
        notes = ["; ".join(filter(None, [worth, *notes]))]
    dims = {str(name): size for name, size in plain.sizes.items() if name != BOUND}
    found = estimate_array(
        values,
        dims,
        {
            INTERVAL: [each.method for each in estimates],
            INTERVAL_LABEL: [each.label for each in estimates],
            NOTE: notes,
        },
        units=attributes.pop("units"),
        long_name=attributes.pop("long_name"),
        attributes=attributes,
        coordinates={k: each for k, each in kept.items() if k != BOUND},
    )
    return found.assign_coords({EQUIVALENT_RUNS: (tuple(dims), equivalent)})


def _equivalent_runs(plain: FloatArray, found: FloatArray, runs: int) -> FloatArray:
    """Return how many runs of its own would give intervals of the same widths; NaN if unknown.

    The width of a plain interval falls with the root of the number of runs.
    """
    before, after = (each[..., 2] - each[..., 1] for each in (plain, found))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(after > 0, (before / after) ** 2, np.nan)
    return np.round(runs * ratio)
