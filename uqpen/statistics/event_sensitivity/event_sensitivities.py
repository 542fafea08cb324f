"""Sensitivities of the probabilities of events to the inputs, from the runs of a design."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import SAMPLING, SENSITIVITY_EVENT
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.units import scale
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.statistics import texts
from uqpen.statistics.analyze import (
    OutputStatistics,
    drawn_runs,
    goes_by_blocks,
    large_sample,
    run_counts,
)
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.event_sensitivity.sample_sensitivity import (
    InputScores,
    SensitivityEstimates,
    sample_sensitivities,
)
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.rare_events.rare_event_probability import rare_event
from uqpen.statistics.run_samples import event_sample, samples_of
from uqpen.statistics.sensitivity.given_data import event_first_order
from uqpen.statistics.sensitivity.input_measures import event_array

# Sensitivities of the probabilities of events to all inputs, as estimate arrays.

# Estimates the sensitivities to an input, by its name and its scores.
Estimator = Callable[[str, InputScores], SensitivityEstimates]


class EventScores(Protocol):
    """Runs of a design for a rare event, in which inputs have scores."""

    def sensitivities(self, name: str, scores: InputScores) -> SensitivityEstimates:
        """Estimate the sensitivities to the distribution of an input."""


@dataclass(frozen=True, eq=False)
class ScoredInputs:
    """The random inputs of a study, as far as their distributions can move."""

    entries: tuple[RandomInput, ...]  # the random inputs
    scores: dict[str, InputScores | None]  # by input; None where its mean cannot move by itself
    # Reason why no input has sensitivities; empty where the inputs are independent.
    dependence: str = ""

    @classmethod
    def of(cls, joint: JointDistribution) -> ScoredInputs:
        """Return the inputs of a joint distribution."""
        if not joint.is_independent:
            return cls(joint.random, {}, texts.MOVED_ALONE)
        known = [each for each in joint.random if each.variable.name not in joint.unloaded]
        known = [each for each in known if not each.variable.labels]
        scores = {each.variable.name: InputScores.of(each.distribution) for each in known}
        return cls(joint.random, scores)

    def estimates(self, estimate: Estimator) -> list[SensitivityEstimates]:
        """Return the sensitivities to each input, or why there are none."""
        return [self._estimates(entry.variable.name, estimate) for entry in self.entries]

    def _estimates(self, name: str, estimate: Estimator) -> SensitivityEstimates:
        scores = self.scores.get(name)
        if scores is None:
            labels = next(e.variable.labels for e in self.entries if e.variable.name == name)
            reason = texts.CODES_WITHOUT_ORDER if labels else texts.MOVED_TOGETHER
            return SensitivityEstimates.without_values(self.dependence or reason)
        return estimate(name, scores)

    @property
    def names(self) -> list[str]:
        """Names of the inputs."""
        return [entry.variable.name for entry in self.entries]

    def elasticities(
        self, found: Sequence[SensitivityEstimates]
    ) -> tuple[list[Estimate], list[Estimate]]:
        """Return the elasticities to the mean and to the standard deviation of each input."""
        means, stds = [], []
        for entry, each in zip(self.entries, found, strict=True):
            scores = self.scores.get(entry.variable.name)
            mean, std = each.elasticities(scores, texts.MEAN_IS_0)
            means.append(_with_offset_note(mean, entry) if scores else mean)
            stds.append(std)
        return means, stds


def _with_offset_note(estimate: Estimate, entry: RandomInput) -> Estimate:
    """Return an elasticity with a note if its mean is shown from another zero."""
    if not scale(entry.display_unit).offset:
        return estimate
    units = {"si": entry.variable.unit, "unit": entry.display_unit}
    return estimate.with_note(texts.OF_SI_VALUE.format(of="input", **units))


def sensitivity_arrays(
    events: Sequence[JointEvent],
    rows: Sequence[Sequence[SensitivityEstimates]],
    inputs: ScoredInputs,
    level: float,
) -> NamedArrays:
    """Yield the sensitivities of events, along the events and the inputs.

    Yields
    ------
    name : str
        ``mean_sensitivity``, ``std_sensitivity``, ``mean_elasticity``, ``std_elasticity``, and the
        diagnostic ``sensitivity_effective_runs``.
    estimate : DataArray
        Along ``sensitivity_event``, ``input`` and ``bound``.
    """
    elasticities = [inputs.elasticities(row) for row in rows]
    columns: dict[str, tuple[str, list[list[Estimate]]]] = {
        "mean_sensitivity": (
            "change of the probability per standard deviation by which the mean of an input moves",
            [[each.changes.mean for each in row] for row in rows],
        ),
        "std_sensitivity": (
            "change of the probability per relative change of the standard deviation of an input",
            [[each.changes.std for each in row] for row in rows],
        ),
        "mean_elasticity": (
            "relative change of the probability per relative change of the mean of an input",
            [means for means, _ in elasticities],
        ),
        "std_elasticity": (
            "relative change of the probability per relative change of the standard deviation",
            [stds for _, stds in elasticities],
        ),
        "sensitivity_effective_runs": (
            "effective number of runs with the event, by their scores",
            [[_diagnostic(each) for each in row] for row in rows],
        ),
    }
    along = event_coordinates(events)
    for name, (long_name, estimates) in columns.items():
        yield name, event_array(estimates, along, inputs.names, long_name, level)


def event_coordinates(events: Sequence[JointEvent]) -> dict[str, Any]:
    """Return the coordinates along ``sensitivity_event``: the names of the events."""
    names = np.array([event.name for event in events], dtype=object)
    return {SENSITIVITY_EVENT: (SENSITIVITY_EVENT, names, {"long_name": "event"})}


def _diagnostic(found: SensitivityEstimates) -> Estimate:
    reason = texts.DIAGNOSTIC_OF_SCORES if found.effective_runs >= 0 else found.changes.mean.note
    return Estimate.without_bounds(found.effective_runs, reason)


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
