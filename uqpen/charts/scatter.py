"""Runs as points: each output against each input."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.axes import ValueAxis, output_axis, padded_limits, quantity, quantity_axis
from uqpen.charts.chart import Axis, Chart, Charts, LegendKey
from uqpen.charts.marks import CROSS, Points, escape_text
from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.catalogue import MEASURES
from uqpen.core.labels import MATRIX, RUN, RUNS, STATUS
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.streams import Stream
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import (
    count_text,
    estimate_text,
    grouped_number,
    number_text,
    range_text,
)
from uqpen.results.input_measures import input_label, input_order
from uqpen.results.long_table import category_labels
from uqpen.results.table import NOTHING, OutputTable, identity
from uqpen.results.texts import capitalized, plain_text, title_with_unit, unit_suffix

# Charts of a model at the most.
_MOST_CHARTS = 24
# Runs in a chart at the most, and failed ones besides.
_MOST_RUNS, _MOST_FAILED = 400, 100
# Characters that stand along the foot of a small chart, and along its side.
_LONGEST, _HIGHEST = 36, 26
_HEIGHT = 230
# Measures of association, shown in the table.
_ASSOCIATIONS = [*MEASURES["associations"][:2], *MEASURES["shares"][:1]]


def scatter_charts(view: ArchiveView) -> Iterator[Charts]:
    """Runs of one design: each output against each input."""
    designs = [each for each in (view.leading_design, *view.sample_designs) if each is not None]
    design = next((each for each in designs if view.design(each).keeps_runs), None)
    if design is not None:
        cloud = PlottedRuns(view, design)
        for output in cloud.outputs:
            yield from scatter_output_charts(cloud, output)


def thin_runs(runs: xr.Dataset, most: int) -> xr.Dataset:
    """A random part of the runs, the same each time, in order; the first runs may not be random."""
    size = runs.sizes[RUN]
    if size <= most:
        return runs
    chosen = Stream(0, "figures", "runs").generator().choice(size, most, replace=False)
    return runs.isel({RUN: np.sort(chosen)})


def _category_labels(output: xr.DataArray) -> dict[int, str]:
    """Return the labels of an output's categories by code, which is negative of failed runs."""
    return {code: label for code, label in category_labels(output).items() if code >= 0}


@dataclass(frozen=True)
class PlottedRuns:
    """Runs that are shown of a design: some of many, the same ones in all charts."""

    view: ArchiveView
    design: str

    @cached_property
    def runs(self) -> xr.Dataset:
        """Sample of the joint distribution, each run with its place among all of the design."""
        every = read_group(self.view.tree, RUNS, self.design)
        runs = self.view.design(self.design).shown_runs
        if MATRIX in every:
            places = np.flatnonzero(every[MATRIX].values <= 1)
        else:
            places = np.arange(runs.sizes[RUN])
        return runs.assign_coords(number=(RUN, places[: runs.sizes[RUN]]))

    @cached_property
    def is_completed(self) -> BoolArray:
        """Completed runs, as a mask of the sample."""
        is_ok: BoolArray = self.runs[STATUS].values == Status.OK
        return is_ok

    @cached_property
    def completed(self) -> xr.Dataset:
        """Some of the completed runs."""
        return self._sample_runs(self.is_completed, _MOST_RUNS)

    @cached_property
    def failed(self) -> xr.Dataset:
        """Some of the failed runs."""
        return self._sample_runs(~self.is_completed, _MOST_FAILED)

    def _sample_runs(self, which: BoolArray, most: int) -> xr.Dataset:
        """Return some of the runs, without copying all."""
        places = xr.Dataset({"place": (RUN, np.flatnonzero(which))})
        return self.runs.isel({RUN: thin_runs(places, most)["place"].values})

    @property
    def inputs(self) -> list[str]:
        """Inputs that are not the same in all runs."""
        return self.view.design(self.design).random_inputs

    @property
    def outputs(self) -> list[str]:
        """Outputs with a chart."""
        return [*self.view.numeric_outputs, *self.view.categorical_outputs][:_MOST_CHARTS]

    @property
    def thinning_note(self) -> str:
        """Number of the runs that are shown."""
        counts = []
        for shown, which, status in (
            (self.completed, self.is_completed, "completed"),
            (self.failed, ~self.is_completed, "failed"),
        ):
            number, whole = shown.sizes[RUN], int(which.sum())
            if number < whole:
                counts.append(f"{grouped_number(number)} of {grouped_number(whole)} {status}")
            elif whole:
                counts.append(f"{'all' if whole > 1 else 'the'} {grouped_number(whole)} {status}")
        of = capitalized(self.view.design(self.design).shown_prefix or "runs of ")
        return f"{of}{self.design} in the charts: {', '.join(counts)}."

    def values(self, name: str, runs: xr.Dataset) -> FloatArray:
        """Values of an input or a numeric output, in the unit that is shown.

        Runs with one label lie beside each other.
        """
        found: FloatArray = self.view.scale(name).from_si(runs[name].values)
        return found + _scattered(found.size) if self.view.code_labels(name) else found

    def heights(self, output: str) -> tuple[FloatArray, tuple[str, ...]]:
        """Return the places of the completed runs along an output, and the rows of its categories.

        Of a number, the values in the unit that is shown, and no rows.
        """
        if output in self.view.numeric_outputs:
            return self.values(output, self.completed), ()
        kinds = _category_labels(self.completed[output])
        codes = self.completed[output].values
        row_of = {code: row for row, code in enumerate(kinds)}
        rows = np.array([row_of.get(code, np.nan) for code in codes.tolist()])
        return rows + _scattered(rows.size), tuple(kinds.values())


