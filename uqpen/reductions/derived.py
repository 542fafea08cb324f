"""Derived outputs of a reduction: its number, its place, and whether a run has one at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Category, Output
from uqpen.core.units import DIMENSIONLESS
from uqpen.core.variables import DerivedOutput, Reduction


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


# Behind the name of an output that some runs may lack: the name of its companion.
_OCCURS = "_occurs"


@dataclass(frozen=True)
class Occurrence(Reduction):
    """Category of a run: whether another reduction finds a number in it."""

    of: Reduction  # the other one

    def unit(self, field: Output) -> str:
        return DIMENSIONLESS

    def display_unit(self, field: Output) -> str:
        return DIMENSIONLESS

    def title(self, field: Output) -> str:
        return f"occurrence of {self.of.title(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return np.isnan(self.of.reduce(values, field)).astype(np.float64)


def derived_outputs(name: str, field: Output, reduction: Reduction) -> tuple[DerivedOutput, ...]:
    """Return the output of a reduction, and its companion where some runs may lack a number.

    The companion, ``<name>_occurs``, has two categories, and so counts the runs without a number.
    """
    absent = reduction.absence(field)
    title, shown = reduction.title(field), reduction.display_unit(field)
    output = Output(
        name,
        reduction.unit(field),
        title,
        shown,
        absent=absent,
        is_difference=reduction.is_difference,
    )
    found = DerivedOutput(output, field.name, reduction)
    if not absent:
        return (found,)
    occurrence = Occurrence(reduction)
    categories = (Category("occurs", "occurs"), Category("absent", absent))
    title = occurrence.title(field)
    companion = Output(name + _OCCURS, DIMENSIONLESS, title, categories=categories)
    return found, DerivedOutput(companion, field.name, occurrence)
