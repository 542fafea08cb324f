"""Predictions as a table: a row for each point, and for each place of a field."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from uqpen.core.blocks import block_ranges
from uqpen.core.labels import INPUT
from uqpen.core.units import scale
from uqpen.results.table import label_with_unit
from uqpen.surrogates.archived_surrogate import EXTRAPOLATED, std_names

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.core.arrays import FloatArray
    from uqpen.core.columns import Column
    from uqpen.core.model import Dimension, Output
    from uqpen.surrogates.archived_surrogate import ArchivedSurrogate

_POINT = "point"


def prediction_parts(
    found: ArchivedSurrogate, values: Mapping[str, FloatArray], columns: Sequence[Column]
) -> Iterator[pd.DataFrame]:
    """Yield the points as their file has them, the predictions, and the inputs out of range.

    A field has a row for each point and place, with the place in columns of its own and the number
    of the point in the column ``point``. Rows of scalar outputs come first, then those of the
    fields along the same dimensions. No part has more than 65 536 points, whose `values` are in SI
    units.
    """
    labels = {each.name: np.array(each.labels, dtype=object) for each in found.inputs}
    given = {
        column.heading: labels[column.name][column.load().astype(int)]
        if labels[column.name].size
        else column.load()
        for column in columns
    }
    groups = sorted({output.dims: None for output in found.outputs}, key=len)
    names: dict[str, None] = {}
    for dims in groups:
        for start, stop in block_ranges(len(next(iter(given.values())))):
            predicted = found.predict({name: each[start:stop] for name, each in values.items()})
            points = pd.DataFrame(
                {name: each[start:stop] for name, each in given.items()},
                index=pd.RangeIndex(start, stop),
            )
            marked = predicted[EXTRAPOLATED]
            inputs = marked[INPUT].values
            points[EXTRAPOLATED] = [" ".join(inputs[row]) for row in np.atleast_2d(marked.values)]
            if not names:  # the columns of all groups
                tables = (_of_group(found, predicted, points, each) for each in groups)
                names = dict.fromkeys(name for each in tables for name in each)
                del names[EXTRAPOLATED]
            table = _of_group(found, predicted, points, dims)
            table = table.reindex(columns=[*names, EXTRAPOLATED])
            if any(groups):
                table.insert(0, _POINT, table.index + 1)
            yield table.reset_index(drop=True)


def _of_group(
    found: ArchivedSurrogate,
    predicted: xr.Dataset,
    points: pd.DataFrame,
    dims: tuple[Dimension, ...],
) -> pd.DataFrame:
    """Return the points with the predictions of the outputs along some dimensions."""
    size = len(points)
    outputs = [each for each in found.outputs if each.dims == dims]
    places = np.prod([len(each.values) for each in dims], dtype=int)
    return (
        points.iloc[np.repeat(np.arange(size), places)]
        .assign(**dict(_places(size, dims)))
        .assign(**dict(_values(predicted, outputs)))
    )


def _places(points: int, dims: tuple[Dimension, ...]) -> Iterator[tuple[str, FloatArray]]:
    """Yield the column of each dimension, in the unit of the study."""
    grids = np.meshgrid(*(each.values for each in dims), indexing="ij")
    for each, grid in zip(dims, grids, strict=True):
        unit = each.preferred_unit
        yield label_with_unit(each.name, unit), np.tile(scale(unit).from_si(grid.ravel()), points)


def _values(predicted: xr.Dataset, outputs: Sequence[Output]) -> Iterator[tuple[str, FloatArray]]:
    """Yield the columns of outputs, each with those of its standard deviations."""
    for output in outputs:
        unit = output.preferred_unit
        values = predicted[output.name].values.ravel()
        yield label_with_unit(output.name, unit), scale(unit).from_si(values)
        for std in filter(predicted.__contains__, std_names(output)):
            deviations = scale(unit).difference_from_si(predicted[std].values.ravel())
            yield label_with_unit(std, unit), deviations
