"""Each output against each input, run by run, and all of them for a reader to select among."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from uqpen.charts.axes import quantity
from uqpen.charts.chart import Block, Charts, LegendKey
from uqpen.charts.scatter import PlottedRuns, scatter_output_charts
from uqpen.core.labels import WEIGHT
from uqpen.report.blocks import RunColumn, RunExplorer, Text
from uqpen.report.sections.main_outputs import output_blocks
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.input_measures import input_order
from uqpen.results.texts import plain_text, unit_suffix

__all__ = ["scatter"]

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
