"""Estimates at all places of a field, as estimate arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.coordinates import field_coordinates
from uqpen.core.labels import BOUND, CONDITIONAL, INPUT
from uqpen.core.model import Output
from uqpen.statistics import texts
from uqpen.statistics.estimate_vector import EstimateVector
from uqpen.statistics.fields.at_each_place import along_field
from uqpen.statistics.sensitivity.input_measures import input_coordinate

__all__ = ["input_place_array", "joined_places"]


def input_place_array(
    estimates: EstimateVector,
    output: Output,
    inputs: Sequence[str],
    long_name: str,
    level: float,
) -> xr.DataArray:
    """Return estimates as an estimate array along the dimensions of a field and ``input``.

    Parameters
    ----------
    estimates : EstimateVector
        Of shape (place, input).
    output : Output
        The field.
    inputs : sequence of str
        Names of the inputs.
    long_name : str
        Meaning of the estimates.
    level : float
        Confidence level of their intervals.
    """
    along = input_coordinate(inputs)
    array = estimates.to_array(
        INPUT, units="1", long_name=long_name, coordinates=along, level=level
    )
    return along_field(array, output, level)


def joined_places(arrays: Sequence[xr.DataArray], output: Output) -> xr.DataArray:
    """Return the estimate arrays at all places of a field as one, along its dimensions first."""
    first = arrays[0]
    own = {str(dim): size for dim, size in first.sizes.items() if dim != BOUND}
    attributes = {key: value for each in arrays for key, value in each.attrs.items()}
    array = estimate_array(
        np.stack([each.values for each in arrays]),
        {**output.sizes, **own},
        {text: np.stack([each.coords[text].values for each in arrays]) for text in INTERVAL_TEXTS},
        units=attributes.pop("units"),
        long_name=attributes.pop("long_name"),
        attributes=attributes,
        coordinates={
            **field_coordinates(output.dims),
            **{dim: first.coords[dim].variable for dim in own},
        },
    )
    return array.assign_attrs(_condition(output))


def _condition(output: Output) -> dict[str, str]:
    return {CONDITIONAL: texts.REACHED} if output.may_end else {}
