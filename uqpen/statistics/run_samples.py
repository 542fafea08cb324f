"""Samples of the joint distribution, read from the runs of a design."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import (
    ABSENT,
    CONDITIONAL,
    DEPENDENCE,
    MATRIX,
    OPTIMIZED_BY,
    REPLICATE,
    REWEIGHTED,
    ROUND,
    RUN,
    RUNS_ABSENT,
    SAMPLING,
    STATUS,
    WEIGHT,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.designs.saltelli import MATRIX_A, MATRIX_B
from uqpen.execution import first_repeats
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.sample import Sample

# Runs in which a derived output has no value, such as the time of an event that never comes.
#
# They are neither used nor missing: a statistic of the output is one of the other runs, and says
# so.


def absent_runs(runs: BlockedRuns, name: str) -> BoolArray | None:
    """Return a mask of the completed runs without a value of an output; None where all have one."""
    if ABSENT not in runs.template[name].attrs:
        return None
    mask: BoolArray = np.isnan(runs.column(name)) & (runs.column(STATUS) == Status.OK)
    return mask if mask.any() else None


def absent_condition(
    runs: BlockedRuns, name: str, count: int | None = None
) -> dict[str, int | str]:
    """Return what the statistics of an output are conditional on, as attributes.

    The number of completed runs without a value may be given.

    Returns
    -------
    dict
        ``runs_absent``, that number, and ``conditional_on``. Empty where all completed runs have a
        value.
    """
    if count is None:
        mask = absent_runs(runs, name)
        count = 0 if mask is None else int(mask.sum())
    if not count:
        return {}
    status, absent = runs.column(STATUS), runs.template[name].attrs[ABSENT]
    share = count / (status == Status.OK).sum()
    condition = texts.VALUE_EXISTS.format(absent=absent, share=100 * share)
    if (status == Status.INADMISSIBLE).any():
        condition = f"{texts.ADMISSIBLE_INPUTS} and {condition}"
    return {RUNS_ABSENT: count, CONDITIONAL: condition}


def runs_with_value(runs: BlockedRuns, name: str) -> xr.Dataset:
    """Return all runs of a design, those without a value of an output marked as inadmissible.

    So an analysis of blocks, nodes or trajectories leaves them out as it leaves out those, and
    takes them for no failure. The attribute ``conditional_on`` says what they have in common.
    """
    whole, mask = runs.dataset(), absent_runs(runs, name)
    if mask is None:
        return whole
    status = np.where(mask, Status.INADMISSIBLE, whole[STATUS].values).astype(np.int8)
    condition = {CONDITIONAL: absent_condition(runs, name)[CONDITIONAL]}
    return whole.assign({STATUS: whole[STATUS].copy(data=status)}).assign_attrs(condition)


def input_sample(runs: xr.Dataset) -> xr.Dataset:
    """Select the runs of a design whose points are a sample of the joint distribution.

    These are all runs, except for pick-freeze blocks: there, they are the rows of the matrices A
    and B as drawn in the first round. Of several runs at a point it is the first.
    """
    runs = first_repeats(runs)
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
        is_reweighted=REWEIGHTED in runs.attrs,
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


# Runs of a sample in which an event is known, and whether it occurs in them.


def event_sample(
    event: JointEvent, samples: Mapping[str, Sample], level: float
) -> tuple[Sample, BoolArray]:
    """Return the runs that decide on an event, and in which of them it occurs.

    Some runs may lack a number; those that have all outputs of the event are used, and those in
    which a category that it names decides. Of a
    conditional event, those are used that meet the condition. A missing run may meet it or not.

    Parameters
    ----------
    event : JointEvent
    samples : mapping of str to Sample
        Of its outputs at least, over the same design.
    level : float
        Confidence level of intervals of the sample.

    Returns
    -------
    sample : Sample
        Its values are 1 where the event occurs, else 0.
    occurs : ndarray of bool, shape (run,)
    """
    if event.category_output:
        completed = samples[event.category_output].used
        whole = {name: _among(samples[name], completed) for name in event.outputs}
        known = event.is_known(whole)
        used = completed[known]
        columns = {name: values[known] for name, values in whole.items()}
    else:
        used = reduce(np.intersect1d, (samples[name].used for name in sorted(event.outputs)))
        columns = {name: _at(samples[name], used) for name in event.outputs}
    occurs, counts = event.occurs(columns), event.counts(columns)
    if counts is not None:
        used, occurs = used[counts], occurs[counts]
    values = occurs.astype(np.float64)
    return replace(samples[event.limits[0].output], used=used, values=values, level=level), occurs


def _among(sample: Sample, runs: IntArray) -> FloatArray:
    """Return the values of a sample in some runs; NaN in those without one."""
    values = np.full(len(runs), np.nan)
    values[np.isin(runs, sample.used, assume_unique=True)] = sample.values
    return values


def _at(sample: Sample, used: IntArray) -> FloatArray:
    """Return the values of a sample in some of its runs."""
    return sample.values[np.isin(sample.used, used, assume_unique=True)]
