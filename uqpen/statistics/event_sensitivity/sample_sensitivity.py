"""Sensitivities of an event's probability from a sample, by the scores of an input."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import REPLICATE
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.distributions.distribution import Distribution
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.rare_events.subset_probability import Level, subset_levels
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.standard_errors import mean_margins
from uqpen.statistics.weights import effective_sizes, runs_on_a_side

# Scores of an input: what a run counts for where the input's mean or standard deviation moves.

# Moments are integrals over a standard normal variable. Beyond its ends lies a probability of
# 2e-16; the trapezoidal rule is exact to rounding for a smooth distribution.
_END, _NODES = 8.2, 4001
# With a smaller determinant, relative to its products, two functions are one but for rounding.
_SMALLEST_DETERMINANT = 1e-9


@dataclass(frozen=True, eq=False)
class InputScores:
    """Scores of the mean and of the standard deviation of one input.

    Each is a combination of the scores of the distribution's two parameters: along it the mean
    moves and the standard deviation stays, or the other way round. They are times the standard
    deviation, so they are plain numbers.

    References
    ----------
    Rubinstein, R. Y. (1986). Math. Comput. Simul. 28, 381-392.
    """

    distribution: Distribution  # of the input
    mean: float  # of the input, in its SI unit
    std: float  # of the same
    centre: FloatArray  # (2,): means of the functions that span the scores
    # (2, 2): of these functions in the score of the mean, and in that of the standard deviation.
    weights: FloatArray

    @classmethod
    def of(cls, distribution: Distribution) -> InputScores | None:
        """Return the scores of an input.

        Returns
        -------
        InputScores or None
            None where the mean cannot move without the standard deviation, as of two values, or
            where one of them is infinite.
        """
        if distribution.highest_moment <= 2:
            return None
        values, shares = _nodes(distribution)
        with np.errstate(all="ignore"):
            mean = float((shares * values).sum())
            deviation = values - mean
            std = float(np.sqrt((shares * deviation**2).sum()))
            standard = deviation / std
            moved = np.array([standard, (standard**2 - 1) / 2])
            spanning = np.array(distribution.scores(values))
            centre = (shares * spanning).sum(axis=1)
            centred = spanning - centre[:, np.newaxis]
            # How far each function moves the mean and the standard deviation.
            (a, b), (c, d) = (moved[:, np.newaxis] * centred * shares).sum(axis=-1)
            determinant = a * d - b * c
            is_small = not abs(determinant) > _SMALLEST_DETERMINANT * max(abs(a * d), abs(b * c))
            weights = np.array([[d, -c], [-b, a]]) / determinant
        if is_small or not np.isfinite(weights).all() or not np.isfinite([mean, std]).all():
            return None
        return cls(distribution, mean, std, centre, weights)

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the scores of the mean and of the standard deviation, shape (2, run)."""
        first, second = (
            function - mean
            for function, mean in zip(self.distribution.scores(values), self.centre, strict=True)
        )
        return np.array([one * first + other * second for one, other in self.weights.tolist()])


def _nodes(distribution: Distribution) -> tuple[FloatArray, FloatArray]:
    """Return values of a distribution with their shares of the probability, for integrals."""
    atoms = distribution.atoms()
    if atoms is not None:
        return atoms
    z = np.linspace(-_END, _END, _NODES)
    lower, upper = special.ndtr(z), special.ndtr(-z)
    values = np.where(z < 0, distribution.ppf(lower), distribution.isf(upper))
    shares = np.exp(-(z**2) / 2)
    return values, shares / shares.sum()


# Sensitivities of an event's probability to one input, as estimates.


class PairOfEstimates(NamedTuple):
    """Estimates for the mean of an input and for its standard deviation."""

    mean: Estimate
    std: Estimate


