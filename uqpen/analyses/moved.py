"""Which inputs a design has moved, one at a time."""

from __future__ import annotations

import xarray as xr

from uqpen.labels import MOVED_INPUT, RUN

__all__ = ["moved_inputs"]


def moved_inputs(runs: xr.Dataset) -> dict[str, int]:
    """The inputs that vary over some runs, each with its number among those that were moved.

    Of several models, one may not take an input, or have a value of its own for it.

    Parameters
    ----------
    runs : Dataset
        Of a design that says what it moved.
    """
    # The first word stands for no input.
    names = str(runs[MOVED_INPUT].attrs["flag_meanings"]).split()[1:]
    return {
        name: number for number, name in enumerate(names) if name in runs and RUN in runs[name].dims
    }
