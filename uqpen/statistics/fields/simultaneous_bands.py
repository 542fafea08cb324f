"""Simultaneous bands of the mean curve and of quantile curves, over all places of a field."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.catalogue import PROBABILITY
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import quantile_estimate, sample_quantile
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.fields.band_places import (
    LEFT_OUT,
    BandPlaces,
    band_places,
    reason_without_band,
)
from uqpen.statistics.fields.deviations import Influence, deviation_blocks
from uqpen.statistics.fields.field_sample import FieldSample, field_coordinates
from uqpen.statistics.fields.simultaneous_level import simultaneous_level
from uqpen.statistics.moments.sample_moments import mean_estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample
from uqpen.statistics.sample_shape import SampleShape

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
    """
    places = band_places(field, reason_without_band(field.runs))
    level = _level(field, places, lambda values, _: values)

    def estimated(sample: Sample) -> list[Estimate]:
        sample = replace(sample, level=level)
        return [mean_estimate(sample, SampleShape(sample))]

    yield (
        "mean_band",
        Estimate.grid(
            _at_places(field, places, estimated),
            field.sizes,
            units=quantity.output.unit,
            long_name=f"mean of {quantity.output.title}, simultaneous bounds",
            coordinates=field_coordinates(field.dims),
            level=field.runs.level,
        ).assign_attrs(_attributes(field, places, level)),
    )


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
    probabilities = quantity.quantiles
    curves = _quantiles(field, probabilities)
    levels = [_level(field, places, partial(_is_below, curve)) for curve in curves]

    def estimated(sample: Sample) -> list[Estimate]:
        pairs = zip(probabilities, levels, strict=True)
        return [_simultaneous_quantile(sample, p, level) for p, level in pairs]

    described = {"units": "1", "long_name": "probability of lying below the quantile"}
    yield (
        "quantile_band",
        Estimate.grid(
            _at_places(field, places, estimated),
            {**field.sizes, PROBABILITY: len(probabilities)},
            units=quantity.output.unit,
            long_name=f"quantiles of {quantity.output.title}, simultaneous bounds",
            coordinates={
                **field_coordinates(field.dims),
                PROBABILITY: (PROBABILITY, np.array(probabilities), described),
            },
            level=field.runs.level,
        ).assign_attrs(_attributes(field, places, np.array(levels))),
    )


def _simultaneous_quantile(sample: Sample, probability: float, level: float) -> Estimate:
    """Return a quantile with the interval at a higher level, no narrower than at its own."""
    wide = quantile_estimate(replace(sample, level=level), probability)
    if sample.error_model is not ErrorModel.REPLICATED:
        return wide
    # Few replicates may show the error at the lower of the levels alone. Another formula, which has
    # the other's place there, may be narrower. NaN stays: it is an end that does not exist.
    narrow = quantile_estimate(sample, probability)
    lower = float(np.minimum(wide.lower, narrow.lower))
    return replace(wide, lower=lower, upper=float(np.maximum(wide.upper, narrow.upper)))


def _level(field: FieldSample, places: BandPlaces, influence: Influence) -> float:
    blocks = deviation_blocks(field, places.covered, influence)
    return simultaneous_level(field.runs, (deviations for _, deviations in blocks))


def _is_below(curve: FloatArray, values: FloatArray, places: IntArray) -> BoolArray:
    return values <= curve[places]


def _quantiles(field: FieldSample, probabilities: Sequence[float]) -> FloatArray:
    """Return quantile curves, shape (probability, place)."""
    curves = np.empty((field.matrix.shape[1], len(probabilities)))
    for group in field.samples():
        for position, place in enumerate(group.places.tolist()):
            curves[place] = sample_quantile(group.at(position), probabilities)
    return curves.T


def _at_places(
    field: FieldSample, places: BandPlaces, estimated: Callable[[Sample], Sequence[Estimate]]
) -> list[Estimate]:
    """Return the estimates at all places, flattened; without bounds where the band has none."""
    found: dict[int, list[Estimate]] = {}
    for group in field.samples():
        for position, place in enumerate(group.places.tolist()):
            reason = places.reasons[place]
            found[place] = [
                Estimate.without_bounds(each.value, reason)
                if reason
                else replace(each, method=texts.SIMULTANEOUS.format(method=each.method))
                if each.label != "none"
                else each
                for each in estimated(group.at(position))
            ]
    return [each for place in sorted(found) for each in found[place]]


def _attributes(field: FieldSample, places: BandPlaces, level: Any) -> dict[str, Any]:
    """Return the attributes of a band: its level at each place, the places that it leaves out."""
    left_out = places.left_out(field.dims)
    attributes = {"pointwise_level": level} if places.covered.size else {}
    return attributes | ({LEFT_OUT: left_out} if left_out else {})
