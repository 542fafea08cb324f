"""Estimates from growing parts of a design's runs, each part a smaller sample of the same kind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import IntArray
from uqpen.core.labels import (
    BOUND,
    EXCEEDANCE,
    INTERVAL_LEVEL,
    MOMENTS,
    QUANTILES,
    REPLICATE,
    RUN,
    SAMPLING,
    SHARES,
    STATUS,
)
from uqpen.core.sampling import Sampling
from uqpen.statistics.analyze import OutputStatistics, analyze
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample, input_sample

__all__ = ["RUNS_SO_FAR", "convergence", "reason_without_parts"]

RUNS_SO_FAR = "runs_so_far"

# The groups of statistics that are estimated from every part.
_GROUPS = (MOMENTS, QUANTILES, EXCEEDANCE, SHARES)
# Parts at the most, and the fewest runs of one.
_MOST, _FEWEST = 16, 20
# Round numbers in each decade; replicates grow by such a factor. Of many runs each part takes long.
_STEPS, _GROWTH = (1, 2, 3, 5), 1.25
_MANY, _STEPS_FOR_MANY, _GROWTH_FOR_MANY = 200_000, (1, 3), 2.0

_UNKNOWN = "its points are not declared independent, so no part is known to be like the whole"
_STRATIFIED = "its points are one stratified set, of which no part is a stratified set"


def reason_without_parts(runs: xr.Dataset) -> str:
    """Reason why no part of a design's runs is a sample of the same kind; empty if some are."""
    if not Sampling(runs.attrs[SAMPLING]).is_sample:
        return "its points are not a sample of the input distribution"
    drawn = input_sample(runs)[[STATUS]]
    error_model = Sample.from_statuses(drawn).error_model
    if error_model is ErrorModel.UNKNOWN:
        return _UNKNOWN
    if error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        return _STRATIFIED
    if len(_part_sizes(drawn)) > 1:
        return ""
    if error_model is ErrorModel.REPLICATED:
        return "it has only two replicates, and an error needs two"
    return f"it has only {drawn.sizes[RUN]} runs"


def convergence(
    runs: xr.Dataset, quantities: Sequence[QuantityOfInterest]
) -> dict[str, OutputStatistics]:
    """Moments, quantiles and probabilities from growing parts of a design's runs.

    Each part of independent draws consists of the first runs, each part of replicates of the first
    replicates. A part is a sample of the same kind as the whole, so each estimate has the same
    interval as if the design had ended there. The last part is the whole.

    Parameters
    ----------
    runs : Dataset
        Of a design. Failed runs count as runs of a part.
    quantities : sequence of QuantityOfInterest
        One for each output.

    Returns
    -------
    dict of str to dict of str to DataArray
        By output and statistic, estimate arrays along ``runs_so_far``, the statistic's own
        dimension if it has one, and ``bound``. Empty where parts are no samples of the same kind,
        see `reason_without_parts`.
    """
    if reason_without_parts(runs):
        return {}
    # The statistics of independent draws or replicates need no inputs.
    names = [quantity.output.name for quantity in quantities]
    drawn = input_sample(runs)[[STATUS, *names]]
    parts = list(_growing_parts(drawn))
    sizes = np.array([part.sizes[RUN] for part in parts])
    answers = [analyze(part, quantities, only=_GROUPS) for part in parts]
    return {
        output: {
            name: _stack_parts([answer[output][name] for answer in answers], sizes)
            for name in statistics
        }
        for output, statistics in answers[-1].items()
    }


def _growing_parts(drawn: xr.Dataset) -> Iterator[xr.Dataset]:
    """Yield the runs of each part, in ascending order of size."""
    for end in _part_sizes(drawn):
        if REPLICATE in drawn.coords:
            numbers = np.unique(drawn[REPLICATE].values)
            yield drawn.isel({RUN: np.isin(drawn[REPLICATE].values, numbers[:end])})
        else:
            yield drawn.isel({RUN: slice(end)})


def _part_sizes(drawn: xr.Dataset) -> list[int]:
    """Number of replicates, or of runs, in each part."""
    whole, is_large = drawn.sizes[RUN], drawn.sizes[RUN] > _MANY
    if REPLICATE in drawn.coords:
        whole = len(np.unique(drawn[REPLICATE].values))
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


def _stack_parts(arrays: Sequence[xr.DataArray], sizes: IntArray) -> xr.DataArray:
    """Put the estimate arrays of all parts along ``runs_so_far``."""
    last = arrays[-1]
    dims = {str(dim): last.sizes[dim] for dim in last.dims if dim != BOUND}
    own = {key: each.variable for key, each in last.coords.items() if key not in INTERVAL_TEXTS}
    described = {"units": "1", "long_name": "runs so far, including failed ones"}
    texts = {
        name: np.stack([each.coords[name].values for each in arrays]) for name in INTERVAL_TEXTS
    }
    return estimate_array(
        np.stack([each.values for each in arrays]),
        {RUNS_SO_FAR: len(arrays), **dims},
        texts,
        units=last.attrs["units"],
        long_name=last.attrs["long_name"],
        attributes={INTERVAL_LEVEL: LEVEL},
    ).assign_coords({**own, RUNS_SO_FAR: (RUNS_SO_FAR, sizes, described)})
