"""Estimates from growing parts of a design's runs, each part a smaller sample of the same kind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.interval_metadata import (
    INTERVAL_METADATA,
    interval_metadata,
    metadata_coordinates,
)
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
    Sampling,
)
from uqpen.statistics.analyze import analyze
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample, input_sample

__all__ = ["RUNS_SO_FAR", "convergence", "reason_without_parts"]

RUNS_SO_FAR = "runs_so_far"

# The groups that are told of every part.
_GROUPS = (MOMENTS, QUANTILES, EXCEEDANCE, SHARES)
# Parts at the most, and the fewest runs of one.
_MOST, _FEWEST = 16, 20
# Round numbers in each decade; replicates grow by such a factor. Of many runs each part takes long.
_STEPS, _GROWTH = (1, 2, 3, 5), 1.25
_MANY, _STEPS_FOR_MANY, _GROWTH_FOR_MANY = 200_000, (1, 3), 2.0

_UNKNOWN = "nothing says that its first points are drawn in the same way as all of them"
_STRATIFIED = "its points are one stratified set, and no part of that is a smaller such set"


def reason_without_parts(runs: xr.Dataset) -> str:
    """Why no part of a design's runs is a smaller sample of the same kind; empty where some are.

    Parameters
    ----------
    runs : Dataset
        Of a design, with attributes that say how the points were drawn.
    """
    if not Sampling(runs.attrs[SAMPLING]).is_sample:
        return "its points are no draws from the law"
    drawn = input_sample(runs)[[STATUS]]
    error_model = Sample.from_statuses(drawn).error_model
    if error_model is ErrorModel.UNKNOWN:
        return _UNKNOWN
    if error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        return _STRATIFIED
    if len(_part_sizes(drawn)) > 1:
        return ""
    if error_model is ErrorModel.REPLICATED:
        return "it takes two replicates to tell an error, and there are no more"
    return f"it has only {drawn.sizes[RUN]} runs"


def convergence(
    runs: xr.Dataset, quantities: Sequence[QuantityOfInterest]
) -> dict[str, xr.Dataset]:
    """Moments, quantiles and probabilities from growing parts of a design's runs.

    Of independent draws the parts are the first so many, of replicates the first so many
    replicates: samples of the same kind, so that each estimate has the very interval that it
    would have, had the design ended there. The last part is the whole.

    Parameters
    ----------
    runs : Dataset
        Of a design; lost runs count among the first so many.
    quantities : sequence of QuantityOfInterest
        One for each output.

    Returns
    -------
    dict of str to Dataset
        By the name of the group; each variable along ``runs_so_far``, its own dimension if it has
        one, and ``bound``. Empty where parts are no samples of the same kind, see
        `reason_without_parts`.
    """
    if reason_without_parts(runs):
        return {}
    # What independent draws or replicates tell needs no inputs.
    names = [quantity.output.name for quantity in quantities]
    drawn = input_sample(runs)[[STATUS, *names]]
    parts = list(_growing_parts(drawn))
    sizes = np.array([part.sizes[RUN] for part in parts])
    answers = [analyze(part, quantities, only=_GROUPS) for part in parts]
    return {
        group: xr.Dataset(
            {
                name: _stack_parts([answer[group][name] for answer in answers], sizes)
                for name in map(str, whole.data_vars)
            }
        )
        for group, whole in answers[-1].items()
        if group in _GROUPS
    }


def _growing_parts(drawn: xr.Dataset) -> Iterator[xr.Dataset]:
    """The runs of each part, in the order that they have."""
    for end in _part_sizes(drawn):
        if REPLICATE in drawn.coords:
            numbers = np.unique(drawn[REPLICATE].values)
            yield drawn.isel({RUN: np.isin(drawn[REPLICATE].values, numbers[:end])})
        else:
            yield drawn.isel({RUN: slice(end)})


def _part_sizes(drawn: xr.Dataset) -> list[int]:
    """How many replicates, or runs, each part has."""
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
    # One that holds nearly all runs says no more than all of them.
    return [*(end for end in ends if _GROWTH * end <= whole), whole][-_MOST:]


def _stack_parts(arrays: Sequence[xr.DataArray], sizes: npt.NDArray[np.int64]) -> xr.DataArray:
    """What all parts say of one statistic."""
    last = arrays[-1]
    own = [str(dimension) for dimension in last.dims if dimension != BOUND]
    shape = {RUNS_SO_FAR: len(arrays), **{each: last.sizes[each] for each in own}}
    texts = {
        what: [text for each in arrays for text in _interval_texts(each, what)]
        for what in INTERVAL_METADATA
    }
    described = {"units": "1", "long_name": "runs so far, lost ones among them"}
    endings = tuple(f"_{what}" for what in INTERVAL_METADATA)
    kept = {
        name: coordinate.variable
        for name, coordinate in last.coords.items()
        if not str(name).endswith(endings)
    }
    return xr.DataArray(
        np.stack([each.values for each in arrays]),
        {
            **kept,
            RUNS_SO_FAR: (RUNS_SO_FAR, sizes, described),
            **metadata_coordinates(str(last.name), shape, texts),
        },
        (RUNS_SO_FAR, *map(str, last.dims)),
        attrs={key: last.attrs[key] for key in ("units", "long_name")} | {INTERVAL_LEVEL: LEVEL},
        name=last.name,
    )


def _interval_texts(array: xr.DataArray, what: str) -> list[str]:
    """What the estimates of one part say of their intervals."""
    entries = [array] if array.dims == (BOUND,) else list(array)
    return [interval_metadata(entry, what) for entry in entries]
