"""Accuracy of surrogates in independent runs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.charts.axes import padded_limits
from uqpen.charts.chart import Axis, Block, Chart, Charts, LegendKey
from uqpen.charts.marks import Line, Mark, Points, escape_text
from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import RUN, RUNS, STATUS, SURROGATES
from uqpen.core.status import Status
from uqpen.figures.scatter import thin_runs
from uqpen.figures.surrogate import fit_quality, predict, test_design
from uqpen.report.blocks import Heading, Table, Text
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, number_text
from uqpen.results.surrogate_tables import (
    correction_tables,
    fit_table,
    fitted_outputs,
    missing_run_tables,
)
from uqpen.results.table import OutputTable
from uqpen.results.texts import title_with_unit, unit_suffix
from uqpen.surrogates.restoring import is_restorable

__all__ = ["surrogates"]


# Runs in a chart, and runs in the table of differences, at the most.
_MOST_RUNS, _MOST_COMPARED = 400, 100_000
# Runs that are shown besides: those with the largest differences.
_WORST = 10


def surrogates(view: ArchiveView) -> Iterator[Block]:
    """Yield the accuracy of surrogates in independent runs."""
    for name in group_names(view.tree, SURROGATES):
        made = view.tree.children[SURROGATES].children[name]
        yield Heading(name)
        yield Table(fit_table(name, made))
        design = test_design(view, made)
        outputs = [each for each in fitted_outputs(made) if each in view.numeric_outputs]
        if not is_restorable(made):
            yield Text(f"{made.attrs['kind']} is not executed here, so no predictions are shown.")
        elif outputs and view.design(design).has_completed_runs:
            yield _comparison(view, name, design, outputs)
        for tables in (correction_tables, missing_run_tables):
            for table in tables(view.tree, name):
                yield Table(table)


class _Predictions(NamedTuple):
    """Results of the model and its surrogate for the same runs, in the unit that is shown."""

    runs: IntArray
    observed: FloatArray
    predicted: FloatArray

    @property
    def differences(self) -> FloatArray:
        found: FloatArray = self.predicted - self.observed
        return found


def _comparison(view: ArchiveView, name: str, design: str, outputs: list[str]) -> Charts:
    made = view.tree.children[SURROGATES].children[name]
    runs = read_group(view.tree, RUNS, design)
    places = np.flatnonzero(runs[STATUS].values == Status.OK)
    chosen = thin_runs(xr.Dataset({"place": (RUN, places)}), _MOST_COMPARED)["place"].values
    taken = runs.isel({RUN: chosen})
    shown = np.isin(chosen, thin_runs(xr.Dataset({"place": (RUN, chosen)}), _MOST_RUNS)["place"])
    has_worst = not shown.all()
    compared = {
        output: _Predictions(
            chosen,
            view.scale(output).from_si(taken[output].values),
            view.scale(output).from_si(predict(made, name, taken, output)),
        )
        for output in outputs
    }
    is_fitted_to = design == str(made.attrs["design"])
    role = "its training runs" if is_fitted_to else "not training runs"
    drawn = f"{grouped_number(int(shown.sum()))} of {grouped_number(places.size)} runs of {design}"
    keys = [LegendKey("run", view.series(name), "circle")]
    if has_worst:
        drawn += f", and the {_WORST} with the largest differences"
        keys.append(LegendKey(f"the {_WORST} largest differences", "ink", "diamond-open"))
    return Charts(
        tuple(_chart(view, name, output, each, shown) for output, each in compared.items()),
        keys=(*keys, LegendKey("surrogate = model", "quiet", "line")),
        notes=(f"Shown are {drawn} ({role}).",),
        tables=(_difference_table(view, design, places.size, compared),),
    )


def _chart(
    view: ArchiveView, name: str, output: str, compared: _Predictions, shown: BoolArray
) -> Chart:
    worst = _largest_differences(compared) if not shown.all() else np.array([], dtype=np.int64)
    at = np.union1d(np.flatnonzero(shown), worst)
    ends = _axis_limits(np.concatenate([compared.observed[at], compared.predicted[at]]))
    room = padded_limits(*ends, 0.04)
    unit = view.unit(output)
    unit_text = unit_suffix(unit)
    off = np.abs(compared.differences)
    middle, most, largest = (
        f"{number_text(value, 3)}{unit_text}"
        for value in (*np.nanquantile(off, [0.5, 0.95]), np.nanmax(off))
    )
    series = view.series(name)
    traces = [
        _prediction_trace(compared, np.flatnonzero(shown), series, unit_text, f"{output} by {name}")
    ]
    if worst.size:
        trace_name = f"{output} by {name}, largest differences"
        traces.append(
            _prediction_trace(compared, worst, "ink", unit_text, trace_name, "diamond-open")
        )
    made = view.tree.children[SURROGATES].children[name]
    return Chart(
        title=f"{output}: {fit_quality(made, output)}",
        summary=f"Half of the {grouped_number(off.size)} runs differ by at most {middle}, 95 % by "
        f"at most {most}, and the largest difference is {largest}.",
        x=Axis(title_with_unit("run of the model", unit), room),
        y=Axis(title_with_unit("surrogate", unit), room),
        marks=(Line(ends, ends, "quiet", hover="", width=1.5), *traces),
        height=300,
    )


def _prediction_trace(
    compared: _Predictions,
    which: IntArray,
    series: int | str,
    unit: str,
    name: str,
    marker: str = "circle",
) -> Mark:
    unit_text = escape_text(unit)
    return Points(
        compared.observed[which],
        compared.predicted[which],
        series,
        hover=f"run %{{customdata}}<br>model %{{x:.5~g}}{unit_text}<br>surrogate "
        f"%{{y:.5~g}}{unit_text}",
        name=name,
        numbers=compared.runs[which].tolist(),
        marker=marker,
        size=4 if marker == "circle" else 8,
        opacity=0.55 if marker == "circle" else 1,
    )


def _largest_differences(compared: _Predictions) -> IntArray:
    """The runs with the largest differences, which a choice at random would leave out."""
    order = np.argsort(-np.abs(np.nan_to_num(compared.differences, nan=0.0)), kind="stable")
    return np.sort(order[:_WORST])


def _axis_limits(values: FloatArray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return float(finite.min()), float(finite.max())


def _difference_table(
    view: ArchiveView, design: str, whole: int, compared: dict[str, _Predictions]
) -> OutputTable:
    size = next(iter(compared.values())).observed.size
    of = grouped_number(size) + f" of {grouped_number(whole)}" * (size != whole)
    title = f"Surrogate minus model, in {of} runs of {design}"
    columns = ["mean", "root mean square", "95 % differ at most by", "largest", "sd of the runs"]
    table = OutputTable(title, columns)
    note = table.note_mark("numbers of these runs, not estimates; so they have no intervals")
    for output, each in compared.items():
        off = each.differences
        values = (
            np.mean(off),
            np.sqrt(np.mean(off**2)),
            np.quantile(np.abs(off), 0.95),
            np.max(np.abs(off)),
            np.std(each.observed),
        )
        table.rows.append(
            (
                title_with_unit(output, view.unit(output)),
                [f"{number_text(float(value), 3)}{note}" for value in values],
            )
        )
    return table
