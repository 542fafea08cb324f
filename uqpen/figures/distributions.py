"""Distribution functions of the outputs, by source or model, and exceedance probabilities."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from uqpen.core.catalogue import LOWER_THRESHOLD, THRESHOLD
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.figures.curves import CUT, Curve, axis_span, draw_band, draw_curve
from uqpen.figures.estimate_dots import error_bar_lengths
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_text
from uqpen.results.source_style import BLACK, GREY, source_style
from uqpen.results.table import estimate_with_verdict, identity
from uqpen.results.texts import plain_text

__all__ = [
    "CUT",
    "cdf",
    "distribution_curves",
    "exceedance",
    "exceedance_span",
    "model_curves",
    "model_panels",
    "thresholds",
]

# Requested probabilities below this need a logarithmic axis.
_SMALL = 0.02
# Widths of an axis by which it is made longer, at the most, for a requested value.
_FAR = 1.5
# The part of an axis that an upright label takes.
_ROOM = 0.03


def cdf(view: ArchiveView) -> Iterator[Panel]:
    """Distribution functions of all sources, one with its band."""
    for output in view.numeric_outputs:
        if curves := distribution_curves(view, output):
            yield Panel(view.title(output), partial(_draw_cdf, view, output, curves))


def exceedance(view: ArchiveView) -> Iterator[Panel]:
    """Probability of exceeding each value, with the requested ones."""
    for output in view.numeric_outputs:
        if curves := distribution_curves(view, output):
            title = view.title(f"{output}, by {curves[0].name}")
            yield Panel(title, partial(_draw_exceedance, view, output, curves[0]))


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
    yield from _mark(axes, view, output, at_foot=True)
    if is_cut:
        yield CUT


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


def _draw_exceedance(view: ArchiveView, output: str, curve: Curve, axes: Axes) -> Iterator[str]:
    appearance = view.look(curve.name)
    lower, upper, is_cut = exceedance_span(view, output, curve)
    curve = curve.extended(lower, upper).complement()
    yield from draw_band(axes, curve, appearance.colour)
    draw_curve(axes, curve, appearance, is_thick=True)
    probabilities = view.statistics.get(curve.name, output, "exceedance")
    axes.set_xlim(lower, upper)
    yield from _mark(axes, view, output, at_foot=False)
    smallest = 1.0
    if probabilities is not None:
        _draw_thresholds(axes, probabilities, view, output)
        if np.isfinite(probabilities.values[:, 1:]).any():
            yield f"bars: {percent_text(float(probabilities.attrs[INTERVAL_LEVEL]))} intervals"
        smallest = float(np.nanmin(probabilities.values[:, 0], initial=1.0))
    axes.set(xlabel=view.axis_label(output), ylabel="P(more than x)")
    if 0 < smallest < _SMALL:
        axes.set_yscale("log")
        axes.set_ylim(smallest / 20, 1)
        axes.yaxis.set_major_formatter("{x:.4g}")
        axes.yaxis.set_minor_formatter("")
        yield "probabilities by their logarithms, as small ones are asked for"
    else:
        axes.set_ylim(0, 1)
    if is_cut:
        yield CUT


def _draw_thresholds(
    axes: Axes, probabilities: xr.DataArray, view: ArchiveView, output: str
) -> None:
    """Draw the probabilities of exceeding the requested values."""
    places = _thresholds(view, output, probabilities)
    for (written, place), estimate in zip(places, probabilities, strict=True):
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
            label=f"{caption} = {estimate_with_verdict(estimate, identity)}",
        )


def thresholds(view: ArchiveView, output: str) -> dict[str, float]:
    """Return the thresholds of a study: each as written, and as a number in the unit shown."""
    found: dict[str, float] = {}
    for statistic, dimension in (("exceedance", THRESHOLD), ("below", LOWER_THRESHOLD)):
        first = next(iter(view.estimates(output, statistic).values()), None)
        found |= {} if first is None else dict(_thresholds(view, output, first, dimension))
    return found


def _thresholds(
    view: ArchiveView, output: str, probabilities: xr.DataArray, dimension: str = THRESHOLD
) -> list[tuple[str, float]]:
    shown = view.scale(output).from_si(probabilities[f"{dimension}_value"].values)
    return list(zip(map(str, probabilities[dimension].values), shown.tolist(), strict=True))


def _mark(axes: Axes, view: ArchiveView, output: str, *, at_foot: bool) -> Iterator[str]:
    """A line at each requested value, with its text in the study where there is room."""
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
