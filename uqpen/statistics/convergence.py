"""Estimates from growing parts of a design's runs, each part a smaller sample of the same type."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    BY_RUNS,
    FAILED_RUN,
    REPLICATE,
    RUN,
    RUNS_SO_FAR,
    SAMPLING,
)
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.execution import replicate_count, run_count
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import input_sample, sample_of_statuses
from uqpen.statistics.sample import ErrorModel, Sample

# The statistics that are followed. Only of the whole is an array made: one for each smaller part
# would take most of the time.
_FOLLOWED = [each for each in CATALOGUE.values() if "part" in each.by]
# Parts at the most, and the fewest runs of one.
_MOST, _FEWEST = 16, 20
# Round numbers in each decade; replicates grow by such a factor. Of many runs each part takes long.
_STEPS, _GROWTH = (1, 2, 3, 5), 1.25
_MANY, _STEPS_FOR_MANY, _GROWTH_FOR_MANY = 200_000, (1, 3), 2.0

_UNKNOWN = "its points are not declared independent, so no part is known to be like the whole"
_STRATIFIED = "its points are one stratified set, of which no part is a stratified set"


def reason_without_parts(runs: xr.Dataset) -> str:
    """Reason why no part of a design's runs is a sample of the same type; empty if some are."""
    if not Sampling(runs.attrs[SAMPLING]).is_sample:
        return "its points are not a sample of the input distribution"
    drawn = input_sample(runs)
    model, replicates = sample_of_statuses(drawn.isel({RUN: slice(1)})).error_model, 0
    # Of the first run alone nothing says that there are several replicates.
    if model is ErrorModel.SINGLE_STRATIFIED_SET and (replicates := replicate_count(drawn)) > 1:
        model = ErrorModel.REPLICATED
    return _reason(model, run_count(drawn), replicates)


