"""Share of the methods' own intervals that contain the reference."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.chart import Axis, Block, Chart, Charts
from uqpen.charts.marks import Mark, Points, Rule, Shade, series_marker
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL, METHODS, SINGLE
from uqpen.report.benchmark.row_charts import (
    chart_height,
    method_positions,
    method_values,
    omitted_charts_note,
    variant_text,
)
from uqpen.report.benchmark.section_elements import (
    MOST_CHARTS,
    benchmark_output_heading,
    entries_by_output,
    method_keys,
    variants,
)
from uqpen.results.benchmark_entries import BenchmarkEntry, entries, lowest_expected_coverage
from uqpen.results.benchmark_methods import ArchivedMethod, benchmark_budgets, benchmark_methods
from uqpen.results.digits import grouped_number, percent_text
from uqpen.results.table import NOTHING, OutputTable

__all__ = ["coverage"]


# Confidence level if the archive states none.
_LEVEL = 0.95


def coverage(tree: xr.DataTree) -> Iterator[Block]:
    """Share of the repeats in which a method's own interval contains the reference."""
    repeats = int(read_group(tree, METHODS).attrs["repeats"])
    charts = [
        _coverage_chart(tree, output, variant, found, repeats)
        for variant in variants(tree)
        for output, found in entries_by_output(tree).items()
        if np.isfinite(method_values(tree, variant, found, "coverage")).any()
    ]
    if charts:
        yield Charts(
            tuple(charts[:MOST_CHARTS]),
            keys=method_keys(benchmark_methods(tree, SINGLE)),
            notes=(
                _expected_coverage_note(tree, repeats),
                *_methods_without_intervals(tree),
                *omitted_charts_note(charts),
            ),
        )


def _nominal_level(tree: xr.DataTree) -> float:
    """Return the nominal level of the methods' own intervals: that of the reference's."""
    truths = (entry.reference for entry in entries(tree))
    levels = (each.attrs[INTERVAL_LEVEL] for each in truths if INTERVAL_LEVEL in each.attrs)
    return float(next(levels, _LEVEL))


def _expected_coverage_note(tree: xr.DataTree, repeats: int) -> str:
    level = _nominal_level(tree)
    least = f"{100 * lowest_expected_coverage(level, repeats):.0f} %"
    return (
        f"Each marker is for one number of runs. Shaded: shares from {least}, which {repeats} "
        f"intervals with a coverage of {percent_text(level)} may well have by chance. Estimates "
        f"without an interval do not count, so a share may be from fewer than {repeats}."
    )


def _methods_without_intervals(tree: xr.DataTree) -> Iterator[str]:
    every = [entry for found in entries_by_output(tree).values() for entry in found]
    has_coverage: dict[str, bool] = {}
    for variant in variants(tree):
        shares = method_values(tree, variant, every, "coverage")
        for at, method in enumerate(benchmark_methods(tree, variant)):
            has_coverage.setdefault(method.source, False)
            has_coverage[method.source] |= bool(np.isfinite(shares[:, at]).any())
    for source, has_intervals in has_coverage.items():
        if not has_intervals:
            yield f"{source} has no intervals of its own."


def _coverage_chart(
    tree: xr.DataTree, output: str, variant: str, found: list[BenchmarkEntry], repeats: int
) -> Chart:
    shares = method_values(tree, variant, found, "coverage")
    methods = benchmark_methods(tree, variant)
    level = _nominal_level(tree)
    known = shares[np.isfinite(shares)]
    lowest, highest = (percent_text(round(share, 3)) for share in (known.min(), known.max()))
    behind = (
        Shade(100 * lowest_expected_coverage(level, repeats), 100, "quiet"),
        Rule(100 * level, "quiet", "dash"),
    )
    return Chart(
        title=f"Intervals of {benchmark_output_heading(tree, output)}{variant_text(tree, variant)}",
        summary=f"The coverage is between {lowest} and {highest}; it should be "
        f"{percent_text(level)}.",
        x=Axis("coverage [%]", (min(78.0, 100 * known.min()) - 2, 102)),
        y=Axis("", rows=tuple(entry.label for entry in found)),
        marks=(
            *behind,
            *(
                _points(
                    tree,
                    method,
                    shares[:, at],
                    found,
                    method_positions(at, len(methods), len(found)),
                )
                for at, method in enumerate(methods)
            ),
        ),
        tables=(_coverage_table(tree, methods, shares, found),),
        height=chart_height(len(methods), len(found)),
    )


def _points(
    tree: xr.DataTree,
    method: ArchivedMethod,
    shares: FloatArray,
    found: list[BenchmarkEntry],
    places: FloatArray,
) -> Mark:
    rows, columns = np.nonzero(np.isfinite(shares))
    budgets = benchmark_budgets(tree)
    texts = [
        f"{method.source}, {found[row].label}, {grouped_number(budgets[column])} runs: "
        f"coverage {100 * shares[row, column]:.1f} %"
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
    ]
    return Points(
        100 * shares[rows, columns],
        places[rows],
        method.series,
        hover="%{text}",
        name=method.source,
        texts=texts,
        marker=series_marker(method.series),
        size=7,
    )


def _coverage_table(
    tree: xr.DataTree,
    methods: list[ArchivedMethod],
    shares: FloatArray,
    found: list[BenchmarkEntry],
) -> OutputTable:
    columns = [*map(grouped_number, benchmark_budgets(tree))]
    table = OutputTable("Coverage of the reference, in %", columns)
    for entry, rows in zip(found, shares, strict=True):
        for method, row in zip(methods, rows.tolist(), strict=True):
            cells = [NOTHING if math.isnan(share) else f"{100 * share:.0f}" for share in row]
            table.rows.append((f"{entry.label}, {method.source}", cells))
    return table
