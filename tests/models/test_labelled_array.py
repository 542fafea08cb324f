"""Arrays with coordinates that a model returns: aligned with the declared ones, or refused."""

import numpy as np
import pytest
import xarray as xr

from uqpen.core.model import Dimension, Output
from uqpen.models.run_grid import RunGrid, UnusableOutputError, extract_outputs

TIME = Dimension("time", "s", display_unit="ms", values=(0.0, 0.001, 0.003))
LEVEL = Dimension("level", "1", values=(1.0, 2.0))
CURVE = Output("y", "m", dims=(TIME,))
SHEET = Output("y", "m", dims=(LEVEL, TIME))


def found(output, array, **grids):
    return extract_outputs({"y": array, "t": [0, 2, 4]}, [output], None, grids)["y"]


def curve(time, **attributes):
    coordinates = xr.Variable("time", time, attributes)
    return xr.DataArray([10.0, 11.0, 13.0], dims="time", coords={"time": coordinates})


@pytest.mark.parametrize(
    "array",
    [
        curve([0, 1, 3]),
        curve([0.0, 1e-3, 3e-3], units="s"),
        curve([0, 1, 3])[::-1],
        curve(["start", "middle", "end"]),
        curve([0, 1, 3]).drop_vars("time"),
    ],
)
def test_values_stand_at_the_coordinates_that_they_were_returned_at(array):
    assert found(CURVE, array).tolist() == [10.0, 11.0, 13.0]


def test_each_dimension_is_put_in_order_by_itself():
    array = xr.DataArray(
        [[1, 2], [3, 4], [5, 6]],
        dims=("time", "level"),
        coords={"time": [3, 0, 1], "level": [2, 1]},
    )
    assert found(SHEET, array).tolist() == [[4, 6, 2], [3, 5, 1]]


@pytest.mark.parametrize(
    ("array", "reason"),
    [
        (curve([0, 2, 3]), "y is not there at time = 1 ms: its own coordinates have time = 2 ms"),
        (curve([0, 1, np.nan]), "y is not there at time = 3 ms: its own coordinates have"),
        (curve([0.0, 1e-3, 3e-3]),
         "y is not there at time = 1 ms: its own coordinates have time = 0.001 ms"),
        (curve([0, 1, 3], units="m"),
         'returned a "y" whose time is refused: found the unit m; expected one that converts to'),
        (curve([0, 1, 3], units="bogus"), 'returned a "y" whose time is refused: found "bogus"'),
        (curve([0, 1, 3])[:2], r'returned a "y" of shape \(2,\), not \(3,\) along \(time\)'),
    ],
)  # fmt: skip
def test_other_coordinates_are_refused_with_the_place(array, reason):
    with pytest.raises(UnusableOutputError, match=reason):
        found(CURVE, array)


def test_a_grid_of_the_runs_own_is_the_one_that_it_returns():
    array = curve([5, 6, 7])
    assert found(CURVE, array, y=RunGrid({"time": "t"})).tolist() == [10.0, 10.5, 12.0]
