"""All inputs and outputs of the runs that are drawn, for a reader to select among."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.charts.axes import quantity
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import WEIGHT
from uqpen.figures.scatter import category_labels, jitter
from uqpen.report.blocks import RunColumn, RunExplorer
from uqpen.report.sections.drivers import input_order
from uqpen.report.sections.plotted_runs import PlottedRuns
from uqpen.results.archive_view import output_title
from uqpen.results.texts import plain_text, unit_suffix

__all__ = ["run_explorer", "run_heights"]

# Inputs at the most.
_MOST_INPUTS = 40
_LONGEST_LABEL, _LONGEST_ROW = 50, 28


def run_explorer(cloud: PlottedRuns) -> RunExplorer:
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
        completed=cloud.shown_completed["number"].values.tolist(),
        failed=cloud.shown_failed["number"].values.tolist(),
        columns=(
            *(_output_column(cloud, name) for name in outputs),
            *_input_columns(cloud, inputs[:_MOST_INPUTS]),
        ),
        notes=tuple(notes),
    )


def run_heights(cloud: PlottedRuns, output: str) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the places of the completed runs along an output, and the rows of its categories.

    Of a number, the values in the unit that is shown, and no rows.
    """
    runs: xr.Dataset = cloud.shown_completed
    if output in cloud.view.numeric_outputs:
        return cloud.values(output, runs), ()
    kinds = category_labels(runs[output])
    return jitter(runs[output].values, kinds), tuple(kinds.values())


def _output_column(cloud: PlottedRuns, output: str) -> RunColumn:
    heights, rows = run_heights(cloud, output)
    return RunColumn(
        quantity=quantity(cloud.view, output),
        label=plain_text(output_title(cloud.view, output), _LONGEST_LABEL),
        unit=unit_suffix(cloud.view.unit(output)).lstrip(),
        is_input=False,
        values=heights,
        rows=tuple(plain_text(row, _LONGEST_ROW) for row in rows),
        is_logarithmic=not rows and cloud.view.is_logarithmic(output),
    )


def _input_columns(cloud: PlottedRuns, inputs: list[str]) -> Iterator[RunColumn]:
    for name in inputs:
        yield RunColumn(
            quantity=quantity(cloud.view, name),
            label=plain_text(output_title(cloud.view, name), _LONGEST_LABEL),
            unit=unit_suffix(cloud.view.unit(name)).lstrip(),
            is_input=True,
            values=cloud.values(name, cloud.shown_completed),
            failed=cloud.values(name, cloud.shown_failed),
        )
