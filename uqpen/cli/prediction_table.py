"""Predictions as a table: a row for each point, and for each place of a field."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from uqpen.core.labels import INPUT
from uqpen.core.units import scale
from uqpen.results.table import label_with_unit
from uqpen.surrogates.archived_surrogate import EXTRAPOLATED, std_name

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.core.arrays import FloatArray, IntArray
    from uqpen.core.columns import Column
    from uqpen.core.model import Dimension, Output
    from uqpen.surrogates.archived_surrogate import ArchivedSurrogate

__all__ = ["prediction_table"]

_POINT = "point"


def prediction_table(
    found: ArchivedSurrogate, predicted: xr.Dataset, columns: Sequence[Column]
) -> pd.DataFrame:
    """Return the points as their file has them, the predictions, and the inputs out of range.

    A field has a row for each point and place, with the place in columns of its own and the number
    of the point in the column ``point``. Rows of scalar outputs come first, then those of the
    fields along the same dimensions.
    """
    marked = predicted[EXTRAPOLATED]
    inputs = marked[INPUT].values
    outside = [" ".join(inputs[row]) for row in np.atleast_2d(marked.values)]
    given = {column.heading: column.load() for column in columns}
    points = pd.DataFrame({**given, EXTRAPOLATED: outside})
    groups = {output.dims: None for output in found.outputs}
    parts = [
        points.loc[_rows(len(points), dims)]
        .assign(**dict(_places(len(points), dims)))
        .assign(**dict(_values(predicted, [each for each in found.outputs if each.dims == dims])))
        for dims in sorted(groups, key=len)
    ]
    table = pd.concat(parts)
    if any(groups):
        table.insert(0, _POINT, table.index + 1)
    table[EXTRAPOLATED] = table.pop(EXTRAPOLATED)
    return table.reset_index(drop=True)


def _rows(points: int, dims: tuple[Dimension, ...]) -> IntArray:
    """Return the position of the point of each row."""
    return np.repeat(np.arange(points), np.prod([len(each.values) for each in dims], dtype=int))


def _places(points: int, dims: tuple[Dimension, ...]) -> Iterator[tuple[str, FloatArray]]:
    """Yield the column of each dimension, in the unit of the study."""
    grids = np.meshgrid(*(each.values for each in dims), indexing="ij")
    for each, grid in zip(dims, grids, strict=True):
        unit = each.preferred_unit
        yield label_with_unit(each.name, unit), np.tile(scale(unit).from_si(grid.ravel()), points)


def _values(predicted: xr.Dataset, outputs: Sequence[Output]) -> Iterator[tuple[str, FloatArray]]:
    """Yield the columns of outputs, each with that of its standard deviation if there is one."""
    for output in outputs:
        unit, std = output.preferred_unit, std_name(output)
        values = predicted[output.name].values.ravel()
        yield label_with_unit(output.name, unit), scale(unit).from_si(values)
        if std in predicted:
            deviations = scale(unit).difference_from_si(predicted[std].values.ravel())
            yield label_with_unit(std, unit), deviations
