"""Derived outputs: numbers that follow from a field of a run, such as its largest value."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.units import scale
from uqpen.core.variables import Output

__all__ = ["DerivedOutput", "Reduction"]


class Reduction(ABC):
    """Reduction of a field of each run to one number.

    A subclass is final and a frozen dataclass; its settings are its fields.

    Attributes
    ----------
    takes_curves_only : bool
        Whether it needs an order of the places, so that the field has one dimension.
    is_difference : bool
        Whether the number is a difference of values, so that no zero of a unit is part of it.
    """

    takes_curves_only: ClassVar[bool] = False
    is_difference: ClassVar[bool] = False

    def mistakes(self, field: Output) -> Iterator[tuple[str, str]]:
        """Yield what is wrong with a field for this reduction, and what is expected."""
        if self.takes_curves_only and len(field.dims) > 1:
            yield f"{field.name} has {len(field.dims)} dimensions", "a curve, along one dimension"

    def unit(self, field: Output) -> str:
        """Return the SI unit of the number."""
        return field.unit

    def display_unit(self, field: Output) -> str:
        """Return the unit to show the number in, where a study names none."""
        shown = field.preferred_unit
        return self.unit(field) if self.is_difference and scale(shown).offset else shown

    @abstractmethod
    def title(self, field: Output) -> str:
        """Return a name of the number for display, such as ``largest infected along time``."""

    def absence(self, field: Output) -> str:
        """Return the condition of runs without a number, in words; empty where each run has one."""
        return ""

    @abstractmethod
    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        """Reduce the field of some runs.

        Each number follows from its run alone, whatever runs stand beside it.

        Parameters
        ----------
        values : ndarray, shape (run, *dims)
            In SI units. A curve that may end is NaN after its end; its first value is there.
        field : Output
            The output that they are of.

        Returns
        -------
        ndarray, shape (run,)
            In the SI unit of `unit`. NaN where a run has no such number, see `absence`.
        """


@dataclass(frozen=True)
class DerivedOutput:
    """Output that follows from a field of the same run, after the run.

    Parameters
    ----------
    output : Output
        Its name, its unit and its categories, if any.
    source : str
        The field.
    reduction : Reduction
        The rule by which it follows.
    """

    output: Output
    source: str
    reduction: Reduction

    def values(self, whole: FloatArray, field: Output, is_ok: BoolArray) -> FloatArray:
        """Return its values in some runs; NaN in those that failed.

        Parameters
        ----------
        whole : ndarray, shape (run, *dims)
            The field, with NaN in runs that failed or are still to come.
        field : Output
            The output that they are of.
        is_ok : ndarray of bool, shape (run,)
            Whether each run has not failed.
        """
        has_field = is_ok & np.isfinite(whole.reshape(len(whole), -1)[:, 0])
        values = np.full(len(whole), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):  # such a run is lost, with a reason
            values[has_field] = self.reduction.reduce(whole[has_field], field)
        return values
