"""Dimensions of a field in words, and the coordinate of a curve as the number of a run."""

from __future__ import annotations

from uqpen.core.derived import Reduction
from uqpen.core.model import Output

__all__ = ["CoordinateReduction", "along"]


def along(field: Output) -> str:
    """Return the names of the dimensions of a field.

    >>> from uqpen.core.model import Dimension
    >>> along(Output("y", "1", dims=(Dimension("x", "m", values=(0, 1)),)))
    'x'
    """
    return " and ".join(dimension.title for dimension in field.dims)


class CoordinateReduction(Reduction):
    """Base of reductions of a curve to one of its coordinates."""

    takes_curves_only = True

    def unit(self, field: Output) -> str:
        return field.dims[0].unit

    def display_unit(self, field: Output) -> str:
        return field.dims[0].preferred_unit
