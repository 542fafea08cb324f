"""Tolerance bands: bands that hold a share of all curves as a whole, with confidence."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import BAND_CONTENT
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import sample_quantile
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.fields.field_sample import FieldSample, along_field
from uqpen.statistics.fields.simultaneous_bands import BandPlaces, band_places, runs_too_few
from uqpen.statistics.intervals import runs_needed, upper_rank
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel

# The shape of a tolerance band: its median curve, and how far it goes to either side of it.

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
    """A family of bands around a median curve; a multiple of its distances gives one of them."""

    # With below, above: (place,): the median curve, and the distances to the low and the high
    # quantile; NaN where no run reaches.
    median: FloatArray
    below: FloatArray
    above: FloatArray
    # Whether the distance of a value y below a median m is m ln(m / y), and not m - y. Both are
    # equal near the median, but no multiple of the former leads to zero.
    is_positive: bool
    # (place,): whether few runs decide the spread at a place. Its distances are then the largest
    # ones of the field, but for those of the logarithm.
    is_widest: BoolArray

    @classmethod
    def of(cls, field: FieldSample, *, is_positive: bool) -> BandShape:
        """Return the shape that the runs of a field have."""
        quantiles = np.full((field.matrix.shape[1], len(_PROBABILITIES)), np.nan)
        for places, runs in field.samples():
            quantiles[places] = sample_quantile(runs, _PROBABILITIES)
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


# Content of the band that is always estimated.
_CONTENT = 0.95
# One run in so many is for the shape of the band.
_THIRD = 3
# Places that are taken together, so that memory is bounded.
_PLACES = 256


def tolerance_band(
    field: FieldSample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate the bands that hold a share of all curves, each curve at all of its places.

    One run in three, or one replicate in three, gives a median and the distances from it to a low
    and to a high quantile. A band goes to a multiple of these distances. The least multiple that
    holds each other run is its score, and the band's multiple is an order statistic of the scores
    (Wilks 1941). If the same runs gave both, the band would be too narrow. A curve that ends counts
    as far as it goes. If all runs are positive, so is the band. Where few runs decide the spread,
    the distances are those of the place that has the largest ones.

    Yields
    ------
    name : str
        ``tolerance_band``.
    estimate : DataArray
        Along the dimensions of the field, ``band_content`` and ``bound``. The estimate is the
        median of the runs that give the distances. The coordinate ``band_content_runs_needed`` is
        the least number of independent runs with a band.
    """
    runs = field.runs
    reason = texts.NOT_WEIGHTED if runs.weights is not None else runs.reason_without_intervals
    first, others = _parts(field)
    places = band_places(first, reason or runs_too_few(first.runs))
    shape = BandShape.of(first, is_positive=_is_positive(field, places))
    scores = _scores(shape, others, places)
    contents = sorted({_CONTENT, *quantity.tolerance_interval_contents})
    needed = [_runs_needed(content, runs.level) for content in contents]
    ranks = upper_rank(others.runs.size, contents, runs.level).tolist()
    multiples = [math.nan if math.isnan(rank) else scores[int(rank) - 1] for rank in ranks]
    is_independent = runs.error_model is ErrorModel.INDEPENDENT
    label = "discrete" if is_independent else "conservative"
    note = np.where(shape.is_widest, texts.WIDEST_DISTANCES, "")
    how = texts.MULTIPLES_OF_DISTANCES, label, note
    bands = [
        Estimate(shape.median, *shape.ends(multiple), *how).remove_bounds_at(
            np.isnan(multiple), texts.TOLERANCE_BAND_NEEDS.format(runs=fewest)
        )
        for multiple, fewest in zip(multiples, needed, strict=True)
    ]
    for why in set(filter(None, places.reasons)):
        bands = [band.remove_bounds_at(np.array(places.reasons) == why, why) for band in bands]
    array = Estimate.stacked(bands).to_array(
        BAND_CONTENT,
        units=quantity.output.unit,
        long_name=f"band that holds curves of {quantity.output.title} with a probability",
        coordinates=_content_coordinates(contents, needed),
        level=runs.level,
    )
    yield (
        "tolerance_band",
        along_field(array, field.output, runs.level).assign_attrs(places.left_out(field.dims)),
    )


def _parts(field: FieldSample) -> tuple[FieldSample, FieldSample]:
    """Return the runs for the shape of a band, and the others for its multiple.

    The runs of a replicate stay together: they know of each other.
    """
    runs = field.runs
    is_replicated = runs.error_model is ErrorModel.REPLICATED
    group = runs.replicate if is_replicated else np.arange(runs.size)
    is_shape = group % _THIRD == 0
    return _chosen(field, is_shape), _chosen(field, ~is_shape)


def _chosen(field: FieldSample, mask: BoolArray) -> FieldSample:
    runs = field.runs
    return replace(field, runs=replace(runs, values=runs.values[mask], used=runs.used[mask]))


def _runs_needed(content: float, level: float) -> int:
    """Return the least number of independent runs; two in three of them have scores."""
    return math.ceil(runs_needed(content, level) * _THIRD / (_THIRD - 1))


def _is_positive(field: FieldSample, places: BandPlaces) -> bool:
    """Return whether all runs are positive at all places of a band.

    If as many curves were not as a band may lose, a run would show it: almost certainly.
    """
    lowest = np.fmin.reduce(field.matrix, axis=0, initial=np.inf)
    return bool((lowest[places.covered] > 0).all())


def _scores(shape: BandShape, others: FieldSample, places: BandPlaces) -> FloatArray:
    """Return the ascending scores of the runs that did not make the shape."""
    scores = np.zeros(others.runs.size)
    for start in range(0, len(places.covered), _PLACES):
        block = places.covered[start : start + _PLACES]
        multiples = shape.multiples(others.matrix[:, block], block)
        np.fmax(scores, np.fmax.reduce(multiples, axis=1), out=scores)
    return np.sort(scores)


def _content_coordinates(contents: list[float], needed: list[int]) -> dict[str, Any]:
    """Return the contents as coordinates, with the least numbers of runs."""
    described = {"units": "1", "long_name": "probability that the band holds a curve"}
    of_runs = {"units": "1", "long_name": texts.RUNS_NEEDED_FOR_BAND}
    return {
        BAND_CONTENT: (BAND_CONTENT, np.array(contents), described),
        f"{BAND_CONTENT}_runs_needed": (BAND_CONTENT, needed, of_runs),
    }
