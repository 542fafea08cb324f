"""Joint probabilities: of events that concern several outputs at once."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import ABSENT, EVENT, SAMPLING, STATUS
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics, drawn_runs, goes_by_blocks, run_counts
from uqpen.statistics.by_blocks.passes import BlockedColumn, BlockedColumns, Grouping
from uqpen.statistics.distribution_function.probabilities import (
    acceptance_coordinates,
    event_probability,
)
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.rare_events.rare_event_probability import RareEventProbability, rare_event
from uqpen.statistics.run_samples import absent_runs, event_sample, samples_of
from uqpen.statistics.sample import Sample


def joint_probabilities(
    runs: xr.Dataset | BlockedRuns,
    events: Sequence[JointEvent],
    level: float,
    *,
    in_memory: int = RUNS_IN_MEMORY,
) -> OutputStatistics:
    """Estimate the probabilities of events over the runs of a design.

    The outputs of a run occur together, so their dependence is that of the runs. Intervals are
    those of the probability of exceeding a value, and count failed runs both ways. A design for a
    rare event has the probability of its own event alone, from its replicates.

    Parameters
    ----------
    runs : Dataset or BlockedRuns
        With every output that an event concerns; events with others are left out.
    in_memory : int
        More runs go by blocks.

    Returns
    -------
    dict of str to DataArray
        ``joint_probability`` along ``event`` and ``bound``; from a design for a rare event, further
        statistics of its method as well. Empty without an event, or for a design that is no sample
        of the inputs.
    """
    handle = LoadedDataset.of(runs)
    if Sampling(handle.attrs[SAMPLING]) is Sampling.TOWARDS_EVENT:
        return _of_rare_event(handle.dataset(), events, level)
    names = set(map(str, handle.template.data_vars))
    known = [event for event in events if event.outputs <= names]
    if not known or not Sampling(handle.attrs[SAMPLING]).is_sample:
        return {}
    drawn = drawn_runs(handle)
    outputs = sorted(set[str]().union(*(event.outputs for event in known)))
    if goes_by_blocks(handle, in_memory):
        estimates = _estimates_by_blocks(known, handle, outputs, level)
    else:
        samples = samples_of(drawn, outputs)
        absent = [name for name in outputs if absent_runs(drawn, name) is not None]
        estimates = [_estimate(event, samples, absent, level) for event in known]
    array = _array(estimates, [(event.name, event.condition) for event in known], known, level)
    return {"joint_probability": array.assign_attrs(run_counts(drawn))}


def _of_rare_event(
    runs: xr.Dataset, events: Sequence[JointEvent], level: float
) -> OutputStatistics:
    """Estimate the probability of the event that a design was made for.

    It has the name of the requested event with the same condition, or its condition as a name.
    """
    rare = rare_event(runs)
    if rare is None:
        return {}
    condition = str(rare.event)
    same = [each for each in events if each.condition == condition][:1]
    name = same[0].name if same else condition
    made: RareEventProbability = resolve(rare.method.probability)(runs, rare.event, level)
    has_all = bool(rare.event.outcomes(runs).belongs[runs[STATUS].values == Status.OK].all())
    array = _array([_noted(made.estimate, has_all=has_all)], [(name, condition)], same, level)
    array = array.assign_coords({key: (EVENT, [each]) for key, each in made.companions.items()})
    counts = run_counts(LoadedDataset.of(runs))
    found = {"joint_probability": array, **made.statistics}
    return {name: each.assign_attrs(counts) for name, each in found.items()}


def _array(
    estimates: Sequence[Estimate],
    described: Sequence[tuple[str, str]],
    accepted: Sequence[JointEvent],
    level: float,
) -> xr.DataArray:
    """Return estimates along ``event``, given the name and the condition of each."""
    names, conditions = (list(each) for each in zip(*described, strict=True))
    return Estimate.stacked(estimates).to_array(
        EVENT,
        units="1",
        long_name="probability of an event of several outputs",
        coordinates={
            EVENT: (EVENT, _texts(names), {"long_name": "event"}),
            f"{EVENT}_condition": (
                EVENT,
                _texts(conditions),
                {"long_name": "condition that the outputs meet"},
            ),
            **dict(acceptance_coordinates(accepted, EVENT)),
        },
        level=level,
    )


def _estimate(
    event: JointEvent, samples: dict[str, Sample], absent: Sequence[str], level: float
) -> Estimate:
    sample, occurs = event_sample(event, samples, level)
    has_all = event.outputs.isdisjoint(absent)
    if event.category_output and event.given is None:
        has_all = len(sample.used) == len(samples[event.category_output].used)
    return _noted(_of_condition(event, event_probability(sample, occurs), sample), has_all=has_all)


def _of_condition(event: JointEvent, found: Estimate, sample: Sample) -> Estimate:
    """Return a conditional probability with the number of its runs; any other as it is."""
    if event.given is None:
        return found
    if not sample.size:
        reason = texts.CONDITION_NEVER_SEEN.format(condition=event.given.condition)
        return Estimate.without_bounds(found.value, reason)
    return found.with_note(texts.RUNS_OF_CONDITION.format(runs=sample.size))


def _estimates_by_blocks(
    events: Sequence[JointEvent], runs: BlockedRuns, outputs: Sequence[str], level: float
) -> list[Estimate]:
    """Estimate the same from one pass over the runs."""
    with_gaps = {name for name in outputs if ABSENT in runs.template[name].attrs}
    columns = [
        BlockedColumn(tuple(outputs), partial(_occurrences, event, with_gaps)) for event in events
    ]
    counted = BlockedColumns(runs, Grouping.of_runs(runs), columns, np.array([0.0, 1.0]))
    samples = [counted.sample(number, level) for number in range(len(events))]
    completed = int((runs.column(STATUS) == Status.OK).sum())
    return [
        _noted(
            _of_condition(event, event_probability(each, each.event(operator.eq, 1)), each),
            has_all=with_gaps.isdisjoint(event.outputs)
            or bool(event.category_output and event.given is None and each.size == completed),
        )
        for event, each in zip(events, samples, strict=True)
    ]


def _occurrences(
    event: JointEvent, with_gaps: set[str], columns: Mapping[str, npt.NDArray[Any]]
) -> tuple[FloatArray, BoolArray]:
    """Return in which runs an event occurs, and the runs that have all of its outputs."""
    used = columns[STATUS] == Status.OK
    if event.category_output:
        used = used & event.is_known(columns)
    else:
        for name in event.outputs & with_gaps:
            used = used & ~np.isnan(columns[name])
    counts = event.counts(columns)
    used = used if counts is None else used & counts
    return event.occurs(columns).astype(np.float64), used


def _noted(estimate: Estimate, *, has_all: bool) -> Estimate:
    return estimate.with_note("" if has_all else texts.ALL_EXIST)


def _texts(texts: list[str]) -> npt.NDArray[np.object_]:
    return np.array(texts, dtype=object)
