"""Inputs and outputs of a model: names, units, possible values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray

__all__ = ["POSITIVE", "Bounds", "Category", "Input", "Output", "Variable"]


@dataclass(frozen=True)
class Bounds:
    """Range of possible values of an input, in its SI unit.

    Parameters
    ----------
    lower, upper : float
        The ends of the interval.
    lower_included, upper_included : bool
        Whether the ends belong to it.
    """

    lower: float = -math.inf
    upper: float = math.inf
    lower_included: bool = False
    upper_included: bool = False

    def contain(self, values: FloatArray) -> BoolArray:
        """Return a mask of the values inside the bounds; NaN is never inside."""
        above = values >= self.lower if self.lower_included else values > self.lower
        below = values <= self.upper if self.upper_included else values < self.upper
        inside: BoolArray = above & below & np.isfinite(values)
        return inside

    def __str__(self) -> str:
        limits = []
        if self.lower > -math.inf:
            limits.append(f"{'>=' if self.lower_included else '>'} {self.lower:g}")
        if self.upper < math.inf:
            limits.append(f"{'<=' if self.upper_included else '<'} {self.upper:g}")
        return " and ".join(limits) or "finite"


POSITIVE = Bounds(lower=0.0)


@dataclass(frozen=True)
class Variable:
    """Quantity that a model takes or returns.

    Parameters
    ----------
    name : str
        Name in a study file, an archive and a script.
    unit : str
        Its coherent SI unit, in which the program keeps it.
    long_name : str
        Name for display; the name itself where it is empty.
    display_unit : str
        The unit to show it in where a study names none; `unit` where it is empty.
    """

    name: str
    unit: str
    long_name: str = ""
    display_unit: str = ""

    @property
    def title(self) -> str:
        """Name for display."""
        return self.long_name or self.name.replace("_", " ")

    @property
    def preferred_unit(self) -> str:
        """Unit for display."""
        return self.display_unit or self.unit


@dataclass(frozen=True)
class Input(Variable):
    """Input variable of a model.

    Parameters
    ----------
    default : float, optional
        Its value in SI units where a study does not give it.
    bounds : Bounds
        Its possible values; a run outside is inadmissible.
    """

    default: float | None = None
    bounds: Bounds = field(default_factory=Bounds)


@dataclass(frozen=True)
class Category:
    """Category of a categorical output: a word for CF's ``flag_meanings``, a label for display."""

    flag: str
    label: str


@dataclass(frozen=True)
class Output(Variable):
    """Output variable of a model; values of a categorical one are positions in its categories."""

    categories: tuple[Category, ...] = ()
