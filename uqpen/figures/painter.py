"""A chart on matplotlib's axes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, Literal

import numpy as np

from uqpen.charts.axes import logarithmic_ticks
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import (
    CROSS,
    END,
    Band,
    Bars,
    Colour,
    Dots,
    HeatMap,
    Line,
    Mark,
    Points,
    Rule,
    Shade,
    has_interval,
)
from uqpen.core.arrays import FloatArray
from uqpen.figures.panel import Axes, Panel
from uqpen.results.source_style import BLACK, BLUE, GREY, VERMILION, source_style
from uqpen.results.texts import plain_text

# By the names of the page's colours.
_COLOURS = {"ink": BLACK, "quiet": GREY, "grid": "#cccccc", "accent": BLUE, "beyond": VERMILION}
_MARKERS = {
    "circle": "o",
    "square": "s",
    "triangle-up": "^",
    "diamond": "D",
    "triangle-down": "v",
    "pentagon": "p",
    "cross": "P",
    "star-diamond": "d",
    "triangle-left": "<",
    "triangle-right": ">",
    CROSS: "x",
    END: "|",
}
_DASHES: dict[str, Any] = {
    "solid": "-",
    "dash": (0, (5, 1.5)),
    "dot": (0, (1, 1)),
    "dashdot": (0, (6, 1.5, 1, 1.5)),
    "6px,3px": (0, (3, 1)),
    "longdashdot": (0, (6, 1, 1, 1, 1, 1)),
    "4px,4px": (0, (2, 2)),
    "longdash": (0, (8, 2, 2, 2)),
    "2px,5px": (0, (1, 2.5)),
    "8px,2px,2px,2px": (0, (4, 1, 1, 1)),
}
# Points of a paper to a pixel of the page, and inches of a row and of what is around all rows.
_POINTS, _MARKER_POINTS = 0.6, 0.56
_ROW_PIXELS, _FRAME = 116.0, 0.18
_HEIGHT = 2.5
# Numbers below a narrow panel.
_MOST_TICKS = 4
# A vector file with more points is large.
_MOST_POINTS = 5_000


def chart_panel(chart: Chart, title_of: Callable[[str], str]) -> Panel:
    """Return a chart as a panel of a figure.

    Parameters
    ----------
    chart : Chart
        As the page has it.
    title_of : callable
        From a title to that which names the model too, if there are several.
    """
    unnamed = [
        each
        for each in (chart.of, chart.source)
        if not re.search(rf"\b{re.escape(each)}\b", chart.title, re.IGNORECASE)
    ]
    title = f"{', '.join(unnamed)}: {chart.title}" if unnamed else chart.title
    height = _FRAME + chart.height / _ROW_PIXELS if chart.y.rows else _HEIGHT

    def draw(axes: Axes) -> Iterator[str]:
        _draw_axis(axes, chart.x, "x")
        _draw_axis(axes, chart.y, "y")
        if chart.y.rows and not chart.x.is_logarithmic:
            axes.locator_params(axis="x", nbins=_MOST_TICKS)
        for mark in chart.marks:
            _draw_mark(axes, mark)
        for key in chart.keys:
            _draw_key(axes, key)
        # A figure has no table.
        yield from (re.sub(r"; the table \w.*", ".", note) for note in chart.notes)

    shown = title if chart.is_of_all_models else title_of(title)
    return Panel(shown, draw, height, chart.y.rows, chart.of)


def _draw_axis(axes: Axes, axis: Axis, along: Literal["x", "y"]) -> None:
    """Give an axis its title, its ends, its scale and its ticks; rows are the panel's."""
    if axis.rows:
        return
    axes.set(**{f"{along}label": axis.title})
    if axis.is_logarithmic:
        axes.set(**{f"{along}scale": "log"})
    # Matplotlib's own texts of powers are formulas.
    of_powers = axis.ends if axis.is_logarithmic and axis.ends is not None else None
    ticks = axis.ticks or (tuple(logarithmic_ticks(*of_powers)) if of_powers else ())
    if ticks:
        places, texts = zip(*ticks, strict=True)
        getattr(axes, f"set_{along}ticks")(places, texts)
        getattr(axes, f"{along}axis").set_minor_formatter("")
        axes.tick_params(axis=along, which="minor", length=0)
    if axis.ends is not None:
        lower, upper = axis.ends
        ends = (10.0**lower, 10.0**upper) if axis.is_logarithmic else (lower, upper)
        if lower < upper:
            axes.set(**{f"{along}lim": ends})


