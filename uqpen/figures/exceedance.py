"""Probability of exceeding a value, up to the largest run, with the requested ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import xarray as xr

from uqpen.charts.axes import CUT
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.core.statistic_dimensions import THRESHOLD
from uqpen.figures.curves import Curve, draw_band, draw_curve
from uqpen.figures.distributions import (
    distribution_curves,
    mark_thresholds,
    output_span,
    scale_notes,
)
from uqpen.figures.painter import error_bar_lengths
from uqpen.figures.panel import Axes, Panel, set_value_axis
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_text
from uqpen.results.empirical_cdf import ExceedanceTail
from uqpen.results.source_style import BLACK, SourceStyle
from uqpen.results.table import identity, shown_estimate
from uqpen.results.texts import plain_text

__all__ = ["exceedance"]

# Requested probabilities below this need a logarithmic axis.
_SMALL = 0.02


def exceedance(view: ArchiveView) -> Iterator[Panel]:
    """Probability of exceeding each value, with the requested ones."""
    for output in view.numeric_outputs:
        if curves := distribution_curves(view, output):
            title = view.title(f"{output}, by {curves[0].name}")
            yield Panel(title, partial(_draw, view, output, curves[0]))


def _draw(view: ArchiveView, output: str, curve: Curve, axes: Axes) -> Iterator[str]:
    appearance = view.look(curve.name)
    probabilities = view.statistics.get(curve.name, output, "exceedance")
    smallest = _smallest_probability(probabilities)
    is_logarithmic = 0 < smallest < _SMALL
    tail = _tail(view, output, curve)
    reached = [tail.largest.value] if tail is not None and is_logarithmic else []
    span = output_span(view, output, [curve.values], reached)
    yield from _draw_function(axes, curve, tail, span.ends, appearance)
    if tail is not None:
        _draw_end(axes, output, tail, appearance)
    set_value_axis(axes, span)
    yield from mark_thresholds(axes, view, output, span, at_foot=False)
    yield from scale_notes(view, output, span, [curve])
    if probabilities is not None:
        _draw_thresholds(axes, probabilities, view, output)
        if np.isfinite(probabilities.values[:, 1:]).any():
            yield f"bars: {percent_text(float(probabilities.attrs[INTERVAL_LEVEL]))} intervals"
    axes.set(xlabel=view.axis_label(output), ylabel="P(more than x)")
    if is_logarithmic:
        yield from _set_logarithmic(axes, min(smallest, *_ends(tail)))
    else:
        axes.set_ylim(0, 1)
    if span.is_cut:
        yield CUT


def _smallest_probability(probabilities: xr.DataArray | None) -> float:
    """Return the smallest requested probability; 1 for none."""
    if probabilities is None:
        return 1.0
    return float(np.nanmin(probabilities.values[:, 0], initial=1.0))


def _tail(view: ArchiveView, output: str, curve: Curve) -> ExceedanceTail | None:
    """Return the tail of a design's runs; None for a surrogate, or where all runs are equal."""
    if curve.name not in view.designs:
        return None
    tail = ExceedanceTail.of_design(view, curve.name, output, curve.limits)
    return tail if tail.values.size else None


def _ends(tail: ExceedanceTail | None) -> tuple[float, ...]:
    return () if tail is None else (float(tail.band[-1, 0]),)


def _draw_function(
    axes: Axes,
    curve: Curve,
    tail: ExceedanceTail | None,
    ends: tuple[float, float],
    appearance: SourceStyle,
) -> Iterator[str]:
    """Draw the band over the whole axis, and the function up to the largest run."""
    whole = curve.extended(*ends).complement()
    yield from draw_band(axes, whole, appearance.colour)
    if tail is None:
        draw_curve(axes, whole, appearance, is_thick=True)
        return
    first = curve.limits.around(np.zeros(1))
    start = np.array([min(ends[0], tail.values[0])])
    drawn = replace(
        curve,
        values=np.concatenate([start, tail.values]),
        band=np.concatenate([1 - first, tail.band]),
    )
    draw_curve(axes, drawn, appearance, is_thick=True)


def _draw_end(axes: Axes, output: str, tail: ExceedanceTail, appearance: SourceStyle) -> None:
    """Draw an upright tick at the largest run, where the function ends."""
    axes.plot(
        tail.values[-1:],
        tail.band[-1:, 0],
        marker="|",
        linestyle="none",
        color=appearance.colour,
        markersize=8,
        markeredgewidth=1.8,
        label=f"{plain_text(output, 30)}, {tail.largest.name}: {tail.largest.text}",
    )


def _set_logarithmic(axes: Axes, smallest: float) -> Iterator[str]:
    axes.set_yscale("log")
    axes.set_ylim(smallest / 20, 1)
    axes.yaxis.set_major_formatter("{x:.4g}")
    axes.yaxis.set_minor_formatter("")
    yield "probabilities by their logarithms, as small ones are asked for"


def _draw_thresholds(
    axes: Axes, probabilities: xr.DataArray, view: ArchiveView, output: str
) -> None:
    """Draw the probabilities of exceeding the requested values."""
    for estimate in probabilities:
        written, in_si = str(estimate[THRESHOLD].item()), estimate[f"{THRESHOLD}_value"].values
        place = float(view.scale(output).from_si(in_si))
        error = error_bar_lengths(estimate.values)
        caption = f"P({plain_text(output, 30)} > {plain_text(written, 20)})"
        axes.errorbar(
            [place],
            estimate.values[:1],
            yerr=error,
            fmt="o",
            color=BLACK,
            markerfacecolor="white" if error is None else BLACK,
            capsize=3,
            zorder=5,
            label=f"{caption} = {shown_estimate(estimate, identity)}",
        )
