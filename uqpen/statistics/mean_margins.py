"""Margins of a mean's interval, by the error model of the sample's design."""

from __future__ import annotations

from uqpen.core.arrays import FloatArray
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.skewness import Margins, extreme_margins, skewness_margins
from uqpen.statistics.standard_errors import standard_error

__all__ = ["mean_margins", "student_margins"]

_NONE = Margins(0.0, 0.0)


def mean_margins(sample: Sample, deviations: FloatArray, *, is_heavy: bool) -> Margins:
    """Return the distances of both ends of a mean's interval from the mean.

    Both ends move out by what the smallest and the largest run have moved the mean. Strata need
    that only for a heavy tail: they spread the other runs evenly. It is no sum with the furthest
    replicate, which owes its place to such a run.

    Parameters
    ----------
    sample : Sample
        The runs; their design allows an error.
    deviations : ndarray, shape (run,)
        Deviations of the values from their mean.
    is_heavy : bool
        True if few runs decide the variance.
    """
    is_stratified = sample.error_model in (
        ErrorModel.REPLICATED,
        ErrorModel.SINGLE_STRATIFIED_SET,
    )
    needs_extremes = is_heavy or not is_stratified
    extremes = extreme_margins(deviations, sample.run_weights) if needs_extremes else _NONE
    skew, extreme_replicate = _replicate_margins(sample, deviations)
    furthest = extremes.at_least(extreme_replicate)
    return _symmetric_margins(sample, deviations).plus(skew).plus(furthest)


def student_margins(sample: Sample, influence: FloatArray) -> Margins:
    """Return the same for any influence: Student's t, moved out for skewed replicates.

    Parameters
    ----------
    sample : Sample
        The runs; their design allows an error.
    influence : ndarray, shape (run,)
        Each run's influence on an estimate.
    """
    skew, extreme_replicate = _replicate_margins(sample, influence)
    return _symmetric_margins(sample, influence).plus(skew).plus(extreme_replicate)


def _symmetric_margins(sample: Sample, influence: FloatArray) -> Margins:
    error, freedom = standard_error(sample, influence)
    half = student_quantile(freedom, sample.level) * error
    return Margins(half, half)


def _replicate_margins(sample: Sample, influence: FloatArray) -> tuple[Margins, Margins]:
    """Return the margins for the skewness of replicates; 0 without replicates."""
    if sample.error_model is not ErrorModel.REPLICATED:
        return _NONE, _NONE
    return skewness_margins(influence, sample.replicate, sample.replicate_count, sample.level)
