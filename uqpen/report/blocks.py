"""Blocks that a section of the report is made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from uqpen.report.marks import Trace
from uqpen.report.shapes import Shape
from uqpen.results.table import OutputTable

__all__ = [
    "Axis",
    "Block",
    "Chart",
    "Charts",
    "Heading",
    "LegendKey",
    "Listing",
    "Quote",
    "Remarks",
    "Table",
    "Text",
    "ThresholdReadout",
    "find_charts",
]


class Block:
    """A part of a section; its class's name chooses how the template sets it."""

    @property
    def kind(self) -> str:
        """Name of the block's kind in the template."""
        return type(self).__name__.lower()


@dataclass(frozen=True)
class Heading(Block):
    """A heading below that of the section; what follows is of one output, or one model.

    Parameters
    ----------
    text : str
    level : int
        As HTML counts: 3, or 4 below another.
    """

    text: str
    level: int = 3


@dataclass(frozen=True)
class Text(Block):
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Quote(Block):
    """Sentences to be quoted, each complete by itself."""

    sentences: tuple[str, ...]


@dataclass(frozen=True)
class Remarks(Block):
    """A list of what must be known, one line each, below a few words that say of what."""

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
    """A table with its notes; folded, a line that opens it stands in its place."""

    table: OutputTable
    is_folded: bool = False


@dataclass(frozen=True)
class Axis:
    """An axis of a chart.

    Parameters
    ----------
    title : str
        With the unit in brackets.
    ends : tuple of float, optional
        Where it begins and ends, of a logarithmic one as powers of ten; without them, where the
        data do.
    rows : tuple of str
        Names in place of numbers: of the rows 0, 1, … from the top.
    is_logarithmic : bool
    ticks : tuple of (float, str)
        The only places that are marked, and what stands there.
    """

    title: str
    ends: tuple[float, float] | None = None
    rows: tuple[str, ...] = ()
    is_logarithmic: bool = False
    ticks: tuple[tuple[float, str], ...] = ()


@dataclass(frozen=True)
class LegendKey:
    """An entry of a legend.

    Parameters
    ----------
    text : str
    series : int or str
        What gives its colour, see `marks`.
    mark : str
        ``"line"``, ``"band"``, ``"bar"``, or the name of a marker.
    dash : str
        Of a line.
    """

    text: str
    series: int | str
    mark: str
    dash: str = "solid"


@dataclass(frozen=True)
class ThresholdReadout:
    """A threshold that is moved over a distribution function, and what is read off there.

    Parameters
    ----------
    output, unit : str
        What is compared with the threshold, and the unit of both.
    source : str
        Whose function it is.
    level : float
        Of the simultaneous band; NaN where there is none.
    note : str
        Why there is none.
    first, step : float
        The first threshold, and how far apart they are.
    decimals : int
        To write them with.
    start : int
        Which one is shown first.
    bounds : sequence of sequence of float
        At each, the probability of lying at or below, and the ends of the band; None for none.
    """

    output: str
    unit: str
    source: str
    level: float
    note: str
    first: float
    step: float
    decimals: int
    start: int
    bounds: Sequence[Sequence[float | None]]


@dataclass(frozen=True)
class Chart(Block):
    """A chart, drawn by the page's script, with what it says to who cannot see it.

    Parameters
    ----------
    title : str
    summary : str
        What is seen in it, for those who do not see it.
    x, y : Axis
    traces : tuple
        See `marks`.
    shapes : tuple
        Lines and shades behind the traces, see `shapes`.
    keys : tuple of LegendKey
        The legend.
    notes : tuple of str
        What a reader must know.
    tables : tuple of OutputTable
        The numbers behind it.
    height : int
        In CSS pixels.
    reading : ThresholdReadout, optional
    is_compared : bool
        Whether a pointer reads off all lines at once.
    """

    title: str
    summary: str
    x: Axis
    y: Axis
    traces: tuple[Trace, ...]
    shapes: tuple[Shape, ...] = ()
    keys: tuple[LegendKey, ...] = ()
    notes: tuple[str, ...] = ()
    tables: tuple[OutputTable, ...] = ()
    height: int = 300
    reading: ThresholdReadout | None = None
    is_compared: bool = False


@dataclass(frozen=True)
class Charts(Block):
    """Charts side by side, as many in a row as there is room for, under one legend.

    Parameters
    ----------
    charts : tuple of Chart
    keys, notes, tables
        Of all of them together.
    """

    charts: tuple[Chart, ...]
    keys: tuple[LegendKey, ...] = ()
    notes: tuple[str, ...] = ()
    tables: tuple[OutputTable, ...] = ()


def find_charts(blocks: Iterable[Block]) -> Iterator[Chart]:
    """All charts among blocks, in the order of the page."""
    for block in blocks:
        if isinstance(block, Chart):
            yield block
        elif isinstance(block, Charts):
            yield from block.charts
