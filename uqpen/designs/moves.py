"""What a design that moves inputs says of its runs: which input was moved, and how far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.labels import MOVED_BY, MOVED_INPUT, RUN

__all__ = ["with_moves"]


def with_moves(
    points: xr.Dataset,
    inputs: Sequence[str],
    moved: npt.NDArray[np.int64],
    by: npt.NDArray[np.float64],
    *,
    measured: str,
) -> xr.Dataset:
    """Points with the coordinates that say what was moved.

    Parameters
    ----------
    points : Dataset
        Along ``run``.
    inputs : sequence of str
        What can be moved.
    moved : ndarray of int, shape (run,)
        Position in `inputs` of the one that is moved; -1 where none is.
    by : ndarray, shape (run,)
        How far, with its sign.
    measured : str
        What that is in.
    """
    flags = {
        "long_name": "input that is moved in the run",
        "flag_values": np.arange(-1, len(inputs), dtype=np.int16),
        # No input is called so: names begin with a letter.
        "flag_meanings": " ".join(["_none", *inputs]),
    }
    described = {"units": "1", "long_name": f"how far it is moved, {measured}"}
    return points.assign_coords(
        {
            MOVED_INPUT: (RUN, moved.astype(np.int16), flags),
            MOVED_BY: (RUN, by, described),
        }
    )
