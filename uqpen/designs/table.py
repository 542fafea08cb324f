"""Points of the user's own, read from a file."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.arrays import floats
from uqpen.designs.design import Design, Rounds
from uqpen.errors import QuantityError, TableError, as_written
from uqpen.inputs.law import InputLaw, points_dataset
from uqpen.labels import Sampling
from uqpen.lookup import choices
from uqpen.model import Input
from uqpen.settings import file, flag
from uqpen.streams import Stream
from uqpen.units import DIMENSIONLESS, NUMBER, are_alike, describe, scale

__all__ = ["Table"]

_NUMBER = re.compile(rf"\s*{NUMBER}\s*\Z")
_HEADER = re.compile(r"\s*([^\[\]]*?)\s*(?:\[([^\[\]]*)\])?\s*\Z")


@dataclass(frozen=True)
class Table(Design):
    """Points from a CSV or NetCDF file, a column (or variable) for each input they vary.

    A column is headed ``name [unit]``, without brackets where the input has no unit; in NetCDF the
    variable's ``units`` say it. A column wins over the study's own value of that input.

    Parameters
    ----------
    file : Path
        Ends in ``.nc`` for NetCDF; anything else is read as CSV.
    independent : bool
        Whether the points are independent draws from the law of interest, which gives statistics
        an interval; of other points no error can be told.
    """

    file: Path = file()
    independent: bool = flag(default=False)

    @property
    def sampling(self) -> Sampling:
        return Sampling.INDEPENDENT if self.independent else Sampling.GIVEN

    def rounds(self, law: InputLaw, stream: Stream) -> Rounds:
        columns = self.columns(law)
        yield points_dataset(law, columns, {}, runs=len(next(iter(columns.values()))))

    def size(self, law: InputLaw) -> int:
        return len(next(iter(self.columns(law).values())))

    def columns(self, law: InputLaw) -> dict[str, npt.NDArray[np.float64]]:
        """The table's columns in SI units.

        Raises
        ------
        TableError
            If it cannot be read, or a column is no input, has the wrong unit or no number.
        """
        known = {variable.name: variable for variable in law.variables}
        columns: dict[str, npt.NDArray[np.float64]] = {}
        for name, unit, values in self._headed:
            if name not in known:
                raise TableError(f'column "{name}" is no input; {choices(name, known)}')
            if name in columns:
                raise TableError(f'column "{name}" stands twice')
            columns[name] = _in_si(known[name], unit, values)
            if len({len(values) for values in columns.values()}) > 1:
                raise TableError(f'column "{name}" differs in length from those before')
        if not columns or not len(next(iter(columns.values()))):
            raise TableError(f'"{self.file.name}" has no rows of points')
        for entry in law.random:
            if entry.variable.name not in columns:
                raise TableError(f'no column "{entry.variable.name}", an input that is random')
        return columns

    @cached_property
    def _headed(self) -> list[Headed]:
        """The table as it stands in the file; read once, so that it cannot change in mid-study."""
        try:
            return _netcdf(self.file) if self.file.suffix == ".nc" else _csv(self.file)
        except FileNotFoundError:
            raise TableError(f'there is no file "{self.file}"') from None
        except OSError as error:
            raise TableError(f'"{self.file}" cannot be read: {error.strerror}') from None


Headed = tuple[str, str, npt.NDArray[np.float64]]


def _in_si(variable: Input, unit: str, values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    try:
        alike = are_alike(unit, variable.unit)
    except QuantityError as error:
        raise TableError(f'column "{variable.name}": {error}') from None
    if not alike:
        raise TableError(
            f'column "{variable.name}" is in "{unit}"; expected {describe(variable.unit)}'
        )
    measure = scale(unit)
    return np.array([measure.to_si(value) for value in values.tolist()])


def _csv(path: Path) -> list[Headed]:
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise TableError(f'"{path.name}" is not UTF-8') from None
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        lines = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except csv.Error as error:
        raise TableError(f'"{path.name}", line {reader.line_num}: {error}') from None
    if not lines:
        raise TableError(f'"{path.name}" is empty')
    (_, header), *rows = lines
    for line, row in rows:
        if len(row) != len(header):
            found = f"{len(row)} values under {len(header)} headings; commas separate columns"
            raise TableError(f'"{path.name}", line {line}: {found}')
    columns = []
    for position, heading in enumerate(header):
        name, unit = _heading(heading, path)
        texts = [(line, row[position]) for line, row in rows]
        columns.append((name, unit, _numbers(texts, name, path)))
    return columns


def _heading(text: str, path: Path) -> tuple[str, str]:
    match = _HEADER.match(text)
    if match is None or not match[1]:
        raise TableError(f'"{path.name}": heading "{text}" is not of the form "name [unit]"')
    return match[1], (match[2] or "").strip() or DIMENSIONLESS


def _numbers(texts: Sequence[tuple[int, str]], name: str, path: Path) -> npt.NDArray[np.float64]:
    values = np.empty(len(texts))
    for position, (line, text) in enumerate(texts):
        if not _NUMBER.match(text) or not math.isfinite(float(text)):
            where = f'"{path.name}", line {line}, column "{name}"'
            raise TableError(f"{where}: found {as_written(text.strip())}, expected a number")
        values[position] = float(text)
    return values


def _netcdf(path: Path) -> list[Headed]:
    import netCDF4

    try:
        with netCDF4.Dataset(path) as dataset:
            return [
                (str(name), str(getattr(variable, "units", DIMENSIONLESS)), _values(variable, path))
                for name, variable in dataset.variables.items()
                if not (name in dataset.dimensions and "units" not in variable.ncattrs())
            ]
    except OSError as error:
        if isinstance(error, FileNotFoundError):
            raise
        raise TableError(f'"{path.name}" is not a NetCDF file') from None


def _values(variable: Any, path: Path) -> npt.NDArray[np.float64]:
    """The values of a NetCDF variable, none of which may be missing."""
    where = f'"{path.name}", variable "{variable.name}"'
    if variable.ndim != 1:
        raise TableError(f"{where} has {variable.ndim} dimensions, expected one")
    try:
        values = floats(variable[:])
    except ValueError as error:
        raise TableError(f"{where} holds {error}") from None
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise TableError(f"{where} has no number at position {bad[0]}")
    return values
