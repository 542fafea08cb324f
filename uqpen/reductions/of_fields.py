"""Reductions of a field: its extremes, its integral, its value at a place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.core.units import DIMENSIONLESS, are_convertible, product, scale
from uqpen.core.variables import Reduction
from uqpen.reductions.derived import CoordinateReduction, along

# Largest and smallest values of a field, and where on a curve they are.


@dataclass(frozen=True)
class Maximum(Reduction):
    """Largest value; of a curve that ends, up to its end."""

    def title(self, field: Output) -> str:
        return f"largest {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        found: FloatArray = np.nanmax(values, axis=_places(values))
        return found


@dataclass(frozen=True)
class Minimum(Reduction):
    """Smallest value; of a curve that ends, up to its end."""

    def title(self, field: Output) -> str:
        return f"smallest {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        found: FloatArray = np.nanmin(values, axis=_places(values))
        return found


@dataclass(frozen=True)
class PlaceOfMaximum(CoordinateReduction):
    """Coordinate of the largest value of a curve, the first of several."""

    def title(self, field: Output) -> str:
        return f"{along(field)} of the largest {field.title}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return np.array(field.dims[0].values)[np.nanargmax(values, axis=1)]


@dataclass(frozen=True)
class PlaceOfLast(CoordinateReduction):
    """Last coordinate that a curve reaches."""

    def title(self, field: Output) -> str:
        return f"last {along(field)} of {field.title}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return np.array(field.dims[0].values)[np.isfinite(values).sum(axis=1) - 1]


@dataclass(frozen=True)
class PlaceOfMinimum(CoordinateReduction):
    """Coordinate of the smallest value of a curve, the first of several."""

    def title(self, field: Output) -> str:
        return f"{along(field)} of the smallest {field.title}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return np.array(field.dims[0].values)[np.nanargmin(values, axis=1)]


def _places(values: FloatArray) -> tuple[int, ...]:
    """Return the axes besides that of the runs."""
    return tuple(range(1, values.ndim))


# Integral and mean of a field, by the trapezoidal rule along each dimension.


@dataclass(frozen=True)
class Integral(Reduction):
    """Integral over all dimensions; of a curve that ends, up to its end."""

    is_difference = True

    def mistakes(self, field: Output) -> Iterator[tuple[str, str]]:
        for dimension in field.dims:
            if len(dimension.values) < 2:
                yield f"a single coordinate of {dimension.name}", "two coordinates or more"

    def unit(self, field: Output) -> str:
        return reduce(product, (dimension.unit for dimension in field.dims), field.unit)

    def display_unit(self, field: Output) -> str:
        factors = [each.preferred_unit for each in (field, *field.dims)]
        if any(scale(each).offset for each in factors):
            return self.unit(field)
        named = [each for each in factors if each != DIMENSIONLESS]
        shown = " ".join(f"({each})" if "/" in each else each for each in named) or DIMENSIONLESS
        return shown if are_convertible(shown, self.unit(field)) else self.unit(field)

    def title(self, field: Output) -> str:
        return f"integral of {field.title} over {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        for dimension in reversed(field.dims):
            values = _trapezoid(values, np.array(dimension.values))
        return values


@dataclass(frozen=True)
class Mean(Reduction):
    """Mean over all dimensions, weighted by lengths; of a curve that ends, up to its end."""

    def title(self, field: Output) -> str:
        return f"mean {field.title} over {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        for dimension in reversed(field.dims):
            coordinates, first = np.array(dimension.values), values[..., :1]
            length = _trapezoid(np.where(np.isfinite(values), 1.0, np.nan), coordinates)
            # From the first value on, so that the mean of a constant is exact. A single place has
            # no length, and is its own mean.
            excess = _trapezoid(values - first, coordinates) / np.where(length > 0, length, 1.0)
            values = first[..., 0] + excess
        return values


def _trapezoid(values: FloatArray, coordinates: FloatArray) -> FloatArray:
    """Integrate along the last axis, over the part of it that has values."""
    # In memory run by run, so that the order of a sum depends on nothing but the run.
    values = np.ascontiguousarray(values)
    pieces = 0.5 * (values[..., 1:] + values[..., :-1]) * np.diff(coordinates)
    found: FloatArray = np.nansum(pieces, axis=-1)
    return found


# Value of a field at a place, interpolated between the coordinates around it.


@dataclass(frozen=True)
class At(Reduction):
    """Value at one place, linear between neighbouring coordinates."""

    # The name of each dimension of the field with a coordinate in its SI unit.
    places: tuple[tuple[str, float], ...]

    def mistakes(self, field: Output) -> Iterator[tuple[str, str]]:
        given = dict(self.places)
        for dimension in field.dims:
            lowest, highest = dimension.values[0], dimension.values[-1]
            ends = [dimension.value_text(each) for each in (lowest, highest)]
            if dimension.name not in given:
                yield f"no {dimension.name}", f"a coordinate from {ends[0]} to {ends[1]}"
            elif not lowest <= given[dimension.name] <= highest:
                found = dimension.place_text(given[dimension.name])
                yield found, f"a coordinate from {ends[0]} to {ends[1]}"

    def title(self, field: Output) -> str:
        return f"{field.title} at {self._place(field)}"

    def absence(self, field: Output) -> str:
        return f"{field.title} ends before {self._place(field)}" if field.may_end else ""

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        given = dict(self.places)
        for dimension in reversed(field.dims):
            values = _interpolated(values, np.array(dimension.values), given[dimension.name])
        return values

    def _place(self, field: Output) -> str:
        given = dict(self.places)
        return ", ".join(
            f"{each.title} = {each.value_text(given[each.name])}" for each in field.dims
        )


def _interpolated(values: FloatArray, coordinates: FloatArray, place: float) -> FloatArray:
    """Interpolate along the last axis; at a coordinate, the value there to the bit."""
    above = int(np.searchsorted(coordinates, place))
    if coordinates[above] == place:  # what comes next may not exist
        return values[..., above]
    below = above - 1
    share = (place - coordinates[below]) / (coordinates[above] - coordinates[below])
    found: FloatArray = (1 - share) * values[..., below] + share * values[..., above]
    return found
