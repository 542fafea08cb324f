"""Each output against each input, run by run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.charts.axes import ValueAxis, output_axis, padded_limits, quantity, quantity_axis
from uqpen.charts.chart import Axis, Block, Chart, Charts, LegendKey
from uqpen.charts.marks import CROSS, Mark, Points, escape_text
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import RUN, STATUS
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.figures.scatter import category_labels
from uqpen.report.blocks import Text
from uqpen.report.counting import count_text
from uqpen.report.sections.drivers import input_label, input_order
from uqpen.report.sections.leading_design import leading_design
from uqpen.report.sections.main_outputs import output_blocks
from uqpen.report.sections.plotted_runs import PlottedRuns
from uqpen.report.sections.run_explorer import run_explorer, run_heights
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import estimate_text, number_text, range_text
from uqpen.results.table import NOTHING, OutputTable, identity
from uqpen.results.texts import plain_text, title_with_unit, unit_suffix

__all__ = ["scatter"]


# Charts of a model at the most.
_MOST_CHARTS = 24
# Characters that stand along the foot of a small chart, and along its side.
_LONGEST, _HIGHEST = 36, 26
_HEIGHT = 230

_BEYOND = (LegendKey("run beyond the threshold", "beyond", "circle"),)
# Measures of association, shown in the table.
_ASSOCIATIONS = (("spearman", "Spearman"), ("pearson", "Pearson"), ("first_order", "first order"))


def scatter(view: ArchiveView) -> Iterator[Block]:
    """Each output against each input, run by run."""
    design = leading_design(view)
    outputs = [*view.numeric_outputs, *view.categorical_outputs][:_MOST_CHARTS]
    if design is None or not outputs:
        return
    if not view.design(design).keeps_runs:
        yield Text(f"The runs of {design} are not in the archive, which keeps their statistics.")
        return
    cloud = PlottedRuns(view, design)
    most = max(1, _MOST_CHARTS // len(outputs))
    keys = [LegendKey("run", view.series(design), "circle")]
    if cloud.shown_failed.sizes[RUN]:
        keys.append(LegendKey("failed run, at the foot", "ink", "x"))
    yield run_explorer(cloud)
    found = {output: _output_charts(cloud, output, most, tuple(keys)) for output in outputs}
    yield from output_blocks(view, found, most=1)


def _output_charts(
    cloud: PlottedRuns, output: str, most: int, keys: tuple[LegendKey, ...]
) -> Iterator[Charts]:
    inputs, note = _chosen_inputs(cloud, output, most)
    if inputs:
        yield Charts(
            tuple(_chart(cloud, output, name) for name in inputs),
            keys=(*keys, *_BEYOND * (output in cloud.view.numeric_outputs)),
            notes=tuple(filter(None, (cloud.thinning_note, note, _cut_note(cloud, output)))),
            tables=(_table(cloud, output),),
        )


def _chosen_inputs(cloud: PlottedRuns, output: str, most: int) -> tuple[list[str], str]:
    """The inputs with a chart, the most important first, and a note if some have none."""
    order = input_order(cloud.view, output)
    every = order.sort(cloud.inputs)
    if len(every) <= most:
        return every, ""
    if not order.reason:
        return every[:most], f"Shown are the first {most} of {len(every)} inputs."
    return every[:most], f"Shown are the {most} of {len(every)} inputs with {order.reason}."


def _chart(cloud: PlottedRuns, output: str, name: str) -> Chart:
    view = cloud.view
    shown = (cloud.shown_completed, cloud.shown_failed)
    every = np.concatenate([cloud.values(name, each) for each in shown])
    finite = every[np.isfinite(every)]
    # No run lies on the frame.
    ends = padded_limits(float(finite.min()), float(finite.max()))
    y, axis = _vertical_axis(cloud, output)
    is_number = output in view.numeric_outputs
    across = _hover_line(view, name, input_label(view, name), "x")
    value = (
        f"<br>{_hover_line(view, output, output_title(view, output), 'y')}"
        if is_number
        else "<br>%{text}"
    )
    kinds = {} if is_number else category_labels(cloud.shown_completed[output])
    codes = cloud.shown_completed[output].values.tolist()
    texts = [kinds.get(code, "") for code in codes] if kinds else ()
    drawn = Points(
        cloud.values(name, cloud.shown_completed),
        y,
        view.series(cloud.design),
        hover=f"run %{{customdata}}<br>{across}{value}",
        name=f"{output}, {name}",
        texts=texts,
        numbers=cloud.shown_completed["number"].values.tolist(),
    )
    traces: list[Mark] = [drawn]
    if cloud.shown_failed.sizes[RUN]:
        traces.append(_failed_run_trace(cloud, name, axis))
    return Chart(
        title=f"{output_title(view, output)} against {input_label(view, name)}",
        summary=_summary(cloud, output, name),
        x=quantity_axis(
            view, name, ends, _short_title(view, name, input_label(view, name), _LONGEST)
        ),
        y=axis,
        marks=tuple(traces),
        height=_HEIGHT,
        runs_of=view.model,
    )


def _short_title(view: ArchiveView, name: str, label: str, longest: int) -> str:
    """Return the title of an axis, its label cut where there is no room for it."""
    room = longest - len(title_with_unit("", view.unit(name)))
    return title_with_unit(plain_text(label, max(room, 8)), view.unit(name))


def _hover_line(view: ArchiveView, name: str, label: str, along: str) -> str:
    return f"{escape_text(label, 40)} %{{{along}:.4~g}}{escape_text(unit_suffix(view.unit(name)))}"


def _vertical_axis(cloud: PlottedRuns, output: str) -> tuple[FloatArray, Axis]:
    """Return the positions of the runs along the vertical axis, and the axis."""
    heights, rows = run_heights(cloud, output)
    if not rows:
        span = _span(cloud, output)
        label = output_title(cloud.view, output)
        title = _short_title(cloud.view, output, label, _HIGHEST)
        return heights, output_axis(cloud.view, output, span, title)
    return heights, Axis("", rows=rows, quantity=quantity(cloud.view, output))


def _span(cloud: PlottedRuns, output: str) -> ValueAxis:
    values = cloud.values(output, cloud.shown_completed)
    return ValueAxis.of_values([values], is_logarithmic=cloud.view.is_logarithmic(output))


def _cut_note(cloud: PlottedRuns, output: str) -> str:
    if output in cloud.view.numeric_outputs and _span(cloud, output).is_cut:
        return "The axis of the output ends where all but 1 % of the runs shown lie inside."
    return ""


def _failed_run_trace(cloud: PlottedRuns, name: str, axis: Axis) -> Mark:
    foot = len(axis.rows) - 0.58
    if axis.ends is not None:
        lower, upper = axis.ends
        foot = lower + 0.025 * (upper - lower)
        foot = 10.0**foot if axis.is_logarithmic else foot
    statuses = [Status(code) for code in cloud.shown_failed[STATUS].values.tolist()]
    x = cloud.values(name, cloud.shown_failed)
    return Points(
        x,
        np.full(x.size, foot),
        "ink",
        hover="run %{customdata}, failed: %{text}<br>"
        + _hover_line(cloud.view, name, input_label(cloud.view, name), "x"),
        name=f"failed, {name}",
        texts=[STATUS_TEXT[status] for status in statuses],
        numbers=cloud.shown_failed["number"].values.tolist(),
        marker=CROSS,
        size=6,
        opacity=0.8,
    )


def _association_estimates(
    cloud: PlottedRuns, output: str, name: str
) -> Iterator[tuple[str, xr.DataArray]]:
    statistics = cloud.view.statistics
    for statistic, label in _ASSOCIATIONS:
        found = statistics.entries(cloud.design, output, statistic).get(name)
        if found is not None:
            yield label, found


def _summary(cloud: PlottedRuns, output: str, name: str) -> str:
    for label, array in _association_estimates(cloud, output, name):
        if np.isfinite(array.values[0]):
            what = "rank correlation" if label == "Spearman" else label
            text = estimate_text(*array.values.tolist())
            both = f"{output_title(cloud.view, output)} and {input_label(cloud.view, name)}"
            return f"{both} by {cloud.design}: {what} {text}."
    span = _range(cloud, name, cloud.completed)
    return f"{input_label(cloud.view, name)} ranges over {span} in the runs."


def _range(cloud: PlottedRuns, name: str, which: BoolArray) -> str:
    values = cloud.values(name, cloud.runs)[which]
    values = values[np.isfinite(values)]
    if not values.size:
        return NOTHING
    return range_text(number_text(values.min()), number_text(values.max()))


def _table(cloud: PlottedRuns, output: str) -> OutputTable:
    first = [label for label, _ in _association_estimates(cloud, output, (cloud.inputs or [""])[0])]
    if not first:
        return _range_table(cloud, output)
    title = f"{output_title(cloud.view, output)} and its inputs, by {cloud.design}"
    table = OutputTable(title, first)
    for name in cloud.inputs:
        found = dict(_association_estimates(cloud, output, name))
        cells = [table.cell(found.get(label), identity) for label in first]
        table.rows.append((input_label(cloud.view, name), cells))
    return table


def _range_table(cloud: PlottedRuns, output: str) -> OutputTable:
    """Return a table of ranges: in all completed runs, and by category of the output."""
    view = cloud.view
    which = {"all completed runs": cloud.completed}
    names: Sequence[str] = [*cloud.inputs, output]
    if output in view.categorical_outputs:
        codes = cloud.runs[output].values
        kinds = category_labels(cloud.runs[output]).items()
        which |= {label: cloud.completed & (codes == code) for code, label in kinds}
        names = cloud.inputs
    columns = [f"{label}\n{count_text(int(runs.sum()), 'run')}" for label, runs in which.items()]
    table = OutputTable(f"Smallest and largest values, by {cloud.design}", columns)
    note = table.note_mark("ranges of these runs, not estimates; so they have no intervals")
    for name in names:
        ranges = (_range(cloud, name, runs) for runs in which.values())
        cells = [text + note * (text != NOTHING) for text in ranges]
        table.rows.append((view.axis_label(name), cells))
    return table
