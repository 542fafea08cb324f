"""Sensitivities of the probability of a rare event, from the last level of subset simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import REPLICATE
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.event_sensitivity.sample_sensitivity import (
    InputScores,
    PairOfEstimates,
    SensitivityEstimates,
)
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.rare_events.subset_probability import Level, subset_levels
from uqpen.statistics.weights import effective_sizes

_FEWEST_REPLICATES = 3


@dataclass(frozen=True, eq=False)
class SubsetScores:
    """First and last levels of all replicates of a design, in which inputs have scores.

    The scores are those of the runs, so states that stand at the same run count it again. The
    scatter of the replicates holds that dependence.
    """

    runs: xr.Dataset  # all runs of the design
    # The independent draws and the last level of each replicate.
    levels: tuple[tuple[Level, Level], ...]
    level: float  # confidence level of the intervals
    reason: str = ""  # why there are no estimates; empty where there are

    @classmethod
    def of(cls, runs: xr.Dataset, event: LimitState, level: float) -> SubsetScores:
        """Follow the chains of all replicates."""
        outcomes, replicate = event.outcomes(runs), runs[REPLICATE].values
        found = []
        for number in np.unique(replicate):
            members = np.flatnonzero(replicate == number)
            if not (levels := subset_levels(runs, outcomes, event, members)):
                return cls(runs, (), level, texts.NO_ADMISSIBLE_REPLICATE)
            found.append((levels[0], levels[-1]))
        reason = "" if all(last.states.occurs.any() for _, last in found) else texts.NOT_MET_BY_ALL
        return cls(runs, tuple(found), level, reason)

    def sensitivities(self, name: str, scores: InputScores) -> SensitivityEstimates:
        """Estimate the sensitivities to the distribution of an input.

        Parameters
        ----------
        name : str
            The input.
        scores : InputScores
            Its scores.
        """
        if self.reason:
            return SensitivityEstimates.without_values(self.reason)
        of_runs = scores(self.runs[name].values)
        rows = [_Replicate.of(of_runs, *each) for each in self.levels]
        return SensitivityEstimates(
            self._pair(rows, is_relative=False),
            self._pair(rows, is_relative=True),
            float(min(each.effective_runs for each in rows) * len(rows)),
        )

    def _pair(self, rows: list[_Replicate], *, is_relative: bool) -> PairOfEstimates:
        """Return the mean over the replicates, or its ratio to that of the probability."""
        value, _ = _mean_and_half(rows, "completed", self.level, is_relative=is_relative)
        if len(rows) < _FEWEST_REPLICATES:
            reason = texts.FEW_REPLICATES_OF_SCORES.format(replicates=_FEWEST_REPLICATES)
            none = [Estimate.without_bounds(each, reason) for each in value.tolist()]
            return PairOfEstimates(*none)
        low, below = _mean_and_half(rows, "lowest", self.level, is_relative=is_relative)
        high, above = _mean_and_half(rows, "highest", self.level, is_relative=is_relative)
        method = texts.SCORES_OVER_REPLICATES
        if any(last.states.missing.any() for _, last in self.levels):
            method = texts.FOR_ANY_OUTCOME.format(method=method)
        ends = zip(value.tolist(), (low - below).tolist(), (high + above).tolist(), strict=True)
        return PairOfEstimates(*(Estimate(*each, method, "nominal") for each in ends))


@dataclass(frozen=True)
class _Replicate:
    """Derivatives of the probability and the probability itself, shape (3,), in one replicate.

    Of completed runs, and with the smallest and the largest derivatives that the outcomes of the
    failed runs leave possible.
    """

    completed: FloatArray
    lowest: FloatArray
    highest: FloatArray
    effective_runs: float

    @classmethod
    def of(cls, of_runs: FloatArray, first: Level, last: Level) -> _Replicate:
        centre = of_runs[:, first.states.runs].mean(axis=1, keepdims=True)
        states = last.states
        own = of_runs[:, states.runs] - centre
        share = last.probability / len(states.runs)
        known = (own * states.occurs).sum(axis=1)
        parts = own[:, states.missing]
        size = states.missing.sum()
        probability = share * states.occurs.sum()
        lowest = share * (known + np.minimum(parts, 0.0).sum(axis=1))
        highest = share * (known + np.maximum(parts, 0.0).sum(axis=1))
        missing = last.probability * size / len(states.runs)
        completed = np.append(share * known, probability) / (1 - missing)
        ends = np.append(lowest, probability), np.append(highest, probability)
        sizes = effective_sizes(np.abs(_once(own, states.runs, states.occurs)))
        return cls(completed, ends[0], ends[1], float(sizes.min()))


def _once(own: FloatArray, runs: IntArray, occurs: BoolArray) -> FloatArray:
    """Return the sum of the scores of the event at each distinct run."""
    distinct, place = np.unique(runs, return_inverse=True)
    return np.array([np.bincount(place, each * occurs, len(distinct)) for each in own])


def _mean_and_half(
    rows: list[_Replicate], which: str, level: float, *, is_relative: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the mean of a derivative, or its ratio to the probability, and its half-width."""
    table = np.array([getattr(each, which) for each in rows])
    derivative, probability = table[:, :2], table[:, 2:]
    number = len(rows)
    if is_relative:
        mean = derivative.mean(axis=0) / probability.mean(axis=0)
        scatter = (derivative - mean * probability) / probability.mean(axis=0)
    else:
        mean = derivative.mean(axis=0)
        scatter = derivative - mean
    if number < 2:
        return mean, np.full(2, math.nan)
    error = np.sqrt((scatter**2).sum(axis=0) / (number - 1) / number)
    return mean, student_quantile(number - 1, level) * error
