"""The shape of a tolerance band: its median curve, and how far it goes to either side of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.distribution_function.quantiles import sample_quantile
from uqpen.statistics.fields.field_sample import FieldSample

__all__ = ["BandShape"]

# The band of multiple 1 goes from the second of these quantiles to the last but one. With 0.05 and
# 0.95, bands of skewed curves are wider; with the extremes, those of heavy tails at many runs.
_PROBABILITIES = 0.0, 0.01, 0.5, 0.99, 1.0
# A distance is at least this share of the range. Else values that coincide at one end of a place
# let the band of all places grow without limit.
_LEAST_SHARE = 0.05
# Where fewer effective runs decide the variance, the runs do not show how far a curve may go. With
# 4, one band in 300 of a travelling pulse is still a thousand times as high as the pulse.
_FEWEST_EFFECTIVE_RUNS = 5


@dataclass(frozen=True, eq=False)
class BandShape:
    """A family of bands around a median curve; a multiple of its distances gives one of them.

    Parameters
    ----------
    median, below, above : ndarray, shape (place,)
        The median curve, and the distances to the low and the high quantile; NaN where no run
        reaches.
    is_positive : bool
        Whether the distance of a value y below a median m is m ln(m / y), and not m - y. Both are
        equal near the median, but no multiple of the former leads to zero.
    is_widest : ndarray of bool, shape (place,)
        Whether few runs decide the spread at a place. Its distances are then the largest ones of
        the field, but for those of the logarithm.
    """

    median: FloatArray
    below: FloatArray
    above: FloatArray
    is_positive: bool
    is_widest: BoolArray

    @classmethod
    def of(cls, field: FieldSample, *, is_positive: bool) -> BandShape:
        """Return the shape that the runs of a field have."""
        quantiles = np.full((field.matrix.shape[1], len(_PROBABILITIES)), np.nan)
        for group in field.samples():
            quantiles[group.places] = sample_quantile(group.runs, _PROBABILITIES)
        lowest, low, median, high, highest = quantiles.T
        below = _distance_below(median, low, is_positive=is_positive)
        least = _LEAST_SHARE * (highest - lowest)
        below, above = np.maximum(below, least), np.maximum(high - median, least)
        is_widest = field.effective_runs < _FEWEST_EFFECTIVE_RUNS
        if is_widest.any():
            above = np.where(is_widest, np.nanmax(above), above)
        if is_widest.any() and not is_positive:
            below = np.where(is_widest, np.nanmax(below), below)
        return cls(median, below, above, is_positive, is_widest)

    def multiples(self, values: FloatArray, places: IntArray) -> FloatArray:
        """Return the multiples whose bands end at the values at some places, shape (run, place)."""
        median = self.median[places]
        below = _distance_below(median, values, is_positive=self.is_positive)
        found: FloatArray = np.where(
            values < median, below / self.below[places], (values - median) / self.above[places]
        )
        return found

    def ends(self, multiple: float) -> tuple[FloatArray, FloatArray]:
        """Return the lower and the upper end of the band of a multiple."""
        # Where the band leaves a place out, a distance may be infinite.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            below, upper = multiple * self.below, self.median + multiple * self.above
            if not self.is_positive:
                return self.median - below, upper
            return self.median * np.exp(-below / self.median), upper


def _distance_below(median: FloatArray, values: FloatArray, *, is_positive: bool) -> FloatArray:
    """Return how far values lie below their median."""
    if not is_positive:
        return median - values
    # A place that the band leaves out may have no positive values.
    with np.errstate(divide="ignore", invalid="ignore"):
        found: FloatArray = median * np.log(median / values)
    return found