@dataclass(frozen=True)
class SensitivityEstimates:
    """Sensitivities of an event's probability to the mean and the deviation of an input."""

    # Derivatives of the probability times the standard deviation of the input.
    changes: PairOfEstimates
    relative_changes: PairOfEstimates  # the same of the logarithm of the probability
    effective_runs: float  # effective number of the runs with the event, by their scores

    @classmethod
    def without_values(cls, reason: str) -> SensitivityEstimates:
        """Return no estimates, for a reason."""
        none = Estimate.without_bounds(float("nan"), reason)
        return cls(PairOfEstimates(none, none), PairOfEstimates(none, none), float("nan"))

    def elasticities(self, scores: InputScores | None, reason: str) -> PairOfEstimates:
        """Return the relative changes of the probability per relative change of each moment.

        Parameters
        ----------
        scores : InputScores or None
            Of the input.
        reason : str
            Why there is no elasticity to a mean of 0.
        """
        mean, std = self.relative_changes
        if scores is None:
            return self.relative_changes
        if abs(scores.mean) < 1e-12 * scores.std:
            return PairOfEstimates(Estimate.without_bounds(float("nan"), reason), std)
        return PairOfEstimates(_scaled(mean, scores.mean / scores.std), std)


def _scaled(estimate: Estimate, factor: float) -> Estimate:
    """Return an estimate times a number."""
    lower, upper = estimate.lower * factor, estimate.upper * factor
    if factor < 0:
        lower, upper = upper, lower
    return replace(estimate, value=estimate.value * factor, lower=lower, upper=upper)


# With fewer runs on a side, the error may be larger than it shows.
_FEWEST = 10
# So it is with fewer effective runs with the event, by their scores.
_FEWEST_EFFECTIVE = 5


def sample_sensitivities(
    sample: Sample, occurs: BoolArray, name: str, scores: InputScores
) -> SensitivityEstimates:
    """Estimate how the probability of an event moves with the distribution of an input.

    Where the distribution moves, each run has a weight, whose derivative is its score. So the
    derivative of the probability is the mean of the scores over the runs with the event.

    Parameters
    ----------
    sample : Sample
        The runs in which the event is known.
    occurs : ndarray of bool, shape (run,)
        Whether it occurs.
    name : str
        The input.
    scores : InputScores
        Its scores.
    """
    points = scores(sample.columns[sample.inputs.index(name)])
    own = points[:, sample.used]
    # About their mean over admissible runs, so the probability is that of admissible inputs.
    own = own - sample.mean(own)[:, np.newaxis]
    events = occurs.astype(np.float64)
    probability = float(sample.mean(events)) if sample.size else math.nan
    changes = sample.mean(events * own) if sample.size else np.full(2, math.nan)
    relative = changes / probability if probability > 0 else np.full(2, math.nan)
    decisive = occurs * np.abs(own) * (1.0 if sample.run_weights is None else sample.run_weights)
    sizes = effective_sizes(decisive) if occurs.any() else np.zeros(2)
    reason = _reason_without_bounds(sample, occurs, float(sizes.min()))
    if reason:
        return SensitivityEstimates(
            PairOfEstimates(*(Estimate.without_bounds(each, reason) for each in changes.tolist())),
            PairOfEstimates(*(Estimate.without_bounds(each, reason) for each in relative.tolist())),
            float(sizes.min()),
        )
    residual = events - probability
    influence = residual * own
    relative_influence = (influence - relative[:, np.newaxis] * residual) / probability
    missing = points[:, sample.missing] - sample.mean(points[:, sample.used])[:, np.newaxis]
    return SensitivityEstimates(
        _pair(sample, changes, influence, _reached(sample, own, occurs, missing)),
        _pair(
            sample,
            relative,
            relative_influence * _factor_of_few(sample, int(occurs.sum())),
            _mean_reached(sample, own, occurs, missing),
        ),
        float(sizes.min()),
    )


def _reason_without_bounds(sample: Sample, occurs: BoolArray, size: float) -> str:
    """Return the reason why the scatter of the runs shows no error; empty where it does."""
    if sample.reason_without_intervals:
        return sample.reason_without_intervals
    if sample.run_weights is not None:
        is_few = bool(runs_on_a_side(sample.run_weights, occurs) < _FEWEST)
    else:
        is_few = not bool(has_enough_runs_around(sample, occurs.sum()))
    if is_few:
        return texts.TOO_ONE_SIDED if sample.weights is None else texts.FEW_WEIGHTED_BEYOND
    return texts.FEW_SCORES_DECIDE.format(runs=size) if size < _FEWEST_EFFECTIVE else ""


