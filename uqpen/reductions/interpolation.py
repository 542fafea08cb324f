"""Value of a field at a place, interpolated between the coordinates around it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.derived import Reduction
from uqpen.core.model import Output

__all__ = ["At"]


@dataclass(frozen=True)
class At(Reduction):
    """Value at one place, linear between neighbouring coordinates.

    Parameters
    ----------
    places : tuple of tuple
        The name of each dimension of the field with a coordinate in its SI unit.
    """

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
