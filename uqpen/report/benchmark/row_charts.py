"""Charts of a benchmark of methods, with a row for each statistic and the methods in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.charts.chart import Chart
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import REPLICATED, SINGLE
from uqpen.report.benchmark.section_elements import MOST_CHARTS, variants
from uqpen.results.benchmark_entries import BenchmarkEntry
from uqpen.results.benchmark_methods import benchmark_methods

__all__ = [
    "chart_height",
    "method_positions",
    "method_values",
    "omitted_charts_note",
    "variant_text",
]

_VARIANT_TEXTS = {SINGLE: "as single sets", REPLICATED: "in replicates"}
# Pixels of a row, of each method in it, and of what is around all rows.
_ROW_HEIGHT, _METHOD_HEIGHT, _FRAME = 10, 11, 80


def variant_text(tree: xr.DataTree, variant: str) -> str:
    """Return the words of a title for how points are taken, where methods have replicates."""
    return f", {_VARIANT_TEXTS[variant]}" if len(variants(tree)) > 1 else ""


def method_positions(at: int, methods: int, rows: int) -> FloatArray:
    """Return the positions of a method's markers, one below the other in each row."""
    shift = (at - (methods - 1) / 2) * 0.8 / methods
    return np.arange(rows, dtype=np.float64) + shift


def method_values(
    tree: xr.DataTree, variant: str, found: Sequence[BenchmarkEntry], name: str
) -> FloatArray:
    """Return a variable along statistic and method, then along its own dimensions."""
    positions = [method.position for method in benchmark_methods(tree, variant)]
    return np.array([entry.variable(name).values[positions] for entry in found], dtype=np.float64)


def chart_height(methods: int, rows: int) -> int:
    """Return the height of a chart, in CSS pixels."""
    return _FRAME + (_ROW_HEIGHT + _METHOD_HEIGHT * max(2, methods)) * rows


def omitted_charts_note(charts: Sequence[Chart]) -> Iterator[str]:
    """Yield a note where there are more charts than are shown."""
    if len(charts) > MOST_CHARTS:
        yield f"The first {MOST_CHARTS} of {len(charts)} charts; more outputs are not drawn."
