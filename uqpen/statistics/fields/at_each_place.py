"""Statistics at each place of a field, by the analysis of a scalar output."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.labels import BOUND
from uqpen.statistics.fields.field_sample import FieldSample, field_coordinates
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

__all__ = ["at_each_place"]

ScalarAnalysis = Callable[[Sample, QuantityOfInterest], Iterable[tuple[str, xr.DataArray]]]


def at_each_place(
    analysis: ScalarAnalysis, field: FieldSample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Apply the analysis of a scalar output to the values of a field at each place.

    Yields
    ------
    name : str
        A statistic of the analysis.
    estimate : DataArray
        Along the dimensions of the field, then as of a scalar output.
    """
    scalar = replace(quantity, output=replace(quantity.output, dims=(), may_end=False))
    found: dict[str, dict[int, xr.DataArray]] = {}
    for group in field.samples():
        for position, place in enumerate(group.places.tolist()):
            for name, array in analysis(group.at(position), scalar):
                found.setdefault(name, {})[place] = array
    for name, by_place in found.items():
        yield name, _stacked([by_place[place] for place in sorted(by_place)], field)


def _stacked(arrays: list[xr.DataArray], field: FieldSample) -> xr.DataArray:
    """Return the arrays of all places as one along the dimensions of the field."""
    first = arrays[0]
    own = {str(dim): size for dim, size in first.sizes.items() if dim != BOUND}
    coordinates = {
        str(name): each.variable
        for name, each in first.coords.items()
        if name not in (*INTERVAL_TEXTS, BOUND)
    }
    attributes = {k: v for each in arrays for k, v in each.attrs.items()}
    return estimate_array(
        np.stack([array.values for array in arrays]),
        {**field.sizes, **own},
        {
            text: np.stack([np.asarray(array.coords[text].values, object) for array in arrays])
            for text in INTERVAL_TEXTS
        },
        units=attributes.pop("units"),
        long_name=attributes.pop("long_name"),
        attributes=attributes,
        coordinates={**field_coordinates(field.dims), **coordinates},
    )
