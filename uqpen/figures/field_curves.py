"""Curves among the outputs: bands along their dimension, single runs behind, and where they end."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from uqpen.charts.scatter import thin_runs
from uqpen.core.labels import RUN, STATUS
from uqpen.core.status import Status
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.curve_estimates import CurveEstimates, curves
from uqpen.results.digits import grouped_number, percent_text
from uqpen.results.source_style import BLACK, GREY, VERMILION, source_style
from uqpen.results.texts import plain_text

__all__ = ["fan_panels", "model_curve_panels"]

# Single runs behind the bands, so few that each can be followed.
_RUNS = 30
# Shares of the curves; a line stands where no more than these get further.
_MARKED = (0.95, 0.5, 0.05)
# Characters of a note on places.
_LONGEST_NOTE = 240
# A label beyond this part of an axis stands before its line.
_NEAR_END = 0.94
# Inches; the name of a quantity takes two lines along it.
_HEIGHT = 2.9
_CONDITIONAL = "statistics at a place are of the curves that get there"
# Opacity of the shades between quantiles, of intervals, of bands around these, and of single runs.
_FAN, _INTERVAL, _BAND, _RUN = 0.2, 0.45, 0.2, 0.35


def fan_panels(view: ArchiveView) -> Iterator[Panel]:
    """Curves: median, mean, quantiles and bands; single runs."""
    by_dimension: dict[str, list[CurveEstimates]] = {}
    for output in curves(view):
        if (found := _estimates(view, output)) is not None:
            by_dimension.setdefault(found.dimension, []).append(found)
    for dimension, every in by_dimension.items():
        for each in every:
            title = view.title(f"{each.output}, {each.source}")
            yield Panel(title, partial(_draw_fan, each), _HEIGHT, group=dimension)
        ending = next((each for each in every if each.bounds("reached") is not None), None)
        if ending is not None:
            title = view.title(f"share of the curves that go on, {ending.source}")
            yield Panel(title, partial(_draw_reached, ending), _HEIGHT, group=dimension)


def model_curve_panels(view: ArchiveView) -> Iterator[Panel]:
    """Curves by each of several models: medians and quantiles."""
    if not view.model:
        return
    for output in curves(view.model_views[0]):
        found = {
            number: estimates
            for number, each in enumerate(view.model_views)
            if output in each.fields and (estimates := _estimates(each, output)) is not None
        }
        if len(found) > 1:
            first = next(iter(found.values()))
            title = f"{output}, by {first.source}"
            yield Panel(title, partial(_draw_models, found), _HEIGHT, group=first.dimension)


def _estimates(view: ArchiveView, output: str) -> CurveEstimates | None:
    """Return the estimates of a curve by the selected source, or the first that has some."""
    found = {**view.estimates(output, "quantile"), **view.estimates(output, "mean")}
    return CurveEstimates(view, output, next(iter(found))) if found else None


def _draw_fan(found: CurveEstimates, axes: Axes) -> Iterator[str]:
    yield from _draw_runs(found, axes)
    colour = found.view.look(found.source).colour
    _draw_quantiles(found, axes, colour)
    _draw_tolerance_bands(found, axes, colour)
    median = found.entries("quantile").get(0.5)
    if median is not None:
        axes.plot(found.places, median[:, 0], color=BLACK, linewidth=1.5, label="median")
        yield from _draw_band(found, axes, "quantile", "median", BLACK)
    mean = found.bounds("mean")
    if mean is not None:
        dashes = (0, (5, 1.5))
        axes.plot(found.places, mean[:, 0], color=VERMILION, linestyle=dashes, label="mean")
        yield from _draw_band(found, axes, "mean", "mean", VERMILION)
    _label_axes(found, axes)
    yield from _mark_ends(found, axes)


def _draw_runs(found: CurveEstimates, axes: Axes) -> Iterator[str]:
    """Draw some completed runs of the design; nothing of a surrogate."""
    view = found.view
    if found.source not in view.designs or not view.design(found.source).has_shown_runs:
        return
    runs = view.design(found.source).shown_runs
    completed = runs.isel({RUN: np.flatnonzero(runs[STATUS].values == Status.OK)})
    some = thin_runs(completed, _RUNS)
    values = view.scale(found.output).from_si(some[found.output].values)
    lines = axes.plot(found.places, values.T, color=GREY, linewidth=0.4, alpha=_RUN, zorder=1)
    lines[0].set_label("single runs")
    drawn, every = (grouped_number(each.sizes[RUN]) for each in (some, completed))
    yield f"grey: {drawn} of {every} completed runs of {found.source}"


def _draw_quantiles(found: CurveEstimates, axes: Axes, colour: str, name: str = "") -> None:
    """Shade between each quantile and its counterpart on the other side of the median."""
    quantiles = found.entries("quantile")
    for probability, lower in quantiles.items():
        upper = next(
            (quantiles[each] for each in quantiles if np.isclose(each, 1 - probability)), None
        )
        if probability < 0.5 and upper is not None:
            ends = f"{percent_text(probability)} to {percent_text(1 - probability)} quantile"
            axes.fill_between(
                found.places,
                lower[:, 0],
                upper[:, 0],
                color=colour,
                alpha=_FAN,
                linewidth=0,
                label=", ".join(filter(None, (name, ends))),
            )


def _draw_tolerance_bands(found: CurveEstimates, axes: Axes, colour: str) -> None:
    confidence = percent_text(found.level("tolerance_band"))
    for content, bounds in found.entries("tolerance_band").items():
        if np.isfinite(bounds[:, 1:]).any():
            held = percent_text(content)
            label = f"band that holds {held} of the curves, {confidence} confidence"
            for bound, text in ((1, label), (2, None)):
                style: dict[str, Any] = {"color": colour, "linestyle": (0, (1, 1)), "label": text}
                axes.plot(found.places, bounds[:, bound], linewidth=0.9, **style)


def _draw_band(
    found: CurveEstimates, axes: Axes, statistic: str, name: str, colour: str
) -> Iterator[str]:
    """Shade the intervals of a curve, at each place and simultaneous, or yield why it has none."""
    drawn = False
    for band, opacity, text in (
        (f"{statistic}_band", _BAND, "simultaneous {level} band of the {name}"),
        (statistic, _INTERVAL, "{level} intervals of the {name}, each place by itself"),
    ):
        bounds = found.bounds(band) if name == "mean" else found.entries(band).get(0.5)
        if bounds is not None and np.isfinite(bounds[:, 1:]).any():
            drawn = True
            axes.fill_between(
                found.places,
                bounds[:, 1],
                bounds[:, 2],
                color=colour,
                alpha=opacity,
                linewidth=0,
                label=text.format(level=percent_text(found.level(band)), name=name),
            )
    if left_out := found.left_out(f"{statistic}_band"):
        yield f"the band of the {name} leaves out {plain_text(left_out, _LONGEST_NOTE)}"
    if not drawn:
        reason = plain_text(found.reason(statistic) or "no reason is known")
        yield f"no interval of the {name}: {reason}"


def _label_axes(found: CurveEstimates, axes: Axes) -> None:
    axes.set_xlabel(found.view.axis_label(found.dimension))
    axes.set_ylabel(found.view.axis_label(found.output))
    if len(found.places) > 1:  # an axis has a length
        axes.set_xlim(found.places[0], found.places[-1])


def _mark_ends(found: CurveEstimates, axes: Axes) -> Iterator[str]:
    """Draw a line where the share of the curves that go on falls below some values."""
    reached = found.bounds("reached")
    if reached is None:
        return
    shares = reached[:, 0]
    near_end = found.places[0] + _NEAR_END * np.ptp(found.places)
    for share in _MARKED:
        if (shares < share).any():
            place = found.places[np.argmax(shares < share)]
            axes.axvline(place, color=GREY, linewidth=0.7, linestyle=(0, (2, 2)), zorder=1)
            axes.annotate(
                percent_text(share),
                (place, 1),
                (-9 if place > near_end else 2, -2),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                rotation=90,
                va="top",
                fontsize=6.5,
                color=GREY,
            )
    if (shares < 1).any():
        yield _CONDITIONAL
        yield "upright lines: shares of the curves that get there"


def _draw_reached(found: CurveEstimates, axes: Axes) -> Iterator[str]:
    bounds = found.bounds("reached")
    if bounds is None:
        return
    colour = found.view.look(found.source).colour
    axes.plot(found.places, bounds[:, 0], color=colour, linewidth=1.5)
    axes.fill_between(
        found.places, bounds[:, 1], bounds[:, 2], color=colour, alpha=_INTERVAL, linewidth=0
    )
    axes.set_xlabel(found.view.axis_label(found.dimension))
    axes.set(ylabel="P(curve gets there)", xlim=found.places[[0, -1]], ylim=(0, 1.02))
    if np.isfinite(bounds[:, 1:]).any():
        yield f"shade of the share: {percent_text(found.level('reached'))} intervals at each place"


def _draw_models(found: dict[int, CurveEstimates], axes: Axes) -> Iterator[str]:
    for number, each in found.items():
        style, name = source_style(number), plain_text(each.view.model, 40)
        _draw_quantiles(each, axes, style.colour, name)
        middle = each.entries("quantile").get(0.5)
        if middle is not None:
            line = {"color": style.colour, "linestyle": style.line, "linewidth": 1.5}
            axes.plot(each.places, middle[:, 0], label=f"{name}, median", **line)
    _label_axes(next(iter(found.values())), axes)
    if any(each.bounds("reached") is not None for each in found.values()):
        yield _CONDITIONAL
