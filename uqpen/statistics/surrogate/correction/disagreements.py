"""Probabilities and quantiles from the runs at which a surrogate is on the wrong side of a value.

A probability is that of the surrogate, plus the probability that the output alone is on the side,
minus the probability that the surrogate alone is. Bonett and Price give the interval of such a
difference, which keeps its coverage where the runs show no disagreement at all.

References
----------
Bonett, D. G. & Price, R. M. (2012). J. Educ. Behav. Stat. 37, 479-488.
Woodruff, R. S. (1952). J. Am. Stat. Assoc. 47, 635-646.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.intervals import ratio_error
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = ["CorrectedCdf", "CorrectedProbability", "bonett_price", "corrected_probability"]


@dataclass(frozen=True, eq=False)
class CorrectedProbability:
    """Probabilities with their bounds, of any one shape."""

    value: FloatArray
    lower: FloatArray
    upper: FloatArray


def bonett_price(
    gained: FloatArray, lost: FloatArray, runs: int, level: float
) -> tuple[FloatArray, FloatArray]:
    """Return centre and half-width of the interval of a difference of paired probabilities.

    Parameters
    ----------
    gained, lost : ndarray
        Numbers of runs where the event happened by the model alone, and by the surrogate alone.
    runs : int
    level : float
        Two-sided.
    """
    one, other = (gained + 1) / (runs + 2), (lost + 1) / (runs + 2)
    variance = (one + other - (one - other) ** 2) / (runs + 2)
    return one - other, special.ndtri(0.5 + level / 2) * np.sqrt(variance)


def corrected_probability(
    runs: CorrectionRuns,
    events: BoolArray,
    predicted: BoolArray,
    drawn: BoolArray,
    lost: BoolArray,
) -> CorrectedProbability:
    """Estimate the probability of an event; missing runs may have had it or not.

    Parameters
    ----------
    runs : CorrectionRuns
    events, predicted : ndarray of bool, shape (run,)
        Whether it happened at each run, by the model and by the run's fit.
    drawn : ndarray of bool, shape (fold, draw)
        Whether it happened at each draw, by each fold's fit.
    lost : ndarray of bool, shape (lost,)
        Whether it happened at the missing runs, by their fits.
    """
    pooled = runs.pooled(drawn)
    error, _ = ratio_error(pooled, runs.draw_replicate, runs.draw_replicates)
    return _with_bounds(
        runs,
        np.asarray(pooled.mean()),
        np.asarray((events & ~predicted).sum()),
        np.asarray((predicted & ~events).sum()),
        np.asarray(lost.sum()),
        np.asarray(error),
    )


def _with_bounds(
    runs: CorrectionRuns,
    share: FloatArray,
    gained: FloatArray,
    lost: FloatArray,
    lost_events: FloatArray,
    error: FloatArray,
) -> CorrectedProbability:
    """Return probabilities with bounds: those of the surrogate, and the disagreements."""
    value = np.clip(share + (gained - lost) / runs.size, 0.0, 1.0)
    total = runs.size + runs.lost
    noise = special.ndtri(0.5 + runs.level / 2) * error
    # The missing runs are against the surrogate, all one way and all the other.
    least, half_below = bonett_price(gained, lost + lost_events, total, runs.level)
    most, half_above = bonett_price(gained + (runs.lost - lost_events), lost, total, runs.level)
    lower = share + least - np.hypot(half_below, noise)
    upper = share + most + np.hypot(half_above, noise)
    return CorrectedProbability(
        value,
        np.minimum(np.maximum(lower, 0.0), value),
        np.maximum(np.minimum(upper, 1.0), value),
    )


@dataclass(frozen=True, eq=False)
class CorrectedCdf:
    """The corrected distribution function at every value where it may change."""

    runs: CorrectionRuns

    @cached_property
    def _grid(self) -> FloatArray:
        """All values of the output, ascending: of runs, predictions and draws."""
        runs = self.runs
        return np.unique(np.concatenate([runs.values, runs.predictions, runs.draws.ravel()]))

    @cached_property
    def _at_grid(self) -> CorrectedProbability:
        return self.at(self._grid)

    @cached_property
    def _share_at_grid(self) -> FloatArray:
        """The distribution function of the corrected estimate, made to ascend."""
        return np.maximum.accumulate(self._at_grid.value)

    def surrogate_share(self, values: FloatArray) -> FloatArray:
        """Return the distribution function of the surrogate at some values."""
        below = [
            np.searchsorted(np.sort(draws), values, side="right") / len(draws)
            for draws in self.runs.draws
        ]
        return self.runs.pooled(np.array(below))

    def at(self, values: FloatArray) -> CorrectedProbability:
        """Return the probability of lying at or below each value, with pointwise bounds."""
        runs = self.runs
        by_model, by_fit, by_both, lost = (
            np.searchsorted(np.sort(each), values, side="right")
            for each in (
                runs.values,
                runs.predictions,
                np.maximum(runs.values, runs.predictions),
                runs.lost_predictions,
            )
        )
        share = self.surrogate_share(values)
        gained, only_fit = by_model - by_both, by_fit - by_both
        return _with_bounds(runs, share, gained, only_fit, lost, self._draws_error(values))

    def _draws_error(self, values: FloatArray) -> FloatArray:
        """Return the error of the surrogate's distribution function from its draws."""
        runs = self.runs
        count = runs.draw_replicates
        sizes = np.bincount(runs.draw_replicate)
        shares = np.empty((count, len(values)))
        for number in range(count):
            rows = runs.draw_replicate == number
            below = [
                np.searchsorted(np.sort(draws[rows]), values, side="right") / sizes[number]
                for draws in runs.draws
            ]
            shares[number] = runs.pooled(np.array(below))
        return shares.std(axis=0, ddof=1) / np.sqrt(count)

    def quantile(self, probability: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return quantiles with bounds: all values whose interval has the probability.

        A bound is NaN where the interval has it beyond all values.

        Parameters
        ----------
        probability : ndarray, shape (probability,)
        """
        grid, found = self._grid, self._at_grid
        value = grid[np.searchsorted(self._share_at_grid, probability).clip(0, len(grid) - 1)]
        # The first value with an upper bound of at least the probability. Before the first value
        # of all, the bounds are those of no run below.
        highest = np.maximum.accumulate(found.upper)
        first = np.searchsorted(highest, probability).clip(0, len(grid) - 1)
        before = self.at(np.array([-np.inf])).upper[0]
        lower = np.where(probability > before, grid[first], np.nan)
        # The first value from which on the lower bound is above the probability.
        least = np.minimum.accumulate(found.lower[::-1])[::-1]
        last = np.searchsorted(least, probability, side="right")
        upper = np.where(last < len(grid), grid[last.clip(0, len(grid) - 1)], np.nan)
        return value, np.minimum(lower, value), np.maximum(upper, value)
