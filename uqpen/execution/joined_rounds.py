"""Runs of several rounds of a design as one dataset, also of rounds whose runs are in files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqpen.archive.lazy_variables import (
    computed_variable,
    is_in_memory,
    joined_variable,
    lazy_dataset,
)
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, ROUND, RUN, STATUS


def join_rounds(rounds: Sequence[xr.Dataset], numbers: Sequence[int] | None = None) -> xr.Dataset:
    """Join the runs of one or more rounds of a design, and number them consecutively.

    If there are several, each run gets the number of its round as a coordinate. It gets that of
    `numbers` where a model has run only some of a design's rounds.
    """
    if len(rounds) == 1 and numbers is None:
        return rounds[0]
    numbers = range(len(rounds)) if numbers is None else numbers
    if not all(is_in_memory(runs.variables[STATUS]) for runs in rounds):
        return _join_unread(rounds, numbers)
    return _join_in_memory(rounds, numbers)


def _join_unread(rounds: Sequence[xr.Dataset], numbers: Sequence[int]) -> xr.Dataset:
    """Join rounds whose values are read when they are needed, as some of them are in files."""
    whole = _join_in_memory([_without_runs(runs) for runs in rounds], numbers)
    starts, own = np.cumsum([0, *(runs.sizes[RUN] for runs in rounds)]), np.asarray(numbers)
    found = {
        str(name): joined_variable([runs.variables[name] for runs in rounds])
        if RUN in each.dims and name not in (RUN, ROUND)
        else each.to_base_variable()
        for name, each in whole.variables.items()
    }
    size = int(starts[-1])
    found[RUN] = computed_variable(found[RUN], size, lambda at: at)
    found[ROUND] = computed_variable(
        found[ROUND], size, lambda at: own[np.searchsorted(starts, at, side="right") - 1]
    )
    failed = [
        (runs.variables[FAILED_RUN].values + start, runs.variables[FAILURE_REASON])
        for runs, start in zip(rounds, starts, strict=False)
        if FAILURE_REASON in runs
    ]
    if failed:
        numbers_failed = np.concatenate([at for at, _ in failed])
        found[FAILED_RUN] = xr.Variable(FAILED_RUN, numbers_failed, found[FAILED_RUN].attrs)
        found[FAILURE_REASON] = joined_variable([reasons for _, reasons in failed])
    coordinates = {name: found.pop(name) for name in map(str, whole.coords)}
    return lazy_dataset(found, coordinates, whole.attrs)[[*map(str, whole.variables)]]


def _without_runs(runs: xr.Dataset) -> xr.Dataset:
    """Return a dataset like that of some runs in memory, without a run."""
    no_run = {RUN: slice(0), FAILED_RUN: slice(0)}
    described = runs.isel(no_run, missing_dims="ignore").load()
    for name in no_run:
        if name in described.coords and name not in described.indexes:
            described = described.set_xindex(name)
    return described


def _join_in_memory(rounds: Sequence[xr.Dataset], numbers: Sequence[int]) -> xr.Dataset:
    sizes = [runs.sizes[RUN] for runs in rounds]
    starts = np.cumsum([0, *sizes[:-1]])
    along_run = [runs.drop_vars([FAILED_RUN, FAILURE_REASON], errors="ignore") for runs in rounds]
    joined = xr.concat(along_run, RUN, data_vars="minimal", coords="minimal", compat="equals")
    joined = joined.assign_coords({RUN: np.arange(sum(sizes))})
    joined[RUN].attrs = rounds[0][RUN].attrs
    joined = joined.assign_coords(
        {ROUND: (RUN, np.repeat(np.array(numbers, dtype=np.int64), sizes))}
    )
    joined[ROUND].attrs = {"units": "1", "long_name": "round that the run was made in"}
    failed = [
        runs[[FAILURE_REASON]].assign_coords({FAILED_RUN: runs[FAILED_RUN] + start})
        for runs, start in zip(rounds, starts, strict=True)
        if FAILURE_REASON in runs
    ]
    return joined.merge(xr.concat(failed, FAILED_RUN)) if failed else joined
