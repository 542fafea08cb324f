"""Integral and mean of a field, by the trapezoidal rule along each dimension."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.derived import Reduction
from uqpen.core.model import Output
from uqpen.core.units import DIMENSIONLESS, are_convertible, product, scale
from uqpen.reductions.places import along

__all__ = ["Integral", "Mean"]


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
