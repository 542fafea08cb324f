"""Histograms of the runs of a design, with their statistics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.core.statistic_dimensions import PROBABILITY
from uqpen.figures.distributions import output_span, scale_notes
from uqpen.figures.painter import error_bar_lengths
from uqpen.figures.panel import Axes, Panel, set_value_axis
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, percent_text
from uqpen.results.source_style import BLACK, VERMILION
from uqpen.results.table import quantile_label
from uqpen.results.texts import plain_text

__all__ = ["histogram", "marked_estimates"]


# A bin's opacity and that of an interval's shade, which is seen on top of it.
_LIGHT, _SHADE = 0.45, 0.2
# Colours and dashes of the lines at marked estimates, and in turn dashes of the other lines.
_LINES: dict[str, tuple[str, object]] = {
    "mean": (VERMILION, (0, (5, 1.5))),
    "median": (BLACK, "-"),
}
_OTHER_DASHES = ((0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)), (0, (1, 3)), (0, (8, 2)))


def histogram(view: ArchiveView) -> Iterator[Panel]:
    """Runs of one design, with mean and quantiles."""
    design = next((name for name in view.sample_designs if view.design(name).has_shown_runs), None)
    if design is None:
        return
    for output in view.numeric_outputs:
        values = view.scale(output).from_si(view.design(design).shown_runs[output].values)
        finite = values[np.isfinite(values)]
        counted = f"{grouped_number(finite.size)} run{'s' * (finite.size > 1)}"
        title = view.title(f"{output}: {counted} of {view.design(design).shown_prefix}{design}")
        if finite.size:
            yield Panel(title, partial(_draw, view, output, design, finite))
    for output in view.categorical_outputs:
        shares = view.statistics.get(design, output, "share")
        if shares is not None and np.isfinite(shares.values[:, 0]).any():
            labels = tuple(map(str, shares["category_label"].values))
            title = view.title(f"{output}: shares, {design}")
            yield Panel(title, partial(_draw_shares, view, output, design, shares), rows=labels)


def _draw(
    view: ArchiveView, output: str, design: str, values: FloatArray, axes: Axes
) -> Iterator[str]:
    span = output_span(view, output, [values], has_all_limits=False)
    counts, edges = span.bins(values)
    outside = values.size - int(counts.sum())
    colour = view.look(design).colour
    axes.stairs(counts, edges, fill=True, color=colour, alpha=_LIGHT, label="runs")
    axes.set(xlabel=view.axis_label(output), ylabel="runs in a bin", ylim=(0, None))
    set_value_axis(axes, span)
    yield from scale_notes(view, output, span, ())
    if outside:
        yield f"{output}: {grouped_number(outside)} runs lie outside of the axis"
    marks = list(marked_estimates(view, output, design))
    convert = view.scale(output).from_si
    styles = _line_styles([name for name, _ in marks])
    lacks = [
        _mark(axes, name, convert(estimate.values), style)
        for (name, estimate), style in zip(marks, styles, strict=True)
    ]
    levels = {each.attrs[INTERVAL_LEVEL] for _, each in marks if INTERVAL_LEVEL in each.attrs}
    if not all(lacks) and levels:
        yield f"shades: {percent_text(max(levels))} intervals of what the lines mark"
    if any(lacks):
        yield f"no interval: {', '.join(dict.fromkeys(filter(None, lacks)))}"


def marked_estimates(
    view: ArchiveView, output: str, design: str
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the marked estimates along ``bound``, in SI units, each with its name."""
    statistics = view.statistics.statistics(design, output)
    if "mean" in statistics:
        yield "mean", statistics["mean"]
    for quantile in statistics.get("quantile", ()):
        yield quantile_label(quantile[PROBABILITY].item()), quantile


def _line_styles(names: Sequence[str]) -> list[tuple[str, object]]:
    """Return colour and dashes of the line of each estimate; no two quantiles look the same."""
    others = [name for name in names if name not in _LINES]
    return [
        _LINES.get(name) or (BLACK, _OTHER_DASHES[others.index(name) % len(_OTHER_DASHES)])
        for name in names
    ]


def _mark(axes: Axes, name: str, bounds: FloatArray, style: tuple[str, object]) -> str:
    """Draw a line at an estimate and shade its interval; return its name if it has none."""
    colour, line = style
    axes.axvline(bounds[0], color=colour, linestyle=line, linewidth=1.2, label=plain_text(name))
    if not np.isfinite(bounds[1:]).all():
        return name
    axes.axvspan(*bounds[1:], color=colour, alpha=_SHADE, linewidth=0)
    return ""


def _draw_shares(
    view: ArchiveView, output: str, design: str, shares: xr.DataArray, axes: Axes
) -> Iterator[str]:
    colour = view.look(design).colour
    for row, bounds in enumerate(shares.values):
        axes.barh(row, bounds[0], height=0.6, color=colour, alpha=_LIGHT)
        error = error_bar_lengths(bounds)
        axes.errorbar(bounds[:1], [row], xerr=error, fmt="none", color=BLACK, capsize=3)
    axes.set(xlabel=f"share of {plain_text(output, 40)}", xlim=(0, 1))
    if not np.isfinite(shares.values[:, 1:]).any():
        yield "shares have no interval"
