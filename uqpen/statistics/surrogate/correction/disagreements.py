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
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.intervals import ratio_error
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = ["CorrectedCdf", "CorrectedProbability", "bonett_price", "corrected_probability"]


# Numbers of runs, of one event or of several.
Counts = npt.NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class CorrectedProbability:
    """Probabilities with their bounds, of any one shape."""

    value: FloatArray
    lower: FloatArray
    upper: FloatArray


def bonett_price(
    gained: npt.ArrayLike, dropped: npt.ArrayLike, runs: int, level: float
) -> tuple[FloatArray, FloatArray]:
    """Return centre and half-width of the interval of a difference of paired probabilities.

    Parameters
    ----------
    gained, dropped : array_like
        Numbers of runs where the event happened by the model alone, and by the surrogate alone.
    runs : int
    level : float
        Two-sided.
    """
    one, other = (
        (np.asarray(each, dtype=np.float64) + 1) / (runs + 2) for each in (gained, dropped)
    )
    variance = (one + other - (one - other) ** 2) / (runs + 2)
    return one - other, special.ndtri(0.5 + level / 2) * np.sqrt(variance)


def corrected_probability(
    runs: CorrectionRuns,
    events: BoolArray,
    predicted: BoolArray,
    drawn: BoolArray,
    missing: BoolArray,
) -> CorrectedProbability:
    """Estimate the probability of an event; missing runs may have had it or not.

    Parameters
    ----------
    runs : CorrectionRuns
    events, predicted : ndarray of bool, shape (run,)
        Whether it happened at each run, by the model and by the run's fit.
    drawn : ndarray of bool, shape (fold, draw)
        Whether it happened at each draw, by each fold's fit.
    missing : ndarray of bool, shape (missing,)
        Whether it happened at the missing runs, by their fits.
    """
    pooled = runs.pooled(drawn.astype(np.float64))
    error, _ = ratio_error(pooled, runs.draw_replicate, runs.draw_replicates)
    return _with_bounds(
        runs,
        np.asarray(pooled.mean()),
        np.asarray((events & ~predicted).sum()),
        np.asarray((predicted & ~events).sum()),
        np.asarray(missing.sum()),
        error,
    )


def _with_bounds(
    runs: CorrectionRuns,
    share: FloatArray,
    gained: Counts,
    dropped: Counts,
    missing_events: Counts,
    error: FloatArray,
) -> CorrectedProbability:
    """Return probabilities with bounds: those of the surrogate, and the disagreements."""
    value = np.clip(share + (gained - dropped) / runs.size, 0.0, 1.0)
    total = runs.size + runs.missing
    noise = special.ndtri(0.5 + runs.level / 2) * error
    # The missing runs are against the surrogate, all one way and all the other.
    least, half_below = bonett_price(gained, dropped + missing_events, total, runs.level)
    most, half_above = bonett_price(
        gained + (runs.missing - missing_events), dropped, total, runs.level
    )
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
        """Values of the output, ascending: of runs, predictions, and as many draws as a fit has."""
        runs = self.runs
        drawn = np.sort(runs.draws, axis=None)[:: len(runs.draws)]
        return np.unique(np.concatenate([runs.values, runs.predictions, drawn]))

    @cached_property
    def _at_grid(self) -> CorrectedProbability:
        return self.at(self._grid)

    def surrogate_share(self, values: FloatArray) -> FloatArray:
        """Return the distribution function of the surrogate at some values."""
        return self._surrogate_share(values)[0]

    def at(self, values: FloatArray) -> CorrectedProbability:
        """Return the probability of lying at or below each value, with pointwise bounds.

        Parameters
        ----------
        values : ndarray, shape (value,)
            Ascending.
        """
        runs = self.runs
        by_model, by_fit, by_both, missing = (
            np.searchsorted(np.sort(each), values, side="right")
            for each in (
                runs.values,
                runs.predictions,
                np.maximum(runs.values, runs.predictions),
                runs.missing_predictions,
            )
        )
        share, error = self._surrogate_share(values)
        return _with_bounds(runs, share, by_model - by_both, by_fit - by_both, missing, error)

    def _surrogate_share(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the surrogate's distribution function at ascending values, and its error."""
        runs, sets, columns = self.runs, self.runs.draw_replicates, len(values) + 1
        # Each draw counts from the first value on that it does not exceed.
        first = np.searchsorted(values, runs.draws)
        at = (runs.draw_replicate * columns + first).ravel()
        parts = np.broadcast_to(runs.shares[:, None], runs.draws.shape).ravel()
        counts = (
            np.bincount(at, parts, sets * columns).reshape(sets, columns)[:, :-1].cumsum(axis=1)
        )
        sizes = np.bincount(runs.draw_replicate)
        by_set = counts / sizes[:, None]
        return counts.sum(axis=0) / sizes.sum(), by_set.std(axis=0, ddof=1) / np.sqrt(sets)

    def quantile(self, probability: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return quantiles with bounds: all values whose interval has the probability.

        A bound is NaN where the interval has it beyond all values.

        Parameters
        ----------
        probability : ndarray, shape (probability,)
        """
        grid, found = self._grid, self._at_grid
        # Made to ascend, as a run at which only the surrogate is below makes it descend.
        ascending = np.maximum.accumulate(found.value)
        value = grid[np.searchsorted(ascending, probability).clip(0, len(grid) - 1)]
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
