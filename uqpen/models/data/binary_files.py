"""Data files that are no text: NetCDF and Parquet."""

from __future__ import annotations

import functools
import io
from typing import Any

import numpy as np

from uqpen.core.arrays import floats
from uqpen.core.netcdf.opening import NetcdfVariable, RefusedContentError, read_variables
from uqpen.models.data.columns import DataColumn, Entries, data_error, name_and_unit

__all__ = ["frame_columns", "read_netcdf", "read_parquet"]


def read_netcdf(name: str, content: bytes) -> tuple[DataColumn, ...]:
    """Read the variables of a NetCDF file along its one dimension.

    Raises
    ------
    SettingsError
        If it is no NetCDF file, or its variables are along other dimensions.
    """
    try:
        columns = [_netcdf_column(name, each) for each in read_variables(content)]
    except RefusedContentError as error:
        found = f"{name}, which cannot be read as NetCDF: {error}"
        raise data_error(found, f"a NetCDF file{error.remedy and ': '}{error.remedy}") from None
    if len({len(column.entries) for column in columns}) > 1:
        raise data_error(f"variables of different length in {name}", "one dimension, of the runs")
    return tuple(columns)


def _netcdf_column(file: str, variable: NetcdfVariable) -> DataColumn:
    values = variable.values()
    if values.ndim != 1:
        found = f'a variable "{variable.name}" of {values.ndim} dimensions in {file}'
        raise data_error(found, "variables along one dimension, of the runs")
    if values.dtype.kind in "biuf":
        place = functools.partial(_row, file)
        return DataColumn(variable.name, variable.unit, floats(values), place)
    return _column(file, variable.name, variable.unit, np.ma.filled(values.astype(object), None))


def read_parquet(name: str, content: bytes) -> tuple[DataColumn, ...]:
    """Read the columns of a Parquet file, headed ``name [unit]``.

    Raises
    ------
    SettingsError
        If it cannot be read, or pandas lacks the package that reads it.
    """
    import pandas as pd

    try:
        frame = pd.read_parquet(io.BytesIO(content))
    except ImportError:
        found = f"{name}, a Parquet file, and neither pyarrow nor fastparquet installed"
        raise data_error(found, "one of these packages, or a CSV or NetCDF file") from None
    except (OSError, ValueError) as error:
        raise data_error(f"{name}, which cannot be read: {error}", "a Parquet file") from None
    return frame_columns(name, frame)


def frame_columns(file: str, frame: Any) -> tuple[DataColumn, ...]:
    """Return the columns of a pandas DataFrame, headed ``name [unit]``.

    Raises
    ------
    SettingsError
        If a heading has another form.
    """
    columns = []
    for position, heading in enumerate(map(str, frame.columns)):
        name, unit = name_and_unit(heading, file)
        columns.append(_column(file, name, unit, frame.iloc[:, position].to_numpy(object)))
    return tuple(columns)


def _column(file: str, name: str, unit: str, entries: Any) -> DataColumn:
    """Return a column with numbers where all entries are numbers or missing, else with texts."""
    found: Entries
    try:
        found = np.array([np.nan if each is None else each for each in entries], dtype=np.float64)
    except (TypeError, ValueError):
        missing = [each is None or each != each for each in entries]
        found = ["" if no else str(each) for each, no in zip(entries, missing, strict=True)]
    return DataColumn(name, unit, found, functools.partial(_row, file))


def _row(file: str, entry: int) -> str:
    return f"{file}, row {entry + 1}"
