"""Simultaneous bands of the mean curve and of quantile curves, over all places of a field."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import BOUND, INTERVAL_LEVEL
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import quantile_estimates
from uqpen.statistics.fields.at_each_place import ScalarAnalysis, at_each_place
from uqpen.statistics.fields.band_places import (
    BandPlaces,
    band_places,
    mean_band_places,
    reason_without_band,
)
from uqpen.statistics.fields.deviations import Influence, deviation_blocks
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.fields.simultaneous_level import simultaneous_level
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["mean_band", "quantile_band"]


def mean_band(
    field: FieldSample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate the mean of a field with a band that holds at all places at once.

    Yields
    ------
    name : str
        ``mean_band``.
    estimate : DataArray
        Along the dimensions of the field and ``bound``. The attribute ``pointwise_level`` is the
        level at each place.

    Notes
    -----
    A place where few runs decide the variance has no bounds.
    """
    places = mean_band_places(field, reason_without_band(field.runs))
    level = _level(field, places, lambda values, _: values)
    array = _at_level(sample_moments, field, quantity, level)
    yield "mean_band", _band(array, field, places, level)


def quantile_band(
    field: FieldSample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate the requested quantiles of a field, each with a band that holds at all places.

    Yields
    ------
    name : str
        ``quantile_band``.
    estimate : DataArray
        Along the dimensions of the field, ``probability`` and ``bound``. The attribute
        ``pointwise_level`` is the level at each place, by probability.
    """
    places = band_places(field, reason_without_band(field.runs))
    array = _at_level(quantile_estimates, field, quantity, field.runs.level)
    curves = array.values[..., 0].reshape(len(places.reasons), -1).T
    levels = [_level(field, places, partial(_is_below, curve)) for curve in curves]
    if places.covered.size:
        alone = [replace(quantity, quantiles=(p,)) for p in quantity.quantiles]
        array = _widened(
            array,
            [
                _at_level(quantile_estimates, field, one, level)
                for one, level in zip(alone, levels, strict=True)
            ],
        )
    yield "quantile_band", _band(array, field, places, np.array(levels))


def _level(field: FieldSample, places: BandPlaces, influence: Influence) -> float:
    blocks = deviation_blocks(field, places.covered, influence)
    return simultaneous_level(field.runs, (deviations for _, deviations in blocks))


def _is_below(curve: FloatArray, values: FloatArray, places: IntArray) -> BoolArray:
    return values <= curve[places]


def _at_level(
    analysis: ScalarAnalysis, field: FieldSample, quantity: QuantityOfInterest, level: float
) -> xr.DataArray:
    """Return the first statistic of an analysis at each place, with intervals at a level."""
    at_level = replace(field, runs=replace(field.runs, level=level))
    return next(at_each_place(analysis, at_level, quantity, most=1))[1]


def _widened(array: xr.DataArray, wide: Sequence[xr.DataArray]) -> xr.DataArray:
    """Return the intervals of several quantiles with the wider bounds of each, and their texts.

    The error over replicates may suffice at the lower of the levels alone. The formula in its place
    at the higher one may be narrower at an end. NaN stays: it is an end that does not exist.
    """
    values = np.concatenate([each.values for each in wide], axis=-2)
    values[..., 0] = array.values[..., 0]
    values[..., 1] = np.minimum(array.values[..., 1], values[..., 1])
    values[..., 2] = np.maximum(array.values[..., 2], values[..., 2])
    texts_of_each = {
        text: (array.dims[:-1], np.concatenate([each.coords[text].values for each in wide], -1))
        for text in INTERVAL_TEXTS
    }
    return array.copy(deep=False, data=values).assign_coords(texts_of_each)


def _band(array: xr.DataArray, field: FieldSample, places: BandPlaces, level: Any) -> xr.DataArray:
    """Return the intervals at each place as a band, without bounds at places that it leaves out."""
    values = array.values.reshape(len(places.reasons), -1, 3).copy()
    method, label, note = (
        array.coords[text].values.reshape(values.shape[:2]).copy() for text in INTERVAL_TEXTS
    )
    left_out = np.setdiff1d(np.arange(len(places.reasons)), places.covered)
    values[left_out, :, 1:] = np.nan
    method[left_out] = label[left_out] = "none"
    note[left_out] = np.array(places.reasons, dtype=object)[left_out, np.newaxis]
    has_bounds = label != "none"
    for each in set(method[has_bounds]):
        method[has_bounds & (method == each)] = texts.SIMULTANEOUS.format(method=each)
    attributes = {
        **array.attrs,
        INTERVAL_LEVEL: field.runs.level,
        **places.left_out(field.dims),
    }
    if places.covered.size:
        attributes["pointwise_level"] = level
    return estimate_array(
        values,
        {str(dim): size for dim, size in array.sizes.items() if dim != BOUND},
        dict(zip(INTERVAL_TEXTS, (method, label, note), strict=True)),
        units=attributes.pop("units"),
        long_name=f"{attributes.pop('long_name')}, simultaneous bounds",
        attributes=attributes,
        coordinates={
            str(name): each.variable
            for name, each in array.coords.items()
            if name not in (*INTERVAL_TEXTS, BOUND)
        },
    )
