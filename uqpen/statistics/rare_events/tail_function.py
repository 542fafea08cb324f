"""Probability beyond each value of an output, from the levels of subset simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import REPLICATE
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.statistics.rare_events.replicate_interval import half_width_of_logarithm
from uqpen.statistics.rare_events.subset_probability import Level, subset_levels

__all__ = ["TailFunction"]


@dataclass(frozen=True, eq=False)
class TailFunction:
    """Probabilities of all replicates beyond values of the output of an event with one limit.

    Values are those of the output, times -1 where the event lies below its limit. The probability
    beyond a value is that of the deepest level that the value reaches, times the share of the
    states of this level that lie beyond the value.

    Parameters
    ----------
    values : ndarray, shape (value,)
        Those of all states, ascending.
    completed : ndarray, shape (replicate, value)
        Probability beyond each value, given that a run completes.
    lowest, largest : ndarray, shape (replicate, value)
        The same where no failed run lies beyond it, and where all do.
    """

    values: FloatArray
    completed: FloatArray
    lowest: FloatArray
    largest: FloatArray

    @classmethod
    def of(cls, runs: xr.Dataset, event: LimitState) -> TailFunction | None:
        """Follow the chains of all replicates; None where a replicate has no draw that counts."""
        outcomes, replicate = event.outcomes(runs), runs[REPLICATE].values
        (limit,) = event.limits
        sign = 1.0 if limit.is_above else -1.0
        values = sign * runs[limit.output].values
        by_replicate = []
        for number in np.unique(replicate):
            members = np.flatnonzero(replicate == number)
            if not (levels := subset_levels(runs, outcomes, event, members)):
                return None
            by_replicate.append(levels)
        known = [
            values[each.states.runs[~each.states.missing]]
            for levels in by_replicate
            for each in levels
        ]
        at = np.unique(np.concatenate(known))
        tables = [_probabilities(levels, values, at) for levels in by_replicate]
        beyond = np.array([each[0] for each in tables])
        missing = np.array([each[1] for each in tables])
        with np.errstate(divide="ignore", invalid="ignore"):
            completed = np.where(missing < 1, beyond / (1 - missing), np.nan)
        return cls(at, completed, beyond, beyond + missing)

    def quantile(self, probability: float) -> float:
        """Return the first value beyond which a probability or less lies; NaN if none is known."""
        return self._first(self.completed.mean(axis=0) <= probability)

    def bounds(self, probability: float, level: float) -> tuple[float, float, bool]:
        """Return the values whose probability beyond has a given one in its interval.

        Parameters
        ----------
        probability : float
        level : float
            Two-sided.

        Returns
        -------
        lower, upper : float
            NaN for an end that the runs do not show.
        is_met : bool
            Whether all replicates have states beyond both ends.
        """
        lower = self._first(_ends(self.lowest, level, -1) <= probability)
        upper = self._first(_ends(self.largest, level, +1) <= probability)
        furthest = np.nanmax([lower, upper, -math.inf])
        beyond = self.completed[
            :, min(np.searchsorted(self.values, furthest), len(self.values) - 1)
        ]
        return lower, upper, bool((beyond > 0).all())

    def _first(self, condition: BoolArray) -> float:
        """Return the first value from which on a condition holds; NaN at the end of all states.

        Beyond the last states nothing is known of the probability.
        """
        holds = np.logical_and.accumulate(condition[::-1])[::-1]
        is_known = holds & (self.completed > 0).any(axis=0)
        return float(self.values[is_known.argmax()]) if is_known.any() else math.nan


def _probabilities(
    levels: list[Level], values: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the probability beyond each value, and that of a failed run, in one replicate."""
    beyond, missing = np.empty(len(at)), np.empty(len(at))
    start = 0
    for number, level in enumerate(levels):
        states = level.states
        own = np.sort(values[states.runs[~states.missing]])
        # The next level begins at the least of its states.
        stop = len(at)
        if number + 1 < len(levels):
            following = levels[number + 1].states
            reached = values[following.runs[~following.missing]]
            if reached.size:
                stop = int(np.searchsorted(at, reached.min()))
        stop = max(stop, start)
        count = own.size - np.searchsorted(own, at[start:stop], side="right")
        beyond[start:stop] = level.probability * count / len(states.runs)
        missing[start:stop] = level.probability * states.missing.mean()
        start = stop
    return beyond, missing


def _ends(table: FloatArray, level: float, sign: int) -> FloatArray:
    """Return an end of the interval of the probability beyond each value.

    It is 0 where a replicate has no state beyond a value: what is found there has no interval.
    """
    is_met = (table > 0).all(axis=0)
    met = table[:, is_met]
    ends = np.zeros(table.shape[1])
    ends[is_met] = met.mean(axis=0) * np.exp(sign * half_width_of_logarithm(met, level))
    return ends
