"""Standard error of a mean, and the margins of its interval."""

from __future__ import annotations

import math
import operator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.intervals import (
    additive_residual_error,
    error_of_sums,
    group_sums,
    mean_half_width,
    student_quantile,
)
from uqpen.statistics.sample import Column, ErrorModel, Sample, Tally
from uqpen.statistics.weights import weighted_mean_error

# Standard error of a mean, by the error model of the sample's design.


def standard_error(sample: Sample, influence: Column) -> tuple[FloatArray, float]:
    """Standard error of a mean over the sample, and its degrees of freedom.

    Parameters
    ----------
    sample : Sample
        The runs.
    influence : ndarray, shape (..., run), or Tally
        Values whose mean is estimated, or each run's influence on an estimate, at any places.

    Returns
    -------
    error : ndarray, shape (...)
        NaN where the design allows none.
    freedom : float
        Its degrees of freedom; 0 where there is none.
    """
    if sample.reason_without_intervals:
        return np.full(influence.shape[:-1], np.nan), 0
    if sample.error_model is ErrorModel.REPLICATED:
        sums = _sums_of_replicates(sample, influence)
        return error_of_sums(sums, influence.shape[-1]), sample.degrees_of_freedom
    if not isinstance(influence, Tally):
        if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET:
            # With failed runs, the mean is a ratio of sums over all points, and a failed run adds
            # nothing to them.
            deviation = np.zeros((*influence.shape[:-1], len(sample.replicates)))
            deviation[..., sample.used] = influence - influence.mean(axis=-1, keepdims=True)
            error, freedom = additive_residual_error(deviation, sample.points)
            return error * len(sample.replicates) / sample.size, freedom
        if sample.run_weights is not None:
            return weighted_mean_error(influence, sample.run_weights), sample.degrees_of_freedom
    # Sums know no residuals: over one stratified set, as large as over independent draws.
    error = influence.std(axis=-1, ddof=1) / math.sqrt(influence.shape[-1])
    return error, sample.degrees_of_freedom


def _sums_of_replicates(sample: Sample, influence: Column) -> FloatArray:
    """Return each replicate's sum of deviations from the mean, shape (..., replicate).

    Failed runs leave replicates of unequal size, so the mean is a ratio of sums. Its error follows
    from the scatter of these sums.
    """
    if isinstance(influence, Tally):
        return influence.deviations[influence.sizes > 0]
    deviations = influence - influence.mean(axis=-1, keepdims=True)
    return group_sums(deviations, sample.replicate, sample.replicate_count)


def rounding_error(sample: Sample) -> float:
    """Largest standard error that a share can have because counts are whole numbers.

    In a stratified replicate, a count is one of two neighbouring whole numbers, so its standard
    deviation is half a run at most. Where all replicates agree, their scatter does not show it.
    """
    if sample.error_model in (ErrorModel.INDEPENDENT, ErrorModel.WEIGHTED):
        return 0.5 / sample.effective_size
    return 0.5 * math.sqrt(sample.replicate_count) / sample.size


def probability_error(sample: Sample, events: Column) -> tuple[FloatArray, float, BoolArray]:
    """Standard error of the share of the runs in which an event happened.

    Parameters
    ----------
    sample : Sample
        The runs.
    events : ndarray of bool, shape (..., run)
        Whether it happened, at any places.

    Returns
    -------
    error : ndarray, shape (...)
    freedom : float
        Its degrees of freedom.
    is_rounded : ndarray of bool, shape (...)
        True if it is the error of counting whole runs, which is larger than that of the scatter.
    """
    error, freedom = standard_error(sample, events.astype(np.float64))
    is_rounded = error <= rounding_error(sample)
    return np.maximum(error, rounding_error(sample)), freedom, is_rounded


def cdf_error(sample: Sample, value: npt.ArrayLike) -> tuple[FloatArray, float, BoolArray]:
    """Like `probability_error`, for the distribution function at a value, which may be an atom.

    At an atom of the distribution the function jumps, and the error of a quantile may be to either
    side. The larger of the errors below and above the jump counts. At places, each has its value.
    """
    error, freedom, is_rounded = probability_error(sample, sample.event(operator.le, value))
    below, _, is_rounded_below = probability_error(sample, sample.event(operator.lt, value))
    is_rounded = np.where(
        error > below, is_rounded, is_rounded_below | (error == below) & is_rounded
    )
    return np.maximum(error, below), freedom, is_rounded


# Allowances for skewness and long tails: how far the ends of a mean's interval move out.
#
# Student's t is for a mean whose error is normal. Where few replicates are skewed, or few runs
# decide the mean, it misses the true value on the side of the longer tail.


class Margins(NamedTuple):
    """Distances of the lower and the upper end of an interval from the estimate, at any places."""

    below: FloatArray
    above: FloatArray

    @classmethod
    def zero(cls, shape: tuple[int, ...]) -> Margins:
        """Return distances of 0 at places of a shape."""
        return cls(np.zeros(shape), np.zeros(shape))

    def plus(self, other: Margins) -> Margins:
        """Return the sum of two distances, at each end."""
        return Margins(self.below + other.below, self.above + other.above)

    def at_least(self, other: Margins) -> Margins:
        """Return the larger of two distances, at each end."""
        return Margins(np.maximum(self.below, other.below), np.maximum(self.above, other.above))

    def zero_except(self, condition: BoolArray) -> Margins:
        """Return the distances at some places, and 0 at the others."""
        return Margins(*(np.where(condition, margin, 0.0) for margin in self))


