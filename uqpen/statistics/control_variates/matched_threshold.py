"""Probabilities and quantiles of a model from a stand-in, whose threshold matches the model's.

The sorted common runs of both models show which value of the stand-in corresponds to a threshold of
the model. How often the stand-in lies below that is all but known from its many runs. Runs in
which one of them lies below and the other above correct this share, with the interval of Bonett, D.
G. & Price, R. M. (2012). J. Educ. Behav. Stat. 37, 479-488, for a difference of paired
probabilities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray
from uqpen.statistics.control_variates.group_runs import GroupRuns
from uqpen.statistics.surrogate.correction.disagreements import bonett_price

__all__ = ["MatchedThresholds"]


class _Probabilities(NamedTuple):
    """Probabilities with their bounds."""

    value: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True, eq=False)
class MatchedThresholds:
    """Values of a model and of its closest stand-in at common points, and of that at all points.

    Parameters
    ----------
    model, stand_in : ndarray, shape (run,)
        Two runs at least, sorted by the model. The stand-in rises with it, its sign changed where
        it falls.
    stand_in_everywhere : ndarray, shape (point,)
        Sorted.
    level : float
        Confidence level of the intervals.
    """

    model: FloatArray
    stand_in: FloatArray
    stand_in_everywhere: FloatArray
    level: float

    @classmethod
    def of(cls, groups: Sequence[GroupRuns], level: float) -> MatchedThresholds:
        """Return the thresholds of the stand-in that is closest in the ranks of shared runs."""
        ranks = np.argsort(np.argsort(groups[0].values, axis=1), axis=1)
        varies = np.ptp(groups[0].values, axis=1) > 0
        correlations = np.where(varies, np.corrcoef(ranks)[0], 0.0)
        closest = 1 + int(np.argmax(np.abs(correlations[1:])))
        sign = -1.0 if correlations[closest] < 0 else 1.0
        both = [group.values for group in groups if group.models[0] and group.models[closest]]
        all_points = [group.values[closest] for group in groups if group.models[closest]]
        model, stand_in = np.concatenate(both, axis=1)[[0, closest]]
        order = np.argsort(model, kind="stable")
        everywhere = np.sort(sign * np.concatenate(all_points))
        return cls(model[order], sign * stand_in[order], everywhere, level)

    def probability_below(self, threshold: float, *, is_strict: bool) -> tuple[float, float, float]:
        """Return the probability of lying below a threshold, with its bounds.

        Parameters
        ----------
        threshold : float
            In the unit of the output.
        is_strict : bool
            True if a value at the threshold does not lie below it.
        """
        model = self.model < threshold if is_strict else self.model <= threshold
        matched = self._matched(threshold)
        stand_in = self.stand_in <= matched
        found = self._corrected(
            self._share(matched), (model & ~stand_in).sum(), (~model & stand_in).sum()
        )
        return float(found.value), float(found.lower), float(found.upper)

    def quantile(self, probability: float) -> tuple[float, float, float]:
        """Return a quantile with its bounds; NaN for a bound that the runs do not have.

        The interval has all values up to which the probability may be that of the quantile
        (Woodruff, R. S. (1952). J. Am. Stat. Assoc. 47, 635-646).
        """
        thresholds, found = self._curve
        rising = np.maximum.accumulate
        value = np.interp(probability, rising(found.value), thresholds)
        lower = np.interp(probability, rising(found.upper), thresholds, left=np.nan)
        # The largest value whose lower bound is not above the probability.
        never_above = np.minimum.accumulate(found.lower[::-1])[::-1]
        upper = np.interp(probability, never_above, thresholds, right=np.nan)
        return float(value), float(min(lower, value)), float(max(upper, value))

    @cached_property
    def _curve(self) -> tuple[FloatArray, _Probabilities]:
        """Thresholds, and the probability of lying below each, with its bounds.

        Each common value stands there twice: as the end of the thresholds that have one run less
        below, and as the beginning of those that have it.
        """
        runs = len(self.model)
        share = self._share(np.sort(self.stand_in))
        # How many sorted runs lie below before one does so: for equal values, the first of them.
        model, stand_in = (
            np.searchsorted(np.sort(values), values, side="left")
            for values in (self.model, self.stand_in)
        )
        only_model, only_stand_in = (
            np.cumsum(
                np.bincount(one[one < other], minlength=runs)
                - np.bincount(other[one < other], minlength=runs)
            )
            for one, other in ((model, stand_in), (stand_in, model))
        )
        twice = [np.repeat(each, 2) for each in (self.model, share, only_model, only_stand_in)]
        thresholds, shares = twice[0][1:-1], twice[1][1:-1]
        return thresholds, self._corrected(shares, *(each[:-2] for each in twice[2:]))

    def _matched(self, threshold: float) -> float:
        """Return the value of the stand-in that corresponds to a threshold of the model."""
        sorted_stand_in = np.sort(self.stand_in)
        inside = np.clip(threshold, self.model[0], self.model[-1])
        spread = float(np.ptp(self.model))
        slope = float(np.ptp(self.stand_in)) / spread if spread > 0 else 0.0
        matched = np.interp(inside, self.model, sorted_stand_in) + slope * (threshold - inside)
        return float(matched)

    def _share(self, values: FloatArray | float) -> FloatArray:
        """Return the share of all points at which the stand-in is not above values."""
        count = np.searchsorted(self.stand_in_everywhere, values, side="right")
        return np.asarray(count / len(self.stand_in_everywhere))

    def _corrected(
        self, share: FloatArray, only_model: FloatArray, only_stand_in: FloatArray
    ) -> _Probabilities:
        """Return shares of the stand-in as probabilities of the model, with their bounds.

        Parameters
        ----------
        share : ndarray
            Of all points at which the stand-in lies below a value.
        only_model, only_stand_in : ndarray
            Numbers of common runs in which only one of them lies below its value.
        """
        runs, points = len(self.model), len(self.stand_in_everywhere)
        difference, half = bonett_price(only_model, only_stand_in, runs, self.level)
        noise = special.ndtri(0.5 + self.level / 2) * np.sqrt(share * (1 - share) / points)
        centre, half = share + difference, np.hypot(half, noise)
        value = np.clip(share + (only_model - only_stand_in) / runs, 0.0, 1.0)
        lower, upper = np.clip(centre - half, 0.0, 1.0), np.clip(centre + half, 0.0, 1.0)
        return _Probabilities(value, np.minimum(lower, value), np.maximum(upper, value))
