"""Runs in a DataFrame or a Dataset, as the data file of a study."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd
import xarray as xr

from uqpen.core.columns import heading_parts
from uqpen.core.errors import TableError

__all__ = ["data_content", "data_table", "is_data"]

# The name of the file under which an archive keeps the runs.
_NAME = "data.csv"


def is_data(value: object) -> bool:
    """Check for an object that has runs in place of a model."""
    return isinstance(value, pd.DataFrame | xr.Dataset)


def data_content(data: Any) -> bytes:
    """Return runs as a CSV file, each number as it is to the bit."""
    return _frame(data).to_csv(index=False).encode("utf-8")


def data_table(data: Any, units: Mapping[str, str], outputs: Iterable[str]) -> dict[str, Any]:
    """Return the table of a study file that declares runs as its data file.

    Parameters
    ----------
    data : DataFrame or Dataset
        A column ``name [unit]`` or a variable along one dimension for each input and output.
    units : mapping of str to str
        The units that the study states for inputs and outputs. They are those of columns without a
        unit; others are units for display.
    outputs : iterable of str
        The outputs. All other columns are inputs, but for those with a meaning of their own.
    """
    known = dict(_parts(heading) for heading in map(str, _frame(data).columns))
    without = {name: unit for name, unit in units.items() if known.get(name) == ""}
    return {"data": _NAME, "outputs": list(outputs), "units": without or None}


def _parts(heading: str) -> tuple[str, str]:
    try:
        name, unit = heading_parts(heading, _NAME)
    except TableError:
        return heading, ""  # whoever reads the file says what is wrong with it
    return name, unit if "[" in heading else ""


def _frame(data: Any) -> pd.DataFrame:
    if isinstance(data, pd.DataFrame):
        return data
    columns = {}
    for name, variable in data.variables.items():
        if variable.ndim == 1 and (name not in data.dims or "units" in variable.attrs):
            unit = variable.attrs.get("units")
            columns[f"{name} [{unit}]" if unit else str(name)] = variable.values
    return pd.DataFrame(columns)
