"""Marks of a chart: lines, bands, bars, points, estimates with intervals, maps, and rules.

A colour is the number of a source among an archive's, or a name: ``"ink"``, ``"quiet"``,
``"accent"``, ``"grid"`` and others of the page's style. Whoever paints a chart looks it up. A
marker and a dash have the names of Plotly, as both painters know them.

The text under a pointer is a template with Plotly's placeholders, such as ``%{y:.4~g}``. Texts that
are put into a template are `escape_text`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.results.digits import percent_text
from uqpen.results.texts import capitalized, plain_text

Colour = int | str
Numbers = Sequence[float] | FloatArray | IntArray

# Markers of no source: of failed runs and refused estimates, and of the end of a line.
CROSS, END = "x", "line-ns"
# By the position of a source, one for each colour.
MARKERS = (
    "circle",
    "square",
    "triangle-up",
    "diamond",
    "triangle-down",
    "pentagon",
    "cross",
    "star-diamond",
    "triangle-left",
    "triangle-right",
)
DASHES = (
    "solid",
    "dash",
    "dot",
    "dashdot",
    "6px,3px",
    "longdashdot",
    "4px,4px",
    "longdash",
    "2px,5px",
    "8px,2px,2px,2px",
)

HOLLOW = "hollow: no interval"

# Plotly reads these in a text; so they are written in the way that it writes them back from.
_READ = str.maketrans({"&": "&#38;", "<": "&#60;", ">": "&#62;", "%": "&#37;"})


@dataclass(frozen=True, eq=False)
class Line:
    """A line.

    Parameters
    ----------
    x, y : array_like
        NaN breaks the line.
    series : int or str
        Its colour.
    hover : str
        Template of the text under a pointer; nothing is shown if it is empty.
    name : str
        What a test or a reader finds it by.
    beside : sequence of array_like
        Values of the placeholders ``customdata``.
    texts : sequence of str
        Plain texts, one for each point: values of the placeholder ``text``.
    dash : str
        Of `DASHES`.
    width : float
        In CSS pixels.
    is_stepped : bool
        Whether it goes on level until the next point.
    """

    x: Numbers
    y: Numbers
    series: Colour
    hover: str = ""
    name: str = ""
    beside: Sequence[Numbers] = ()
    texts: Sequence[str] = ()
    dash: str = "solid"
    width: float = 2
    is_stepped: bool = False


@dataclass(frozen=True, eq=False)
class Band:
    """The area between two lines."""

    x: Numbers
    lower: Numbers
    upper: Numbers
    series: Colour
    is_stepped: bool = False


@dataclass(frozen=True, eq=False)
class Points:
    """Points by themselves."""

    x: Numbers  # their places
    y: Numbers  # their places
    series: Colour  # their colour
    hover: str = ""  # as of a `Line`
    name: str = ""  # as of a `Line`
    texts: Sequence[str] = ()  # as of a `Line`
    # Values of the placeholder ``customdata``, such as the place of a run among all.
    numbers: Sequence[int] = ()
    # Of `MARKERS`, or with ``-open`` behind it; for all points, or of each.
    marker: str | Sequence[str] = "circle"
    size: float | Sequence[float] = 4  # in CSS pixels
    opacity: float = 0.55  # by default that of one of many runs
    outline: float | Sequence[float] | None = None  # width of the markers' outline


@dataclass(frozen=True, eq=False)
class Dots:
    """Estimates with their intervals; hollow where there is none."""

    bounds: FloatArray  # (estimate, bound): estimate, lower, upper; NaN for a bound that is none
    places: Numbers  # along the other axis
    series: Colour  # their colour
    hovers: Sequence[str] = ()  # plain texts under a pointer, one for each
    name: str = ""  # as of a `Line`
    marker: str = "circle"  # of `MARKERS`
    along: str = "x"  # which axis the estimates lie along
    is_joined: bool = False  # whether a line goes through them
    # Template that has `hovers` as ``text`` and `labels` as ``customdata``, if there is one.
    hover: str = ""
    labels: Sequence[str] = ()  # plain texts, one for each


@dataclass(frozen=True, eq=False)
class Bars:
    """Counts between edges."""

    edges: Numbers  # one more than counts
    counts: Numbers  # their heights
    series: Colour  # their colour
    hover: str  # as of a `Line`
    is_even: bool = False  # whether all bins have the width of the first


@dataclass(frozen=True, eq=False)
class HeatMap:
    """Estimates at places along two dimensions, as colours."""

    x: FloatArray  # the places, in ascending order
    y: FloatArray  # the places, in ascending order
    bounds: FloatArray  # (y, x, bound): estimate, lower, upper
    unit: str  # text behind an estimate

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest estimate."""
        values = self.bounds[..., 0]
        return float(np.nanmin(values)), float(np.nanmax(values))

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Both ends along x, and both along y; a single place has the width 1."""
        first, last = (
            (each[0] - 0.5, each[0] + 0.5) if each.size == 1 else (each[0], each[-1])
            for each in (self.x, self.y)
        )
        return (float(first[0]), float(first[1])), (float(last[0]), float(last[1]))


@dataclass(frozen=True)
class Rule:
    """A straight line across a whole chart, behind the other marks."""

    at: float  # where it crosses an axis
    series: Colour  # its colour
    dash: str = "solid"  # of `DASHES`
    # Whether it is a thin one from the left to the right, and not one from the foot to the top.
    is_horizontal: bool = False
    label: str = ""  # A plain text along an upright line
    at_foot: bool = False  # whether that stands at the foot
    is_before: bool = False  # whether it stands on the left of the line


@dataclass(frozen=True)
class Shade:
    """The shaded area between two upright lines."""

    lower: float
    upper: float
    series: Colour


Mark = Line | Band | Points | Dots | Bars | HeatMap | Rule | Shade


def end_of_line(x: float, y: float, series: Colour, name: str) -> Points:
    """Return the upright tick at the end of a line; a pointer finds its name."""
    hover, marker = escape_text(name), f"{END}-open"
    return Points([x], [y], series, hover, name, marker=marker, size=14, opacity=1, outline=2.5)


def series_marker(series: int) -> str:
    """The marker of a source, by its position."""
    return MARKERS[series % len(MARKERS)]


def series_dash(series: int) -> str:
    """The dashes of a source's line, by its position."""
    return DASHES[series % len(DASHES)]


