"""Panels of a benchmark of methods: errors against runs, coverage of intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.marks import HOLLOW
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INTERVAL_LEVEL, METHODS, SINGLE
from uqpen.figures.painter import error_bar_lengths
from uqpen.figures.panel import Axes, Panel
from uqpen.results.benchmark_entries import BenchmarkEntry, entries, lowest_expected_coverage
from uqpen.results.benchmark_methods import (
    ArchivedMethod,
    benchmark_budgets,
    benchmark_methods,
)
from uqpen.results.digits import grouped_number, percent_text
from uqpen.results.source_style import GREY, source_style

__all__ = ["coverage_panels", "error_panels"]

_GUIDE = "falls with 1/√runs"
# Between markers at the same number of runs, as a factor.
_APART = 1.04
# The rows of methods within the row of a statistic.
_SPREAD = 0.7
# Inches of a row, of each method in it, and of what is around all rows.
_ROW, _METHOD, _FRAME = 0.1, 0.09, 0.9
# An axis whose ends have a smaller ratio is marked at 1, 2 and 5.
_SHORT = 60.0
# Confidence level if the archive states none.
_LEVEL = 0.95


def error_panels(tree: xr.DataTree) -> Iterator[Panel]:
    """Error of each method against runs, with intervals."""
    methods = benchmark_methods(tree, SINGLE)
    for entry in entries(tree):
        if any(
            np.isfinite(entry.percent_errors(method.position)[:, 0]).any() for method in methods
        ):
            draw = partial(_draw_errors, entry, methods)
            yield Panel(f"{entry.output}: {entry.label}", draw, group=entry.output)


def coverage_panels(tree: xr.DataTree) -> Iterator[Panel]:
    """Coverage of the methods' own intervals."""
    methods = benchmark_methods(tree, SINGLE)
    by_output: dict[str, list[BenchmarkEntry]] = {}
    for entry in entries(tree):
        if any(np.isfinite(_shares(entry, method)).any() for method in methods):
            by_output.setdefault(entry.output, []).append(entry)
    for output, found in by_output.items():
        height = _FRAME + (_ROW + _METHOD * len(methods)) * len(found)
        draw = partial(_draw_coverage, tree, found, methods)
        rows = tuple(entry.label for entry in found)
        yield Panel(f"{output}: coverage of intervals", draw, height, rows, output)


def _shares(entry: BenchmarkEntry, method: ArchivedMethod) -> FloatArray:
    """Coverage in per cent along budget; NaN without intervals."""
    return 100 * np.asarray(entry.variable("coverage").values[method.position], dtype=np.float64)


def _draw_errors(
    entry: BenchmarkEntry, methods: Sequence[ArchivedMethod], axes: Axes
) -> Iterator[str]:
    budgets = np.array(benchmark_budgets(entry.tree), dtype=np.float64)
    notes: dict[str, None] = {"bars: 95 % intervals of the error over the repeats": None}
    for place, method in enumerate(methods):
        at = budgets * _APART ** (place - (len(methods) - 1) / 2)
        style = source_style(method.series)
        bounds = entry.percent_errors(method.position)
        axes.plot(at, bounds[:, 0], color=style.colour, linestyle=style.line, linewidth=1)
        for number, row in enumerate(bounds):
            bar = error_bar_lengths(row)
            axes.errorbar(
                at[number : number + 1],
                row[:1],
                yerr=bar,
                fmt=style.marker,
                color=style.colour,
                markerfacecolor="white" if bar is None else style.colour,
                elinewidth=1.2,
                capsize=2,
                label=method.source if not number else None,
            )
            if bar is None and math.isfinite(row[0]):
                notes[HOLLOW] = None
    _draw_guide(
        axes, budgets, np.array([entry.percent_errors(each.position)[:, 0] for each in methods])
    )
    axes.set(xscale="log", yscale="log", xlabel="runs", ylabel="error [%]")
    _set_ticks(axes, budgets)
    yield from notes
    yield "errors are relative to the reference, or to the standard deviation where that is about 0"


def _set_ticks(axes: Axes, budgets: FloatArray) -> None:
    """Mark the numbers of runs, and round errors; a short axis has more marks."""
    from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

    axes.set_xticks(budgets, [grouped_number(int(budget)) for budget in budgets])
    axes.xaxis.set_minor_locator(NullLocator())
    lower, upper = axes.get_ylim()
    if upper < _SHORT * lower:
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:.4g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def _draw_guide(axes: Axes, budgets: FloatArray, errors: FloatArray) -> None:
    """Draw a line that falls with the root of the runs, from the largest error at the fewest."""
    known = np.isfinite(errors).any(axis=0)
    if known.sum() < 2:
        return
    first = int(np.argmax(known))
    runs = budgets[first:]
    fall = float(np.nanmax(errors[:, first])) * np.sqrt(runs[0] / runs)
    axes.plot(runs, fall, color=GREY, linestyle=":", linewidth=1.2, label=_GUIDE)


def _draw_coverage(
    tree: xr.DataTree,
    found: Sequence[BenchmarkEntry],
    methods: Sequence[ArchivedMethod],
    axes: Axes,
) -> Iterator[str]:
    repeats = int(read_group(tree, METHODS).attrs["repeats"])
    level = float(found[0].reference.attrs.get(INTERVAL_LEVEL, _LEVEL))
    least = 100 * lowest_expected_coverage(level, repeats)
    axes.axvspan(least, 100, color=GREY, alpha=0.15, linewidth=0)
    axes.axvline(100 * level, color=GREY, linestyle="--", linewidth=1)
    lowest = 100.0
    for place, method in enumerate(methods):
        shift = (place - (len(methods) - 1) / 2) * _SPREAD / len(methods)
        shares = np.array([_shares(entry, method) for entry in found])
        rows, columns = np.nonzero(np.isfinite(shares))
        lowest = min([lowest, *shares[rows, columns].tolist()])
        style = source_style(method.series)
        axes.plot(
            shares[rows, columns],
            rows + shift,
            style.marker,
            color=style.colour,
            markersize=4,
            label=method.source if rows.size else None,
        )
    axes.set(xlabel="coverage [%]", xlim=(min(78.0, lowest) - 2, 102))
    yield (
        f"shaded: shares from {least:.0f} %, which {repeats} intervals with a coverage of "
        f"{percent_text(level)} may well have by chance"
    )
    yield "each mark is for one number of runs"
