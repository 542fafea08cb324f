"""Coordinates of a dimension in a file beside the study: CSV, NetCDF, or a table with blanks."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import TableError
from uqpen.core.files import FileSnapshot
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.distributions.measurements import Measurements
from uqpen.models.command.output_reader import parse_number
from uqpen.models.command.tables import blank_column
from uqpen.models.command.written import UnreadableError

__all__ = ["FileCoordinates", "read_coordinates_file"]

_WITH_UNITS = (".csv", ".nc")


class FileCoordinates(NamedTuple):
    """Coordinates in a file.

    Attributes
    ----------
    values : ndarray, shape (place,)
        In SI units, as they stand there.
    unit : str
        The unit that the study or the file states.
    file : FileSnapshot
        The file.
    place : str
        The file and the column, for a message.
    """

    values: FloatArray
    unit: str
    file: FileSnapshot
    place: str


def read_coordinates_file(
    path: Path, column: str | int | None, unit: str | None
) -> FileCoordinates:
    """Read a column of a file.

    Parameters
    ----------
    path : Path
        Ends in ``.csv`` for CSV and in ``.nc`` for NetCDF. Any other file is a table with blanks
        between its columns.
    column : str or int, optional
        Its heading, or its position in a table; may be left out where there is one column.
    unit : str, optional
        The unit to show the coordinates in. It is also that of a column without a unit.

    Raises
    ------
    TableError
        If there is no such file or column, or an entry is no number.
    """
    if path.suffix not in _WITH_UNITS:
        return _read_table(path, column, unit or DIMENSIONLESS)
    if isinstance(column, int):
        raise TableError(f'"{path.name}" has columns with headings')
    measurements = Measurements(path)
    found = measurements.column(column or "")
    place = f'column "{found.heading}" of "{path.name}"'
    if unit is not None and found.unit == DIMENSIONLESS:
        values = np.asarray(scale(unit).array_to_si(found.load()))
        return FileCoordinates(values, unit, measurements.source, place)
    shown = unit or found.unit
    return FileCoordinates(found.values(shown), shown, measurements.source, place)


def _read_table(path: Path, column: str | int | None, unit: str) -> FileCoordinates:
    try:
        content = path.read_bytes()
        text = content.decode("utf-8-sig")
    except FileNotFoundError:
        raise TableError(f'there is no file "{path}"') from None
    except (OSError, UnicodeDecodeError):
        raise TableError(f'"{path.name}" cannot be read as a text') from None
    if column is None and any(blank_column(text, 1) or ()):
        raise TableError(f'"{path.name}" has several columns')
    entries = blank_column(text, 0 if column is None else column)
    if entries is None:
        raise TableError(f'"{path.name}" has no column "{column}"')
    place = f'column {column or 0} of "{path.name}"'
    try:
        numbers = [
            parse_number(entry or "", f"row {row} of {place}") for row, entry in enumerate(entries)
        ]
    except UnreadableError as error:
        raise TableError(str(error)) from None
    values = np.asarray(scale(unit).array_to_si(np.array(numbers, dtype=np.float64)))
    return FileCoordinates(values, unit, FileSnapshot.from_content(path, content), place)
