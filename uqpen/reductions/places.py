"""Places of a field in words, and the coordinate as the number of a run."""

from __future__ import annotations

from uqpen.core.derived import Reduction
from uqpen.core.model import Dimension, Output
from uqpen.core.units import DIMENSIONLESS, scale

__all__ = ["CoordinateReduction", "along", "quantity_text"]


def along(field: Output) -> str:
    """Return the names of the dimensions of a field.

    >>> from uqpen.core.model import Dimension
    >>> along(Output("y", "1", dims=(Dimension("x", "m", values=(0, 1)),)))
    'x'
    """
    return " and ".join(dimension.title for dimension in field.dims)


def quantity_text(value: float, variable: Output | Dimension) -> str:
    """Return a value of an output or a dimension, with the unit that it is shown in."""
    shown = variable.preferred_unit
    number = f"{scale(shown).from_si(value):.10g}"
    return number if shown == DIMENSIONLESS else f"{number} {shown}"


class CoordinateReduction(Reduction):
    """Base of reductions of a curve to one of its coordinates."""

    takes_curves_only = True

    def unit(self, field: Output) -> str:
        return field.dims[0].unit

    def display_unit(self, field: Output) -> str:
        return field.dims[0].preferred_unit
