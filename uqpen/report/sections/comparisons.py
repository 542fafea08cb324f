"""Comparisons of estimates by runs so far, source and model; surrogates and trajectories."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from itertools import takewhile

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names
from uqpen.charts.chart import Block, Charts
from uqpen.charts.convergence_history import convergence_charts
from uqpen.charts.distributions import model_chart
from uqpen.charts.measured_values import measurement_charts, posterior_charts
from uqpen.charts.source_comparison import (
    available_statistics,
    compared_sources,
    comparison_charts,
    interval_cost_charts,
    main_statistics,
)
from uqpen.charts.surrogate import prediction_charts
from uqpen.charts.sweeps import sweep_charts
from uqpen.charts.trajectory import (
    find_trajectories,
    quantity_name,
    readable_unit,
    shown_values,
    trajectory_charts,
)
from uqpen.core.arrays import evenly_spread
from uqpen.core.labels import SURROGATES
from uqpen.report.blocks import Fold, Heading, Remarks, Table, Text
from uqpen.report.sections.fields import further_curves
from uqpen.report.sections.sentences import main_outputs, output_blocks
from uqpen.results.archive_view import ArchiveView, output_heading
from uqpen.results.calibrations import calibration_tables
from uqpen.results.digits import number_text
from uqpen.results.output_tables import difference_tables, statistics_table
from uqpen.results.surrogate_tables import correction_tables, fit_table, missing_run_tables
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import title_with_unit
from uqpen.results.validations import validation_tables
from uqpen.surrogates.archived_surrogate import is_restorable

# A model beside measurements.


def measurements(view: ArchiveView) -> Iterator[Block]:
    """Charts of the model beside the measurements, and a row for each measured value."""
    by_heading = defaultdict[str, list[Charts]](list)  # a posterior has those held out as well
    for charts in measurement_charts(view):
        first = charts.charts[0]
        by_heading[f"{output_heading(view, first.of)} by {first.source}"].append(charts)
    for heading, own in by_heading.items():
        yield Heading(heading)
        yield from own
    for charts in posterior_charts(view):
        yield Heading(f"prior and posterior by {charts.charts[0].source}")
        yield charts
    for table in (*validation_tables(view.tree), *calibration_tables(view.tree)):
        yield Table(table, is_folded=True)


# Convergence of estimates as runs are added.

# Outputs that are drawn.
_MOST_OUTPUTS = 6


def convergence(view: ArchiveView) -> Iterator[Block]:
    """Estimates of the leading design from growing parts of its runs."""
    design = view.leading_design
    if design is None:
        return
    outputs = [*view.numeric_outputs, *view.categorical_outputs]
    shown = outputs[:_MOST_OUTPUTS]
    found = list(takewhile(lambda each: each.charts[0].of in shown, convergence_charts(view)))
    if not found:
        reason = view.design(design).reason_without_convergence
        reason = reason or "the archive has no estimates from parts of its runs"
        yield Text(
            f"Convergence cannot be shown for {design}, the design of the main results: {reason}."
        )
        return
    sentence, *remarks = found[0].notes
    yield Text(sentence)
    yield Remarks("How to read it", tuple(remarks))
    for each in found:
        yield Heading(output_heading(view, each.charts[0].of))
        yield replace(each, notes=())
    if left := outputs[_MOST_OUTPUTS:]:
        yield Text(f"Left out, as there are many outputs: {', '.join(left)}.")


# Estimates of the same statistics by all sources, side by side, and their cost.

# Outputs that are drawn.
_MOST_COMPARED = 6


def source_comparison(view: ArchiveView) -> Iterator[Block]:
    """The statistics of each output by all sources, and the cost of their intervals."""
    outputs = [
        each
        for each in (*view.numeric_outputs, *view.categorical_outputs)
        if available_statistics(view, each)
    ]
    drawn = outputs[:_MOST_COMPARED]
    yield from output_blocks(view, {each: _output_blocks(view, each) for each in drawn}, most=1)
    if left := outputs[_MOST_COMPARED:]:
        yield Text(f"Without charts, as there are many outputs: {', '.join(left)}.")
        for output in left:
            yield from _tables(view, output, is_folded=True)


def _output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Yield charts of the main statistics, and all others folded."""
    found = available_statistics(view, output)
    rows = compared_sources(view, found)
    if len(rows) < 2:
        yield Text(f"Only {rows[0]} has estimates, so there is nothing to compare.")
        yield from _tables(view, output, is_folded=True)
        return
    first = main_statistics(found)
    yield comparison_charts(view, output, first, rows)
    others = [each for each in found if each not in first]
    charts = [comparison_charts(view, output, others, rows)] if others else []
    costs = interval_cost_charts(view, output, found)
    yield Fold(
        "All statistics by all methods, and what their intervals cost",
        (
            *charts,
            *_tables(view, output),
            *(replace(each, tables=()) for each in costs),
            *(Table(table) for each in costs for table in each.tables),
        ),
    )


