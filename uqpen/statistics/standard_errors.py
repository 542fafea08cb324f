"""Standard error of a mean, and the margins of its interval."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.intervals import (
    additive_residual_error,
    error_of_sums,
    group_sums,
    ratio_error,
    student_quantile,
)
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.tally import Tally
from uqpen.statistics.weights import weighted_mean_error

__all__ = [
    "Margins",
    "cdf_error",
    "extreme_margins",
    "mean_margins",
    "probability_error",
    "rounding_error",
    "skewness_margins",
    "skewness_margins_of_sums",
    "standard_error",
    "student_margins",
]

# Standard error of a mean, by the error model of the sample's design.


def standard_error(sample: Sample, influence: FloatArray | Tally) -> tuple[FloatArray, float]:
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
    if isinstance(influence, Tally):
        return _error_of_tally(sample, influence)
    if sample.error_model is ErrorModel.REPLICATED:
        return ratio_error(influence, sample.replicate, sample.replicate_count)
    if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        # With failed runs, the mean is a ratio of sums over all points, and a failed run adds
        # nothing to them.
        deviation = np.zeros((*influence.shape[:-1], len(sample.replicates)))
        deviation[..., sample.used] = influence - influence.mean(axis=-1, keepdims=True)
        error, freedom = additive_residual_error(deviation, sample.points)
        return error * len(sample.replicates) / sample.size, freedom
    if sample.run_weights is not None:
        return weighted_mean_error(influence, sample.run_weights), sample.degrees_of_freedom
    return influence.std(axis=-1, ddof=1) / math.sqrt(sample.size), sample.degrees_of_freedom


def _error_of_tally(sample: Sample, influence: Tally) -> tuple[FloatArray, float]:
    """Return the same from sums; over one stratified set, as large as over independent draws."""
    freedom = sample.degrees_of_freedom
    if sample.error_model is ErrorModel.REPLICATED:
        sums = influence.deviations[influence.sizes > 0]
        return error_of_sums(sums, influence.size), freedom
    return influence.std(ddof=1) / math.sqrt(influence.size), freedom


def rounding_error(sample: Sample) -> float:
    """Largest standard error that a share can have because counts are whole numbers.

    In a stratified replicate, a count is one of two neighbouring whole numbers, so its standard
    deviation is half a run at most. Where all replicates agree, their scatter does not show it.
    """
    if sample.error_model in (ErrorModel.INDEPENDENT, ErrorModel.WEIGHTED):
        return 0.5 / sample.effective_size
    return 0.5 * math.sqrt(sample.replicate_count) / sample.size


def probability_error(sample: Sample, events: BoolArray) -> tuple[FloatArray, float, BoolArray]:
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
    at = np.asarray(value)[..., np.newaxis]
    error, freedom, is_rounded = probability_error(sample, sample.values <= at)
    below, _, is_rounded_below = probability_error(sample, sample.values < at)
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


def extreme_margins(influence: FloatArray | Tally, weights: FloatArray | None = None) -> Margins:
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


def skewness_margins(
    influence: FloatArray, replicate: IntArray, replicates: int, level: float
) -> tuple[Margins, Margins]:
    """Return how far the end moves out towards which the means of replicates are skewed.

    Parameters
    ----------
    influence : ndarray, shape (..., run)
        Values whose mean is estimated, at any places.
    replicate : ndarray of int, shape (run,)
        The replicate of each run, from 0.
    replicates : int
        Number of replicates.
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
    sums = group_sums(influence - influence.mean(axis=-1, keepdims=True), replicate, replicates)
    return skewness_margins_of_sums(sums, len(replicate), level)


def skewness_margins_of_sums(sums: FloatArray, runs: int, level: float) -> tuple[Margins, Margins]:
    """Return `skewness_margins` from each replicate's sum of deviations from the mean."""
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


def mean_margins(
    sample: Sample, deviations: FloatArray | Tally, *, is_heavy: npt.ArrayLike
) -> Margins:
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
    skew, extreme_replicate = _replicate_margins(sample, deviations)
    furthest = extremes.at_least(extreme_replicate)
    return _symmetric_margins(sample, deviations).plus(skew).plus(furthest)


def student_margins(sample: Sample, influence: FloatArray | Tally) -> Margins:
    """Return the same for any influence: Student's t, moved out for skewed replicates.

    Parameters
    ----------
    sample : Sample
        The runs; their design allows an error.
    influence : ndarray, shape (..., run), or Tally
        Each run's influence on an estimate, at any places.
    """
    skew, extreme_replicate = _replicate_margins(sample, influence)
    return _symmetric_margins(sample, influence).plus(skew).plus(extreme_replicate)


def _symmetric_margins(sample: Sample, influence: FloatArray | Tally) -> Margins:
    error, freedom = standard_error(sample, influence)
    half = student_quantile(freedom, sample.level) * error
    return Margins(half, half)


def _replicate_margins(sample: Sample, influence: FloatArray | Tally) -> tuple[Margins, Margins]:
    """Return the margins for the skewness of replicates; 0 without replicates."""
    if sample.error_model is not ErrorModel.REPLICATED:
        none = Margins.zero(influence.shape[:-1])
        return none, none
    if isinstance(influence, Tally):
        sums = influence.deviations[influence.sizes > 0]
        return skewness_margins_of_sums(sums, influence.size, sample.level)
    return skewness_margins(influence, sample.replicate, sample.replicate_count, sample.level)
