"""Standard error of a mean, by the error model of the sample's design."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.intervals import additive_residual_error, error_of_sums, ratio_error
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.tally import Tally
from uqpen.statistics.weights import weighted_mean_error

__all__ = ["cdf_error", "probability_error", "rounding_error", "standard_error"]


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