def _tables(view: ArchiveView, output: str, *, is_folded: bool = False) -> Iterator[Table]:
    if table := statistics_table(view.statistics, output):
        yield Table(table, is_folded)


# Differences of several models at the same points.


def model_comparison(view: ArchiveView) -> Iterator[Block]:
    """Curves and distribution functions by each of several models, and the models' differences.

    The first curves and the first main output are on the page already, with the main results.
    """
    if not view.model:
        return
    yield from further_curves(view)
    design = view.leading_design
    main = main_outputs(view) if design else []
    first = main[:1]
    for output in view.numeric_outputs if design else ():
        chart = model_chart(view, output, design or "")
        if chart is not None and output not in first:
            yield Heading(output_heading(view, output))
            yield chart
        swept = tuple(each for each in sweep_charts(view) if each.of == output)
        if swept and output not in main:  # those of the main outputs are on the page already
            yield Charts(swept)
    for table in difference_tables(view.archive):
        yield Table(table, is_folded=True)


# Accuracy of surrogates in independent runs.


def surrogates(view: ArchiveView) -> Iterator[Block]:
    """Yield the accuracy of surrogates in independent runs."""
    for name in group_names(view.tree, SURROGATES):
        made = view.tree.children[SURROGATES].children[name]
        yield Heading(name)
        yield Table(fit_table(name, made))
        if not is_restorable(made):
            yield Text(f"{made.attrs['kind']} is not executed here, so no predictions are shown.")
        elif charts := prediction_charts(view, name):
            yield charts
        for tables in (correction_tables, missing_run_tables):
            for table in tables(view.tree, name):
                yield Table(table)


# The trajectory of the model at the nominal inputs.

# Points of a line at the most, and rows of a table.
_MOST_POINTS, _ROWS = 300, 11


def trajectory(view: ArchiveView) -> Iterator[Block]:
    """The trajectory at the nominal inputs; of several models, all together."""
    for charts in trajectory_charts(view, _MOST_POINTS):
        tables = (_table(view, *each) for each in find_trajectories(view).items())
        yield replace(charts, tables=tuple(tables))


def _table(view: ArchiveView, model: str, dataset: xr.Dataset) -> OutputTable:
    along = str(next(iter(dataset.dims)))
    title = f"Trajectory of {model}" if model else "Trajectory"
    where = title_with_unit(quantity_name(dataset[along]), view.unit(along))
    table = OutputTable(f"{title}, by {where}", [])
    columns = []
    for name in map(str, dataset.data_vars):
        unit, _ = readable_unit(dataset[name])
        table.columns.append(title_with_unit(quantity_name(dataset[name]), unit))
        x, y, _ = shown_values(view, dataset[name])
        columns.append(y)
    for position in evenly_spread(x.size, _ROWS).tolist():
        values = (y[position] for y in columns)
        cells = [number_text(value) if np.isfinite(value) else NOTHING for value in values]
        table.rows.append((number_text(x[position]), cells))
    return table