def extreme_margins(influence: Column, weights: FloatArray | None = None) -> Margins:
    """Return how far the smallest and the largest run move a mean.

    A run further out than all others may well come as often as the largest one has. The mean would
    move by as much as that one has moved it.

    Parameters
    ----------
    influence : ndarray, shape (..., run), or Tally
        Values whose mean is estimated, at any places.
    weights : ndarray, shape (run,), optional
        Relative weights.
    """
    if isinstance(influence, Tally):
        ends = np.array([-influence.smallest, influence.largest]) + [1, -1] * influence.mean()
        return Margins(*map(np.asarray, np.maximum(ends / influence.size, 0.0)))
    runs = influence.shape[-1]
    shares = np.full(runs, 1 / runs) if weights is None else weights
    shares = shares / shares.sum()
    parts = shares * (influence - (shares * influence).sum(axis=-1, keepdims=True))
    return Margins(np.maximum(-parts.min(axis=-1), 0.0), np.maximum(parts.max(axis=-1), 0.0))


def skewness_margins(sums: FloatArray, runs: int, level: float) -> tuple[Margins, Margins]:
    """Return how far the end moves out towards which the means of replicates are skewed.

    Parameters
    ----------
    sums : ndarray, shape (..., replicate)
        Each replicate's sum of deviations from the mean, at any places.
    runs : int
        Number of runs of all replicates.
    level : float
        Two-sided.

    Returns
    -------
    skew, extreme : Margins
        By the skewness of the replicates, the first term of an Edgeworth expansion; by the furthest
        of them. Both are 0 at the end of the shorter tail, and for fewer than three replicates.

    References
    ----------
    Hall, P. (1992). J. R. Statist. Soc. B 54, 221-228.
    """
    replicates = sums.shape[-1]
    means = replicates / runs * sums
    deviations = means - means.mean(axis=-1, keepdims=True)
    squares = (deviations**2).sum(axis=-1)
    if replicates < 3:
        return Margins.zero(squares.shape), Margins.zero(squares.shape)
    varies = squares > 0
    std = np.sqrt(np.where(varies, squares, 1.0) / (replicates - 1))
    skewness = ((deviations / std[..., np.newaxis]) ** 3).sum(axis=-1) * replicates
    skewness = skewness / ((replicates - 1) * (replicates - 2))
    t = student_quantile(replicates - 1, level)
    skew = std * np.abs(skewness) * (1 + 2 * t**2) / (6 * replicates)
    furthest = -deviations.min(axis=-1) / replicates, deviations.max(axis=-1) / replicates
    below, above = varies & (skewness < 0), varies & ~(skewness < 0)
    skew_margins = Margins(np.where(below, skew, 0.0), np.where(above, skew, 0.0))
    return skew_margins, Margins(
        np.where(below, furthest[0], 0.0), np.where(above, furthest[1], 0.0)
    )


# Margins of a mean's interval, by the error model of the sample's design.


def mean_margins(sample: Sample, deviations: Column, *, is_heavy: npt.ArrayLike) -> Margins:
    """Return the distances of both ends of a mean's interval from the mean.

    Both ends move out by what the smallest and the largest run have moved the mean. Strata need
    that only for a heavy tail: they spread the other runs evenly. It is no sum with the furthest
    replicate, which owes its place to such a run.

    Parameters
    ----------
    sample : Sample
        The runs; their design allows an error.
    deviations : ndarray, shape (..., run), or Tally
        Deviations of the values from their mean, at any places.
    is_heavy : array_like of bool, shape (...)
        True if few runs decide the variance.
    """
    is_stratified = sample.error_model in (
        ErrorModel.REPLICATED,
        ErrorModel.SINGLE_STRATIFIED_SET,
    )
    needs_extremes = np.asarray(is_heavy) | (not is_stratified)
    extremes = Margins.zero(deviations.shape[:-1])
    if needs_extremes.any():
        extremes = extreme_margins(deviations, sample.run_weights).zero_except(needs_extremes)
    return student_margins(sample, deviations, extremes)


def student_margins(sample: Sample, influence: Column, extremes: Margins | None = None) -> Margins:
    """Return the same for any influence: Student's t, moved out for skewed replicates.

    The furthest replicate, or what is given, moves an end out if it is further.
    """
    error, freedom = standard_error(sample, influence)
    half = mean_half_width(error, freedom, sample.level)
    found, none = Margins(half, half), Margins.zero(influence.shape[:-1])
    skew = furthest = none
    if sample.error_model is ErrorModel.REPLICATED:
        sums = _sums_of_replicates(sample, influence)
        skew, furthest = skewness_margins(sums, influence.shape[-1], sample.level)
    return found.plus(skew).plus((extremes or none).at_least(furthest))
