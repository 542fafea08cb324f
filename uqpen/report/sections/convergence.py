"""Convergence of estimates as runs are added."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.catalogue import CATEGORY, PROBABILITY, RUNS_SO_FAR, THRESHOLD
from uqpen.core.labels import INTERVAL_LEVEL, REPLICATE, RUN, RUNS
from uqpen.core.units import DIMENSIONLESS
from uqpen.report.axes import logarithmic_axis, padded_limits
from uqpen.report.blocks import Axis, Block, Chart, Charts, Heading, LegendKey, Remarks, Text
from uqpen.report.counting import count_text
from uqpen.report.marks import dot_trace, series_marker
from uqpen.report.notes import all_bounded, has_interval
from uqpen.report.sections.leading_design import (
    leading_design,
    output_heading,
    output_title,
)
from uqpen.report.sections.quoted_statistics import share_label
from uqpen.report.sections.view_statistics import view_statistics
from uqpen.report.shapes import horizontal_line
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number, percent_text
from uqpen.results.table import (
    Conversion,
    OutputTable,
    estimate_with_verdict,
    exceedance_label,
    identity,
    quantile_label,
)
from uqpen.results.texts import capitalized, title_with_unit, unit_suffix

__all__ = ["convergence"]

FloatArray = npt.NDArray[np.float64]

# Outputs that are drawn, and kinds of one.
_MOST_OUTPUTS, _MOST_KINDS = 6, 3
# Widths of the last interval that an axis goes to on either side; wider ones are cut off.
_WIDEST = 12

_SHARED = (
    "Each point's runs are among those of the next, so points are not independent of each other: "
    "they stray less than separate samples would."
)
_FIXED = (
    "An interval covers at its level for a number of runs that is fixed beforehand. Making runs "
    "until it looks good is another procedure, and with that it covers less often."
)
_CUT = "The widest intervals go on beyond the axis; the table has their ends."


class _EstimateHistory(NamedTuple):
    """A statistic along the runs so far."""

    label: str
    unit: str
    convert: Conversion
    estimates: xr.DataArray

    @property
    def runs(self) -> list[int]:
        """The runs so far."""
        return [int(size) for size in self.estimates[RUNS_SO_FAR].values]

    @property
    def bounds(self) -> FloatArray:
        """Estimate, lower, upper for each, in the unit that is shown."""
        return np.asarray(self.convert(self.estimates.values), dtype=np.float64)

    def estimate_texts(self) -> list[str]:
        """Each estimate in its digits, with the unit."""
        unit = unit_suffix(self.unit)
        return [f"{estimate_with_verdict(each, self.convert)}{unit}" for each in self.estimates]


def convergence(view: ArchiveView) -> Iterator[Block]:
    """Estimates of the leading design from growing parts of its runs."""
    design = leading_design(view)
    if design is None:
        return
    outputs = [*view.numeric_outputs, *view.categorical_outputs]
    statistics = {
        output: view_statistics(view).statistics(design, output)
        for output in outputs[:_MOST_OUTPUTS]
    }
    reason = view.reason_without_convergence(design)
    if not any(RUNS_SO_FAR in array.dims for of in statistics.values() for array in of.values()):
        reason = reason or "the archive has no estimates from parts of its runs"
    if reason:
        yield Text(
            f"How the answers settle cannot be shown by {design}, the design that they come from: "
            f"{reason}."
        )
        return
    yield Text(_design_sentence(view, design))
    yield Remarks("How to read it", (_SHARED, _FIXED))
    for output, arrays in statistics.items():
        if histories := list(_estimate_histories(view, output, arrays)):
            yield Heading(output_heading(view, output))
            yield _history_charts(view, output, design, histories)
    if left := outputs[_MOST_OUTPUTS:]:
        yield Text(f"Left out, as there are so many outputs: {', '.join(left)}.")


def _design_sentence(view: ArchiveView, design: str) -> str:
    """Which design it is, why that one, and what its parts are."""
    runs = read_group(view.tree, RUNS, design)
    drawn = view.runs(design)
    runs_text = count_text(drawn.sizes[RUN], "run")
    if drawn.sizes[RUN] < runs.sizes[RUN]:
        runs_text += " that are a sample"
    place = (
        "the first of the study whose runs are a sample of the input law"
        if view.is_sample_design(design)
        else "as no other design's runs are a sample of the input law"
    )
    if REPLICATE in drawn.coords:
        count = len(np.unique(drawn[REPLICATE].values))
        parts = (
            f"Its {runs_text} are {count} independent replicates, and each part is the first so "
            "many "
            "of these: less than a whole replicate would not be a sample of the same kind."
        )
    else:
        parts = (
            f"Its {runs_text} are independent draws, and each part is the first so many of these."
        )
    return f"By {design}, the design that the answers come from, {place}. {parts}"


def _estimate_histories(
    view: ArchiveView, output: str, statistics: Mapping[str, xr.DataArray]
) -> Iterator[_EstimateHistory]:
    """Yield the statistics of an output that are followed."""
    unit, convert = view.unit(output), view.scale(output).from_si
    found = []
    if (array := statistics.get("convergence_mean")) is not None:
        found.append(_EstimateHistory("mean", unit, convert, array))
    if (array := statistics.get("convergence_quantile")) is not None:
        asked = array[PROBABILITY].values.tolist()
        for p in [0.5] if 0.5 in asked else dict.fromkeys([asked[0], asked[-1]]):
            entry = array[{PROBABILITY: asked.index(p)}]
            found.append(_EstimateHistory(quantile_label(p), unit, convert, entry))
    if (array := statistics.get("convergence_exceedance")) is not None:
        label = exceedance_label(str(array[THRESHOLD].values[0]))
        entry = array[{THRESHOLD: 0}]
        found.append(_EstimateHistory(label, DIMENSIONLESS, identity, entry))
    if (array := statistics.get("convergence_share")) is not None:
        labels = array["category_label"].values.tolist()
        for position, label in enumerate(labels[:_MOST_KINDS]):
            entry = array[{CATEGORY: position}]
            found.append(_EstimateHistory(share_label(label), DIMENSIONLESS, identity, entry))
    yield from (each for each in found if np.isfinite(each.bounds[:, 0]).any())


def _history_charts(
    view: ArchiveView, output: str, design: str, histories: Sequence[_EstimateHistory]
) -> Charts:
    charts = [_chart(view, output, design, history) for history in histories]
    position = view.sources.index(design)
    every = np.concatenate([history.bounds for history in histories])
    keys = [LegendKey("by all runs", "quiet", "line", "dot")]
    if not all_bounded(every):
        keys.insert(0, LegendKey("no interval", position, f"{series_marker(position)}-open"))
    if has_interval(every).any():
        levels = (each.estimates.attrs.get(INTERVAL_LEVEL) for each in histories)
        covered = percent_text(next(filter(None, levels)))
        keys.insert(0, LegendKey(f"with its {covered} interval", position, series_marker(position)))
    return Charts(
        charts=tuple(charts),
        keys=tuple(keys),
        tables=(_table(view, output, design, histories),),
    )


def _chart(view: ArchiveView, output: str, design: str, course: _EstimateHistory) -> Chart:
    """One statistic against the number of runs."""
    position = view.sources.index(design)
    bounds, runs, estimate_texts = course.bounds, course.runs, course.estimate_texts()
    lower, upper, is_cut = _axis_limits(bounds)
    texts = [
        f"{count_text(n, 'run')}: {text}" for n, text in zip(runs, estimate_texts, strict=True)
    ]
    middle = len(texts) // 2
    return Chart(
        title=course.label,
        summary=f"{capitalized(output_title(view, output))} by {design}, {texts[0]}; "
        f"{texts[middle]}; "
        f"{texts[-1]}.",
        x=logarithmic_axis("runs so far", runs),
        y=Axis(title_with_unit(course.label, course.unit), (lower, upper)),
        traces=(
            dot_trace(
                bounds,
                np.array(runs),
                position,
                hovers=texts,
                name=course.label,
                marker=series_marker(position),
                along="y",
            ),
        ),
        shapes=(horizontal_line(float(bounds[-1, 0]), "quiet", "dot"),),
        notes=(_CUT,) if is_cut else (),
        height=260,
    )


def _axis_limits(bounds: FloatArray) -> tuple[float, float, bool]:
    """Return the axis limits, and whether they cut off any wide interval; all estimates fit."""
    estimates = bounds[np.isfinite(bounds[:, 0]), 0]
    last = bounds[-1]
    half = np.nanmax(np.abs(last[1:] - last[0])) if np.isfinite(last[1:]).any() else np.inf
    sides = bounds[:, 1:][np.isfinite(bounds[:, 1:])]
    kept = np.clip(sides, last[0] - _WIDEST * half, last[0] + _WIDEST * half) if half else sides
    lower, upper = min([*estimates, *kept]), max([*estimates, *kept])
    is_cut = bool((sides < lower).any() or (sides > upper).any())
    return *padded_limits(float(lower), float(upper), 0.05), is_cut


def _table(
    view: ArchiveView, output: str, design: str, histories: Sequence[_EstimateHistory]
) -> OutputTable:
    """Return a table of the points."""
    columns = [title_with_unit(history.label, history.unit) for history in histories]
    table = OutputTable(f"{output_title(view, output)} by {design}, by its runs so far", columns)
    for number, runs in enumerate(histories[0].runs):
        cells = [table.cell(history.estimates[number], history.convert) for history in histories]
        table.rows.append((grouped_number(runs), cells))
    return table
