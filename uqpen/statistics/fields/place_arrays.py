"""Estimates at all places of a field, as estimate arrays."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr

from uqpen.core.labels import INPUT
from uqpen.core.model import Dimension
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.fields.field_sample import field_coordinates
from uqpen.statistics.sensitivity.input_measures import input_coordinate

__all__ = ["input_place_array"]


def input_place_array(
    rows: Sequence[Sequence[Estimate]],
    dims: Sequence[Dimension],
    inputs: Sequence[str],
    long_name: str,
    level: float,
) -> xr.DataArray:
    """Return estimates as an estimate array along the dimensions of a field and ``input``.

    Parameters
    ----------
    rows : sequence of sequence of Estimate
        For each place, one for each input.
    dims : sequence of Dimension
        Those of the field.
    inputs : sequence of str
        Names of the inputs.
    long_name : str
        Meaning of the estimates.
    level : float
        Confidence level of their intervals.
    """
    sizes = {each.name: len(each.values) for each in dims}
    return Estimate.array(
        [estimate for row in rows for estimate in row],
        {**sizes, INPUT: len(inputs)},
        units="1",
        long_name=long_name,
        coordinates={**field_coordinates(tuple(dims)), **input_coordinate(inputs)},
        level=level,
    )
