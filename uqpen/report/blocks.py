"""Blocks that a section of the report is made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from uqpen.report.marks import Trace
from uqpen.report.place_selection import PlaceReadout, PlaceSlices
from uqpen.report.shapes import Shape
from uqpen.results.table import OutputTable

__all__ = [
    "Alert",
    "Alerts",
    "Axis",
    "Block",
    "Chart",
    "Charts",
    "Columns",
    "Finding",
    "Findings",
    "Fold",
    "Heading",
    "LegendKey",
    "Listing",
    "PlottedQuantity",
    "Quote",
    "Remarks",
    "RunColumn",
    "RunExplorer",
    "RunsBeyondAxis",
    "Table",
    "Text",
    "ThresholdReadout",
    "find_charts",
    "find_explorers",
    "flattened",
]


class Block:
    """A part of a section; the template sets it by the name of its class."""

    @property
    def kind(self) -> str:
        """Name of the block's kind in the template."""
        return type(self).__name__.lower()


@dataclass(frozen=True)
class Heading(Block):
    """A heading within a section, for the blocks of one output or one model."""

    text: str
    level: int = 3  # as HTML counts: 4 below another


@dataclass(frozen=True)
class Text(Block):
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Quote(Block):
    """Sentences to be quoted, each complete by itself."""

    sentences: tuple[str, ...]


class Finding(NamedTuple):
    """Statement of the archive about one thing, below a head of few words."""

    head: str
    text: str


@dataclass(frozen=True)
class Findings(Block):
    """Findings with their heads, one below the other."""

    entries: tuple[Finding, ...]
    is_verdict: bool = False  # of the study's own limits: set larger


class Alert(NamedTuple):
    """Something to mind, of a kind, and what a reader can do about it."""

    about: str  # the kind, in one or two words
    text: str
    remedy: str


@dataclass(frozen=True)
class Alerts(Block):
    """Warnings about the numbers of a page."""

    alerts: tuple[Alert, ...]


@dataclass(frozen=True)
class Remarks(Block):
    """A list of remarks, one line each, below a short head."""

    head: str
    lines: tuple[str, ...]
    is_folded: bool = False


@dataclass(frozen=True)
class Listing(Block):
    """A text as it stands in a file."""

    title: str
    text: str
    is_folded: bool = False


@dataclass(frozen=True)
class Table(Block):
    """A table with its notes; if folded, a line opens it."""

    table: OutputTable
    is_folded: bool = False


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


@dataclass(frozen=True)
class LegendKey:
    """An entry of a legend."""

    text: str
    series: int | str  # chooses its colour, see `marks`
    mark: str  # "line", "band", "bar", or the name of a marker
    dash: str = "solid"


class RunsBeyondAxis(NamedTuple):
    """Values of a distribution function beyond the ends of its axis.

    Attributes
    ----------
    runs : int
        Behind the function.
    smallest, largest : float
        Of these runs.
    nothing : sequence of float or None
        The bounds below the smallest run.
    below, above : sequence
        Values of some runs there, in ascending order up to the most extreme one, each followed by
        the bounds at it.
    """

    runs: int
    smallest: float
    largest: float
    nothing: Sequence[float | None]
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
class Chart(Block):
    """A chart, drawn by the page's script, with a summary for readers who cannot see it."""

    title: str
    summary: str  # its content in words, for readers who cannot see it
    x: Axis
    y: Axis
    traces: tuple[Trace, ...]
    shapes: tuple[Shape, ...] = ()  # lines and shades behind the traces
    keys: tuple[LegendKey, ...] = ()
    notes: tuple[str, ...] = ()
    tables: tuple[OutputTable, ...] = ()  # the numbers behind it
    height: int = 300  # in CSS pixels
    reading: ThresholdReadout | None = None
    images: tuple[Trace, ...] = ()  # behind the traces, in Plotly's form
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


@dataclass(frozen=True)
class RunColumn:
    """An input or an output of all runs that are drawn.

    Attributes
    ----------
    values : sequence of float or None
        Of the completed runs; of a categorical output, places near the row of each category.
    failed : sequence of float or None
        Likewise of the failed runs; empty of an output.
    rows : tuple of str
        The categories, in the order of their rows; empty of a number.
    is_logarithmic : bool
        True for an output that is shown by its logarithm, which all values have.
    """

    quantity: PlottedQuantity
    label: str
    unit: str  # as the page shows it; empty without one
    is_input: bool
    values: Sequence[float | None]
    failed: Sequence[float | None] = ()
    rows: tuple[str, ...] = ()
    is_logarithmic: bool = False


@dataclass(frozen=True)
class RunExplorer(Block):
    """All inputs and outputs of the runs that are drawn, to select runs by their values."""

    title: str
    summary: str
    model: str  # empty of a single one
    design: str
    series: int  # chooses the colour of the design
    completed: Sequence[int]  # places of the runs among all of the design
    failed: Sequence[int]
    columns: tuple[RunColumn, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fold(Block):
    """Blocks that a line opens; with a level, the line is a heading."""

    title: str
    blocks: tuple[Block, ...]
    level: int = 0  # as that of a `Heading`; 0 for a plain line


@dataclass(frozen=True)
class Columns(Block):
    """Blocks beside a picture where there is room, otherwise above it."""

    blocks: tuple[Block, ...]
    picture: Chart


def flattened(blocks: Iterable[Block]) -> Iterator[Block]:
    """Yield blocks, and those in them, in the order of the page."""
    for block in blocks:
        yield block
        match block:
            case Charts():
                yield from block.charts
            case Fold():
                yield from flattened(block.blocks)
            case Columns():
                yield from flattened((*block.blocks, block.picture))


def find_charts(blocks: Iterable[Block]) -> Iterator[Chart]:
    """Yield all charts among blocks, in the order of the page."""
    return (block for block in flattened(blocks) if isinstance(block, Chart))


def find_explorers(blocks: Iterable[Block]) -> Iterator[RunExplorer]:
    """Yield the run explorers among blocks, in the order of the page."""
    return (block for block in flattened(blocks) if isinstance(block, RunExplorer))
