"""What all sections about methods head to head go by: the methods, the budgets, the statistics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import xarray as xr

from uqpen.archive.head_to_head_skeleton import faults_of_contest
from uqpen.archive.read import group
from uqpen.errors import ArchiveError
from uqpen.figures.needs import faults_of_levels
from uqpen.figures.texts import named
from uqpen.labels import (
    BUDGET,
    ERRORS,
    ESTIMATES,
    METHODS,
    MOMENTS,
    REFERENCE,
    REPLICATED,
    SINGLE,
)
from uqpen.report.blocks import Axis, Key
from uqpen.report.marks import marker_of
from uqpen.summary.digits import grouped
from uqpen.summary.head_to_head_entries import Entry, entries
from uqpen.summary.table import OutputTable

__all__ = [
    "MOST_CHARTS",
    "Method",
    "along_budgets",
    "budgets_of",
    "by_output",
    "called",
    "check_comparison",
    "indented",
    "keys_of",
    "methods_of",
    "own_error",
    "runs_of_reference",
    "variants_of",
]

# Of more charts in a section the first are shown, and a note says so.
MOST_CHARTS = 24

# Beside the fewest and the most runs, as a power of ten.
_FREE = 0.1


@dataclass(frozen=True)
class Method:
    """One that takes part.

    Parameters
    ----------
    position : int
        Along the dimension of the methods.
    source : str
        The study's name of what it is.
    variants : tuple of str
        The contests that it is in.
    series : int
        Its colour and marker: the same for a design as one set and in replicates.
    """

    position: int
    source: str
    variants: tuple[str, ...]
    series: int

    @property
    def marker(self) -> str:
        """The same wherever it is drawn."""
        return marker_of(self.series)


def check_comparison(tree: xr.DataTree) -> None:
    """Hold an archive of methods head to head against what the report goes by.

    Raises
    ------
    ArchiveError
        If it lacks anything.
    """
    if fault := next(chain(faults_of_contest(tree), faults_of_levels(tree)), None):
        raise ArchiveError(f"the archive is damaged: {fault}")


def methods_of(tree: xr.DataTree, variant: str) -> list[Method]:
    """The methods that are in a contest, in the order of the archive."""
    methods = group(tree, METHODS)
    sources = [str(source) for source in methods["source"].values]
    looks = list(dict.fromkeys(sources))
    every = [
        Method(position, source, tuple(str(contests).split()), looks.index(source))
        for position, (source, contests) in enumerate(
            zip(sources, methods["contests"].values, strict=True)
        )
    ]
    return [method for method in every if variant in method.variants]


def variants_of(tree: xr.DataTree) -> list[str]:
    """The contests that differ: there is one where no method has replicates."""
    has_replicates = any(SINGLE not in each.variants for each in methods_of(tree, REPLICATED))
    return [SINGLE, REPLICATED] if has_replicates else [SINGLE]


def budgets_of(tree: xr.DataTree) -> list[int]:
    """The numbers of runs that methods are given."""
    return [int(budget) for budget in group(tree, METHODS)[BUDGET].values]


def by_output(tree: xr.DataTree) -> dict[str, list[Entry]]:
    """The entries of all statistics of each output."""
    found: dict[str, list[Entry]] = {}
    for entry in entries(tree):
        found.setdefault(entry.output, []).append(entry)
    return found


def called(tree: xr.DataTree, output: str) -> str:
    """What an output is called in a heading."""
    estimates = group(tree, ESTIMATES, output)
    described = str(estimates["mean"].attrs.get("long_name", "")) if "mean" in estimates else ""
    return named(described.removeprefix("mean of ") or output, output)


def own_error(entry: Entry) -> float:
    """Half the reference's interval, in per cent of what errors are relative to; NaN for none."""
    _, lower, upper = entry.truth.values.tolist()
    relative_to = float(entry.of(ERRORS, "_scale"))
    return 100 * (upper - lower) / 2 / relative_to if relative_to > 0 else math.nan


def runs_of_reference(tree: xr.DataTree) -> tuple[int, int]:
    """How many runs the reference made, and how many of them came back and count."""
    told = group(tree, REFERENCE, MOMENTS).attrs
    made = told.get("runs", group(tree, METHODS).attrs["reference_runs"])
    return int(made), int(told["runs_used"])


def along_budgets(tree: xr.DataTree) -> Axis:
    """A logarithmic axis with a tick at each number of runs."""
    budgets = budgets_of(tree)
    ends = (math.log10(budgets[0]) - _FREE, math.log10(budgets[-1]) + _FREE)
    ticks = tuple((float(budget), grouped(budget)) for budget in budgets)
    return Axis("runs", ends, ticks=ticks, is_logarithmic=True)


def keys_of(methods: Sequence[Method]) -> tuple[Key, ...]:
    """The legend's entries of methods."""
    return tuple(Key(method.source, method.series, method.marker) for method in methods)


def indented(table: OutputTable) -> OutputTable:
    """A table whose labels keep the room before them on a page."""
    rows = [
        (label.replace("  ", "\u00a0\u00a0\u00a0"), [cell.strip() for cell in cells])
        for label, cells in table.rows
    ]
    return OutputTable(table.title, table.columns, rows, table.notes)