def _scattered(size: int) -> FloatArray:
    """Return distances that keep points of one place apart, within a quarter of it."""
    golden: FloatArray = (np.arange(size, dtype=np.float64) * 0.6180339887498949) % 1
    return 0.5 * (golden - 0.5)


def scatter_output_charts(cloud: PlottedRuns, output: str) -> Iterator[Charts]:
    """Yield the charts of an output against the most important inputs, if there are any."""
    order, most = input_order(cloud.view, output), _MOST_CHARTS // len(cloud.outputs)
    every = order.sort(cloud.inputs)
    if not every:
        return
    notes = [cloud.thinning_note]
    if len(every) > most:
        first, having = ("", f" with {order.reason}") if order.reason else ("first ", "")
        notes.append(f"Shown are the {first}{most} of {len(every)} inputs{having}.")
    keys = [LegendKey("run", cloud.view.series(cloud.design), "circle")]
    if cloud.failed.sizes[RUN]:
        keys.append(LegendKey("failed run, at the foot", "ink", CROSS))
    axis, is_cut = _vertical_axis(cloud, output)
    if is_cut:
        notes.append("The axis of the output ends where all but 1 % of the runs shown lie inside.")
    yield Charts(
        tuple(_chart(cloud, output, name, axis) for name in every[:most]),
        keys=tuple(keys),
        notes=tuple(notes),
        tables=(_table(cloud, output),),
    )


def _vertical_axis(cloud: PlottedRuns, output: str) -> tuple[Axis, bool]:
    """Return the axis of an output, and whether it leaves some of the runs out."""
    values, rows = cloud.heights(output)
    if not values.size:
        rows = rows or ("no run completed",)
    if rows:
        return Axis("", rows=rows, quantity=quantity(cloud.view, output)), False
    span = ValueAxis.of_values([values], is_logarithmic=cloud.view.is_logarithmic(output))
    title = _short_title(cloud.view, output, output_title(cloud.view, output), _HIGHEST)
    return replace(output_axis(cloud.view, output, span), short_title=title), span.is_cut


def _short_title(view: ArchiveView, name: str, label: str, longest: int) -> str:
    """Return the title of an axis, its label cut where there is no room for it."""
    room = longest - len(title_with_unit("", view.unit(name)))
    return title_with_unit(plain_text(label, max(room, 8)), view.unit(name))


def _hover_line(view: ArchiveView, name: str, label: str, along: str) -> str:
    return f"{escape_text(label, 40)} %{{{along}:.4~g}}{escape_text(unit_suffix(view.unit(name)))}"