def _draw_mark(axes: Axes, mark: Mark) -> None:
    match mark:
        case Line():
            style = "steps-post" if mark.is_stepped else "default"
            # A label with a line before it is not in the legend.
            axes.plot(mark.x, mark.y, **_stroke(mark), drawstyle=style, label=f"_{mark.name}")
        case Band():
            axes.fill_between(
                mark.x,
                mark.lower,
                mark.upper,
                step="post" if mark.is_stepped else None,
                color=_colour(mark.series),
                alpha=0.35,
                linewidth=0,
            )
        case Points():
            x, y = (np.asarray(each, dtype=np.float64) for each in (mark.x, mark.y))
            outline = _POINTS * mark.outline if isinstance(mark.outline, float) else 1.0
            markers = np.broadcast_to(np.asarray(mark.marker), x.shape)
            sizes = np.broadcast_to(np.asarray(mark.size, dtype=np.float64), x.shape)
            for marker, size in dict.fromkeys(zip(markers.tolist(), sizes.tolist(), strict=True)):
                chosen = (markers == marker) & (sizes == size)
                axes.plot(
                    x[chosen],
                    y[chosen],
                    **_marker(marker, mark.series),
                    markersize=_MARKER_POINTS * size,
                    linestyle="none",
                    alpha=mark.opacity,
                    markeredgewidth=outline if marker.endswith("-open") or marker == CROSS else 0,
                    rasterized=x.size > _MOST_POINTS,
                )
        case Dots():
            _draw_dots(axes, mark)
        case Bars():
            # One area: between bars of their own a vector file shows gaps.
            axes.stairs(mark.counts, mark.edges, fill=True, color=_colour(mark.series), alpha=0.5)
        case HeatMap():
            # As a picture: a vector file of ten thousand cells would be large.
            mesh = axes.pcolormesh(
                mark.x,
                mark.y,
                mark.bounds[..., 0],
                shading="nearest",
                cmap="viridis",
                rasterized=True,
            )
            axes.grid(visible=False)
            axes.figure.colorbar(mesh, ax=axes)
        case Rule():
            _draw_rule(axes, mark)
        case Shade():
            axes.axvspan(mark.lower, mark.upper, color=_colour(mark.series), alpha=0.2, linewidth=0)


def _draw_dots(axes: Axes, dots: Dots) -> None:
    places, colour = np.asarray(dots.places, dtype=np.float64), _colour(dots.series)
    if dots.is_joined:
        line = (dots.bounds[:, 0], places) if dots.along == "x" else (places, dots.bounds[:, 0])
        axes.plot(*line, color=colour, linewidth=1)
    for place, row, is_known in zip(places, dots.bounds, has_interval(dots.bounds), strict=True):
        lengths, is_across = error_bar_lengths(row), dots.along == "x"
        axes.errorbar(
            [row[0] if is_across else place],
            [place if is_across else row[0]],
            xerr=lengths if is_across else None,
            yerr=None if is_across else lengths,
            linestyle="none",
            elinewidth=1.2,
            capsize=2,
            **_marker(dots.marker if is_known else f"{dots.marker}-open", dots.series),
        )


def error_bar_lengths(bounds: FloatArray) -> FloatArray | None:
    """Return the lengths of an interval below and above its estimate; None without any bound."""
    estimate, lower, upper = bounds
    if not np.isfinite(bounds[1:]).any():
        return None
    sides = np.array([[estimate - lower], [upper - estimate]])
    lengths: FloatArray = np.maximum(np.nan_to_num(sides), 0.0)
    return lengths


def _draw_rule(axes: Axes, rule: Rule) -> None:
    draw = axes.axhline if rule.is_horizontal else axes.axvline
    colour = _colour(rule.series)
    draw(rule.at, color=colour, linewidth=0.9, linestyle=_DASHES[rule.dash], zorder=1)
    if rule.label:
        axes.annotate(
            plain_text(rule.label, 20),
            (rule.at, 0 if rule.at_foot else 1),
            (-2 if rule.is_before else 2, 3 if rule.at_foot else -2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            rotation=90,
            ha="right" if rule.is_before else "left",
            va="bottom" if rule.at_foot else "top",
            fontsize=6.5,
            color=colour,
        )


def _draw_key(axes: Axes, key: LegendKey) -> None:
    """Add an entry of the legend, without anything on the axes."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    label = plain_text(key.text, 80)
    if key.mark in ("band", "bar"):
        patch = Rectangle((0, 0), 0, 0, color=_colour(key.series), alpha=0.35, linewidth=0)
        patch.set_label(label)
        axes.add_patch(patch)
        return
    if key.mark == "line":
        style = {"color": _colour(key.series), "linestyle": _DASHES[key.dash]}
    else:
        style = _marker(key.mark, key.series) | {"linestyle": "none"}
    axes.add_line(Line2D([], [], **style, label=label))


def _stroke(line: Line) -> dict[str, Any]:
    width = _POINTS * line.width
    return {"color": _colour(line.series), "linestyle": _DASHES[line.dash], "linewidth": width}


def _colour(series: Colour) -> str:
    return source_style(series).colour if isinstance(series, int) else _COLOURS[series]


def _marker(name: str, series: Colour) -> dict[str, Any]:
    colour, is_open = _colour(series), name.endswith("-open")
    marker = _MARKERS[name.removesuffix("-open")]
    return {"marker": marker, "color": colour, "markerfacecolor": "white" if is_open else colour}
