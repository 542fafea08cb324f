"""Blocks that a section of the report is made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from uqpen.charts.chart import Block, Chart, Charts, PlottedQuantity
from uqpen.charts.marks import Numbers
from uqpen.results.table import OutputTable


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


@dataclass(frozen=True)
class RunColumn:
    """An input or an output of all runs that are drawn."""

    quantity: PlottedQuantity
    label: str
    unit: str  # as the page shows it; empty without one
    is_input: bool
    # Of the completed runs; of a categorical output, places near the row of each category.
    values: Numbers
    failed: Numbers = ()  # likewise of the failed runs; empty of an output
    rows: tuple[str, ...] = ()  # the categories, in the order of their rows; empty of a number
    # True for an output that is shown by its logarithm, which all values have.
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
