"""Samples of the joint distribution, read from the runs of a design."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import (
    DEPENDENCE,
    MATRIX,
    OPTIMIZED_BY,
    REPLICATE,
    ROUND,
    RUN,
    SAMPLING,
    STATUS,
    WEIGHT,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.designs.pick_freeze import MATRIX_A, MATRIX_B
from uqpen.statistics.absent_values import absent_runs
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.sample import Sample

__all__ = ["each_sample", "input_sample", "sample_of", "sample_of_statuses", "samples_of"]


def input_sample(runs: xr.Dataset) -> xr.Dataset:
    """Select the runs of a design whose points are a sample of the joint distribution.

    These are all runs, except for pick-freeze blocks: there, they are the rows of the matrices A
    and B as drawn in the first round.
    """
    if Sampling(runs.attrs[SAMPLING]) is not Sampling.PICK_FREEZE:
        return runs
    drawn = np.isin(runs[MATRIX].values, (MATRIX_A, MATRIX_B))
    if ROUND in runs.coords:
        drawn &= runs[ROUND].values == 0
    return runs.isel({RUN: drawn})


def sample_of(runs: xr.Dataset | BlockedRuns, name: str) -> Sample:
    """Return the sample of a variable in a runs dataset."""
    return next(each_sample(runs, [name]))


def samples_of(runs: xr.Dataset | BlockedRuns, names: Iterable[str]) -> dict[str, Sample]:
    """Return the samples of several variables by name, which have the inputs in common."""
    names = list(names)
    return dict(zip(names, each_sample(runs, names), strict=True))


def each_sample(runs: xr.Dataset | BlockedRuns, names: Iterable[str]) -> Iterator[Sample]:
    """Yield the sample of each variable; none is held here when the next one is made.

    Runs without a value of a derived output are neither used nor missing in its sample.
    """
    handle = LoadedDataset.of(runs)
    is_used = handle.column(STATUS) == Status.OK
    if WEIGHT in handle.template.coords:
        is_used &= handle.column(WEIGHT) > 0  # a run without a weight counts for nothing
    used = np.flatnonzero(is_used)
    whole = _sample(handle, np.broadcast_to(np.nan, used.shape), used)
    for name in names:
        yield _with_variable(whole, handle, name)


def sample_of_statuses(runs: xr.Dataset | BlockedRuns, level: float = LEVEL) -> Sample:
    """Return the sample of the runs' statuses, in which no run is missing."""
    handle = LoadedDataset.of(runs)
    values = handle.column(STATUS).astype(np.float64)
    whole = _sample(handle, values, np.arange(len(values)))
    return replace(whole, level=level)


def _sample(runs: BlockedRuns, values: FloatArray, used: IntArray) -> Sample:
    """Return the sample of values at some runs."""
    status, coordinates = runs.column(STATUS), runs.template.coords
    failed = np.flatnonzero((status != Status.OK) & (status != Status.INADMISSIBLE))
    replicates = np.zeros(len(status), dtype=np.int64)
    if REPLICATE in coordinates:
        replicates = runs.column(REPLICATE).astype(np.int64)
    return Sample(
        values=values,
        used=used,
        missing=np.setdiff1d(failed, used, assume_unique=True),
        columns=InputColumns.from_runs(runs),
        replicates=replicates,
        sampling=Sampling(runs.attrs[SAMPLING]),
        dependence=str(runs.attrs.get(DEPENDENCE, "")),
        optimized_by=str(runs.attrs.get(OPTIMIZED_BY, "")),
        weights=runs.column(WEIGHT).astype(np.float64) if WEIGHT in coordinates else None,
    )


def _with_variable(sample: Sample, runs: BlockedRuns, name: str) -> Sample:
    """Return the sample of a variable over those of these runs that have a value of it."""
    values = _values_at(runs.column(name), sample.used)
    if absent_runs(runs, name) is None:
        return replace(sample, values=values)
    exists = ~np.isnan(values)
    return replace(sample, values=values[exists], used=sample.used[exists])


def _values_at(column: npt.NDArray[Any], used: IntArray) -> FloatArray:
    """Return a column at some runs, as floats; all of it as a read-only view."""
    if len(used) < len(column):
        return np.asarray(column[used], dtype=np.float64)
    view = np.asarray(column, dtype=np.float64).view()
    view.flags.writeable = False
    return view
