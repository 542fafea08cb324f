"""Standard error of a mean, by the error model of the sample's design."""

from __future__ import annotations

import math

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.intervals import additive_residual_error, ratio_error
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.weights import weighted_mean_error

__all__ = [
    "cdf_error",
    "probability_error",
    "rounding_error",
    "standard_error",
    "standard_errors",
]


def standard_error(sample: Sample, influence: FloatArray) -> tuple[float, float]:
    """Standard error of a mean over the sample, and its degrees of freedom.

    Parameters
    ----------
    sample : Sample
        The runs.
    influence : ndarray, shape (run,)
        Values whose mean is estimated, or each run's influence on an estimate.

    Returns
    -------
    error, freedom : float
        NaN and 0 where the design allows none.
    """
    error, freedom = standard_errors(sample, influence)
    return float(error), freedom


def standard_errors(sample: Sample, influence: FloatArray) -> tuple[FloatArray, float]:
    """Return what `standard_error` does, of several means over the same runs.

    Parameters
    ----------
    sample : Sample
    influence : ndarray, shape (..., run)
        As of one mean.

    Returns
    -------
    errors : ndarray, shape (...)
    freedom : float
    """
    if sample.reason_without_intervals:
        return np.full(influence.shape[:-1], np.nan), 0
    if sample.error_model is ErrorModel.REPLICATED:
        return ratio_error(influence, sample.replicate, sample.replicate_count)
    if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        # With failed runs, the mean is a ratio of sums over all points, and a failed run adds
        # nothing to them.
        deviation = np.zeros((*influence.shape[:-1], len(sample.replicates)))
        deviation[..., sample.used] = influence - influence.mean(axis=-1, keepdims=True)
        errors, freedom = additive_residual_error(deviation, sample.points)
        return errors * len(sample.replicates) / sample.size, freedom
    if (weights := sample.run_weights) is not None:
        errors = np.apply_along_axis(weighted_mean_error, -1, influence, weights)
        return errors, sample.degrees_of_freedom
    return influence.std(axis=-1, ddof=1) / math.sqrt(sample.size), sample.degrees_of_freedom


def rounding_error(sample: Sample) -> float:
    """Largest standard error that a share can have because counts are whole numbers.

    In a stratified replicate, a count is one of two neighbouring whole numbers, so its standard
    deviation is half a run at most. Where all replicates agree, their scatter does not show it.
    """
    if sample.error_model in (ErrorModel.INDEPENDENT, ErrorModel.WEIGHTED):
        return 0.5 / sample.effective_size
    return 0.5 * math.sqrt(sample.replicate_count) / sample.size


def probability_error(sample: Sample, events: BoolArray) -> tuple[float, float, bool]:
    """Standard error of the share of the runs in which an event happened.

    Returns
    -------
    error, freedom : float
        With the degrees of freedom.
    is_rounded : bool
        True if it is the error of counting whole runs, which is larger than that of the scatter.
    """
    error, freedom = standard_error(sample, events.astype(np.float64))
    is_rounded = error <= rounding_error(sample)
    return max(error, rounding_error(sample)), freedom, is_rounded


def cdf_error(sample: Sample, value: float) -> tuple[float, float, bool]:
    """Like `probability_error`, for the distribution function at a value, which may be an atom.

    At an atom of the distribution the function jumps, and the error of a quantile may be to either
    side. The larger of the errors below and above the jump counts.
    """
    at_or_below = probability_error(sample, sample.values <= value)
    return max(at_or_below, probability_error(sample, sample.values < value))
