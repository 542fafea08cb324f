"""Each output: its distribution, the sources of its uncertainty, its runs against the inputs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from uqpen.charts.axes import quantity
from uqpen.charts.chart import Block, Chart, Charts, LegendKey, RunsBeyondAxis, ThresholdReadout
from uqpen.charts.distributions import (
    Curve,
    LargestRun,
    cdf_chart,
    distribution_curves,
    empirical_cdf,
    exceedance_chart,
)
from uqpen.charts.histograms import histogram, shares
from uqpen.charts.marks import Line, Rule
from uqpen.charts.measures import (
    MeasureSeries,
    category_charts,
    category_series,
    effect_charts,
    index_charts,
    noise_charts,
    part_charts,
    responses,
    salib_charts,
)
from uqpen.charts.scatter import PlottedRuns, scatter_output_charts
from uqpen.charts.study_limits import study_limits
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.core.labels import INPUT, INTERVAL_LEVEL, PERCENT, WEIGHT
from uqpen.report.blocks import Fold, RunColumn, RunExplorer, Table, Text
from uqpen.report.sections.sentences import main_outputs, output_blocks
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import number_text, percent_text, range_text
from uqpen.results.input_measures import index_titles, input_order, named_tables
from uqpen.results.table import NOTHING, OutputTable, identity, quantile_label
from uqpen.results.texts import plain_text, unit_suffix

# Distribution function, histogram and quantiles.


# Probabilities at which the numbers behind a distribution function are shown.
_SHOWN = np.linspace(0, 1, 21)
# Runs beyond either end of an axis at the most, so that a page does not grow with their number.
_MOST_BEYOND = 40


def distributions(view: ArchiveView) -> Iterator[Block]:
    """Distribution function with its band, histogram and quantiles of each output."""
    design = view.leading_design
    if design is None:
        return
    # The main results have the histogram of the first main output.
    pictured = "" if view.model else next(iter(main_outputs(view)), "")
    found = {
        each: _numeric_blocks(view, each, design, is_pictured=each == pictured)
        for each in view.numeric_outputs
    }
    found |= {each: _category_blocks(view, each, design) for each in view.categorical_outputs}
    yield from output_blocks(view, found)


def _category_blocks(view: ArchiveView, output: str, design: str) -> Iterator[Block]:
    probabilities = view.statistics.get(design, output, "share")
    if probabilities is not None:
        yield shares(view, output, design, probabilities)


def _numeric_blocks(
    view: ArchiveView, output: str, design: str, *, is_pictured: bool
) -> Iterator[Block]:
    # The function of the leading design comes first.
    found = distribution_curves(view, output)
    curves = sorted(found, key=lambda curve: curve.source != design)
    if not curves:
        return
    bins = () if is_pictured else (histogram(view, output, design),)
    tail = exceedance_chart(view, output, curves[0])
    yield Charts((_cdf(view, output, curves[:1]), *bins, *tail))
    convert = view.scale(output).from_si
    array = view.statistics.statistics(design, output)["percentile"]
    probabilities = array[PERCENT] / 100
    level = array.attrs.get(INTERVAL_LEVEL)
    with_intervals = "" if level is None else f", with {percent_text(level)} intervals"
    table = OutputTable(f"Quantiles by {design}{with_intervals}", [view.axis_label(output)])
    for p, estimate in zip(probabilities.values.tolist(), array, strict=True):
        cell = table.cell(estimate, convert, is_logarithmic=view.is_logarithmic(output))
        table.rows.append((quantile_label(p), [cell]))
    largest = LargestRun.of_design(view, design, output)
    table.rows.append((largest.name, [number_text(largest.value)]))
    yield Table(table, is_folded=True)
    if len(curves) > 1:
        yield Fold("Distribution functions by all methods", (_cdf(view, output, curves),))


def _cdf(view: ArchiveView, output: str, curves: list[Curve]) -> Chart:
    """Return a chart of functions with the numbers of the first; of one alone with a threshold."""
    curve = curves[0]
    with_band = ", with its simultaneous band" * curve.has_band
    title = f"Distribution function by {curve.name}{with_band}"
    table = OutputTable(title, [view.axis_label(output), "P(at most)", "band"])
    ranks = np.unique(np.round(_SHOWN * (curve.values.size - 1)).astype(np.int64))
    for rank in ranks.tolist():
        estimate, lower, upper = curve.band[rank]
        ends = range_text(f"{lower:.4f}", f"{upper:.4f}") if curve.has_band else "–"
        cells = [number_text(curve.values[rank]), f"{estimate:.4f}", ends]
        table.rows.append((percent_text(round(rank / (curve.values.size - 1), 6)), cells))
    if not curve.has_band:
        table.columns[-1] += table.note_mark(f"no band: {curve.note}")
    chart = replace(cdf_chart(view, output, curves), tables=(table,))
    if len(curves) > 1:
        return chart
    return replace(chart, reading=_threshold_readout(view, output, curves[0], chart))


def _threshold_readout(
    view: ArchiveView, output: str, curve: Curve, chart: Chart
) -> ThresholdReadout:
    (thresholds,) = (mark.x for mark in chart.marks if isinstance(mark, Line))
    drawn = [mark.at for mark in chart.marks if isinstance(mark, Rule)]
    curve = curve.at(np.asarray(thresholds))
    limits = study_limits(view, output)
    # First the limit that the study has a verdict about, wherever it lies; else the first limit on
    # the axis, or any; and without limits, a quantile.
    decided = [limit.value for limit in limits if limit.acceptance is not None]
    place = min(int(np.searchsorted(curve.band[:, 0], 0.95)), curve.values.size - 1)
    quantile = float(curve.values[place])
    return ThresholdReadout(
        output=output_title(view, output),
        unit=unit_suffix(view.unit(output)).lstrip(),
        source=curve.source,
        level=curve.level,
        note=curve.note,
        values=curve.values.tolist(),
        limits=tuple((limit.value, limit.text) for limit in limits),
        start=[*decided, *drawn, *(limit.value for limit in limits), quantile][0],
        bounds=_listed_bounds(curve.band),
        beyond=_runs_beyond_axis(view, output, curve),
    )


def _runs_beyond_axis(view: ArchiveView, output: str, curve: Curve) -> RunsBeyondAxis | None:
    """Return the runs beyond the thresholds of a function, for those that a reader types."""
    if not view.design(curve.source).keeps_runs:
        return None
    values = np.sort(view.design(curve.source).completed_values(output))
    shown = view.scale(output).from_si(values)
    first, last = float(curve.values[0]), float(curve.values[-1])

    def listed(which: FloatArray) -> list[list[float | None]]:
        chosen = np.unique(which[evenly_spread(which.size, _MOST_BEYOND)]) if which.size else which
        bounds = _listed_bounds(curve.limits.around(empirical_cdf(values, chosen)))
        return [
            [_exact(value), *row]
            for value, row in zip(view.scale(output).from_si(chosen).tolist(), bounds, strict=True)
        ]

    (nothing,) = _listed_bounds(curve.limits.around(np.zeros(1)))
    return RunsBeyondAxis(
        runs=int(values.size),
        smallest=_exact(float(shown[0])),
        largest=_exact(float(shown[-1])),
        nothing=nothing,
        below=listed(values[shown < first]),
        above=listed(values[shown > last]),
    )


def _listed_bounds(band: FloatArray) -> list[list[float | None]]:
    """Return a function with its band as rows of numbers; None in place of NaN."""
    return [
        [round(value, 9) if math.isfinite(value) else None for value in row]
        for row in band.tolist()
    ]


def _exact(value: float) -> float:
    """Return a value in more digits than anybody types."""
    return float(f"{value:.12g}")


# Sources of the uncertainty: shares of the variance, effects, responses.


def sensitivity(view: ArchiveView) -> Iterator[Block]:
    """Yield the sources of the uncertainty: shares of the variance, effects, responses."""
    found = {output: _numeric_output_blocks(view, output) for output in view.numeric_outputs}
    found |= {each: _categorical_output_blocks(view, each) for each in view.categorical_outputs}
    yield from output_blocks(view, found)


def _numeric_output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Yield the first measure that the archive has, and the others folded."""
    measures = tuple(_measure_blocks(view, output))
    yield from measures[:1]
    if further := measures[1:]:
        yield Fold("Other measures", further)