def key_marker(marker: str, bounds: FloatArray) -> str:
    """Return the marker of a legend for estimates: hollow where none of them has an interval.

    Parameters
    ----------
    bounds : ndarray of shape (estimate, bound)
        As of `Dots`.
    """
    return marker if has_interval(bounds).any() else f"{marker}-open"


def escape_text(text: str, longest: int = 80) -> str:
    """A text for Plotly, which shows it as it stands."""
    return plain_text(text, longest).translate(_READ)


def has_interval(bounds: FloatArray) -> BoolArray:
    """Return whether an estimate has an interval, which may have one end alone.

    Parameters
    ----------
    bounds : ndarray of shape (..., bound)
        Estimate, lower, upper; NaN for a bound that is none.
    """
    return np.asarray(np.isfinite(bounds[..., 1:]).any(axis=-1))


def all_bounded(bounds: FloatArray) -> bool:
    """Return whether each estimate has an interval; a missing estimate does not count."""
    return bool(has_interval(bounds)[np.isfinite(bounds[..., 0])].all())


def hollow_note(bounds: FloatArray) -> Iterator[str]:
    """A note on estimates without an interval, if there are any, for a chart that has a table."""
    if not all_bounded(bounds):
        yield f"{capitalized(HOLLOW)}; the table gives the reason."


def interval_notes(estimates: Iterable[xr.DataArray], each: str = "") -> Iterator[str]:
    """Yield a note for each level of the intervals drawn as bars, followed by a text."""
    levels = {
        float(estimate.attrs[INTERVAL_LEVEL])
        for estimate in estimates
        if INTERVAL_LEVEL in estimate.attrs and has_interval(estimate.values).any()
    }
    yield from (f"Bars: {percent_text(level)} intervals{each}." for level in sorted(levels))
