"""Margins of a mean's interval, by the error model of the sample's design."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.skewness import (
    Margins,
    extreme_margins,
    skewness_margins,
    skewness_margins_of_sums,
)
from uqpen.statistics.standard_errors import standard_error
from uqpen.statistics.tally import Tally

__all__ = ["mean_margins", "student_margins"]


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
