"""How fast errors fall with the runs."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.labels import SINGLE, SLOPES
from uqpen.report.axes import padded
from uqpen.report.blocks import Axis, Block, Chart, Charts
from uqpen.report.head_to_head.contest import (
    MOST_CHARTS,
    Method,
    by_output,
    called,
    keys_of,
    methods_of,
    variants_of,
)
from uqpen.report.head_to_head.rows import capped, height_of, places_of, said_of
from uqpen.report.marks import Trace, dots
from uqpen.report.shapes import upright
from uqpen.summary.digits import sensible
from uqpen.summary.head_to_head_entries import Entry
from uqpen.summary.table import OutputTable

__all__ = ["rates"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# Of Monte Carlo.
_USUAL = -0.5
_NO_INTERVAL = "no interval, as few of the repeats decide an error that it is of"
_NO_SLOPE = "a slope takes errors at two numbers of runs, none of them 0"


def rates(tree: xr.DataTree) -> Iterator[Block]:
    """Slopes with their intervals."""
    charts = [
        _slopes(tree, output, variant, found)
        for variant in variants_of(tree)
        for output, found in by_output(tree).items()
        if np.isfinite(_slopes_of(tree, variant, found)[..., 0]).any()
    ]
    if charts:
        yield Charts(
            tuple(charts[:MOST_CHARTS]),
            keys=keys_of(methods_of(tree, SINGLE)),
            notes=("Dashed: −0.5, as errors fall with 1/√runs.", *capped(charts)),
        )


def _slopes_of(tree: xr.DataTree, variant: str, found: list[Entry]) -> FloatArray:
    """Along statistic, method and bound."""
    positions = [method.position for method in methods_of(tree, variant)]
    return np.array([entry.of(SLOPES).values[positions] for entry in found], dtype=np.float64)


def _slopes(tree: xr.DataTree, output: str, variant: str, found: list[Entry]) -> Chart:
    slopes = _slopes_of(tree, variant, found)
    methods = methods_of(tree, variant)
    has_interval = np.asarray(np.isfinite(slopes).all(axis=-1))
    lower, upper = _ends(slopes, has_interval)
    outside = [
        f"{found[row].label} by {methods[at].source} {slopes[row, at, 0]:.2f}"
        for row, at in zip(*np.nonzero(_is_outside(slopes, lower, upper)), strict=True)
    ]
    notes = [f"Outside of the axis: {', '.join(outside)}."] if outside else []
    if (np.isfinite(slopes[..., 0]) & ~has_interval).any():
        notes.append("Hollow: no interval, as few of the repeats decide an error on the line.")
    return Chart(
        title=f"Slopes of {called(tree, output)}{said_of(tree, variant)}",
        summary="; ".join(_steepest(found, methods, slopes)),
        x=Axis("slope of log error over log runs", (lower, upper)),
        y=Axis("", rows=tuple(entry.label for entry in found)),
        traces=tuple(
            _dots(method, slopes[:, at], found, places_of(at, len(methods), len(found)))
            for at, method in enumerate(methods)
        ),
        shapes=(upright(_USUAL, "quiet", "dash"),),
        notes=tuple(notes),
        tables=(_slope_table(found, methods, slopes),),
        height=height_of(len(methods), len(found)),
    )


def _ends(slopes: FloatArray, has_interval: BoolArray) -> tuple[float, float]:
    """An axis that holds all intervals, a slope of 0, and that of Monte Carlo."""
    shown = slopes[has_interval] if has_interval.any() else slopes[np.isfinite(slopes[..., 0]), :1]
    lower, upper = min(float(shown.min()), _USUAL), max(float(shown.max()), 0.0)
    return padded(lower, upper, 0.05)


def _is_outside(slopes: FloatArray, lower: float, upper: float) -> BoolArray:
    with np.errstate(invalid="ignore"):
        outside: BoolArray = (slopes[..., 0] < lower) | (slopes[..., 0] > upper)
    return outside


def _steepest(found: list[Entry], methods: list[Method], slopes: FloatArray) -> Iterator[str]:
    """Whose error falls fastest, a sentence for each statistic."""
    for entry, row in zip(found, slopes, strict=True):
        if np.isfinite(row[:, 0]).any():
            at = int(np.nanargmin(row[:, 0]))
            yield f"{entry.label}: steepest by {methods[at].source}, {sensible(*row[at])}"


def _dots(method: Method, slopes: FloatArray, found: list[Entry], places: FloatArray) -> Trace:
    hovers = [
        f"{method.source}, {entry.label}: {sensible(*row)}"
        + ("" if np.isfinite(row).all() else f"; {_NO_INTERVAL}")
        for entry, row in zip(found, slopes, strict=True)
    ]
    return dots(
        slopes, places, method.series, hovers=hovers, name=method.source, marker=method.marker
    )


def _slope_table(found: list[Entry], methods: list[Method], slopes: FloatArray) -> OutputTable:
    table = OutputTable("Slopes, with their 95 % intervals", [m.source for m in methods])
    for entry, row in zip(found, slopes, strict=True):
        cells = []
        for bounds in row.tolist():
            has_interval = math.isfinite(bounds[1]) and math.isfinite(bounds[2])
            note = _NO_SLOPE if math.isnan(bounds[0]) else "" if has_interval else _NO_INTERVAL
            cells.append(sensible(*bounds) + table.mark(note))
        table.rows.append((entry.label, cells))
    return table
