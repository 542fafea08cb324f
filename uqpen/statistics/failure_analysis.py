"""Association of failure with an input: inputs of failed runs compared with completed runs."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import INPUT
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.input_columns import Ordering
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.sensitivity.input_measures import input_array, input_coordinate

# Least number of failed and of completed runs to estimate the spread of both.
_FEWEST_RUNS = 10


def failure_analysis(sample: Sample) -> NamedArrays:
    """Association of each input with the failure of runs.

    Inadmissible points do not count as failed here: they lie outside the joint distribution, and
    the model was not run there.

    Yields
    ------
    name : str
        ``larger``: probability that an input is larger in a failed run than in a completed one
        (probability of superiority, AUC); 0.5 where the input has no influence. ``further_out``:
        the same probability for the distance of the input from the median of all runs. ``lowest``
        and ``highest``: smallest and largest value of the input in the failed runs, in SI units.
    array : DataArray
        Along ``input``; ``larger`` and ``further_out`` also along ``bound``. No statistic is
        yielded where no run failed.

    References
    ----------
    DeLong, DeLong and Clarke-Pearson (1988), "Comparing the areas under two or more correlated
    receiver operating characteristic curves", Biometrics 44, 837-845.
    """
    if not sample.missing.size or not sample.inputs:
        return
    at = np.concatenate([sample.used, sample.missing])
    is_failed = np.arange(len(at)) >= len(sample.used)
    columns = [sample.columns[number][at] for number in range(len(sample.inputs))]
    ranks = [_ranks(column) for column in columns]
    distances = [np.abs(each - each.mean()) for each in ranks]
    for name, what, measured in (
        ("larger", "is larger", columns),
        ("further_out", "lies further from its median", distances),
    ):
        estimates = [
            Estimate.without_bounds(math.nan, texts.CODES_WITHOUT_ORDER)
            if sample.columns.is_coded(number)
            else _superiority_probability(sample, values, is_failed)
            for number, values in enumerate(measured)
        ]
        long_name = texts.LARGER_IF_FAILED.format(is_larger=what)
        yield name, input_array(estimates, sample.inputs, long_name, level=sample.level)
    for name, end in (("lowest", np.min), ("highest", np.max)):
        values = np.array([end(column[is_failed]) for column in columns])
        described = {"long_name": texts.END_OF_FAILED.format(end=name)}
        yield name, xr.DataArray(values, input_coordinate(sample.inputs), (INPUT,), attrs=described)


def _superiority_probability(sample: Sample, values: FloatArray, is_failed: BoolArray) -> Estimate:
    """Probability that a failed run has the larger value; ties count half."""
    failed, others = int(is_failed.sum()), int((~is_failed).sum())
    if not others or not np.ptp(values) > 0:
        reason = texts.CONSTANT_INPUT if others else texts.NO_RUN
        return Estimate.without_bounds(math.nan, reason)
    ranks = _ranks(values)
    within = np.empty(len(values))
    for kind in (is_failed, ~is_failed):
        within[kind] = _ranks(values[kind])
    # The share of the other group below each run: completed runs for a failed one, and vice versa.
    below = np.where(is_failed, (ranks - within) / others, (ranks - within) / failed)
    value = float(below[is_failed].mean())
    if reason := sample.reason_without_intervals or _reason_without_bounds(failed, others, value):
        return Estimate.without_bounds(value, reason)
    variances = [float(below[kind].var(ddof=1)) / kind.sum() for kind in (is_failed, ~is_failed)]
    slope = value * (1 - value)
    half = (
        student_quantile(min(failed, others) - 1, sample.level) * math.sqrt(sum(variances)) / slope
    )
    centre = math.log(value / (1 - value))
    ends = (1 / (1 + math.exp(half - centre)), 1 / (1 + math.exp(-half - centre)))
    # The formula is for independent draws; points spread evenly scatter less.
    label = "nominal" if sample.error_model is ErrorModel.INDEPENDENT else "conservative"
    return Estimate(value, *ends, texts.DELONG, label)


def _reason_without_bounds(failed: int, others: int, value: float) -> str:
    if min(failed, others) < _FEWEST_RUNS:
        reason = texts.FEW_FAILED if failed <= others else texts.FEW_COMPLETED
        return reason.format(runs=_FEWEST_RUNS)
    if not 0 < value < 1:
        return texts.SEPARATED
    return ""


def _ranks(values: FloatArray) -> FloatArray:
    return Ordering.of(values).mean_ranks
