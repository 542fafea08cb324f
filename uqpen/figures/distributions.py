"""Distribution functions of the outputs, by source or model."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from uqpen.core.statistic_dimensions import LOWER_THRESHOLD, THRESHOLD
from uqpen.figures.curves import CUT, Curve, axis_span, draw_band, draw_curve
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.exceedance_tail import LargestRun
from uqpen.results.source_style import GREY, source_style
from uqpen.results.texts import plain_text

__all__ = [
    "CUT",
    "cdf",
    "distribution_curves",
    "exceedance_span",
    "mark_thresholds",
    "model_curves",
    "model_panels",
    "threshold_places",
    "thresholds",
]

# Widths of an axis by which it is made longer, at the most, for a requested value.
_FAR = 1.5
# The part of an axis that an upright label takes.
_ROOM = 0.03


def cdf(view: ArchiveView) -> Iterator[Panel]:
    """Distribution functions of all sources, one with its band."""
    for output in view.numeric_outputs:
        if curves := distribution_curves(view, output):
            yield Panel(view.title(output), partial(_draw_cdf, view, output, curves))


def model_panels(view: ArchiveView) -> Iterator[Panel]:
    """Distribution functions by each of several models."""
    if not view.model:
        return
    for output in view.numeric_outputs:
        source = next(iter(view.estimates(output, "cdf_value")), "")
        if curves := model_curves(view, output, source):
            yield Panel(f"{output}, by {source}", partial(_draw_models, view, output, curves))


def model_curves(view: ArchiveView, output: str, source: str) -> list[Curve]:
    """Return the functions of an output by one source of each model."""
    curves = (
        Curve.from_source(each.model, each.statistics, source, output, view.scale(output))
        for each in view.model_views
    )
    return [curve for curve in curves if curve is not None]


def distribution_curves(view: ArchiveView, output: str) -> list[Curve]:
    """Return the functions of all sources; first that of the requested one, or a design."""
    statistics, measure = view.statistics, view.scale(output)
    curves = (
        Curve.from_source(source, statistics, source, output, measure)
        for source in statistics.sources
    )
    found = [curve for curve in curves if curve is not None]
    if view.source is None:
        return found
    first = [curve for curve in found if curve.name == view.source]
    return first and [*first, *(curve for curve in found if curve.name != view.source)]


def _draw_cdf(view: ArchiveView, output: str, curves: list[Curve], axes: Axes) -> Iterator[str]:
    lower, upper, is_cut = exceedance_span(view, output, curves[0])
    banded = curves[0].extended(lower, upper)
    yield from draw_band(axes, banded, view.look(banded.name).colour)
    draw_curve(axes, banded, view.look(banded.name), is_thick=True)
    for curve in curves[1:]:
        thin = curve.thinned().extended(lower, upper)
        draw_curve(axes, thin, view.look(curve.name), is_thick=False)
    axes.set(xlabel=view.axis_label(output), ylabel="P(at most x)")
    axes.set(xlim=(lower, upper), ylim=(0, 1))
    yield from mark_thresholds(axes, view, output, at_foot=True)
    if is_cut:
        yield CUT
        if banded.name in view.designs:
            yield LargestRun.of_design(view, banded.name, output).sentence


def _draw_models(view: ArchiveView, output: str, curves: list[Curve], axes: Axes) -> Iterator[str]:
    names = [each.model for each in view.model_views]
    lower, upper, is_cut = axis_span([curve.values for curve in curves])
    for curve in curves:
        style, thin = source_style(names.index(curve.name)), curve.thinned().extended(lower, upper)
        yield from draw_band(axes, thin, style.colour)
        draw_curve(axes, thin, style, is_thick=False)
    axes.set(xlabel=view.axis_label(output), ylabel="P(at most x)")
    axes.set(xlim=(lower, upper), ylim=(0, 1))
    if is_cut:
        yield CUT


def thresholds(view: ArchiveView, output: str) -> dict[str, float]:
    """Return the thresholds of a study: each as written, and as a number in the unit shown."""
    found: dict[str, float] = {}
    for statistic, dimension in (("exceedance", THRESHOLD), ("below", LOWER_THRESHOLD)):
        first = next(iter(view.estimates(output, statistic).values()), None)
        found |= {} if first is None else dict(threshold_places(view, output, first, dimension))
    return found


def threshold_places(
    view: ArchiveView, output: str, probabilities: xr.DataArray, dimension: str = THRESHOLD
) -> list[tuple[str, float]]:
    """Return each threshold of some probabilities as written, and in the unit shown."""
    shown = view.scale(output).from_si(probabilities[f"{dimension}_value"].values)
    return list(zip(map(str, probabilities[dimension].values), shown.tolist(), strict=True))


def mark_thresholds(axes: Axes, view: ArchiveView, output: str, *, at_foot: bool) -> Iterator[str]:
    """Draw a line at each requested value, with its text in the study where there is room."""
    lower, upper = axes.get_xlim()
    beyond, last = [], -np.inf
    for written, place in sorted(thresholds(view, output).items(), key=lambda each: each[1]):
        if not lower <= place <= upper:
            beyond.append(plain_text(written, 20))
            continue
        axes.axvline(place, color=GREY, linewidth=0.9, linestyle=(0, (2, 2)), zorder=1)
        if place - last > _ROOM * (upper - lower):
            axes.annotate(
                plain_text(written, 20),
                (place, 0 if at_foot else 1),
                (2, 3 if at_foot else -2),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                rotation=90,
                va="bottom" if at_foot else "top",
                fontsize=6.5,
                color=GREY,
            )
            last = place
    if beyond:
        yield f"asked for beyond the axis of {plain_text(output, 30)}: {', '.join(beyond)}"


def exceedance_span(view: ArchiveView, output: str, curve: Curve) -> tuple[float, float, bool]:
    """Return the ends of the axis, past most of the tail and past the requested values.

    Not after those so far away that nothing could be seen of the rest.
    """
    lower, upper, _ = axis_span([curve.values])
    limit = _FAR * (upper - lower)
    threshold_values = thresholds(view, output).values()
    near = [place for place in threshold_values if lower - limit <= place <= upper + limit]
    return axis_span([curve.values], near)
