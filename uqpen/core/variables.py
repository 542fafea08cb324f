"""Inputs and outputs of a model: names, units, possible values, dimensions."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.catalogue import CATALOGUE, NAMES_IN_USE
from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.labels import CODE_LABELS, NAME
from uqpen.core.lookup import choices
from uqpen.core.units import DIMENSIONLESS, scale

if TYPE_CHECKING:
    import xarray as xr

# Dimensions of an output at most, beside that of the runs.
MOST_DIMENSIONS = 3


@dataclass(frozen=True)
class Bounds:
    """Range of possible values of an input, in its SI unit."""

    lower: float = -math.inf  # the lower end
    upper: float = math.inf  # the upper end
    lower_included: bool = False  # whether the end belongs to it
    upper_included: bool = False  # whether the end belongs to it

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
    """Quantity that a model takes or returns."""

    name: str  # name in a study file, an archive and a script
    unit: str  # its coherent SI unit, in which the program keeps it
    long_name: str = ""  # name for display; the name itself where it is empty
    # The unit to show it in where a study names none; `unit` where it is empty.
    display_unit: str = ""

    @property
    def title(self) -> str:
        """Name for display."""
        return self.long_name or self.name.replace("_", " ")

    @property
    def preferred_unit(self) -> str:
        """Unit for display."""
        return self.display_unit or self.unit

    @property
    def attributes(self) -> dict[str, str]:
        """Units and name, as attributes of a variable of a dataset."""
        return {
            "units": self.unit,
            "display_units": self.preferred_unit,
            "long_name": self.title,
        }

    def value_text(self, value: float) -> str:
        """Return a value in SI units as text, in the unit for display."""
        unit = "" if self.preferred_unit == DIMENSIONLESS else f" {self.preferred_unit}"
        return f"{scale(self.preferred_unit).from_si(value):.10g}{unit}"


@dataclass(frozen=True)
class Input(Variable):
    """Input variable of a model.

    Parameters
    ----------
    default : float, optional
        Its value in SI units where a study does not give it.
    bounds : Bounds
        Its possible values; a run outside is inadmissible.
    labels : tuple of str
        The texts that its values 0, 1, … stand for, which have no order; empty for a number.
    """

    default: float | None = None
    bounds: Bounds = field(default_factory=Bounds)
    labels: tuple[str, ...] = ()

    def to_own(self, values: FloatArray, unit: str) -> Any:
        """Return SI values as a model's code takes them: texts of labels, or numbers in a unit."""
        if not self.labels:
            return scale(unit).from_si(values)
        return np.asarray(np.array(self.labels, dtype=object)[np.asarray(values).astype(int)])

    def label_code(self, label: object) -> float:
        """Return the value that stands for one of its labels; QuantityError for another text."""
        if label in self.labels:
            return float(self.labels.index(str(label)))
        expected = f"a label of {self.name}; {choices(str(label), self.labels)}"
        raise QuantityError(toml_text(label), expected)

    @property
    def unordered_labels(self) -> int:
        """Number of its labels where their order matters to polynomials and distances, else 0.

        Two labels are the same in either order, but for a sign.
        """
        return len(self.labels) if len(self.labels) > 2 else 0


def label_attributes(variable: Input) -> dict[str, Any]:
    """Return the attributes of an input whose values stand for texts, by the CF conventions."""
    if not variable.labels:
        return {}
    words = (re.sub(r"\W+", "_", label) for label in variable.labels)
    meanings = " ".join(f"{word}_{code}" for code, word in enumerate(words))
    values = np.arange(len(variable.labels), dtype=np.float64)
    labels = {CODE_LABELS: list(variable.labels)}
    return {**labels, "flag_values": values, "flag_meanings": meanings}


def code_labels(attributes: Mapping[Any, Any]) -> tuple[str, ...]:
    """Return the texts that `label_attributes` has written; none of an input of numbers."""
    return tuple(map(str, np.atleast_1d(attributes.get(CODE_LABELS, ()))))


@dataclass(frozen=True)
class Category:
    """Category of a categorical output: a word for CF's ``flag_meanings``, a label for display."""

    flag: str
    label: str


def dimension_name_problem(name: str) -> str:
    """Return the expected form of an invalid name of a dimension; empty for a valid one."""
    if not NAME.match(name):
        return "a name of letters, digits and _, at most 100"
    if name in NAMES_IN_USE or name in CATALOGUE:
        return "a name that archives do not use themselves"
    return ""


@dataclass(frozen=True)
class Dimension(Variable):
    """Dimension of outputs, such as time or depth, with the coordinates of their values.

    Raises
    ------
    SettingsError
        If the name is invalid or used by archives themselves, or the coordinates are.
    """

    values: tuple[float, ...] = ()  # coordinates in the SI unit, finite and in ascending order

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(float(value) for value in self.values))
        if problems := list(self._problems()):
            raise SettingsError(problems)

    @property
    def weights(self) -> FloatArray:
        """Weight of each coordinate in a mean along the dimension, by the trapezoidal rule."""
        if len(self.values) == 1:
            return np.ones(1)
        steps = np.diff(self.values) / (self.values[-1] - self.values[0])
        weights: FloatArray = (np.append(steps, 0.0) + np.append(0.0, steps)) / 2
        return weights

    def place_text(self, value: float) -> str:
        """Return a place along it as text, such as ``time = 12 day``; the value is in SI units."""
        return f"{self.name} = {self.value_text(value)}"

    def _problems(self) -> Iterator[Problem]:
        if expected := dimension_name_problem(self.name):
            yield Problem(("name",), toml_text(self.name), expected)
        if not self.values:
            yield Problem(("values",), "nothing", "at least one coordinate")
        for position, value in enumerate(self.values):
            before = self.values[position - 1] if position else -math.inf
            if not before < value < math.inf:
                expected = "finite numbers in ascending order"
                yield Problem(("values", position), toml_text(value), expected)
                return
        if self.values and math.isinf(self.values[-1] - self.values[0]):
            ends = f"{self.values[0]:g} to {self.values[-1]:g}"
            yield Problem(("values",), ends, "coordinates that are a finite distance apart")


