"""Measurements of an input in a file beside the study."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import Column, ColumnFile, read_columns
from uqpen.core.errors import Problem, TableError
from uqpen.core.files import FileSnapshot
from uqpen.core.lookup import choices
from uqpen.core.model import Input
from uqpen.core.setting_fields import declared_settings
from uqpen.core.settings import file
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.distributions.distribution import Distribution

__all__ = [
    "FEWEST",
    "FEWEST_FOR_A_FAMILY",
    "Measurements",
    "check_measurements",
    "parameters_text",
    "value_text",
]


# On average, a share (n - 1) / (n + 1) of the distribution lies between the least and the greatest
# of n measurements. An empirical distribution has no more than this share: 82 % for n = 10.
FEWEST = 10

# A family adds the rest of the distribution. More measurements than its two parameters are needed
# to check the fit.
FEWEST_FOR_A_FAMILY = 5


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
        """Columns of the file; TableError if it cannot be read."""
        return self._column_file.columns

    @property
    def source(self) -> FileSnapshot:
        """Snapshot of the file; TableError if it cannot be read."""
        return self._column_file.file

    @cached_property
    def _column_file(self) -> ColumnFile:
        return read_columns(self.file)

    def column(self, heading: str) -> Column:
        """Return the column with a heading, with or without its unit; empty for the only column.

        Raises
        ------
        TableError
            If there is none, or more than one.
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


def check_measurements(
    values: FloatArray, column: Column, variable: Input, *, fewest: int
) -> Iterator[Problem]:
    """Check measurements of an input, in SI units, and yield the problems."""
    if len(values) < fewest:
        yield Problem((), f"{len(values)} measurements", f"at least {fewest}")
    elif len(np.unique(values)) < 2:
        yield Problem((), f"{len(values)} measurements that are all the same", "some that differ")
    outside = np.flatnonzero(~variable.bounds.contain(values))
    if outside.size:
        first = int(outside[0])
        found = f"{value_text(values[first], column.unit)} as measurement {first + 1}"
        where = "" if variable.unit == DIMENSIONLESS else f" {variable.unit}"
        yield Problem((), found, f"values {variable.bounds}{where}")


def value_text(value: float, unit: str) -> str:
    """Format a value given in SI units for display."""
    return _with_unit(scale(unit).from_si(value), unit)


def parameters_text(distribution: Distribution, unit: str) -> str:
    """Return the parameters of a distribution in one line, in a unit of its variable."""
    parts = []
    for field, setting in declared_settings(distribution):
        value = getattr(distribution, field.name)
        if setting.kind == "quantity":
            text = value_text(value, unit)
        elif setting.kind == "difference":
            text = _with_unit(scale(unit).difference_from_si(value), unit)
        else:
            text = f"{value:.4g}"
        parts.append(f"{field.name} {text}")
    return ", ".join(parts)


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.4g}" if unit == DIMENSIONLESS else f"{value:.4g} {unit}"
