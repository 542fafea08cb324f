"""Where among the inputs the runs lie that were lost, against those that came back."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.estimate import LEVEL, Estimate
from uqpen.analyses.given_inputs import input_coordinate, mean_ranks
from uqpen.analyses.sample import Plan, Sample
from uqpen.intervals import student_quantile
from uqpen.labels import INPUT

__all__ = ["LOSSES", "where_lost"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# The group that the answers stand in.
LOSSES = "losses"

# Runs of each of the two kinds below which the spread of neither can be told.
_FEWEST_RUNS = 10


def where_lost(sample: Sample) -> Iterator[tuple[str, xr.DataArray]]:
    """Which inputs go with the loss of runs.

    Inadmissible points are not among them: they lie outside of the law, not where a model fails.

    Parameters
    ----------
    sample : Sample
        Of any output; its `missing` runs are compared with those that came back.

    Yields
    ------
    name : str
        ``larger``: the probability that an input is larger in a lost run than in one that came
        back, 0.5 where the input has nothing to do with it. ``further_out``: the same of its
        distance from the median of all runs. ``lowest`` and ``highest``: between which values the
        lost runs lie, in SI units.
    answer : DataArray
        Along ``input``, the first two and ``bound``. Nothing where no run was lost.

    References
    ----------
    DeLong, DeLong and Clarke-Pearson (1988), "Comparing the areas under two or more correlated
    receiver operating characteristic curves", Biometrics 44, 837-845.
    """
    if not sample.missing.size or not sample.inputs:
        return
    at = np.concatenate([sample.used, sample.missing])
    is_lost = np.arange(len(at)) >= len(sample.used)
    columns = sample.points[at].T
    for name, what, measured in (
        ("larger", "is larger", columns),
        ("further_out", "lies further from its median", [_distances(x) for x in columns]),
    ):
        array = Estimate.stack(
            [_probability(sample, values, is_lost) for values in measured],
            INPUT,
            units="1",
            long_name=f"probability that an input {what} in a lost run than in another",
            name=name,
        )
        yield name, array.assign_coords(input_coordinate(sample))
    for name, end in (("lowest", np.min), ("highest", np.max)):
        values = np.array([end(column[is_lost]) for column in columns])
        attributes = {"long_name": f"{name} value of each input among the lost runs, in SI units"}
        yield name, xr.DataArray(values, input_coordinate(sample), (INPUT,), attrs=attributes)


def _distances(values: FloatArray) -> FloatArray:
    """How far each value is from the median, counted in values that lie between."""
    ranks = _ranks(values)
    distances: FloatArray = np.abs(ranks - ranks.mean())
    return distances


def _probability(sample: Sample, values: FloatArray, is_lost: BoolArray) -> Estimate:
    """The probability that a lost run has the larger value, ties counted half."""
    lost, others = int(is_lost.sum()), int((~is_lost).sum())
    if not others or not np.ptp(values) > 0:
        reason = "no run came back" if not others else "the input does not vary"
        return Estimate.without_bounds(math.nan, reason)
    ranks = _ranks(values)
    within = np.empty(len(values))
    for kind in (is_lost, ~is_lost):
        within[kind] = _ranks(values[kind])
    # Of each run, the share of the other kind that lies below it.
    below = np.where(is_lost, (ranks - within) / others, (ranks - within) / lost)
    value = float(below[is_lost].mean())
    if reason := sample.reason_for_none or _reason_for_no_bounds(lost, others, value):
        return Estimate.without_bounds(value, reason)
    variances = [float(below[kind].var(ddof=1)) / kind.sum() for kind in (is_lost, ~is_lost)]
    slope = value * (1 - value)
    half = student_quantile(min(lost, others) - 1, LEVEL) * math.sqrt(sum(variances)) / slope
    centre = math.log(value / (1 - value))
    ends = (1 / (1 + math.exp(half - centre)), 1 / (1 + math.exp(-half - centre)))
    # Points that fill the law evenly scatter less than the formula says.
    label = "nominal" if sample.plan is Plan.INDEPENDENT else "conservative"
    return Estimate(value, *ends, "DeLong on the logit", label)


def _reason_for_no_bounds(lost: int, others: int, value: float) -> str:
    if min(lost, others) < _FEWEST_RUNS:
        kind = "lost" if lost <= others else "that came back"
        return f"fewer than {_FEWEST_RUNS} runs {kind} do not tell the error"
    if not 0 < value < 1:
        return "the lost runs lie apart from all others"
    return ""


def _ranks(values: FloatArray) -> FloatArray:
    return mean_ranks(np.unique(values, return_inverse=True)[1])
