"""A chart: its axes, marks, legend and notes, and what a reader of the page can do with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from uqpen.charts.marks import Mark, Numbers
from uqpen.results.table import NOTHING, OutputTable


class Block:
    """A part of a section of a page, whose template sets it by the name of its class."""

    @property
    def kind(self) -> str:
        """Name of the block's kind in the template."""
        return type(self).__name__.lower()


class PlottedQuantity(NamedTuple):
    """An input or an output, in the unit that the page shows it in.

    Charts with the same quantity along an axis have one threshold and one selection in common.
    """

    name: str
    unit: str  # as a study writes it; empty without one


@dataclass(frozen=True)
class Axis:
    """An axis of a chart, its title with the unit in brackets."""

    title: str
    ends: tuple[float, float] | None = None  # powers of ten if logarithmic; None: where data end
    rows: tuple[str, ...] = ()  # names in place of numbers: of the rows 0, 1, … from the top
    is_logarithmic: bool = False
    ticks: tuple[tuple[float, str], ...] = ()  # the only places that are marked, with texts
    quantity: PlottedQuantity | None = None  # along it, if that is a single one
    short_title: str = ""  # on a page, where there is no room for the title


@dataclass(frozen=True)
class LegendKey:
    """An entry of a legend."""

    text: str
    series: int | str  # chooses its colour, see `uqpen.charts.marks`
    mark: str  # "line", "band", "bar", or the name of a marker
    dash: str = "solid"


class RunsBeyondAxis(NamedTuple):
    """Values of a distribution function beyond the ends of its axis."""

    runs: int  # behind the function
    smallest: float  # of these runs
    largest: float  # of these runs
    nothing: Sequence[float | None]  # the bounds below the smallest run
    # Values of some runs there, ascending up to the most extreme one, each with its bounds.
    below: Sequence[Sequence[float | None]]
    above: Sequence[Sequence[float | None]]


@dataclass(frozen=True)
class ThresholdReadout:
    """A threshold that a reader moves over a distribution function, and the values there."""

    output: str
    unit: str
    source: str
    level: float  # of the simultaneous band; NaN where there is none
    note: str  # the reason why there is no band
    values: Sequence[float]  # thresholds that the slider has, ascending
    limits: Sequence[tuple[float, str]]  # of the study, each with its text there
    start: float  # the threshold that is shown first
    # At each of the values, the probability of lying at or below, and the ends of the band or None.
    bounds: Sequence[Sequence[float | None]]
    beyond: RunsBeyondAxis | None = None  # None where the function is of no runs


@dataclass(frozen=True)
class PlaceColumn:
    """A statistic at each of the places of a curve."""

    label: str  # what stands before its estimates
    unit: str  # what stands behind them
    texts: Sequence[str]  # the estimates; `NOTHING` where there is none
    reasons: dict[int, str]  # why an estimate has no interval, by position of the place

    def text(self, position: int) -> str:
        """Return the estimate at a place with its label; empty where there is none."""
        if self.texts[position] == NOTHING:
            return ""
        reason = self.reasons.get(position)
        remark = f" (no interval: {reason})" if reason else ""
        return f"{self.label} {self.texts[position]}{self.unit}{remark}"


@dataclass(frozen=True)
class PlaceReadout:
    """A place along the axis of a chart that a reader moves, and the estimates there."""

    output: str  # its title
    dimension: str  # its title
    values: Numbers  # the coordinates, in the unit of the axis
    heads: Sequence[str]  # the coordinates with their unit
    columns: Sequence[PlaceColumn]  # the statistics there
    start: int  # position of the place that is shown first

    def text(self, position: int) -> str:
        """Return the estimates at a place as a sentence; the page's script makes the same."""
        found = "; ".join(filter(None, (column.text(position) for column in self.columns)))
        return f"At {self.heads[position]}: {found or 'no run gets this far'}."


@dataclass(frozen=True)
class PlaceSlices:
    """Content of a chart at each of some places; the nearest one is shown."""

    # Name and unit of the dimension, as the axis of another chart has them.
    dimension: tuple[str, str]
    values: Sequence[float]  # the coordinates, in this unit
    marks: Sequence[Sequence[Mark]]  # at each place, in place of each mark of the chart


@dataclass(frozen=True)
class Chart(Block):
    """A chart, with a summary for readers who cannot see it."""

    title: str
    summary: str  # its content in words, for readers who cannot see it
    x: Axis
    y: Axis
    marks: tuple[Mark, ...]
    keys: tuple[LegendKey, ...] = ()
    notes: tuple[str, ...] = ()
    tables: tuple[OutputTable, ...] = ()  # the numbers behind it
    height: int = 300  # in CSS pixels
    of: str = ""  # output that it shows: a figure names it, a page has it in a heading
    source: str = ""  # whose estimates it shows, likewise
    is_of_all_models: bool = False  # a figure names the model of other charts
    reading: ThresholdReadout | None = None
    place: PlaceReadout | None = None  # along the axis x
    slices: PlaceSlices | None = None
    is_compared: bool = False  # whether a pointer reads off all lines at once
    # The model whose `RunExplorer` has its points: completed runs, then failed ones as a second
    # trace. None where its points are no runs.
    runs_of: str | None = None


@dataclass(frozen=True)
class Charts(Block):
    """Charts side by side, as many in a row as there is room for, under one legend."""

    charts: tuple[Chart, ...]
    keys: tuple[LegendKey, ...] = ()
    notes: tuple[str, ...] = ()
    tables: tuple[OutputTable, ...] = ()
