"""Derived outputs: a number by a reduction or a formula, and whether a run has one at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.formulas import Formula
from uqpen.core.model import Category, Output
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.core.variables import DerivedOutput, Reduction, Variable


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


@dataclass(frozen=True)
class ReducedOutput(DerivedOutput):
    """Output that follows from a field by a reduction."""

    field: Output
    reduction: Reduction

    @property
    def source(self) -> str:
        return self.field.name

    def values(self, found: Arrays, is_ok: BoolArray) -> FloatArray:
        whole = found[self.field.name]
        has_field = is_ok & np.isfinite(whole.reshape(len(whole), -1)[:, 0])
        values = np.full(len(whole), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):  # such a run is lost, with a reason
            values[has_field] = self.reduction.reduce(whole[has_field], self.field)
        return values


@dataclass(frozen=True)
class FormulaOutput(DerivedOutput):
    """Output that follows from numbers by a formula, or the category of whether it has a value."""

    formula: Formula

    @property
    def source(self) -> str:
        return self.formula.text

    def values(self, found: Arrays, is_ok: BoolArray) -> FloatArray:
        # Copies: a library of array operations may round by how an array lies in memory.
        columns = {name: np.array(found[name][is_ok], np.float64) for name in self.formula.names}
        values = np.full(len(is_ok), np.nan)
        numbers = self.formula.values(columns)
        values[is_ok] = np.isnan(numbers) if self.output.categories else numbers
        return values


def formula_outputs(
    name: str, formula: Formula, named: Sequence[Variable]
) -> tuple[DerivedOutput, ...]:
    """Return the output of a formula, and its companion where some runs may lack a number.

    It is shown in the unit of the first of the variables that has its dimension.
    """
    absent = f"{formula.text} is not finite"
    alike = [each.preferred_unit for each in named if each.unit == formula.unit]
    shown = next((unit for unit in alike if not scale(unit).offset), formula.unit)
    if alike and not formula.is_computed:
        shown = alike[0]
    is_difference = formula.is_computed
    title = formula.text
    output = Output(name, formula.unit, title, shown, absent=absent, is_difference=is_difference)
    found = FormulaOutput(output, formula)
    if not formula.may_fail and not any(isinstance(each, Output) and each.absent for each in named):
        return (found,)
    return found, FormulaOutput(_companion(name, title, absent), formula)


def _companion(name: str, title: str, absent: str) -> Output:
    categories = (Category("occurs", "occurs"), Category("absent", absent))
    title = f"occurrence of {title}"
    return Output(name + _OCCURS, DIMENSIONLESS, title, categories=categories)


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
    found = ReducedOutput(output, field, reduction)
    if not absent:
        return (found,)
    companion = _companion(name, title, absent)
    return found, ReducedOutput(companion, field, Occurrence(reduction))
