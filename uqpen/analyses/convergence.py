"""Estimates from growing parts of a design's runs, each part a smaller sample of the same kind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.analyze import analyze
from uqpen.analyses.estimate import LEVEL
from uqpen.analyses.question import Question
from uqpen.analyses.sample import Plan, Sample, sample_of_law
from uqpen.archive.told import TOLD, told, told_along
from uqpen.labels import (
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

__all__ = ["RUNS_SO_FAR", "convergence", "why_whole"]

RUNS_SO_FAR = "runs_so_far"

# The groups that are told of every part.
_TOLD = (MOMENTS, QUANTILES, EXCEEDANCE, SHARES)
# Parts at the most, and the fewest runs of one.
_MOST, _FEWEST = 16, 20
# Round numbers in each decade; replicates grow by such a factor. Of many runs each part takes long.
_STEPS, _GROWTH = (1, 2, 3, 5), 1.25
_MANY, _STEPS_OF_MANY, _GROWTH_OF_MANY = 200_000, (1, 3), 2.0

_UNKNOWN = "nothing says that its first points are drawn in the same way as all of them"
_STRATIFIED = "its points are one stratified set, and no part of that is a smaller such set"


def why_whole(runs: xr.Dataset) -> str:
    """Why no part of a design's runs is a smaller sample of the same kind; empty where some are.

    Parameters
    ----------
    runs : Dataset
        Of a design, with attributes that say how the points were drawn.
    """
    if not Sampling(runs.attrs[SAMPLING]).is_sample:
        return "its points are no draws from the law"
    drawn = sample_of_law(runs)[[STATUS]]
    plan = Sample.of_status(drawn).plan
    if plan is Plan.UNKNOWN:
        return _UNKNOWN
    if plan is Plan.SINGLE:
        return _STRATIFIED
    if len(_ends(drawn)) > 1:
        return ""
    if plan is Plan.REPLICATED:
        return "it takes two replicates to tell an error, and there are no more"
    return f"it has only {drawn.sizes[RUN]} runs"


def convergence(runs: xr.Dataset, questions: Sequence[Question]) -> dict[str, xr.Dataset]:
    """Moments, quantiles and probabilities from growing parts of a design's runs.

    Of independent draws the parts are the first so many, of replicates the first so many
    replicates: samples of the same kind, so that each estimate has the very interval that it
    would have, had the design ended there. The last part is the whole.

    Parameters
    ----------
    runs : Dataset
        Of a design; lost runs count among the first so many.
    questions : sequence of Question
        One for each output.

    Returns
    -------
    dict of str to Dataset
        By the name of the group; each variable along ``runs_so_far``, its own dimension if it has
        one, and ``bound``. Empty where parts are no samples of the same kind, see `why_whole`.
    """
    if why_whole(runs):
        return {}
    # What independent draws or replicates tell needs no inputs.
    names = [question.output.name for question in questions]
    drawn = sample_of_law(runs)[[STATUS, *names]]
    parts = list(_parts(drawn))
    sizes = np.array([part.sizes[RUN] for part in parts])
    answers = [analyze(part, questions, only=_TOLD) for part in parts]
    return {
        group: xr.Dataset(
            {
                name: _along([answer[group][name] for answer in answers], sizes)
                for name in map(str, whole.data_vars)
            }
        )
        for group, whole in answers[-1].items()
        if group in _TOLD
    }


def _parts(drawn: xr.Dataset) -> Iterator[xr.Dataset]:
    """The runs of each part, in the order that they have."""
    for end in _ends(drawn):
        if REPLICATE in drawn.coords:
            numbers = np.unique(drawn[REPLICATE].values)
            yield drawn.isel({RUN: np.isin(drawn[REPLICATE].values, numbers[:end])})
        else:
            yield drawn.isel({RUN: slice(end)})


def _ends(drawn: xr.Dataset) -> list[int]:
    """How many replicates, or runs, each part has."""
    whole, is_large = drawn.sizes[RUN], drawn.sizes[RUN] > _MANY
    if REPLICATE in drawn.coords:
        whole = len(np.unique(drawn[REPLICATE].values))
        growth = _GROWTH_OF_MANY if is_large else _GROWTH
        ends = [2]
        while ends[-1] < whole:
            ends.append(max(ends[-1] + 1, math.ceil(growth * ends[-1])))
    else:
        steps = _STEPS_OF_MANY if is_large else _STEPS
        decades = range(1, len(str(whole)))
        ends = [step * 10**decade for decade in decades for step in steps]
        ends = [end for end in ends if end >= _FEWEST]
    # One that holds nearly all runs says no more than all of them.
    return [*(end for end in ends if _GROWTH * end <= whole), whole][-_MOST:]


def _along(arrays: Sequence[xr.DataArray], sizes: npt.NDArray[np.int64]) -> xr.DataArray:
    """What all parts say of one statistic."""
    last = arrays[-1]
    own = [str(dimension) for dimension in last.dims if dimension != BOUND]
    shape = {RUNS_SO_FAR: len(arrays), **{each: last.sizes[each] for each in own}}
    texts = {what: [text for each in arrays for text in _texts(each, what)] for what in TOLD}
    described = {"units": "1", "long_name": "runs so far, lost ones among them"}
    endings = tuple(f"_{what}" for what in TOLD)
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
            **told_along(str(last.name), shape, texts),
        },
        (RUNS_SO_FAR, *map(str, last.dims)),
        attrs={key: last.attrs[key] for key in ("units", "long_name")} | {INTERVAL_LEVEL: LEVEL},
        name=last.name,
    )


def _texts(array: xr.DataArray, what: str) -> list[str]:
    """What the estimates of one part say of their intervals."""
    entries = [array] if array.dims == (BOUND,) else list(array)
    return [told(entry, what) for entry in entries]
