"""Points of the user's own, read from a file."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from uqpen.designs.design import Design, Rounds
from uqpen.errors import QuantityError, TableError
from uqpen.inputs.law import InputLaw, points_dataset
from uqpen.labels import Sampling
from uqpen.lookup import choices
from uqpen.model import Input
from uqpen.settings import file, flag
from uqpen.streams import Stream
from uqpen.units import DIMENSIONLESS, are_alike, describe, scale

__all__ = ["Table"]

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
        try:
            read = _netcdf if self.file.suffix == ".nc" else _csv
            headed = read(self.file)
        except FileNotFoundError:
            raise TableError(f'there is no file "{self.file.name}" beside the study') from None
        except OSError as error:
            raise TableError(f'"{self.file.name}" cannot be read: {error.strerror}') from None
        columns: dict[str, npt.NDArray[np.float64]] = {}
        for name, unit, values in headed:
            if name not in known:
                raise TableError(f'column "{name}" is no input; {choices(name, known)}')
            if name in columns:
                raise TableError(f'column "{name}" stands twice')
            columns[name] = _in_si(known[name], unit, values)
        if not columns or not len(next(iter(columns.values()))):
            raise TableError(f'"{self.file.name}" has no rows of points')
        for entry in law.random:
            if entry.variable.name not in columns:
                raise TableError(f'no column "{entry.variable.name}", an input that is random')
        return columns


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
    lines = [
        line for line in csv.reader(io.StringIO(text, newline="")) if any(map(str.strip, line))
    ]
    if not lines:
        raise TableError(f'"{path.name}" is empty')
    header, *rows = lines
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            found = f"{len(row)} values under {len(header)} headings"
            raise TableError(f'"{path.name}", row {number}: {found}')
    columns = []
    for position, heading in enumerate(header):
        name, unit = _heading(heading, path)
        columns.append((name, unit, _numbers([row[position] for row in rows], name, path)))
    return columns


def _heading(text: str, path: Path) -> tuple[str, str]:
    match = _HEADER.match(text)
    if match is None or not match[1]:
        raise TableError(f'"{path.name}": heading "{text}" is not of the form "name [unit]"')
    return match[1], (match[2] or "").strip() or DIMENSIONLESS


def _numbers(texts: Sequence[str], name: str, path: Path) -> npt.NDArray[np.float64]:
    values = np.empty(len(texts))
    for row, text in enumerate(texts):
        try:
            values[row] = float(text)
        except ValueError:
            values[row] = math.nan
        if not math.isfinite(values[row]):
            where = f'"{path.name}", row {row + 2}, column "{name}"'
            raise TableError(f'{where}: found "{text.strip()}", expected a number')
    return values


def _netcdf(path: Path) -> list[Headed]:
    import netCDF4

    try:
        with netCDF4.Dataset(path) as dataset:
            found = [
                (str(name), str(getattr(variable, "units", DIMENSIONLESS)), np.asarray(variable[:]))
                for name, variable in dataset.variables.items()
                if variable.ndim == 1 and name not in dataset.dimensions
            ]
    except OSError as error:
        if isinstance(error, FileNotFoundError):
            raise
        raise TableError(f'"{path.name}" is not a NetCDF file') from None
    if len({len(values) for _, _, values in found}) > 1:
        raise TableError(f'"{path.name}": its variables differ in length')
    for name, _, values in found:
        if not np.issubdtype(values.dtype, np.number) or not np.isfinite(values).all():
            raise TableError(f'"{path.name}": "{name}" has values that are no numbers')
    return found
