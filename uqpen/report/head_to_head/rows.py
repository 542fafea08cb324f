"""Charts of methods head to head that have a row for each statistic, and the methods in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.labels import REPLICATED, SINGLE
from uqpen.report.blocks import Chart
from uqpen.report.head_to_head.contest import MOST_CHARTS, variants_of

__all__ = ["capped", "height_of", "places_of", "said_of"]

_OF_VARIANT = {SINGLE: "as single sets", REPLICATED: "in replicates"}
# Pixels of a row, of each method in it, and of what is around all rows.
_OF_ROW, _OF_METHOD, _FRAME = 10, 11, 80


def said_of(tree: xr.DataTree, variant: str) -> str:
    """What a title says of how points are taken, where methods have replicates."""
    return f", {_OF_VARIANT[variant]}" if len(variants_of(tree)) > 1 else ""


def places_of(at: int, methods: int, rows: int) -> npt.NDArray[np.float64]:
    """Where the markers of a method stand, one below the other in each row."""
    shift = (at - (methods - 1) / 2) * 0.8 / methods
    return np.arange(rows, dtype=np.float64) + shift


def height_of(methods: int, rows: int) -> int:
    """How high a chart is, in CSS pixels."""
    return _FRAME + (_OF_ROW + _OF_METHOD * max(2, methods)) * rows


def capped(charts: Sequence[Chart]) -> Iterator[str]:
    """What is said where there are more charts than are shown."""
    if len(charts) > MOST_CHARTS:
        yield f"The first {MOST_CHARTS} of {len(charts)} charts; more outputs are not drawn."
