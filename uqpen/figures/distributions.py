"""Distribution functions of the outputs, and the probabilities of exceeding a value."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group, names_in
from uqpen.archive.told import told
from uqpen.figures.curves import Curve, draw_band, draw_curve, span
from uqpen.figures.estimates import interval
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.figures.style import BLACK, GREY
from uqpen.figures.texts import plain
from uqpen.labels import CDFS, EXCEEDANCE, INTERVAL_LABEL, INTERVAL_LEVEL, REFUSED, UNCHECKED
from uqpen.summary.digits import percent, sensible

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["CUT", "cdf", "curves_of", "ends_of", "exceedance", "thresholds_of"]

FloatArray = npt.NDArray[np.float64]

# An asked probability below which probabilities are shown by their logarithms.
_SMALL = 0.02
# Widths of an axis by which it is made longer, at the most, for a value that is asked for.
_FAR = 1.5
# The part of an axis that a value takes which is written upright.
_ROOM = 0.03

CUT = "axes end where all but 1 % lies inside"


def cdf(part: Part) -> Iterator[Panel]:
    """Distribution functions of all sources, one with its band."""
    for output in part.numbers:
        if curves := curves_of(part, output):
            yield Panel(part.titled(output), partial(_draw_cdf, part, output, curves))


def exceedance(part: Part) -> Iterator[Panel]:
    """Probability of exceeding each value, and those asked for."""
    for output in part.numbers:
        if curves := curves_of(part, output):
            title = part.titled(f"{output}, by {curves[0].name}")
            yield Panel(title, partial(_draw_exceedance, part, output, curves[0]))


def curves_of(part: Part, output: str) -> list[Curve]:
    """The distribution functions of all sources; first that of the one asked for, or a design."""
    found = [
        Curve.of(source, group(part.tree, CDFS, source), output, part.measure(output))
        for source in part.sources
        if source in names_in(part.tree, CDFS) and output in group(part.tree, CDFS, source)
    ]
    found = [curve for curve in found if np.isfinite(curve.values).any()]
    if part.source is None:
        return found
    first = [curve for curve in found if curve.name == part.source]
    return first and [*first, *(curve for curve in found if curve.name != part.source)]


def _draw_cdf(part: Part, output: str, curves: list[Curve], axes: Axes) -> Iterator[str]:
    lower, upper, is_cut = ends_of(part, output, curves[0])
    banded = curves[0].up_to(lower, upper)
    yield from draw_band(axes, banded, part.look(banded.name).colour)
    draw_curve(axes, banded, part.look(banded.name), is_thick=True)
    for curve in curves[1:]:
        thin = curve.thinned().up_to(lower, upper)
        draw_curve(axes, thin, part.look(curve.name), is_thick=False)
    axes.set(xlabel=part.axis(output), ylabel="P(at most x)")
    axes.set(xlim=(lower, upper), ylim=(0, 1))
    yield from _mark(axes, part, output, at_foot=True)
    if is_cut:
        yield CUT


def _draw_exceedance(part: Part, output: str, curve: Curve, axes: Axes) -> Iterator[str]:
    appearance = part.look(curve.name)
    lower, upper, is_cut = ends_of(part, output, curve)
    curve = curve.up_to(lower, upper)
    yield from draw_band(axes, curve, appearance.colour, exceeding=True)
    draw_curve(axes, curve, appearance, is_thick=True, exceeding=True)
    asked = group(part.tree, EXCEEDANCE, curve.name).get(output)
    axes.set_xlim(lower, upper)
    yield from _mark(axes, part, output, at_foot=False)
    smallest = 1.0
    if asked is not None:
        _draw_asked(axes, asked, part, output)
        if np.isfinite(asked.values[:, 1:]).any():
            yield f"bars: {percent(float(asked.attrs[INTERVAL_LEVEL]))} intervals"
        smallest = float(np.nanmin(asked.values[:, 0], initial=1.0))
    axes.set(xlabel=part.axis(output), ylabel="P(more than x)")
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


def _draw_asked(axes: Axes, asked: xr.DataArray, part: Part, output: str) -> None:
    """The probabilities of exceeding the values that the study asks for."""
    places = part.measure(output).from_si(_threshold_values(asked, output))
    written = asked[f"{output}_threshold"].values
    for number, place in enumerate(places):
        bounds = asked.values[number]
        label = told(asked[number], INTERVAL_LABEL)
        verdict = f" {label}" if label in (REFUSED, UNCHECKED) else ""
        called = f"P({plain(output, 30)} > {plain(str(written[number]), 20)})"
        has_interval = np.isfinite(bounds[1:]).any()
        axes.errorbar(
            [place],
            bounds[:1],
            yerr=interval(bounds) if has_interval else None,
            fmt="o",
            color=BLACK,
            markerfacecolor=BLACK if has_interval else "white",
            capsize=3,
            zorder=5,
            label=f"{called} = {sensible(*bounds)}{verdict}",
        )


def thresholds_of(part: Part, output: str) -> dict[str, float]:
    """The values whose exceedance the study asks for, as written, in the unit that is shown."""
    for _, figures in part.told(EXCEEDANCE):
        if output in figures:
            written = figures[f"{output}_threshold"].values
            values = _threshold_values(figures[output], output)
            shown = part.measure(output).from_si(values).tolist()
            return dict(zip(map(str, written), shown, strict=True))
    return {}


def _threshold_values(asked: xr.DataArray, output: str) -> FloatArray:
    return np.asarray(asked[f"{output}_threshold_value"].values, dtype=np.float64)


def _mark(axes: Axes, part: Part, output: str, *, at_foot: bool) -> Iterator[str]:
    """A line at each value asked for, with the value as it was written where there is room."""
    lower, upper = axes.get_xlim()
    beyond, last = [], -np.inf
    for written, place in sorted(thresholds_of(part, output).items(), key=lambda each: each[1]):
        if not lower <= place <= upper:
            beyond.append(plain(written, 20))
            continue
        axes.axvline(place, color=GREY, linewidth=0.9, linestyle=(0, (2, 2)), zorder=1)
        if place - last > _ROOM * (upper - lower):
            _write_along(axes, place, plain(written, 20), at_foot=at_foot)
            last = place
    if beyond:
        yield f"asked for beyond the axis of {plain(output, 30)}: {', '.join(beyond)}"


def _write_along(axes: Axes, place: float, text: str, *, at_foot: bool) -> None:
    axes.annotate(
        text,
        (place, 0 if at_foot else 1),
        (2, 3 if at_foot else -2),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        rotation=90,
        va="bottom" if at_foot else "top",
        fontsize=6.5,
        color=GREY,
    )


def ends_of(part: Part, output: str, curve: Curve) -> tuple[float, float, bool]:
    """Where the axis ends: where the tail has all but ended, but after the values asked for.

    Not after those so far away that nothing could be seen of the rest.
    """
    lower, upper, _ = span([curve.values])
    reach = _FAR * (upper - lower)
    asked = thresholds_of(part, output).values()
    near = [place for place in asked if lower - reach <= place <= upper + reach]
    return span([curve.values], near)