def _measure_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    tables: dict[str, list[OutputTable]] = {}
    for name, table in named_tables(view.statistics, output, view.unit(output), everything=True):
        tables.setdefault(name, []).append(table)
    charts = [*index_charts(view, output, tables), *effect_charts(view, output, tables)]
    charts += [*salib_charts(view, output, tables), *part_charts(view, output)]
    yield from charts
    if changes := tuple(responses(view, output)):
        yield Charts(changes, tables=tuple(tables.pop("responses", ())))
    drawn = [table for chart in charts for table in chart.tables]
    for table in chain.from_iterable(tables.values()):
        if table not in drawn and any(
            not cell.startswith(NOTHING) for _, cells in table.rows for cell in cells
        ):
            yield Table(table, is_folded=True)


def noise(view: ArchiveView) -> Iterator[Block]:
    """Yield the noise of each output along the inputs."""
    yield from output_blocks(
        view, {output: noise_charts(view, output) for output in view.numeric_outputs}
    )


def _categorical_output_blocks(view: ArchiveView, output: str) -> Iterator[Block]:
    """Shares of the variance of an output being in a category."""
    shares = index_titles(view.tree)
    tables = tuple(
        _category_table(f"{output}: {shares.title(f'the variance of whether it is {kind}')}", each)
        for kind, each in category_series(view, output).items()
    )
    if charts := tuple(category_charts(view, output)):
        yield Charts(charts, tables=tables)
    else:
        yield from (Table(table, is_folded=True) for table in tables)


