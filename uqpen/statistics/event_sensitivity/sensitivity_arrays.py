"""Sensitivities of the probabilities of events to all inputs, as estimate arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import xarray as xr

from uqpen.core.statistic_dimensions import SENSITIVITY_EVENT
from uqpen.core.units import scale
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.event_sensitivity.input_scores import InputScores
from uqpen.statistics.event_sensitivity.sensitivity_estimates import SensitivityEstimates
from uqpen.statistics.joint_event import JointEvent
from uqpen.statistics.sensitivity.input_measures import event_array

__all__ = ["EventScores", "ScoredInputs", "event_coordinates", "sensitivity_arrays"]

# Estimates the sensitivities to an input, by its name and its scores.
Estimator = Callable[[str, InputScores], SensitivityEstimates]


class EventScores(Protocol):
    """Runs of a design for a rare event, in which inputs have scores."""

    def sensitivities(self, name: str, scores: InputScores) -> SensitivityEstimates:
        """Estimate the sensitivities to the distribution of an input."""


@dataclass(frozen=True, eq=False)
class ScoredInputs:
    """The random inputs of a study, as far as their distributions can move.

    Parameters
    ----------
    entries : tuple of RandomInput
        The random inputs.
    scores : dict of str to InputScores or None
        By input; None where its mean cannot move by itself.
    dependence : str
        Reason why no input has sensitivities; empty where the inputs are independent.
    """

    entries: tuple[RandomInput, ...]
    scores: dict[str, InputScores | None]
    dependence: str = ""

    @classmethod
    def of(cls, joint: JointDistribution) -> ScoredInputs:
        """Return the inputs of a joint distribution."""
        if not joint.is_independent:
            return cls(joint.random, {}, texts.MOVED_ALONE)
        known = [each for each in joint.random if each.variable.name not in joint.unloaded]
        scores = {each.variable.name: InputScores.of(each.distribution) for each in known}
        return cls(joint.random, scores)

    def estimates(self, estimate: Estimator) -> list[SensitivityEstimates]:
        """Return the sensitivities to each input, or why there are none."""
        return [self._estimates(entry.variable.name, estimate) for entry in self.entries]

    def _estimates(self, name: str, estimate: Estimator) -> SensitivityEstimates:
        scores = self.scores.get(name)
        if scores is None:
            return SensitivityEstimates.without_values(self.dependence or texts.MOVED_TOGETHER)
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
    return estimate.with_note(estimate.note, texts.OF_SI_VALUE.format(of="input", **units))


def sensitivity_arrays(
    events: Sequence[JointEvent],
    rows: Sequence[Sequence[SensitivityEstimates]],
    inputs: ScoredInputs,
    level: float,
) -> Iterator[tuple[str, xr.DataArray]]:
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
