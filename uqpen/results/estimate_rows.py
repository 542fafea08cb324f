"""Estimates as rows of a long table: one entry of one statistic a row."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS
from uqpen.core.catalogue import DIMENSIONS
from uqpen.core.labels import BOUND, BOUNDS, EQUIVALENT_RUNS, SURROGATE_ESTIMATE

__all__ = ["Row", "estimate_rows", "rows_frame"]

Row = dict[str, Any]

_BEFORE = ("model", "source", "kind", "output", "statistic", "coordinates")
_BEHIND = (*BOUNDS, "unit", *INTERVAL_TEXTS)
# Numbers of entries whose labels are texts, such as a threshold as it was written.
_VALUES_OF_DIMENSIONS = {
    companion: dimension
    for dimension, labels in DIMENSIONS.items()
    for companion, kind in labels.companions.items()
    if kind == "number"
}
# Beside corrected estimates.
_CORRECTION = (SURROGATE_ESTIMATE, EQUIVALENT_RUNS)


def estimate_rows(array: xr.DataArray, **described: str) -> Iterator[Row]:
    """Yield the entries of an estimate array, or of an array without bounds.

    Columns that are the same in all rows, such as ``source``, are passed by their names.
    """
    dims = [str(dim) for dim in array.dims if dim != BOUND]
    labels = [array[dim].values.tolist() for dim in dims]
    texts = {key: array.coords[key].values for key in INTERVAL_TEXTS if key in array.coords}
    numbers = {key: array.coords[key].values for key in _CORRECTION if key in array.coords}
    values_of = [name for name in _VALUES_OF_DIMENSIONS if name in array.coords]
    beside = {name: (array.coords[name].dims[0], array.coords[name].values) for name in values_of}
    unit = str(array.attrs.get("units", ""))
    for index in np.ndindex(*(array.sizes[dim] for dim in dims)):
        at = {dim: of_dim[i] for dim, of_dim, i in zip(dims, labels, index, strict=True)}
        yield {
            **described,
            "coordinates": ", ".join(f"{dim}={label}" for dim, label in at.items()),
            **at,
            **{
                key: float(values[index[dims.index(str(dim))]])
                for key, (dim, values) in beside.items()
            },
            **dict(zip(BOUNDS, np.ravel(array.values[index]).tolist(), strict=False)),
            **{key: float(values[index]) for key, values in numbers.items()},
            "unit": unit,
            **{key: str(values[index]) for key, values in texts.items()},
        }


def rows_frame(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return the table of rows, with a column for each dimension that is used.

    Where estimates are corrected, the surrogate's own figures and the numbers of plain runs stand
    last.
    """
    listed = list(rows)
    keys = {key for row in listed for key in row}
    used = keys - {*_BEFORE, *_BEHIND, *_CORRECTION}
    own = {_VALUES_OF_DIMENSIONS[name]: name for name in used & _VALUES_OF_DIMENSIONS.keys()}
    known = [[name, own[name]] if name in own else [name] for name in DIMENSIONS if name in used]
    first = list(chain(*known))
    dims = [*first, *sorted(used.difference(first))]
    columns: dict[str, list[Any]] = {
        name: [row.get(name, np.nan if name in BOUNDS else "") for row in listed]
        for name in (*_BEFORE, *_BEHIND)
    }
    entries = {name: [row.get(name) for row in listed] for name in dims}
    behind = {name: columns.pop(name) for name in _BEHIND}
    last = {key: [row.get(key, np.nan) for row in listed] for key in _CORRECTION if key in keys}
    return pd.DataFrame({**columns, **entries, **behind, **last})