def _category_table(title: str, series: Sequence[MeasureSeries]) -> OutputTable:
    """A row for each input."""
    table = OutputTable(title, [f"{each.label}\n{each.source}" for each in series])
    known = [each.array[INPUT].values.tolist() for each in series]
    for name in dict.fromkeys(name for inputs in known for name in inputs):
        cells = [
            table.cell(each.array[inputs.index(name)], identity) if name in inputs else NOTHING
            for each, inputs in zip(series, known, strict=True)
        ]
        table.rows.append((str(name), cells))
    return table


# Each output against each input, run by run, and all of them for a reader to select among.

# Inputs of the runs for a reader to select among, at the most.
_MOST_INPUTS = 40
_LONGEST_LABEL, _LONGEST_ROW = 50, 28

_BEYOND = LegendKey("run beyond the threshold", "beyond", "circle")


def scatter(view: ArchiveView) -> Iterator[Block]:
    """Each output against each input, run by run."""
    design = view.leading_design
    if design is None or not (view.numeric_outputs or view.categorical_outputs):
        return
    if not view.design(design).keeps_runs:
        yield Text(f"The runs of {design} are not in the archive, which keeps their statistics.")
        return
    cloud = PlottedRuns(view, design)
    yield _run_explorer(cloud)
    found = {output: _output_charts(cloud, output) for output in cloud.outputs}
    yield from output_blocks(view, found, most=1)


def _output_charts(cloud: PlottedRuns, output: str) -> Iterator[Charts]:
    for charts in scatter_output_charts(cloud, output):
        is_number = output in cloud.view.numeric_outputs
        yield replace(charts, keys=(*charts.keys, _BEYOND)) if is_number else charts


def _run_explorer(cloud: PlottedRuns) -> RunExplorer:
    """Return the runs with their outputs, and then their inputs, the most important first."""
    view = cloud.view
    outputs = [*view.numeric_outputs, *view.categorical_outputs]
    inputs = input_order(view, outputs[0]).sort(cloud.inputs)
    notes = [cloud.thinning_note]
    if WEIGHT in cloud.runs.coords:
        notes.append("The runs have weights, which these lines and counts leave out.")
    if len(inputs) > _MOST_INPUTS:
        notes.append(f"Shown are {_MOST_INPUTS} of {len(inputs)} inputs.")
    return RunExplorer(
        title=f"All inputs and outputs of the runs of {cloud.design}",
        summary="Each run is a line, which crosses each axis at its value.",
        model=view.model,
        design=cloud.design,
        series=view.series(cloud.design),
        completed=cloud.completed["number"].values.tolist(),
        failed=cloud.failed["number"].values.tolist(),
        columns=tuple(_column(cloud, name) for name in (*outputs, *inputs[:_MOST_INPUTS])),
        notes=tuple(notes),
    )


def _column(cloud: PlottedRuns, name: str) -> RunColumn:
    view = cloud.view
    is_input = name in cloud.inputs
    # An input has a value in failed runs too.
    values, rows = (cloud.values(name, cloud.completed), ()) if is_input else cloud.heights(name)
    return RunColumn(
        quantity=quantity(view, name),
        label=plain_text(output_title(view, name), _LONGEST_LABEL),
        unit=unit_suffix(view.unit(name)).lstrip(),
        is_input=is_input,
        values=values,
        failed=cloud.values(name, cloud.failed) if is_input else (),
        rows=tuple(plain_text(row, _LONGEST_ROW) for row in rows),
        is_logarithmic=not (is_input or rows) and view.is_logarithmic(name),
    )
