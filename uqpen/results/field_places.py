"""Places along the dimensions of a field, from a user's text, and as text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, field_dimensions
from uqpen.core.errors import QuantityError, UnknownNameError, toml_text
from uqpen.core.lookup import choices
from uqpen.core.quantities import parse_quantity
from uqpen.core.units import DIMENSIONLESS, scale

__all__ = ["FieldPlace", "cut_coordinates", "cut_text", "find_place", "label_at_place"]


class FieldPlace(NamedTuple):
    """A coordinate along a dimension of a field.

    Attributes
    ----------
    dimension : str
        The dimension.
    position : int
        The position among the coordinates.
    text : str
        The coordinate, such as ``time = 10 day``.
    asked : str
        What a user asked for, where no coordinate is; else empty.
    """

    dimension: str
    position: int
    text: str
    asked: str = ""

    @property
    def remark(self) -> str:
        """Sentence on a place that is not where it was asked for; else empty."""
        return f"{self.text} is the nearest to {self.asked}" if self.asked else ""


def find_place(field: xr.DataArray, text: str) -> FieldPlace:
    """Return the coordinate of a field that is nearest to a text of a user.

    Parameters
    ----------
    field : DataArray
        The field over runs.
    text : str
        Such as ``"time=10 day"``; without a unit it is that of the study.

    Raises
    ------
    UnknownNameError
        If the field has no such dimension.
    QuantityError
        If it is no quantity, or lies outside the coordinates.
    """
    name, _, asked = (part.strip() for part in text.partition("="))
    along = field_dimensions(field)
    if name not in along:
        known = choices(name, along) if along else "it is a single number or category"
        raise UnknownNameError(f'{field.name} has no dimension "{name}"; {known}')
    coordinate = field[name]
    values = coordinate.values
    if not asked:
        raise QuantityError(toml_text(text), f"a place, such as {name}=1")
    value = _si_value(asked, str(coordinate.attrs.get("display_units", DIMENSIONLESS)))
    if not values[0] <= value <= values[-1]:
        first, last = (coordinate_text(coordinate, end) for end in values[[0, -1]])
        raise QuantityError(toml_text(text), f"{first} to {last.partition('= ')[2]}")
    position = int(np.abs(values - value).argmin())
    is_there = np.isclose(values[position], value, rtol=1e-9, atol=0)
    found = coordinate_text(coordinate, values[position])
    return FieldPlace(name, position, found, "" if is_there else asked)


def _si_value(text: str, unit: str) -> float:
    """Return a quantity in SI units; a plain number is in the unit given."""
    try:
        return scale(unit).to_si(float(text))
    except ValueError:
        return parse_quantity(text, unit).value


def cut_coordinates(variable: xr.DataArray) -> Iterator[xr.DataArray]:
    """Yield the coordinates of the place to which a field was cut; none of another output."""
    for name, coordinate in variable.coords.items():
        if not coordinate.dims and "units" in coordinate.attrs:
            yield coordinate.rename(name)


def label_at_place(name: str, variable: xr.DataArray) -> str:
    """Return the name of an output, and the place to which it was cut, if it was."""
    place = cut_text(variable)
    return f"{name} at {place}" if place else name


def cut_text(variable: xr.DataArray) -> str:
    """Return the place to which a field was cut, such as ``time = 10 day``; empty without one."""
    return ", ".join(coordinate_text(each, each.item()) for each in cut_coordinates(variable))
