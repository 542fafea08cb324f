"""Tolerance bands: bands that hold a share of all curves as a whole, with confidence."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.catalogue import BAND_CONTENT
from uqpen.statistics import texts
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.fields.at_each_place import along_field
from uqpen.statistics.fields.band_places import BandPlaces, band_places, runs_too_few
from uqpen.statistics.fields.deviations import deviation_blocks, field_means
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.intervals import runs_needed, upper_rank
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel

__all__ = ["tolerance_band"]

# Content of the band that is always estimated.
_CONTENT = 0.95
# One run in so many is for the middle of the band.
_THIRD = 3


def tolerance_band(
    field: FieldSample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate the bands that hold a share of all curves, each curve at all of its places.

    One run in three, or one replicate in three, gives a mean and a standard deviation. A band is
    that mean plus and minus a multiple of that standard deviation. The furthest deviation of each
    other run, in standard deviations, is its score, and the multiple is an order statistic of the
    scores (Wilks 1941). If the same runs gave both, the band would be too narrow. A curve that ends
    counts as far as it goes.

    Yields
    ------
    name : str
        ``tolerance_band``.
    estimate : DataArray
        Along the dimensions of the field, ``band_content`` and ``bound``. The estimate is the
        middle of the band. The coordinate ``band_content_runs_needed`` is the least number of
        independent runs with a band.
    """
    runs = field.runs
    reason = texts.NOT_WEIGHTED if runs.weights is not None else runs.reason_without_intervals
    centre, others = _parts(field)
    places = band_places(centre, reason or runs_too_few(centre.runs))
    stds, scores = _scores(centre, others, places)
    contents = sorted({_CONTENT, *quantity.tolerance_interval_contents})
    needed = [_runs_needed(content, runs.level) for content in contents]
    ranks = upper_rank(others.runs.size, contents, runs.level).tolist()
    multiples = [math.nan if math.isnan(rank) else scores[int(rank) - 1] for rank in ranks]
    is_independent = runs.error_model is ErrorModel.INDEPENDENT
    how = texts.FURTHEST_DEVIATIONS, "discrete" if is_independent else "conservative"
    means = field_means(centre)
    bands = []
    for multiple, fewest in zip(multiples, needed, strict=True):
        half = multiple * stds
        band = EstimateVector(means, means - half, means + half, *how)
        needs = texts.TOLERANCE_BAND_NEEDS.format(runs=fewest)
        bands.append(band.remove_bounds_at(np.isnan(half), needs))
    for why in set(filter(None, places.reasons)):
        bands = [band.remove_bounds_at(np.array(places.reasons) == why, why) for band in bands]
    array = EstimateVector.stack(bands).to_array(
        BAND_CONTENT,
        units=quantity.output.unit,
        long_name=f"band that holds curves of {quantity.output.title} with a probability",
        coordinates=_content_coordinates(contents, needed),
        level=runs.level,
    )
    yield "tolerance_band", along_field(array, field).assign_attrs(places.left_out(field.dims))


def _parts(field: FieldSample) -> tuple[FieldSample, FieldSample]:
    """Return the runs for the middle of a band, and the others for its width.

    The runs of a replicate stay together: they know of each other.
    """
    runs = field.runs
    is_replicated = runs.error_model is ErrorModel.REPLICATED
    group = runs.replicate if is_replicated else np.arange(runs.size)
    is_middle = group % _THIRD == 0
    return _chosen(field, is_middle), _chosen(field, ~is_middle)


def _chosen(field: FieldSample, mask: BoolArray) -> FieldSample:
    runs = field.runs
    return replace(field, runs=replace(runs, values=runs.values[mask], used=runs.used[mask]))


def _runs_needed(content: float, level: float) -> int:
    """Return the least number of independent runs; two in three of them have scores."""
    return math.ceil(runs_needed(content, level) * _THIRD / (_THIRD - 1))


def _scores(
    centre: FieldSample, others: FieldSample, places: BandPlaces
) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviation at each place, and the ascending scores of the other runs."""
    stds = np.full(len(places.reasons), math.nan)
    scores = np.zeros(others.runs.size)
    means = field_means(centre)
    for block, deviations in deviation_blocks(centre, places.covered, lambda values, _: values):
        runs = centre.exists[:, block].sum(axis=0)
        stds[block] = np.sqrt((deviations**2).sum(axis=0) / (runs - 1))
        distances = np.abs(others.matrix[:, block] - means[block]) / stds[block]
        np.fmax(scores, np.fmax.reduce(distances, axis=1), out=scores)
    return stds, np.sort(scores)


def _content_coordinates(contents: list[float], needed: list[int]) -> dict[str, Any]:
    """Return the contents as coordinates, with the least numbers of runs."""
    described = {"units": "1", "long_name": "probability that the band holds a curve"}
    of_runs = {"units": "1", "long_name": texts.RUNS_NEEDED_FOR_BAND}
    return {
        BAND_CONTENT: (BAND_CONTENT, np.array(contents), described),
        f"{BAND_CONTENT}_runs_needed": (BAND_CONTENT, needed, of_runs),
    }
