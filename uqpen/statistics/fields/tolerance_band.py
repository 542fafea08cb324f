"""Tolerance bands: bands that hold a share of all curves as a whole, with confidence."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.statistic_dimensions import BAND_CONTENT
from uqpen.statistics import texts
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.fields.at_each_place import along_field
from uqpen.statistics.fields.band_places import BandPlaces, band_places, runs_too_few
from uqpen.statistics.fields.band_shape import BandShape
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.intervals import runs_needed, upper_rank
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel

__all__ = ["tolerance_band"]

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
        EstimateVector(shape.median, *shape.ends(multiple), *how).remove_bounds_at(
            np.isnan(multiple), texts.TOLERANCE_BAND_NEEDS.format(runs=fewest)
        )
        for multiple, fewest in zip(multiples, needed, strict=True)
    ]
    for why in set(filter(None, places.reasons)):
        bands = [band.remove_bounds_at(np.array(places.reasons) == why, why) for band in bands]
    array = EstimateVector.stack(bands).to_array(
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