def _factor_of_few(sample: Sample, events: int) -> float:
    """Return the factor of an error from few runs: the mean score is one over the event's alone."""
    freedom = sample.degrees_of_freedom
    few = student_quantile(min(events - 1, freedom), sample.level)
    return few / student_quantile(freedom, sample.level)


def _pair(
    sample: Sample, values: FloatArray, influence: FloatArray, reached: tuple[FloatArray, ...]
) -> PairOfEstimates:
    """Return estimates whose ends are those of what the missing runs leave possible."""
    margins = mean_margins(sample, influence, is_heavy=np.array([True, True]))
    lowest, highest = reached
    ends = lowest - margins.below, highest + margins.above
    method, label, note = texts.SCORES, "nominal", ""
    if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        label = "conservative"
    if sample.missing.size:
        method, label = texts.FOR_ANY_OUTCOME.format(method=method), "conservative"
        note = texts.MISSING_RUNS.format(runs=sample.missing.size)
    return PairOfEstimates(
        *(
            Estimate(value, low, high, method, label, note)
            for value, low, high in zip(*(each.tolist() for each in (values, *ends)), strict=True)
        )
    )


def _reached(
    sample: Sample, own: FloatArray, occurs: BoolArray, missing: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest mean score of the event, for any outcome of the missing.

    Those with a negative score make it smaller where they have the event, the others larger.
    """
    weights, of_missing = _weights(sample)
    total = weights.sum() + of_missing.sum()
    known = (weights * occurs * own).sum(axis=1)
    parts = of_missing * missing
    lowest = known + np.minimum(parts, 0).sum(axis=1)
    return lowest / total, (known + np.maximum(parts, 0).sum(axis=1)) / total


def _mean_reached(
    sample: Sample, own: FloatArray, occurs: BoolArray, missing: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the same of the mean score among the runs with the event."""
    weights, of_missing = _weights(sample)
    chosen = weights * occurs
    known, total = (chosen * own).sum(axis=1), chosen.sum()
    ends = []
    for sign in (1, -1):
        order = np.argsort(sign * missing, axis=1, kind="stable")
        parts = np.take_along_axis(of_missing * missing, order, axis=1)
        sums = known[:, np.newaxis] + np.cumsum(parts, axis=1)
        means = sums / (total + np.cumsum(of_missing[order], axis=1))
        whole = np.concatenate([(known / total)[:, np.newaxis], means], axis=1)
        ends.append(sign * (sign * whole).min(axis=1))
    return ends[0], ends[1]


def _weights(sample: Sample) -> tuple[FloatArray, FloatArray]:
    """Return the weights of the runs and of the missing runs."""
    if sample.weights is None:
        return np.ones(sample.size), np.ones(sample.missing.size)
    largest = sample.weights[sample.used].max()
    return sample.weights[sample.used] / largest, sample.weights[sample.missing] / largest


# Sensitivities of the probability of a rare event, from the last level of subset simulation.


_FEWEST_REPLICATES = 3


@dataclass(frozen=True, eq=False)
class SubsetScores:
    """First and last levels of all replicates of a design, in which inputs have scores.

    The scores are those of the runs, so states that stand at the same run count it again. The
    scatter of the replicates holds that dependence.
    """

    runs: xr.Dataset  # all runs of the design
    # The independent draws and the last level of each replicate.
    levels: tuple[tuple[Level, Level], ...]
    level: float  # confidence level of the intervals
    reason: str = ""  # why there are no estimates; empty where there are

    @classmethod
    def of(cls, runs: xr.Dataset, event: LimitState, level: float) -> SubsetScores:
        """Follow the chains of all replicates."""
        outcomes, replicate = event.outcomes(runs), runs[REPLICATE].values
        found = []
        for number in np.unique(replicate):
            members = np.flatnonzero(replicate == number)
            if not (levels := subset_levels(runs, outcomes, event, members)):
                return cls(runs, (), level, texts.NO_ADMISSIBLE_REPLICATE)
            found.append((levels[0], levels[-1]))
        reason = "" if all(last.states.occurs.any() for _, last in found) else texts.NOT_MET_BY_ALL
        return cls(runs, tuple(found), level, reason)

    def sensitivities(self, name: str, scores: InputScores) -> SensitivityEstimates:
        """Estimate the sensitivities to the distribution of an input.

        Parameters
        ----------
        name : str
            The input.
        scores : InputScores
            Its scores.
        """
        if self.reason:
            return SensitivityEstimates.without_values(self.reason)
        of_runs = scores(self.runs[name].values)
        rows = [_Replicate.of(of_runs, *each) for each in self.levels]
        return SensitivityEstimates(
            self._mean(rows, is_relative=False),
            self._mean(rows, is_relative=True),
            float(min(each.effective_runs for each in rows) * len(rows)),
        )

    def _mean(self, rows: list[_Replicate], *, is_relative: bool) -> PairOfEstimates:
        """Return the mean over the replicates, or its ratio to that of the probability."""
        value, _ = _mean_and_half_width([r.completed for r in rows], self.level, is_relative)
        if len(rows) < _FEWEST_REPLICATES:
            reason = texts.FEW_REPLICATES_OF_SCORES.format(replicates=_FEWEST_REPLICATES)
            none = [Estimate.without_bounds(each, reason) for each in value.tolist()]
            return PairOfEstimates(*none)
        low, below = _mean_and_half_width([r.lowest for r in rows], self.level, is_relative)
        high, above = _mean_and_half_width([r.highest for r in rows], self.level, is_relative)
        method = texts.SCORES_OVER_REPLICATES
        if any(last.states.missing.any() for _, last in self.levels):
            method = texts.FOR_ANY_OUTCOME.format(method=method)
        ends = zip(value.tolist(), (low - below).tolist(), (high + above).tolist(), strict=True)
        return PairOfEstimates(*(Estimate(*each, method, "nominal") for each in ends))


@dataclass(frozen=True)
class _Replicate:
    """Derivatives of the probability and the probability itself, shape (3,), in one replicate.

    Of completed runs, and with the smallest and the largest derivatives that the outcomes of the
    failed runs leave possible.
    """

    completed: FloatArray
    lowest: FloatArray
    highest: FloatArray
    effective_runs: float

    @classmethod
    def of(cls, of_runs: FloatArray, first: Level, last: Level) -> _Replicate:
        centre = of_runs[:, first.states.runs].mean(axis=1, keepdims=True)
        states = last.states
        own = of_runs[:, states.runs] - centre
        share = last.probability / len(states.runs)
        known = (own * states.occurs).sum(axis=1)
        parts = own[:, states.missing]
        size = states.missing.sum()
        probability = share * states.occurs.sum()
        lowest = share * (known + np.minimum(parts, 0.0).sum(axis=1))
        highest = share * (known + np.maximum(parts, 0.0).sum(axis=1))
        missing = last.probability * size / len(states.runs)
        completed = np.append(share * known, probability) / (1 - missing)
        ends = np.append(lowest, probability), np.append(highest, probability)
        sizes = effective_sizes(np.abs(_once(own, states.runs, states.occurs)))
        return cls(completed, ends[0], ends[1], float(sizes.min()))


def _once(own: FloatArray, runs: IntArray, occurs: BoolArray) -> FloatArray:
    """Return the sum of the scores of the event at each distinct run."""
    distinct, place = np.unique(runs, return_inverse=True)
    return np.array([np.bincount(place, each * occurs, len(distinct)) for each in own])


def _mean_and_half_width(
    replicates: list[FloatArray], level: float, is_relative: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the mean of a derivative, or its ratio to the probability, and its half-width."""
    derivative, probability = np.split(np.array(replicates), [2], axis=1)
    number = len(replicates)
    if is_relative:
        mean = derivative.mean(axis=0) / probability.mean(axis=0)
        scatter = (derivative - mean * probability) / probability.mean(axis=0)
    else:
        mean = derivative.mean(axis=0)
        scatter = derivative - mean
    if number < 2:
        return mean, np.full(2, math.nan)
    error = np.sqrt((scatter**2).sum(axis=0) / (number - 1) / number)
    return mean, student_quantile(number - 1, level) * error
