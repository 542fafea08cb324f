"""Largest and smallest values of a field, and where on a curve they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.derived import Reduction
from uqpen.core.model import Output
from uqpen.reductions.places import CoordinateReduction, along

__all__ = ["Maximum", "Minimum", "PlaceOfMaximum", "PlaceOfMinimum"]


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
class PlaceOfMinimum(CoordinateReduction):
    """Coordinate of the smallest value of a curve, the first of several."""

    def title(self, field: Output) -> str:
        return f"{along(field)} of the smallest {field.title}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return np.array(field.dims[0].values)[np.nanargmin(values, axis=1)]


def _places(values: FloatArray) -> tuple[int, ...]:
    """Return the axes besides that of the runs."""
    return tuple(range(1, values.ndim))
