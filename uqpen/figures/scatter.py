"""Each output against each input, run by run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.charts.axes import ValueAxis
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN, STATUS
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.figures.panel import Axes, Panel, set_value_axis
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.source_style import VERMILION
from uqpen.results.texts import plain_text

__all__ = ["category_labels", "jitter", "scatter_panels", "thin_runs"]


# Runs that are drawn in a panel at the most, and in all panels together.
_MOST_RUNS, _MOST_IN_ALL = 1000, 8000
_MOST_FAILED = 100
_FEWEST_RUNS = 250


def scatter_panels(view: ArchiveView) -> Iterator[Panel]:
    """Runs of one design: each output against each input."""
    design = next((name for name in view.sample_designs if view.design(name).keeps_runs), None)
    if design is None:
        return
    inputs = view.design(design).random_inputs
    outputs = [*view.numeric_outputs, *view.categorical_outputs]
    panels = max(1, len(inputs) * len(outputs))
    every = view.design(design).shown_runs
    is_ok = every[STATUS].values == Status.OK
    most = max(_FEWEST_RUNS, min(_MOST_RUNS, _MOST_IN_ALL // panels))
    parts, counts = [], []
    for which, limit, end in ((is_ok, most, "completed"), (~is_ok, _MOST_FAILED, "failed")):
        whole = every.isel({RUN: np.flatnonzero(which)})
        parts.append(thin_runs(whole, limit))
        if whole.sizes[RUN]:
            shown = grouped_number(parts[-1].sizes[RUN])
            counts.append(f"{shown} of {grouped_number(whole.sizes[RUN])} {end} runs")
    note = f"drawn of {view.design(design).shown_prefix}{design}: {'; '.join(counts)}"
    colour = view.look(design).colour
    for output in outputs:
        for name in inputs:
            title = view.title(f"{output}, {name}")
            draw = partial(_draw, view, name, output, parts, colour, note)
            yield Panel(title, draw, 2.2, group=output)


def thin_runs(runs: xr.Dataset, most: int) -> xr.Dataset:
    """A random part of the runs, the same each time, in order; the first runs may not be random."""
    size = runs.sizes[RUN]
    if size <= most:
        return runs
    chosen = Stream(0, "figures", "runs").generator().choice(size, most, replace=False)
    return runs.isel({RUN: np.sort(chosen)})


def _draw(
    view: ArchiveView,
    name: str,
    output: str,
    runs: list[xr.Dataset],
    colour: str,
    note: str,
    axes: Axes,
) -> Iterator[str]:
    ok, failed = runs
    x, x_failed = (view.scale(name).from_si(each[name].values) for each in runs)
    y = _vertical_positions(axes, view, output, ok)
    axes.plot(x, y, ".", color=colour, markersize=2.2, alpha=0.6)
    axes.set(xlabel=view.axis_label(name), ylabel=view.axis_label(output))
    if not ok.sizes[RUN]:
        axes.set_yticks([])
    elif output in view.numeric_outputs:
        span = ValueAxis.of_values([y], is_logarithmic=view.is_logarithmic(output))
        set_value_axis(axes, span, "y")
        if span.is_cut:
            yield "axes of outputs end where all but 1 % lies inside"
    if failed.sizes[RUN]:
        axes.plot(
            x_failed,
            np.full(x_failed.size, 0.02),
            "x",
            color=VERMILION,
            markersize=4,
            transform=axes.get_xaxis_transform(),
            label="failed runs, at the foot",
            clip_on=False,
        )
    yield note


def _vertical_positions(axes: Axes, view: ArchiveView, output: str, runs: xr.Dataset) -> FloatArray:
    """Return the height of each run; runs of one category are spread so that they can be seen."""
    if output in view.numeric_outputs:
        heights: FloatArray = view.scale(output).from_si(runs[output].values)
        return heights
    kinds = category_labels(runs[output])
    axes.set_yticks(range(len(kinds)), [plain_text(label, 20) for label in kinds.values()])
    axes.set_ylim(len(kinds) - 0.4, -0.6)  # the first on top, as on the page
    return jitter(runs[output].values, kinds)


def category_labels(output: xr.DataArray) -> dict[int, str]:
    """Return the labels of an output's categories by code, without that of failed runs."""
    attributes: dict[Any, Any] = dict(output.attrs)
    codes = np.asarray(attributes["flag_values"]).tolist()
    labels = np.atleast_1d(attributes.get("flag_labels", attributes["flag_meanings"].split()))
    named = zip(codes, map(str, labels), strict=True)
    return {code: label for code, label in named if label != "lost"}


def jitter(codes: npt.NDArray[np.integer], kinds: Iterable[int]) -> FloatArray:
    """Spread runs around the row of their category, so that they do not hide each other."""
    row_of = {code: row for row, code in enumerate(kinds)}
    rows = np.array([row_of.get(code, np.nan) for code in codes.tolist()])
    golden = (np.arange(rows.size) * 0.6180339887498949) % 1
    return rows + 0.5 * (golden - 0.5)
