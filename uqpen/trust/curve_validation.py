"""Validation of a surrogate's distribution function as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import CHECKED, INTERVAL_LEVEL, MISSING, RANK, REFUSED
from uqpen.statistics.estimate import LEVEL
from uqpen.trust import verdict_texts as texts
from uqpen.trust.validation_interval import band_widening
from uqpen.trust.verdict import EstimateVerdict, designs_text, undecided

__all__ = ["validate_curve"]

Statistics = Mapping[str, xr.DataArray]


class _Band(NamedTuple):
    """Simultaneous band of a design's distribution function, a step function of its values."""

    values: FloatArray
    estimate: FloatArray
    lower: FloatArray
    upper: FloatArray
    level: float

    @classmethod
    def from_statistics(cls, statistics: Statistics) -> _Band:
        """Take the band of a design's statistics."""
        band = statistics["cdf_band"]
        level = float(band.attrs.get(INTERVAL_LEVEL, LEVEL))
        estimate, lower, upper = band.values.T
        return cls(statistics["cdf_value"].values, estimate, lower, upper, level)

    def excludes(self, values: FloatArray, ranks: FloatArray, count: int) -> BoolArray:
        """Return where a distribution function is outside, given the number of bands."""
        factor = band_widening(self.level, count)
        lower = self.estimate - factor * (self.estimate - self.lower)
        upper = self.estimate + factor * (self.upper - self.estimate)
        # Between two of its values the lower end is that of the left one.
        left = np.searchsorted(self.values, values, side="right") - 1
        low = np.where(left >= 0, lower[np.maximum(left, 0)], 0.0)
        right = np.searchsorted(self.values, values, side="left")
        high = np.where(right < len(upper), upper[np.minimum(right, len(upper) - 1)], 1.0)
        return (ranks < low) | (ranks > high)


def validate_curve(
    curve: xr.DataArray, validation_runs: Mapping[str, Statistics]
) -> EstimateVerdict:
    """Compare a distribution function with the simultaneous bands of all validation runs.

    Parameters
    ----------
    curve : DataArray
        Its values along ``rank``.
    validation_runs : mapping of str to mapping of str to DataArray
        The statistics of the same output by design.
    """
    known = {
        design: statistics
        for design, statistics in validation_runs.items()
        if "cdf_band" in statistics and not np.isnan(statistics["cdf_band"].values[:, 1:]).any()
    }
    lacking = [design for design, each in known.items() if MISSING in each["cdf_band"].attrs]
    bands = {
        design: _Band.from_statistics(statistics)
        for design, statistics in known.items()
        if design not in lacking
    }
    if not bands:
        return undecided(lacking, has_runs=bool(validation_runs))
    ranks = curve[RANK].values
    for design, band in bands.items():
        outside = band.excludes(curve.values, ranks, len(bands))
        if outside.any():
            lowest, highest = ranks[outside].min(), ranks[outside].max()
            note = texts.OUTSIDE_BAND.format(design=design, lowest=lowest, highest=highest)
            return EstimateVerdict(REFUSED, note)
    if len(bands) == 1:
        return EstimateVerdict(CHECKED, texts.INSIDE_BAND.format(design=next(iter(bands))))
    return EstimateVerdict(CHECKED, texts.INSIDE_BANDS.format(designs=designs_text([*bands])))
