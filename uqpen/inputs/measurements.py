"""Measurements of an input in a file beside the study."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from uqpen.columns import Column, Sheet, read_columns
from uqpen.errors import Problem, TableError
from uqpen.files import FileRead
from uqpen.inputs.distribution import Distribution
from uqpen.lookup import choices
from uqpen.model import Input
from uqpen.settings import declared, file
from uqpen.units import DIMENSIONLESS, scale

__all__ = ["FEWEST", "FEWEST_OF_A_FAMILY", "Measurements", "parameters_shown", "problems", "shown"]

FloatArray = npt.NDArray[np.float64]

# Between the least and the greatest of n measurements lie (n - 1) / (n + 1) of the law on average.
# An empirical law has nothing else; with ten it has 82 %.
FEWEST = 10

# A family adds the rest of the law; more measurements than its two parameters have to stand against
# it before it can be said to fit.
FEWEST_OF_A_FAMILY = 5


@dataclass(frozen=True)
class Measurements:
    """A file with a column of measurements.

    Parameters
    ----------
    file : Path
        Ends in ``.nc`` for NetCDF; anything else is read as CSV.
    """

    file: Path = file()

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of the file; raises TableError where it cannot be read."""
        return self._read.columns

    @property
    def source(self) -> FileRead:
        """The file as it stood when it was read; raises TableError where it cannot be."""
        return self._read.file

    @cached_property
    def _read(self) -> Sheet:
        return read_columns(self.file)

    def column(self, heading: str) -> Column:
        """The column with a heading, with its unit or without.

        Parameters
        ----------
        heading : str
            Empty for the only column of a file.

        Raises
        ------
        TableError
            If it is none, or more than one.
        """
        headings = [column.heading for column in self.columns]
        if not heading and len(headings) > 1:
            raise TableError(f'"{self.file.name}" has the columns {", ".join(headings)}')
        found = [
            column
            for column in self.columns
            if not heading or heading.strip() in (column.heading, column.name)
        ]
        if not found:
            known = choices(heading, headings)
            raise TableError(f'"{self.file.name}" has no column "{heading}"; {known}')
        if len(found) > 1:
            raise TableError(f'column "{heading}" stands twice in "{self.file.name}"')
        return found[0]


def problems(
    values: FloatArray, column: Column, variable: Input, *, fewest: int
) -> Iterator[Problem]:
    """What keeps measurements, in SI units, from being those of an input."""
    if len(values) < fewest:
        yield Problem((), f"{len(values)} measurements", f"at least {fewest}")
    elif len(np.unique(values)) < 2:
        yield Problem((), f"{len(values)} measurements that are all the same", "some that differ")
    outside = np.flatnonzero(~variable.bounds.contain(values))
    if outside.size:
        first = int(outside[0])
        found = f"{shown(values[first], column.unit)} as measurement {first + 1}"
        where = "" if variable.unit == DIMENSIONLESS else f" {variable.unit}"
        yield Problem((), found, f"values {variable.bounds}{where}")


def shown(value: float, unit: str) -> str:
    """A value in SI units as a person reads it."""
    return _with_unit(scale(unit).from_si(value), unit)


def parameters_shown(law: Distribution, unit: str) -> str:
    """The parameters of a law in one line, in a unit of its variable."""
    parts = []
    for field, setting in declared(law):
        value = getattr(law, field.name)
        if setting.kind == "quantity":
            parts.append(f"{field.name} {shown(value, unit)}")
        elif setting.kind == "difference":
            difference = _with_unit(scale(unit).difference_from_si(value), unit)
            parts.append(f"{field.name} {difference}")
        else:
            parts.append(f"{field.name} {value:.4g}")
    return ", ".join(parts)


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.4g}" if unit == DIMENSIONLESS else f"{value:.4g} {unit}"
