"""Distribution function and quantiles of an output, by its surrogate and corrected by real runs.

References
----------
Woodruff, R. S. (1952). J. Am. Stat. Assoc. 47, 635-646.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.correction.disagreements import (
    CorrectedProbability,
    Counts,
    FoldCounts,
    with_bounds,
)

__all__ = ["CorrectedCdf", "corrected_half_spread"]


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

    def surrogate_share(self, values: FloatArray) -> FloatArray:
        """Return the distribution function of the surrogate at some values."""
        by_set = self.runs.shares @ self._shares_by_set(values).swapaxes(0, 1)
        return self._pooled(by_set)

    def at(self, values: FloatArray) -> CorrectedProbability:
        """Return the distribution function with pointwise bounds at ascending values."""
        counts, drawn = self._counts(values), self._shares_by_set(values)
        return self._bounded(drawn, counts, counts.uses_surrogate(self.runs))

    def _counts(self, values: FloatArray) -> FoldCounts:
        runs, folds = self.runs, len(self.runs.draws)
        both = np.maximum(runs.values, runs.predictions)

        def counts(weights: FloatArray | None, missing_weights: FloatArray | None) -> FoldCounts:
            by_model, by_fit, by_both = (
                _counts(outputs, runs.fold, weights, folds, values)
                for outputs in (runs.values, runs.predictions, both)
            )
            missing = runs.missing_predictions, runs.missing_fold, missing_weights
            return FoldCounts(by_model, by_fit, by_both, _counts(*missing, folds, values))

        return FoldCounts.weighted(runs, counts)

    def _bounded(
        self, drawn: FloatArray, counts: FoldCounts, is_used: BoolArray
    ) -> CorrectedProbability:
        """Return bounds from shares of draws and counts of runs; each fold uses its fit or not."""
        weights = self.runs.shares[:, None] * is_used
        by_set = np.einsum("kv,ksv->sv", weights, drawn)
        error = by_set.std(axis=0, ddof=1) / np.sqrt(len(by_set))
        return with_bounds(self.runs, self._pooled(by_set), counts, is_used, error)

    def _pooled(self, by_set: FloatArray) -> FloatArray:
        """Return the mean over all draws of what is known by set."""
        draws = self.runs.draw_replicate
        return np.asarray(np.bincount(draws) @ by_set / len(draws))

    def _shares_by_set(self, values: FloatArray) -> FloatArray:
        """Return the distribution function of each fit in each set of draws, at ascending values.

        Its shape is (fold, set, value).
        """
        runs, sets = self.runs, self.runs.draw_replicates
        shares = np.empty((len(runs.draws), sets, len(values)))
        for share, row in zip(shares, runs.draws, strict=True):
            # A draw counts from the first value on that is not below it.
            first = np.searchsorted(values, row)
            at = np.bincount(
                runs.draw_replicate * (len(values) + 1) + first,
                minlength=sets * (len(values) + 1),
            )
            np.cumsum(at.reshape(sets, -1)[:, :-1], axis=1, out=share)
        return shares / np.bincount(runs.draw_replicate)[:, None]

    def quantile(self, probability: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return quantiles with bounds: all values whose interval has the probability.

        A bound is NaN where the interval has it beyond all values.

        Parameters
        ----------
        probability : ndarray, shape (probability,)
        """
        choices, choice_of = np.unique(self.choices(probability), axis=0, return_inverse=True)
        found = np.empty((3, len(probability)))
        # Minus infinity comes first: there, no run is below.
        grid = np.concatenate([[-np.inf], self._grid])
        counts, drawn = self._counts(grid), self._shares_by_set(grid)
        for number, choice in enumerate(choices):
            chosen = choice_of.ravel() == number
            is_used = np.broadcast_to(choice[:, None], (len(choice), len(grid)))
            bounded = self._bounded(drawn, counts, is_used)
            found[:, chosen] = _inverted(self._grid, bounded, probability[chosen])
        return found[0], found[1], found[2]

    def choices(self, probability: FloatArray) -> BoolArray:
        """Return whether each fold uses its fit for quantiles, shape (probability, fold).

        The other folds decide, at their own quantile. One choice for all values keeps an interval
        of one piece.
        """
        runs = self.runs
        if len(runs.draws) == 1:
            return np.ones((len(probability), 1), dtype=np.bool_)
        found = [
            self._counts(np.quantile(runs.values[runs.fold != number], probability)).uses_surrogate(
                runs
            )[number]
            for number in range(len(runs.draws))
        ]
        return np.array(found).T


def corrected_half_spread(runs: CorrectionRuns) -> tuple[float, float, float]:
    """Return half the 16 % to 84 % range with bounds; NaN where one of the ends has none.

    The ends have intervals of a higher level, so that both hold together at least as often as the
    level of the runs says (Bonferroni).
    """
    both = replace(runs, level=(1 + runs.level) / 2)
    value, lower, upper = CorrectedCdf(both).quantile(np.array([0.16, 0.84]))
    least, most = lower[1] - upper[0], upper[1] - lower[0]
    return float(np.diff(value)[0]) / 2, float(np.maximum(least, 0.0)) / 2, float(most) / 2


def _inverted(
    grid: FloatArray, found: CorrectedProbability, probability: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return quantiles with bounds, of a distribution function before and at values of a grid."""
    # Made to ascend, as a run at which only the surrogate is below makes it descend.
    ascending = np.maximum.accumulate(found.value[1:])
    value = grid[np.searchsorted(ascending, probability).clip(0, len(grid) - 1)]
    # The first value with an upper bound of at least the probability.
    highest = np.maximum.accumulate(found.upper[1:])
    first = np.searchsorted(highest, probability).clip(0, len(grid) - 1)
    lower = np.where(probability > found.upper[0], grid[first], np.nan)
    # The first value from which on the lower bound is above the probability.
    least = np.minimum.accumulate(found.lower[:0:-1])[::-1]
    last = np.searchsorted(least, probability, side="right")
    upper = np.where(last < len(grid), grid[last.clip(0, len(grid) - 1)], np.nan)
    return value, np.minimum(lower, value), np.maximum(upper, value)


def _counts(
    outputs: FloatArray,
    fold: IntArray,
    weights: FloatArray | None,
    folds: int,
    values: FloatArray,
) -> Counts:
    """Return how many outputs of each fold are at most each value, or what these weigh.

    The shape is (fold, value).
    """
    found = []
    for number in range(folds):
        own = fold == number
        order = np.argsort(outputs[own])
        below = np.searchsorted(outputs[own][order], values, side="right")
        if weights is not None:
            below = np.concatenate([[0.0], np.cumsum(weights[own][order])])[below]
        found.append(below)
    return np.array(found)