def _chart(cloud: PlottedRuns, output: str, name: str, axis: Axis) -> Chart:
    view, label, title = cloud.view, input_label(cloud.view, name), output_title(cloud.view, output)
    every = np.concatenate([cloud.values(name, each) for each in (cloud.completed, cloud.failed)])
    finite = every[np.isfinite(every)]
    # No run lies on the frame.
    ends = padded_limits(float(finite.min()), float(finite.max()))
    across = _hover_line(view, name, label, "x")
    value, texts = _hover_line(view, output, title, "y"), []
    if output in view.categorical_outputs:
        kinds = _category_labels(cloud.completed[output])
        value = "%{text}"
        texts = [kinds.get(code, "") for code in cloud.completed[output].values.tolist()]
    completed = Points(
        cloud.values(name, cloud.completed),
        cloud.heights(output)[0],
        view.series(cloud.design),
        hover=f"run %{{customdata}}<br>{across}<br>{value}",
        name=f"{output}, {name}",
        texts=texts,
        numbers=cloud.completed["number"].values.tolist(),
    )
    return Chart(
        title=f"{title} against {label}",
        summary=_summary(cloud, output, name),
        x=replace(
            quantity_axis(view, name, ends), short_title=_short_title(view, name, label, _LONGEST)
        ),
        y=axis,
        marks=(completed, *_failed_runs(cloud, name, axis, across)),
        height=_HEIGHT,
        of=output,
        runs_of=view.model,
    )


def _failed_runs(cloud: PlottedRuns, name: str, axis: Axis, across: str) -> Iterator[Points]:
    """Yield the failed runs at the foot of a chart, if there are any."""
    if not cloud.failed.sizes[RUN]:
        return
    foot = len(axis.rows) - 0.58
    if axis.ends is not None:
        lower, upper = axis.ends
        foot = lower + 0.025 * (upper - lower)
        foot = 10.0**foot if axis.is_logarithmic else foot
    x = cloud.values(name, cloud.failed)
    yield Points(
        x,
        np.full(x.size, foot),
        "ink",
        hover=f"run %{{customdata}}, failed: %{{text}}<br>{across}",
        name=f"failed, {name}",
        texts=[STATUS_TEXT[Status(code)] for code in cloud.failed[STATUS].values.tolist()],
        numbers=cloud.failed["number"].values.tolist(),
        marker=CROSS,
        size=6,
        opacity=0.8,
    )


def _association_estimates(cloud: PlottedRuns, output: str, name: str) -> dict[str, xr.DataArray]:
    """Return the measures of association of an output with an input, by their labels."""
    statistics = cloud.view.statistics
    every = (
        (each.measure.label, statistics.entries(cloud.design, output, each.name).get(name))
        for each in _ASSOCIATIONS
    )
    return {label: found for label, found in every if found is not None}


def _summary(cloud: PlottedRuns, output: str, name: str) -> str:
    for label, array in _association_estimates(cloud, output, name).items():
        if np.isfinite(array.values[0]):
            what = "rank correlation" if label == "Spearman" else label
            text = estimate_text(*array.values.tolist())
            both = f"{output_title(cloud.view, output)} and {input_label(cloud.view, name)}"
            return f"{both} by {cloud.design}: {what} {text}."
    span = _range(cloud, name, cloud.is_completed)
    return f"{input_label(cloud.view, name)} ranges over {span} in the runs."


def _range(cloud: PlottedRuns, name: str, which: BoolArray) -> str:
    values = cloud.values(name, cloud.runs)[which]
    values = values[np.isfinite(values)]
    if not values.size:
        return NOTHING
    return range_text(number_text(values.min()), number_text(values.max()))


def _table(cloud: PlottedRuns, output: str) -> OutputTable:
    """Return the table of measures of association, or else of ranges.

    Ranges are those in all completed runs, and by category of the output.
    """
    view = cloud.view
    if first := [*_association_estimates(cloud, output, cloud.inputs[0])]:
        table = OutputTable(
            f"{output_title(view, output)} and its inputs, by {cloud.design}", first
        )
        for name in cloud.inputs:
            found = _association_estimates(cloud, output, name)
            cells = [table.cell(found.get(label), identity) for label in first]
            table.rows.append((input_label(view, name), cells))
        return table
    which = {"all completed runs": cloud.is_completed}
    names: Sequence[str] = [*cloud.inputs, output]
    if output in view.categorical_outputs:
        codes = cloud.runs[output].values
        kinds = _category_labels(cloud.runs[output]).items()
        which |= {label: cloud.is_completed & (codes == code) for code, label in kinds}
        names = cloud.inputs
    columns = [f"{label}\n{count_text(int(runs.sum()), 'run')}" for label, runs in which.items()]
    table = OutputTable(f"Smallest and largest values, by {cloud.design}", columns)
    note = table.note_mark("ranges of these runs, not estimates; so they have no intervals")
    for name in names:
        ranges = (_range(cloud, name, runs) for runs in which.values())
        cells = [text + note * (text != NOTHING) for text in ranges]
        table.rows.append((view.axis_label(name), cells))
    return table
