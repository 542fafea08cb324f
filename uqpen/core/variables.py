"""What goes into a model and comes out of it: names, units, what a value can be."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

__all__ = ["POSITIVE", "Bounds", "Category", "Input", "Output", "Variable"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Bounds:
    """The values that an input can have at all, in its SI unit.

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
        """Which of the values lie inside; NaN never does."""
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
    """A quantity that goes into a model or comes out of it.

    Parameters
    ----------
    name : str
        What a study file, an archive and a script call it.
    unit : str
        Its coherent SI unit, in which the program keeps it.
    long_name : str
        What a person reads; the name itself where it is empty.
    display_unit : str
        The unit to show it in where a study names none; `unit` where it is empty.
    """

    name: str
    unit: str
    long_name: str = ""
    display_unit: str = ""

    @property
    def title(self) -> str:
        """What a person reads."""
        return self.long_name or self.name.replace("_", " ")

    @property
    def preferred_unit(self) -> str:
        """The unit to show it in."""
        return self.display_unit or self.unit


@dataclass(frozen=True)
class Input(Variable):
    """A variable that goes in.

    Parameters
    ----------
    default : float, optional
        Its value in SI units where a study does not give it.
    bounds : Bounds
        What it can be at all; a run outside is inadmissible.
    """

    default: float | None = None
    bounds: Bounds = field(default_factory=Bounds)


@dataclass(frozen=True)
class Category:
    """One value of an output that has kinds, not numbers.

    Parameters
    ----------
    flag : str
        One word, as CF asks of ``flag_meanings``.
    label : str
        What a person reads.
    """

    flag: str
    label: str


@dataclass(frozen=True)
class Output(Variable):
    """A variable that comes out.

    Parameters
    ----------
    categories : sequence of Category
        Not empty for an output with kinds; its values are then positions in this sequence.
    """

    categories: tuple[Category, ...] = ()
