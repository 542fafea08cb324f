"""Tail of an output beyond the training range of its surrogate, and what hangs on it.

Beyond the range a surrogate extrapolates. Where an interval hangs on values there, a rehearsal
shows how often it would hold for the surrogate, not for the model.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqpen.benchmark.statistics import BenchmarkStatistic
from uqpen.core.arrays import FloatArray
from uqpen.rehearsal.rehearsed_study import RehearsedStudy, ok_values

__all__ = ["tail_record", "tail_shares"]

# By statistic, the power of the deviation from the mean in the influence of a run on it. The others
# are of the distribution function, on which all values beyond a limit have the same influence.
_POWERS = {"mean": 1, "std": 2, "first_order": 2, "total_order": 2}


def tail_record(
    rehearsed: RehearsedStudy,
    statistics: Sequence[BenchmarkStatistic],
    truth: FloatArray,
    sample: xr.Dataset,
) -> FloatArray:
    """Return the shares of all statistics, in draws of the surrogate and in the study's own runs.

    Parameters
    ----------
    rehearsed : RehearsedStudy
    statistics : sequence of BenchmarkStatistic
    truth : ndarray, shape (entry,)
        Their true values, one after the other.
    sample : Dataset
        Draws of the surrogate.

    Returns
    -------
    ndarray, shape (2, entry)
    """
    columns, start = [], 0
    for statistic in statistics:
        stop = start + len(statistic.entries)
        ends = rehearsed.fitted.training_range(statistic.output)
        values = ok_values(sample, statistic.output), rehearsed.own_values(statistic.output)
        columns.append([tail_shares(statistic, truth[start:stop], each, ends) for each in values])
        start = stop
    return np.concatenate(columns, axis=1)


def tail_shares(
    statistic: BenchmarkStatistic,
    truth: FloatArray,
    values: FloatArray,
    ends: tuple[float, float],
) -> FloatArray:
    """Return the share of a statistic's sampling variance that comes from beyond a range.

    Parameters
    ----------
    statistic : BenchmarkStatistic
    truth : ndarray, shape (entry,)
        Its true values.
    values : ndarray, shape (run,)
        A sample of its output.
    ends : tuple of float
        The smallest and the largest value of the training runs.

    Returns
    -------
    ndarray, shape (entry,)
        For a quantile or a probability 1 if its limit is beyond the range, else 0.
    """
    lowest, highest = ends
    if statistic.name not in _POWERS:
        limits = _limits(statistic, truth, values)
        return ((limits < lowest) | (limits > highest)).astype(np.float64)
    deviations = values - values.mean()
    influence = deviations ** _POWERS[statistic.name]
    squares = (influence - influence.mean()) ** 2
    whole = squares.sum()
    beyond = (values < lowest) | (values > highest)
    share = squares[beyond].sum() / whole if whole > 0 else 0.0
    return np.full(truth.shape, share)


def _limits(statistic: BenchmarkStatistic, truth: FloatArray, values: FloatArray) -> FloatArray:
    """Return the values of the output at which a statistic reads its distribution function."""
    if statistic.name == "quantile":
        return truth
    quantity = statistic.quantity
    if statistic.name == "exceedance":
        return np.array([threshold.value for threshold in quantity.thresholds])
    if statistic.name == "below":
        return np.array([threshold.value for threshold in quantity.lower_thresholds])
    return np.full(truth.shape, np.median(values))
