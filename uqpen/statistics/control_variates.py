"""Statistics of a model with its stand-ins as control variates, in place of those of its runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    EQUIVALENT_RUNS,
    LOWER_THRESHOLD,
    NOTE,
    ROUND,
    RUN,
    STATUS,
    THRESHOLD,
)
from uqpen.core.lookup import resolve
from uqpen.core.status import Status
from uqpen.designs.multifidelity import LinearEstimator
from uqpen.execution import worst_status_runs
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import bonett_price, equivalent_runs, mean_half_width
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ENOUGH_RUNS_FOR_MEANS
from uqpen.statistics.standard_errors import Margins, extreme_margins
from uqpen.statistics.surrogate.corrected_moments import (
    kurtosis,
    quantile_estimates,
    quantile_probabilities,
)

# Runs of an output by groups of models, at independent points of each group.


@dataclass(frozen=True, eq=False)
class GroupRuns:
    """Values of an output at the points of a group, by the models that have run them."""

    models: BoolArray  # (model,): the models of the group, the one of interest first
    # (model, run): of runs that all models of the group completed; 0 for models outside of it.
    values: FloatArray

    @property
    def size(self) -> int:
        """Number of points."""
        return self.values.shape[1]


def read_groups(runs: Mapping[str, xr.Dataset], output: str) -> tuple[GroupRuns, ...]:
    """Return the runs of an output by groups of models, that of all models first.

    Parameters
    ----------
    runs : mapping of str to Dataset
        The runs of a design by model, with the round of each. The output is a number in all.
    """
    found: dict[tuple[bool, ...], list[FloatArray]] = {}
    for parts in _rounds(runs):
        models = np.array([part is not None for part in parts])
        made = [part for part in parts if part is not None]
        is_ok = worst_status_runs(made)[STATUS].values == Status.OK
        is_ok &= np.all([np.isfinite(part[output].values) for part in made], axis=0)
        values = np.zeros((len(parts), int(is_ok.sum())))
        values[models] = [part[output].values[is_ok] for part in made]
        found.setdefault(tuple(models), []).append(values)
    ordered = sorted(found.items(), reverse=True)
    return tuple(
        GroupRuns(np.array(models), np.concatenate(values, axis=1)) for models, values in ordered
    )


def _rounds(runs: Mapping[str, xr.Dataset]) -> Iterator[Sequence[xr.Dataset | None]]:
    """Yield the runs of each round by model; None for a model that has not run it."""
    numbers = {name: each[ROUND].values for name, each in runs.items()}
    for number in np.unique(np.concatenate([*numbers.values()])):
        parts = [each.isel({RUN: numbers[name] == number}) for name, each in runs.items()]
        yield [part if part.sizes[RUN] else None for part in parts]


# Mean of a model by the best linear unbiased estimator over groups of runs, with its margins.

# Of what the closest stand-in does beyond all common runs, the part that may be missed of the
# model. With 0, means of the concrete rod's depth and of a lognormal output covered in 91 to 94 %;
# with a quarter in 96 to 99 %. A larger part costs width where outputs are bounded.
_MISSED = 0.25


@dataclass(frozen=True)
class LinearEstimate:
    """Mean of a model, the standard error with its degrees of freedom, and the margins."""

    value: float  # the mean
    error: float  # its standard error
    freedom: float  # Welch's degrees of freedom of that
    # How far both ends of an interval move out beyond Student's t, for long tails.
    allowance: Margins

    def margins(self, level: float) -> Margins:
        """Return the distances of both ends of the interval from the mean."""
        half = mean_half_width(self.error, self.freedom, level)
        return Margins(half, half).plus(self.allowance)


def linear_estimate(groups: Sequence[GroupRuns]) -> LinearEstimate:
    """Estimate the mean of the first model.

    The weights follow from the covariances at the points of the first group, and the error from the
    scatter of the weighted outputs in each group.

    Parameters
    ----------
    groups : sequence of GroupRuns
        The first has all models, and more runs than twice the models.
    """
    whole, models = groups[0], len(groups[0].models)
    covariance = np.atleast_2d(np.cov(whole.values))
    sizes = np.array([group.size for group in groups], dtype=np.float64)
    weights = LinearEstimator(covariance, [group.models for group in groups]).weights(sizes)
    # About a centre, as the weights of a stand-in add up to 0 but for rounding.
    centre = whole.values.mean(axis=1, keepdims=True)
    scores = [each @ (group.values - centre) for each, group in zip(weights, groups, strict=True)]
    # A weight of each stand-in has been fitted to the first group.
    freedoms = sizes - np.where(np.arange(len(groups)) == 0, models, 1)
    squares = np.array([((each - each.mean()) ** 2).sum() for each in scores])
    variances = squares / freedoms / sizes
    total = float(variances.sum())
    freedom = total**2 / float((variances**2 / freedoms).sum()) if total > 0 else 1.0
    allowance = _beyond(groups, covariance)
    for score in scores:
        allowance = allowance.plus(extreme_margins(score))
    value = float(centre[0, 0] + sum(each.mean() for each in scores))
    return LinearEstimate(value, float(np.sqrt(total)), freedom, allowance)


def _beyond(groups: Sequence[GroupRuns], covariance: FloatArray) -> Margins:
    """Return the margins for what the closest stand-in does beyond all common runs.

    There, no run shows how well it stands in. Both models are compared in standard deviations.
    """
    variances = np.diag(covariance)
    scale = np.where(variances > 0, variances, np.inf)
    closest = 1 + int(np.argmax((covariance[0] ** 2 / scale)[1:]))
    slope = np.sqrt(variances[0] / scale[closest]) * np.sign(covariance[0, closest])
    common = slope * groups[0].values[closest]
    values = slope * np.concatenate(
        [group.values[closest] for group in groups if group.models[closest]]
    )
    below = np.maximum(common.min() - values, 0.0).mean()
    above = np.maximum(values - common.max(), 0.0).mean()
    return Margins(np.asarray(_MISSED * below), np.asarray(_MISSED * above))


# Probabilities and quantiles of a model from a stand-in, whose threshold matches the model's.
#
# The sorted common runs of both models show which value of the stand-in corresponds to a threshold
# of the model. How often the stand-in lies below that is all but known from its many runs. Runs in
# which one of them lies below and the other above correct this share, with the interval of Bonett,
# D. G. & Price, R. M. (2012). J. Educ. Behav. Stat. 37, 479-488, for a difference of paired
# probabilities.


@dataclass(frozen=True, eq=False)
class MatchedThresholds:
    """Values of a model and of its closest stand-in at common points, and of that at all points."""

    model: FloatArray  # (run,): two runs at least, sorted
    stand_in: FloatArray  # (run,): in that order; its sign is changed where it falls
    stand_in_everywhere: FloatArray  # (point,): sorted
    level: float  # confidence level of the intervals

    @classmethod
    def of(cls, groups: Sequence[GroupRuns], level: float) -> MatchedThresholds:
        """Return the thresholds of the stand-in that is closest in the ranks of shared runs."""
        ranks = np.argsort(np.argsort(groups[0].values, axis=1), axis=1)
        varies = np.ptp(groups[0].values, axis=1) > 0
        correlations = np.where(varies, np.corrcoef(ranks)[0], 0.0)
        closest = 1 + int(np.argmax(np.abs(correlations[1:])))
        sign = -1.0 if correlations[closest] < 0 else 1.0
        both = [group.values for group in groups if group.models[0] and group.models[closest]]
        all_points = [group.values[closest] for group in groups if group.models[closest]]
        model, stand_in = np.concatenate(both, axis=1)[[0, closest]]
        order = np.argsort(model, kind="stable")
        everywhere = np.sort(sign * np.concatenate(all_points))
        return cls(model[order], sign * stand_in[order], everywhere, level)

    def probability_below(self, threshold: float, *, is_strict: bool) -> Estimate:
        """Return the probability of lying below a threshold, with its bounds.

        Parameters
        ----------
        threshold : float
            In the unit of the output.
        is_strict : bool
            True if a value at the threshold does not lie below it.
        """
        model = self.model < threshold if is_strict else self.model <= threshold
        matched = self._matched(threshold)
        stand_in = self.stand_in <= matched
        only_model, only_stand_in = (model & ~stand_in).sum(), (~model & stand_in).sum()
        return self._corrected(self._share(matched), only_model, only_stand_in)

    def quantile(self, probability: float) -> tuple[float, float, float]:
        """Return a quantile with its bounds; NaN for a bound that the runs do not have.

        The interval has all values up to which the probability may be that of the quantile
        (Woodruff, R. S. (1952). J. Am. Stat. Assoc. 47, 635-646).
        """
        thresholds, found = self._curve
        rising = np.maximum.accumulate
        value = np.interp(probability, rising(found.value), thresholds)
        lower = np.interp(probability, rising(found.upper), thresholds, left=np.nan)
        # The largest value whose lower bound is not above the probability.
        never_above = np.minimum.accumulate(found.lower[::-1])[::-1]
        upper = np.interp(probability, never_above, thresholds, right=np.nan)
        return float(value), float(min(lower, value)), float(max(upper, value))

    @cached_property
    def _curve(self) -> tuple[FloatArray, Estimate]:
        """Thresholds, and the probability of lying below each, with its bounds.

        Each common value stands there twice: as the end of the thresholds that have one run less
        below, and as the beginning of those that have it.
        """
        runs = len(self.model)
        share = self._share(np.sort(self.stand_in))
        # How many sorted runs lie below before one does so: for equal values, the first of them.
        model, stand_in = (
            np.searchsorted(np.sort(values), values, side="left")
            for values in (self.model, self.stand_in)
        )
        only_model, only_stand_in = (
            np.cumsum(
                np.bincount(one[one < other], minlength=runs)
                - np.bincount(other[one < other], minlength=runs)
            )
            for one, other in ((model, stand_in), (stand_in, model))
        )
        twice = [np.repeat(each, 2) for each in (self.model, share, only_model, only_stand_in)]
        thresholds, shares = twice[0][1:-1], twice[1][1:-1]
        return thresholds, self._corrected(shares, *(each[:-2] for each in twice[2:]))

    def _matched(self, threshold: float) -> float:
        """Return the value of the stand-in that corresponds to a threshold of the model."""
        sorted_stand_in = np.sort(self.stand_in)
        inside = np.clip(threshold, self.model[0], self.model[-1])
        spread = float(np.ptp(self.model))
        slope = float(np.ptp(self.stand_in)) / spread if spread > 0 else 0.0
        matched = np.interp(inside, self.model, sorted_stand_in) + slope * (threshold - inside)
        return float(matched)

    def _share(self, values: FloatArray | float) -> FloatArray:
        """Return the share of all points at which the stand-in is not above values."""
        count = np.searchsorted(self.stand_in_everywhere, values, side="right")
        return np.asarray(count / len(self.stand_in_everywhere))

    def _corrected(
        self, share: FloatArray, only_model: FloatArray, only_stand_in: FloatArray
    ) -> Estimate:
        """Return shares of the stand-in as probabilities of the model, with their bounds.

        Parameters
        ----------
        share : ndarray
            Of all points at which the stand-in lies below a value.
        only_model, only_stand_in : ndarray
            Numbers of common runs in which only one of them lies below its value.
        """
        runs, points = len(self.model), len(self.stand_in_everywhere)
        difference, half = bonett_price(only_model, only_stand_in, runs, self.level)
        noise = special.ndtri(0.5 + self.level / 2) * np.sqrt(share * (1 - share) / points)
        centre, half = share + difference, np.hypot(half, noise)
        value = np.clip(share + (only_model - only_stand_in) / runs, 0.0, 1.0)
        lower, upper = np.clip(centre - half, 0.0, 1.0), np.clip(centre + half, 0.0, 1.0)
        lower, upper = np.minimum(lower, value), np.maximum(upper, value)
        return Estimate(value, lower, upper, texts.MATCHED_THRESHOLD, "discrete")


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
        mean = plain["mean"]
        note = "; ".join(filter(None, [str(mean.coords[NOTE].values), reason]))
        return {"mean": mean.assign_coords({NOTE: ((), np.asarray(note, dtype=object))})}
    variates = ControlVariates(groups, tuple(able), quantity.confidence_level)
    return {
        statistic: _replaced(
            array, resolve(record.by["stand_ins"])(variates, array), variates.level
        )
        for statistic, record in CATALOGUE.items()
        if "stand_ins" in record.by and (array := plain.get(statistic)) is not None
    }


def _reason_against(runs: Mapping[str, xr.Dataset], groups: Sequence[GroupRuns]) -> str:
    """Return why stand-ins cannot be used; empty where they can."""
    for parts in _rounds(runs):
        lost = [part[STATUS].values == Status.INADMISSIBLE for part in parts if part is not None]
        # Points that one model admits and another does not have other inputs.
        if any((each != lost[0]).any() for each in lost[1:]):
            return texts.ADMITS_OTHER_POINTS
    if (common := groups[0].size) < _FEWEST_COMMON:
        return texts.FEW_COMMON_RUNS.format(runs=common)
    return ""


@dataclass(frozen=True, eq=False)
class ControlVariates:
    """Runs of an output by groups of models; the first model's statistics follow from all of them.

    The records of these in the catalogue refer to its methods, which take the plain estimate array.
    """

    groups: tuple[GroupRuns, ...]
    names: tuple[str, ...]
    level: float

    def mean(self, plain: xr.DataArray) -> Estimate:
        """Return the mean."""
        found = linear_estimate(self.groups)
        below, above = found.margins(self.level)
        ends = found.value - float(below), found.value + float(above)
        note = texts.DOUBTFUL_TAIL if self._own_runs < ENOUGH_RUNS_FOR_MEANS else ""
        method = texts.CONTROL_VARIATES.format(models=", ".join(self.names[1:]))
        return Estimate(found.value, *ends, method, "conservative", note)

    def std(self, plain: xr.DataArray) -> Estimate:
        """Return the standard deviation: the root of the mean of the squares about the mean."""
        mean = linear_estimate(self.groups)
        # The values of each model at the points of all groups.
        pooled = [
            np.concatenate([group.values[model] for group in self.groups if group.models[model]])
            for model in range(len(self.names))
        ]
        centres = np.array([mean.value, *(values.mean() for values in pooled[1:])])
        found = linear_estimate(
            [
                replace(each, values=(each.values - centres[:, None]) ** 2 * each.models[:, None])
                for each in self.groups
            ]
        )
        # About a mean that the same runs give, squares are too small by the variance of that mean.
        variance = found.value + mean.error**2
        if not variance > 0:
            return Estimate.without_bounds(math.nan, texts.NO_INTERVAL)
        value = math.sqrt(variance)
        if reason := self._tail(pooled):
            return Estimate.without_bounds(value, reason)
        factors = [math.exp(float(each) / (2 * variance)) for each in found.margins(self.level)]
        method = texts.CONTROL_VARIATES_OF_LOGARITHM.format(models=", ".join(self.names[1:]))
        note = texts.DOUBTFUL_TAIL if self._own_runs < ENOUGH_RUNS_FOR_MEANS else ""
        return Estimate(value, value / factors[0], value * factors[1], method, "conservative", note)

    def quantiles(self, plain: xr.DataArray) -> Estimate:
        """Return quantiles, at the probabilities of a plain estimate."""
        thresholds = MatchedThresholds.of(self.groups, self.level)
        found = [thresholds.quantile(float(each)) for each in quantile_probabilities(plain)]
        value, lower, upper = np.array(found).reshape(-1, 3).T
        return quantile_estimates(value, lower, upper, texts.MATCHED_THRESHOLD, self._own_runs)

    def exceedance(self, plain: xr.DataArray) -> Estimate:
        """Return probabilities of exceeding the thresholds of a plain estimate."""
        below = self._below(plain[f"{THRESHOLD}_value"], is_strict=False)
        return replace(below, value=1 - below.value, lower=1 - below.upper, upper=1 - below.lower)

    def below(self, plain: xr.DataArray) -> Estimate:
        """Return probabilities of lying below the thresholds of a plain estimate."""
        return self._below(plain[f"{LOWER_THRESHOLD}_value"], is_strict=True)

    def _below(self, values: xr.DataArray, *, is_strict: bool) -> Estimate:
        thresholds = MatchedThresholds.of(self.groups, self.level)
        return Estimate.stacked(
            thresholds.probability_below(each, is_strict=is_strict) for each in values.values
        )

    @property
    def _own_runs(self) -> int:
        """Number of runs of the first model."""
        return sum(group.size for group in self.groups if group.models[0])

    def _tail(self, pooled: Sequence[FloatArray]) -> str:
        """Return why the tail allows no interval of the standard deviation; empty if it does."""
        values = self.groups[0].values
        varying = np.flatnonzero(np.ptp(values, axis=1) > 0)
        squares = np.atleast_2d(np.corrcoef(values[varying]))[0] ** 2
        # The closest stand-in, or the model itself where none varies.
        closest = 1 + int(np.argmax(squares[1:])) if len(varying) > 1 else 0
        heaviest = max(kurtosis(pooled[0]), kurtosis(pooled[varying[closest]]))
        if heaviest > _HEAVY_KURTOSIS:
            return texts.NO_INTERVAL_AS.format(reason=texts.HEAVY_AMONG.format(kurtosis=heaviest))
        is_close = closest > 0 and squares[closest] >= _CLOSE
        is_seen = len(pooled[0]) >= _ENOUGH_FOR_TAILS or is_close
        return "" if is_seen else texts.HIDDEN_TAIL.format(runs=_ENOUGH_FOR_TAILS)


def _replaced(plain: xr.DataArray, found: Estimate, level: float) -> xr.DataArray:
    """Return an estimate array with other estimates, and the runs that they are worth."""
    before = plain.values[..., 2] - plain.values[..., 1]
    width = np.asarray(found.upper - found.lower)
    runs = int(plain.attrs["runs_used"])
    equivalent = np.round(equivalent_runs(width.reshape(before.shape), before, runs))
    if plain.ndim == 1 and np.isfinite(equivalent):
        worth = texts.AS_NARROW_AS.format(runs=int(float(f"{equivalent:.2g}")))
        found = replace(found, note="; ".join(filter(None, [worth, found.note])))
    return found.in_place_of(plain, level=level, **{EQUIVALENT_RUNS: equivalent})
