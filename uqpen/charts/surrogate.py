"""Predictions of a surrogate, compared with runs of the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.charts.axes import padded_limits
from uqpen.charts.chart import Axis, Chart, Charts, LegendKey
from uqpen.charts.marks import Colour, Line, Points, escape_text
from uqpen.charts.scatter import thin_runs
from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import REFUTED, RUN, RUNS, STATUS, SURROGATES
from uqpen.core.status import Status
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, number_text
from uqpen.results.surrogate_tables import fit_diagnostics, fitted_outputs
from uqpen.results.table import OutputTable
from uqpen.results.texts import title_with_unit, unit_suffix
from uqpen.surrogates.archived_surrogate import is_restorable, restore_surrogate
from uqpen.surrogates.diagnostics import quality_text

# Runs in a chart, and runs in the table of differences, at the most.
_MOST_RUNS, _MOST_COMPARED = 400, 100_000
# Runs that are shown besides: those with the largest differences.
_WORST = 10


def surrogate_charts(view: ArchiveView) -> Iterator[Charts]:
    """A surrogate's predictions, compared with runs of the model."""
    for name in group_names(view.tree, SURROGATES):
        if view.source in (None, name) and (of := prediction_charts(view, name, f" by {name}")):
            yield of


class _Predictions(NamedTuple):
    """Results of the model and its surrogate for the same runs, in the unit that is shown."""

    runs: IntArray
    observed: FloatArray
    predicted: FloatArray

    @property
    def differences(self) -> FloatArray:
        found: FloatArray = self.predicted - self.observed
        return found


def prediction_charts(view: ArchiveView, name: str, by: str = "") -> Charts | None:
    """Return the charts of a surrogate's outputs; None where it has no predictions to show.

    The runs are its check runs or, without any, those that it was fitted to. Surrogates of the
    package and of installed ones are evaluated; no code of the archive is.
    Where no heading names it, `by` does so behind what is shown.
    """
    made = view.tree.children[SURROGATES].children[name]
    check, fitted_to = str(made.attrs.get("check", "")), str(made.attrs["design"])
    design = check if check in view.designs else fitted_to
    outputs = [each for each in fitted_outputs(made) if each in view.numeric_outputs]
    if not (is_restorable(made) and outputs and view.design(design).has_completed_runs):
        return None
    runs = read_group(view.tree, RUNS, design)
    places = xr.Dataset({"place": (RUN, np.flatnonzero(runs[STATUS].values == Status.OK))})
    compared = thin_runs(places, _MOST_COMPARED)
    chosen = compared["place"].values
    shown = np.flatnonzero(np.isin(chosen, thin_runs(compared, _MOST_RUNS)["place"]))
    taken = runs.isel({RUN: chosen})
    found = {
        output: _Predictions(
            chosen,
            view.scale(output).from_si(taken[output].values),
            view.scale(output).from_si(_predict(made, name, taken, output)),
        )
        for output in outputs
    }
    whole = grouped_number(places.sizes[RUN])
    drawn = f"{grouped_number(shown.size)} of {whole} runs of {design}"
    keys = [LegendKey(f"run{by}", view.series(name), "circle")]
    if shown.size < chosen.size:
        drawn += f", and the {_WORST} with the largest differences"
        keys.append(LegendKey(f"the {_WORST} largest differences", "ink", "diamond-open"))
    role = "its training runs" if design == fitted_to else "not training runs"
    of = f"{grouped_number(chosen.size)}" + f" of {whole}" * (chosen.size != places.sizes[RUN])
    return Charts(
        tuple(
            _chart(view, name, output, each, shown, f"{output}{by}: {_fit_quality(made, output)}")
            for output, each in found.items()
        ),
        keys=(*keys, LegendKey("surrogate = model", "quiet", "line")),
        notes=(f"Shown{by} are {drawn} ({role}).",),
        tables=(_difference_table(view, f"{of} runs of {design}", found),),
    )


def _predict(made: xr.DataTree, name: str, runs: xr.Dataset, output: str) -> np.ndarray:
    """Return a surrogate's predictions of runs, in SI; an `ArchiveError` if it is not whole."""
    model = restore_surrogate(made, name)
    try:
        inputs = {
            key: np.broadcast_to(runs[key].values, runs.sizes[RUN]) for key in model.random_inputs
        }
        return model.evaluate(inputs).outputs[output]
    except KeyError as error:
        raise ArchiveError(f"/{SURROGATES}/{name}: is damaged: {error} is missing") from None


def _fit_quality(made: xr.DataTree, output: str) -> str:
    attributes = fit_diagnostics(made, output)
    refuted = ", refuted" * (REFUTED in attributes)
    for of, key in (("check runs", "check_q2_of_output"), ("runs left out", "q2")):
        if np.isfinite(attributes.get(key, np.nan)):
            return f"Q² {quality_text(float(attributes[key]))} ({of}){refuted}"
    return f"Q² unknown{refuted}"


def _chart(
    view: ArchiveView,
    name: str,
    output: str,
    compared: _Predictions,
    shown: IntArray,
    title: str,
) -> Chart:
    unit, off = view.unit(output), np.abs(compared.differences)
    drawn: list[tuple[str, Colour, IntArray]] = [("", view.series(name), shown)]
    if shown.size < off.size:
        # A choice at random would leave them out.
        largest_first = np.argsort(-np.nan_to_num(off), kind="stable")
        drawn.append((", largest differences", "ink", np.sort(largest_first[:_WORST])))
    marks = []
    hover_unit = escape_text(unit_suffix(unit))
    for what, series, which in drawn:
        marks.append(
            Points(
                compared.observed[which],
                compared.predicted[which],
                series,
                hover=f"run %{{customdata}}<br>model %{{x:.5~g}}{hover_unit}<br>surrogate "
                f"%{{y:.5~g}}{hover_unit}",
                name=f"{output} by {name}{what}",
                numbers=compared.runs[which].tolist(),
                marker="diamond-open" if what else "circle",
                size=8 if what else 4,
                opacity=1 if what else 0.55,
            )
        )
    both = np.concatenate([each for points in marks for each in (points.x, points.y)])
    both = both[np.isfinite(both)]
    ends = float(both.min()), float(both.max())
    room = padded_limits(*ends, 0.04)
    middle, most, largest = (
        f"{number_text(value, 3)}{unit_suffix(unit)}"
        for value in (*np.nanquantile(off, [0.5, 0.95]), np.nanmax(off))
    )
    return Chart(
        title=title,
        summary=f"Half of the {grouped_number(off.size)} runs differ by at most {middle}, 95 % by "
        f"at most {most}, and the largest difference is {largest}.",
        x=Axis(title_with_unit("run of the model", unit), room),
        y=Axis(title_with_unit("surrogate", unit), room),
        marks=(Line(ends, ends, "quiet", width=1.5), *marks),
    )


def _difference_table(
    view: ArchiveView, of: str, compared: Mapping[str, _Predictions]
) -> OutputTable:
    columns = ["mean", "root mean square", "95 % differ at most by", "largest", "sd of the runs"]
    table = OutputTable(f"Surrogate minus model, in {of}", columns)
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
        cells = [f"{number_text(float(value), 3)}{note}" for value in values]
        table.rows.append((title_with_unit(output, view.unit(output)), cells))
    return table