def convergence(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Mean, quantiles and probabilities of an output from growing parts of a design's runs.

    Each part of independent draws consists of the first runs, each part of replicates of the first
    replicates. A part is a sample of the same kind as the whole, so each estimate has the same
    interval as if the design had ended there. The last part is the whole. Failed runs count as
    runs of a part.

    Yields
    ------
    name : str
        ``convergence_mean``, ``convergence_quantile``, ``convergence_exceedance``,
        ``convergence_below``, ``convergence_share``. Nothing where no part is a sample of the same
        kind, see `reason_without_parts`.
    estimate : DataArray
        Along ``runs_so_far``, the statistic's own dimension if it has one, and ``bound``.
    """
    if _reason(sample.error_model, len(sample.replicates), _replicates(sample)):
        return
    parts = list(_growing_parts(sample))
    yield from convergence_of_parts(parts, [len(part.replicates) for part in parts], quantity)


def convergence_of_parts(
    parts: Sequence[Sample], sizes: Sequence[int], quantity: QuantityOfInterest
) -> NamedArrays:
    """Yield the same from the parts and their numbers of points."""
    *smaller, whole = parts
    for statistic in _FOLLOWED:
        analysis, estimate = resolve(statistic.by["sample"]), resolve(statistic.by["part"])
        for name, last in islice(analysis(whole, quantity), 1):
            estimates = [estimate(part, quantity) for part in smaller]
            estimates.append(Estimate.from_array(last))
            stacked = Estimate.stacked(estimates, axis=0)
            described = {"units": "1", "long_name": "runs so far, including failed ones"}
            along = RUNS_SO_FAR, np.array(sizes), described
            array = stacked.along(last, along, ", by the runs so far", level=whole.level)
            yield f"{BY_RUNS}{name}", array


def _reason(model: ErrorModel, runs: int, replicates: int) -> str:
    if model is ErrorModel.UNKNOWN:
        return _UNKNOWN
    if model is ErrorModel.SINGLE_STRATIFIED_SET:
        return _STRATIFIED
    if len(part_sizes(runs, replicates)) > 1:
        return ""
    if model is ErrorModel.REPLICATED:
        return "it has only two replicates, and an error needs two"
    return f"it has only {runs} runs"


def _growing_parts(sample: Sample) -> Iterator[Sample]:
    """Yield each part of a sample, in ascending order of size."""
    numbers = np.unique(sample.replicates)
    for end in part_sizes(len(sample.replicates), _replicates(sample)):
        if sample.error_model is ErrorModel.REPLICATED:
            yield _part(sample, np.isin(sample.replicates, numbers[:end]))
        elif end == len(sample.replicates):
            yield sample  # what its statistics have found is not found again
        else:
            yield _first_points(sample, end)


def _part(sample: Sample, is_taken: BoolArray) -> Sample:
    """Return a sample of some of the points, without the inputs, which no estimate here needs."""
    numbers = np.cumsum(is_taken) - 1
    return replace(
        sample,
        values=sample.values[is_taken[sample.used]],
        used=numbers[sample.used[is_taken[sample.used]]],
        missing=numbers[sample.missing[is_taken[sample.missing]]],
        columns=InputColumns.none(int(is_taken.sum())),
        replicates=sample.replicates[is_taken],
        weights=None if sample.weights is None else sample.weights[is_taken],
    )


def _first_points(sample: Sample, end: int) -> Sample:
    """Return a sample of the first points, as views where the numbers of its runs ascend."""
    if (np.diff(sample.used) < 0).any():
        return _part(sample, np.arange(len(sample.replicates)) < end)
    runs = slice(int(np.searchsorted(sample.used, end)))
    return replace(
        sample,
        values=sample.values[runs],
        used=sample.used[runs],
        missing=sample.missing[sample.missing < end],
        columns=InputColumns.none(end),
        replicates=sample.replicates[:end],
        weights=None if sample.weights is None else sample.weights[:end],
    )


def _replicates(sample: Sample) -> int:
    """Return the number of its replicates; 0 where it is no set of replicates."""
    is_replicated = sample.error_model is ErrorModel.REPLICATED
    return len(np.unique(sample.replicates)) if is_replicated else 0


def part_sizes(runs: int, replicates: int) -> list[int]:
    """Return the number of replicates in each part of some runs, or of runs without replicates."""
    is_large, whole = runs > _MANY, replicates or runs
    if replicates:
        growth = _GROWTH_FOR_MANY if is_large else _GROWTH
        ends = [2]
        while ends[-1] < whole:
            ends.append(max(ends[-1] + 1, math.ceil(growth * ends[-1])))
    else:
        steps = _STEPS_FOR_MANY if is_large else _STEPS
        decades = range(1, len(str(whole)))
        ends = [step * 10**decade for decade in decades for step in steps]
        ends = [end for end in ends if end >= _FEWEST]
    # A part with nearly all runs adds no information to the whole.
    return [*(end for end in ends if _GROWTH * end <= whole), whole][-_MOST:]


# Sample from the first runs of a design that is still being run.


_IN_BLOCKS = "its points form blocks, and a part of them is no sample of the inputs"
_NO_REPLICATE = (
    "it has fewer than two complete replicates, and a part of a stratified set is no such set"
)
# Fewer draws say little, and the interval of a mean relies on more.
_FEW = f"fewer than {_FEWEST} of its first runs are finished"


class SampleSoFar(NamedTuple):
    """First runs that are a sample as the whole design will be, or why there are none yet."""

    runs: xr.Dataset | None  # the runs; None where there is a reason
    reason: str = ""  # empty where there are runs


def first_runs(finished: xr.Dataset) -> xr.Dataset:
    """Return the runs before the first that is not finished.

    A run that takes long is finished late. So slow runs are too rare among the finished runs of
    several workers, but not among the first runs.

    Parameters
    ----------
    finished : Dataset
        The finished runs of a round with their numbers along ``run``, in ascending order.
    """
    numbers = finished[RUN].values
    end = int(np.cumprod(numbers == np.arange(numbers.size)).sum())
    first = finished.isel({RUN: slice(end)})
    if FAILED_RUN not in finished:
        return first
    return first.isel({FAILED_RUN: finished[FAILED_RUN].values < end})


def sample_so_far(runs: xr.Dataset, *, is_complete: bool) -> SampleSoFar:
    """Return the first runs of a design as a sample, or the reason why they are none.

    Of a design of replicates, this is those that are complete.

    Parameters
    ----------
    runs : Dataset
        The result of `first_runs`, with the attribute on the sampling of the design.
    is_complete : bool
        Whether these are all runs of the design.
    """
    sampling = Sampling(runs.attrs[SAMPLING])
    if is_complete:
        reason = "" if sampling.is_sample else reason_without_parts(runs)
        return SampleSoFar(None, reason) if reason else SampleSoFar(runs)
    if sampling is Sampling.PICK_FREEZE:
        return SampleSoFar(None, _IN_BLOCKS)
    if not runs.sizes[RUN]:
        return SampleSoFar(None, _FEW)
    if not sampling.is_sample or sampling is Sampling.GIVEN:
        return SampleSoFar(None, reason_without_parts(runs))
    if sampling is Sampling.INDEPENDENT:
        is_enough = runs.sizes[RUN] >= _FEWEST
        return SampleSoFar(runs) if is_enough else SampleSoFar(None, _FEW)
    if REPLICATE not in runs.coords:
        return SampleSoFar(None, reason_without_parts(runs))
    # One may not be complete. Where replicates grow, those before it are larger than those behind.
    replicates, sizes = np.unique(runs[REPLICATE].values, return_counts=True)
    shared, times = np.unique(sizes, return_counts=True)
    complete = replicates[sizes == shared[(shared * times).argmax()]]
    if len(complete) < 2:
        return SampleSoFar(None, _NO_REPLICATE)
    return SampleSoFar(runs.isel({RUN: np.isin(runs[REPLICATE].values, complete)}))
