"""Sensitivities of the probabilities of events to the inputs, from the runs of a design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import SAMPLING
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.statistics import texts
from uqpen.statistics.analyze import (
    OutputStatistics,
    drawn_runs,
    goes_by_blocks,
    large_sample,
    run_counts,
)
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.event_sample import event_sample
from uqpen.statistics.event_sensitivity.sample_sensitivity import sample_sensitivities
from uqpen.statistics.event_sensitivity.sensitivity_arrays import (
    EventScores,
    ScoredInputs,
    event_coordinates,
    sensitivity_arrays,
)
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.rare_events.rare_event_probability import rare_event
from uqpen.statistics.run_samples import samples_of
from uqpen.statistics.sensitivity.given_data import event_first_order
from uqpen.statistics.sensitivity.input_measures import event_array

__all__ = ["event_sensitivities"]


def event_sensitivities(
    runs: xr.Dataset | BlockedRuns,
    events: Sequence[JointEvent],
    joint: JointDistribution,
    level: float,
    *,
    in_memory: int = RUNS_IN_MEMORY,
) -> OutputStatistics:
    """Estimate how the probabilities of events depend on the distributions of the inputs.

    Parameters
    ----------
    runs : Dataset or BlockedRuns
        Of a design that is a sample of the joint distribution, or moves towards one of the events.
    events : sequence of JointEvent
        Those that request sensitivities are taken.
    joint : JointDistribution
        Of the inputs.
    level : float
        Confidence level of the intervals.
    in_memory : int
        Of more runs, as many are taken, and the notes say so.

    Returns
    -------
    dict of str to DataArray
        The arrays of `sensitivity_arrays`, and ``event_first_order``, the first-order Sobol'
        indices of the events. Empty where no event requests them.
    """
    handle = LoadedDataset.of(runs)
    names = set(map(str, handle.template.data_vars))
    known = [event for event in events if event.sensitivities and event.outputs <= names]
    sampling = Sampling(handle.attrs[SAMPLING])
    if not known or not joint.random:
        return {}
    if sampling is Sampling.TOWARDS_EVENT:
        return _of_rare_event(handle.dataset(), known, joint, level)
    if not sampling.is_sample:
        return {}
    if goes_by_blocks(handle, in_memory):
        large = large_sample(handle, in_memory)
        found = _of_sample(large.part, known, joint, level)
        return large.with_note(found, texts.INPUTS_IN_MEMORY)
    return _of_sample(drawn_runs(handle), known, joint, level)


def _of_sample(
    runs: BlockedRuns, events: Sequence[JointEvent], joint: JointDistribution, level: float
) -> OutputStatistics:
    outputs = sorted(set[str]().union(*(event.outputs for event in events)))
    samples = samples_of(runs, outputs)
    known = [event_sample(event, samples, level) for event in events]
    inputs = ScoredInputs.of(joint)
    rows = [inputs.estimates(partial(sample_sensitivities, *each)) for each in known]
    found = dict(sensitivity_arrays(events, rows, inputs, level))
    indices = [dict(zip(s.inputs, event_first_order(s, o), strict=True)) for s, o in known]
    found["event_first_order"] = _index_array(events, indices, inputs, level)
    return _with_counts(found, runs)


def _of_rare_event(
    runs: xr.Dataset, events: Sequence[JointEvent], joint: JointDistribution, level: float
) -> OutputStatistics:
    """Estimate the same of the event that a design was made for, from the states that show it."""
    rare = rare_event(runs)
    same = [each for each in events if rare and each.condition == str(rare.event)][:1]
    if rare is None or not same or not rare.method.sensitivities:
        return {}
    scores: EventScores = resolve(rare.method.sensitivities)(runs, rare.event, level)
    inputs = ScoredInputs.of(joint)
    rows = [inputs.estimates(scores.sensitivities)]
    found = dict(sensitivity_arrays(same, rows, inputs, level))
    return _with_counts(found, LoadedDataset(runs))


def _index_array(
    events: Sequence[JointEvent],
    indices: Sequence[Mapping[str, Estimate]],
    inputs: ScoredInputs,
    level: float,
) -> xr.DataArray:
    """Return first-order indices along the events and the inputs."""
    name = "first-order Sobol' indices of events"
    rows = [[of_event[each] for each in inputs.names] for of_event in indices]
    return event_array(rows, event_coordinates(events), inputs.names, name, level)


def _with_counts(found: OutputStatistics, runs: BlockedRuns) -> OutputStatistics:
    counts = run_counts(runs)
    return {name: array.assign_attrs(counts) for name, array in found.items()}