@dataclass(frozen=True)
class Output(Variable):
    """Output variable of a model: a number, a category, or a field of numbers.

    Parameters
    ----------
    categories : tuple of Category
        Of a categorical output, whose values are positions in them.
    dims : tuple of Dimension
        Of a field, such as a curve in time; `MOST_DIMENSIONS` at most.
    may_end : bool
        Whether a curve may end before its dimension does: its values after the end are NaN.
    absent : str
        What is true of the completed runs in which a number does not exist, and is NaN; empty where
        every run has one.
    is_difference : bool
        Whether a derived number is a difference, which no unit with a zero of its own can state.

    Raises
    ------
    SettingsError
        If these do not go together.
    """

    categories: tuple[Category, ...] = ()
    dims: tuple[Dimension, ...] = ()
    may_end: bool = False
    absent: str = ""
    is_difference: bool = False

    def __post_init__(self) -> None:
        names = [dimension.name for dimension in self.dims]
        if len(names) > MOST_DIMENSIONS or len({*names, self.name}) <= len(names):
            expected = f"at most {MOST_DIMENSIONS} dimensions, of names that differ"
            raise SettingsError([Problem(("dims",), ", ".join(names), expected)])
        if self.dims and self.categories:
            found = "categories and dimensions"
            raise SettingsError([Problem(("dims",), found, "one of them")])
        if self.may_end and len(self.dims) != 1:
            found = f"an output along {len(self.dims)} dimensions"
            raise SettingsError([Problem(("may_end",), found, "a curve, along one dimension")])

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of its values in one run; empty for a single one."""
        return tuple(len(dimension.values) for dimension in self.dims)

    @property
    def sizes(self) -> dict[str, int]:
        """Size of each dimension by name."""
        return {dimension.name: len(dimension.values) for dimension in self.dims}

    @property
    def place_weights(self) -> FloatArray:
        """Weight of each place in a mean over a field, flattened; their sum is 1."""
        along = [dimension.weights for dimension in self.dims]
        weights: FloatArray = reduce(np.multiply.outer, along).ravel()
        return weights

    @property
    def is_number(self) -> bool:
        """True if each run has one number of it, neither a category nor a field."""
        return not self.categories and not self.dims

    def place_text(self, place: Sequence[int]) -> str:
        """Return the coordinates of a place, given by its position along each dimension."""
        along = zip(self.dims, place, strict=True)
        return ", ".join(dim.place_text(dim.values[position]) for dim, position in along)

    def invalid_text(self, values: FloatArray) -> str:
        """Return the first invalid value of a run, shape (*dims), and its place; or empty."""
        invalid = self.invalid(values[np.newaxis])[0]
        if not invalid.any():
            return ""
        place = np.unravel_index(int(invalid.argmax()), self.shape)
        text = f"{self.name} is {values[place]}"
        return f"{text} at {self.place_text([int(each) for each in place])}" if self.dims else text

    def invalid(self, values: FloatArray) -> BoolArray:
        """Return a mask of the values of runs, of shape (run, *dims), that are no results.

        Each must be finite. Of a curve that may end, all after the end are NaN; its first value
        must be there. NaN is a result where it means `absent`.
        """
        if self.absent:
            return np.isinf(values)
        if not self.may_end:
            return ~np.isfinite(values)
        backwards = np.isnan(values)[:, ::-1]
        is_after_end = np.logical_and.accumulate(backwards, axis=1)[:, ::-1]
        is_after_end[:, 0] = False
        mask: BoolArray = ~np.isfinite(values) & ~is_after_end
        return mask


def field_coordinates(dims: Iterable[Dimension]) -> dict[str, xr.Variable]:
    """Return the coordinates of fields by dimension, with units and names."""
    import xarray as xr

    return {
        each.name: xr.Variable(each.name, np.array(each.values), each.attributes) for each in dims
    }


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
class DerivedOutput(ABC):
    """Output that follows from others of the same run, after the run."""

    output: Output  # its name, its unit and its categories, if any

    @property
    @abstractmethod
    def source(self) -> str:
        """The name of the field, or the formula, that it follows from, as a reader sees it."""

    @abstractmethod
    def values(self, found: Arrays, is_ok: BoolArray) -> FloatArray:
        """Return its values in some runs; NaN in those that failed.

        Parameters
        ----------
        found : mapping of str to ndarray, shape (run, *dims)
            The inputs, and the outputs that it follows from, with NaN in runs that failed.
        is_ok : ndarray of bool, shape (run,)
            Whether each run has been made, and has not failed.
        """
