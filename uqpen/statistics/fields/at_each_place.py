"""Statistics at each place of a field, by the analysis of a scalar output."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import IntArray
from uqpen.core.coordinates import field_coordinates
from uqpen.core.labels import BOUND, CONDITIONAL, INTERVAL_LEVEL
from uqpen.core.model import Output
from uqpen.statistics import texts
from uqpen.statistics.estimate_vector import PLACE
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

__all__ = ["ScalarAnalysis", "along_field", "at_each_place"]

ScalarAnalysis = Callable[[Sample, QuantityOfInterest], Iterable[tuple[str, xr.DataArray]]]


def at_each_place(
    analysis: ScalarAnalysis,
    field: FieldSample,
    quantity: QuantityOfInterest,
    most: int | None = None,
) -> Iterator[tuple[str, xr.DataArray]]:
    """Apply the analysis of a scalar output to the values of a field at each place.

    Parameters
    ----------
    analysis : callable
        Takes samples of several places, too.
    field : FieldSample
        The runs of the field.
    quantity : QuantityOfInterest
        What is requested of it.
    most : int, optional
        Number of the statistics that are wanted, the first of the analysis.

    Yields
    ------
    name : str
        A statistic of the analysis.
    estimate : DataArray
        Along the dimensions of the field, then as of a scalar output.
    """
    scalar = replace(quantity, output=replace(quantity.output, dims=(), may_end=False))
    found: dict[str, list[tuple[IntArray, xr.DataArray]]] = {}
    for group in field.samples():
        for name, array in islice(analysis(group.runs, scalar), most):
            found.setdefault(name, []).append((group.places, array))
    for name, parts in found.items():
        yield name, _joined(parts, field.output, field.runs.level)


def along_field(array: xr.DataArray, output: Output, level: float) -> xr.DataArray:
    """Return an estimate array along all places as one along the dimensions of the field."""
    return _joined([(np.arange(array.sizes[PLACE]), array)], output, level)


def _joined(
    parts: list[tuple[IntArray, xr.DataArray]], output: Output, level: float
) -> xr.DataArray:
    """Return the arrays of all groups of places as one along the dimensions of the field."""
    order = np.argsort(np.concatenate([places for places, _ in parts]))
    arrays = [array for _, array in parts]
    own = {str(dim): size for dim, size in arrays[0].sizes.items() if dim not in (PLACE, BOUND)}
    coordinates = {
        str(name): each.variable
        for name, each in arrays[0].coords.items()
        if name not in (*INTERVAL_TEXTS, BOUND)
    }
    attributes: dict[str, Any] = {INTERVAL_LEVEL: level}
    if output.may_end:
        attributes[CONDITIONAL] = texts.REACHED
    return estimate_array(
        np.concatenate([array.values for array in arrays])[order],
        {**output.sizes, **own},
        {
            text: np.concatenate([array.coords[text].values for array in arrays])[order]
            for text in INTERVAL_TEXTS
        },
        units=arrays[0].attrs["units"],
        long_name=arrays[0].attrs["long_name"],
        attributes=attributes,
        coordinates={**field_coordinates(output.dims), **coordinates},
    )
