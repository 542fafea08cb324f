"""How often the methods' own intervals held the reference."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group
from uqpen.intervals import clopper_pearson
from uqpen.labels import ERRORS, INTERVAL_LEVEL, METHODS, SINGLE
from uqpen.report.blocks import Axis, Block, Chart, Charts
from uqpen.report.head_to_head.contest import (
    MOST_CHARTS,
    Method,
    budgets_of,
    by_output,
    called,
    keys_of,
    methods_of,
    variants_of,
)
from uqpen.report.head_to_head.rows import capped, height_of, places_of, said_of
from uqpen.report.marks import Trace, points
from uqpen.report.shapes import Shape, shade, upright
from uqpen.summary.digits import grouped, percent
from uqpen.summary.head_to_head_entries import Entry, entries
from uqpen.summary.table import NOTHING, OutputTable

__all__ = ["coverage"]

FloatArray = npt.NDArray[np.float64]

# Of the shares that chance may show; and of intervals that do not say themselves.
_LEVEL = 0.95


def coverage(tree: xr.DataTree) -> Iterator[Block]:
    """In what share of the repeats a method's own interval held the reference."""
    repeats = int(group(tree, METHODS).attrs["repeats"])
    charts = [
        _coverage(tree, output, variant, found, repeats)
        for variant in variants_of(tree)
        for output, found in by_output(tree).items()
        if np.isfinite(_shares(tree, variant, found)).any()
    ]
    if charts:
        yield Charts(
            tuple(charts[:MOST_CHARTS]),
            keys=keys_of(methods_of(tree, SINGLE)),
            notes=(_expected(tree, repeats), *_silent(tree), *capped(charts)),
        )


def _shares(tree: xr.DataTree, variant: str, found: list[Entry]) -> FloatArray:
    """Along statistic, method and budget."""
    positions = [method.position for method in methods_of(tree, variant)]
    values = [entry.of(ERRORS, "_coverage").values[positions] for entry in found]
    return np.array(values, dtype=np.float64)


def _least(level: float, repeats: int) -> float:
    """The least share that intervals that cover as often as they say would show."""
    held = np.arange(repeats + 1)
    _, upper = clopper_pearson(held, repeats, _LEVEL)
    return float(held[upper >= level][0] / repeats)


def _level(tree: xr.DataTree) -> float:
    """How often the methods' own intervals should hold: as those of the reference, of one kind."""
    truths = (entry.truth for entry in entries(tree))
    levels = (each.attrs[INTERVAL_LEVEL] for each in truths if INTERVAL_LEVEL in each.attrs)
    return float(next(levels, _LEVEL))


def _expected(tree: xr.DataTree, repeats: int) -> str:
    level = _level(tree)
    least = f"{100 * _least(level, repeats):.0f} %"
    return (
        f"Each marker is of one number of runs. Shaded: shares from {least}, which {repeats} "
        f"intervals that cover {percent(level)} may well show by chance. Estimates without an "
        f"interval do not count, so a share may be of fewer than {repeats}."
    )


def _silent(tree: xr.DataTree) -> Iterator[str]:
    """The methods without any interval of their own."""
    every = [entry for found in by_output(tree).values() for entry in found]
    told: dict[str, bool] = {}
    for variant in variants_of(tree):
        shares = _shares(tree, variant, every)
        for at, method in enumerate(methods_of(tree, variant)):
            told[method.source] = told.get(method.source, False) or _is_told(shares[:, at])
    for source, has_intervals in told.items():
        if not has_intervals:
            yield f"{source} tells no intervals of its own."


def _is_told(shares: FloatArray) -> bool:
    return bool(np.isfinite(shares).any())


def _coverage(
    tree: xr.DataTree, output: str, variant: str, found: list[Entry], repeats: int
) -> Chart:
    shares, methods = _shares(tree, variant, found), methods_of(tree, variant)
    level = _level(tree)
    known = shares[np.isfinite(shares)]
    shapes: tuple[Shape, ...] = (
        shade(100 * _least(level, repeats), 100, "quiet"),
        upright(100 * level, "quiet", "dash"),
    )
    return Chart(
        title=f"Intervals of {called(tree, output)}{said_of(tree, variant)}",
        summary=f"The shares of intervals that held lie between {percent(round(known.min(), 3))} "
        f"and {percent(round(known.max(), 3))}; they should be {percent(level)}.",
        x=Axis("intervals that held [%]", (min(78.0, 100 * known.min()) - 2, 102)),
        y=Axis("", rows=tuple(entry.label for entry in found)),
        traces=tuple(
            _points(tree, method, shares[:, at], found, places_of(at, len(methods), len(found)))
            for at, method in enumerate(methods)
        ),
        shapes=shapes,
        tables=(_coverage_table(tree, methods, shares, found),),
        height=height_of(len(methods), len(found)),
    )


def _points(
    tree: xr.DataTree, method: Method, shares: FloatArray, found: list[Entry], places: FloatArray
) -> Trace:
    rows, columns = np.nonzero(np.isfinite(shares))
    budgets = budgets_of(tree)
    texts = [
        f"{method.source}, {found[row].label}, {grouped(budgets[column])} runs: "
        f"{100 * shares[row, column]:.1f} % of its intervals held"
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
    ]
    return points(
        100 * shares[rows, columns],
        places[rows],
        method.series,
        hover="%{text}",
        name=method.source,
        texts=texts,
        marker=method.marker,
        size=7,
    )


def _coverage_table(
    tree: xr.DataTree, methods: list[Method], shares: FloatArray, found: list[Entry]
) -> OutputTable:
    columns = [*map(grouped, budgets_of(tree))]
    table = OutputTable("Intervals that held the reference, in %", columns)
    for entry, rows in zip(found, shares, strict=True):
        for method, row in zip(methods, rows.tolist(), strict=True):
            cells = [NOTHING if math.isnan(share) else f"{100 * share:.0f}" for share in row]
            table.rows.append((f"{entry.label}, {method.source}", cells))
    return table
