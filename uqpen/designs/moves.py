"""Labels of the runs of a design that moves inputs: writing and reading them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import MOVED_BY, MOVED_INPUT, RUN

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["add_move_coordinates", "moved_input_numbers"]

# Stands for no input, in the runs that move none; names of inputs begin with a letter.
_NONE = "_none"


def add_move_coordinates(
    points: xr.Dataset,
    inputs: Sequence[str],
    moved_inputs: IntArray,
    by: FloatArray,
    *,
    measure: str,
) -> xr.Dataset:
    """Add the coordinates of the moves to points.

    Parameters
    ----------
    points : Dataset
        Along ``run``.
    inputs : sequence of str
        The inputs that can be moved.
    moved_inputs : ndarray of int, shape (run,)
        Position of the moved input in `inputs`; -1 for none.
    by : ndarray, shape (run,)
        The signed step.
    measure : str
        Scale of the steps in words, for their ``long_name``.
    """
    flags = {
        "long_name": "input that is moved in the run",
        "flag_values": np.arange(-1, len(inputs), dtype=np.int16),
        "flag_meanings": " ".join([_NONE, *inputs]),
    }
    described = {"units": "1", "long_name": f"how far it is moved, {measure}"}
    number = (RUN, moved_inputs.astype(np.int16), flags)
    return points.assign_coords({MOVED_INPUT: number, MOVED_BY: (RUN, by, described)})


def moved_input_numbers(runs: xr.Dataset) -> dict[str, int]:
    """Return the inputs that vary over some runs, with their numbers among the moved ones.

    Of several models, one may not take an input, or have a value of its own for it.
    """
    _, *names = str(runs[MOVED_INPUT].attrs["flag_meanings"]).split()
    return {
        name: number for number, name in enumerate(names) if name in runs and RUN in runs[name].dims
    }
