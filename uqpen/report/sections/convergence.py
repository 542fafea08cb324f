"""How estimates settle as runs are added."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.convergence import RUNS_SO_FAR, why_whole
from uqpen.analyses.convergence import convergence as by_parts
from uqpen.analyses.sample import sample_of_law
from uqpen.archive.read import group
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, capitalized, with_unit
from uqpen.labels import (
    EXCEEDANCE,
    INTERVAL_LEVEL,
    MOMENTS,
    QUANTILES,
    REPLICATE,
    RUN,
    RUNS,
    SHARES,
)
from uqpen.report.axes import logarithmic, padded
from uqpen.report.blocks import Axis, Block, Chart, Charts, Heading, Key, Remarks, Text
from uqpen.report.counting import counted
from uqpen.report.marks import dots, marker_of
from uqpen.report.notes import all_bounded, has_interval
from uqpen.report.sections.evidence import asked_of, called, leading, titled
from uqpen.report.shapes import level
from uqpen.summary.digits import grouped, percent
from uqpen.summary.table import (
    Conversion,
    OutputTable,
    exceedance_label,
    figure_text,
    quantile_label,
    unchanged,
)
from uqpen.units import DIMENSIONLESS

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


class _Course(NamedTuple):
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

    def figures(self) -> list[str]:
        """Each estimate in its digits, with the unit."""
        unit = after_number(self.unit)
        return [f"{figure_text(each, self.convert)}{unit}" for each in self.estimates]


def convergence(part: Part) -> Iterator[Block]:
    """Estimates of the leading design from growing parts of its runs."""
    design = leading(part)
    if design is None:
        return
    runs = group(part.tree, RUNS, design)
    if reason := why_whole(runs):
        yield Text(
            f"How the answers settle cannot be shown by {design}, the design that they come from: "
            f"{reason}."
        )
        return
    outputs = [*part.numbers, *part.kinds]
    shown = outputs[:_MOST_OUTPUTS]
    told = by_parts(runs, [asked_of(part, output, design) for output in shown])
    yield Text(_whose(part, design))
    yield Remarks("How to read it", (_SHARED, _FIXED))
    for output in shown:
        if courses := list(_courses(part, output, told)):
            yield Heading(called(part, output))
            yield _settling(part, output, design, courses)
    if left := outputs[_MOST_OUTPUTS:]:
        yield Text(f"Left out, as there are so many outputs: {', '.join(left)}.")


def _whose(part: Part, design: str) -> str:
    """Which design it is, why that one, and what its parts are."""
    runs = group(part.tree, RUNS, design)
    drawn = sample_of_law(runs)
    made = counted(drawn.sizes[RUN], "run")
    if drawn.sizes[RUN] < runs.sizes[RUN]:
        made += " that are a sample"
    place = (
        "the first of the study whose runs are a sample of the input law"
        if part.is_plain(design)
        else "as no other design's runs are a sample of the input law"
    )
    if REPLICATE in drawn.coords:
        count = len(np.unique(drawn[REPLICATE].values))
        parts = (
            f"Its {made} are {count} independent replicates, and each part is the first so many "
            "of these: less than a whole replicate would not be a sample of the same kind."
        )
    else:
        parts = f"Its {made} are independent draws, and each part is the first so many of these."
    return f"By {design}, the design that the answers come from, {place}. {parts}"


def _courses(part: Part, output: str, told: Mapping[str, xr.Dataset]) -> Iterator[_Course]:
    """The statistics of an output that are followed."""
    unit, convert = part.unit(output), part.measure(output).from_si
    groups = {kind: told.get(kind, xr.Dataset()) for kind in (QUANTILES, EXCEEDANCE, SHARES)}
    means = told.get(MOMENTS, xr.Dataset())
    found = []
    if f"{output}_mean" in means:
        found.append(_Course("mean", unit, convert, means[f"{output}_mean"]))
    if output in groups[QUANTILES]:
        array = groups[QUANTILES][output]
        asked = array[f"{output}_probability"].values.tolist()
        for p in [0.5] if 0.5 in asked else dict.fromkeys([asked[0], asked[-1]]):
            entry = array[:, asked.index(p)]
            found.append(_Course(quantile_label(p), unit, convert, entry))
    if output in groups[EXCEEDANCE]:
        array = groups[EXCEEDANCE][output]
        label = exceedance_label(str(array[f"{output}_threshold"].values[0]))
        found.append(_Course(label, DIMENSIONLESS, unchanged, array[:, 0]))
    if output in groups[SHARES]:
        array = groups[SHARES][output]
        labels = array[f"{output}_category_label"].values.tolist()
        for position, label in enumerate(labels[:_MOST_KINDS]):
            entry = array[:, position]
            found.append(_Course(f"share {label}", DIMENSIONLESS, unchanged, entry))
    yield from (each for each in found if np.isfinite(each.bounds[:, 0]).any())


def _settling(part: Part, output: str, design: str, courses: Sequence[_Course]) -> Charts:
    charts = [_chart(part, output, design, course) for course in courses]
    position = part.sources.index(design)
    every = np.concatenate([course.bounds for course in courses])
    keys = [Key("by all runs", "quiet", "line", "dot")]
    if not all_bounded(every):
        keys.insert(0, Key("no interval", position, f"{marker_of(position)}-open"))
    if has_interval(every).any():
        covered = percent(float(courses[0].estimates.attrs[INTERVAL_LEVEL]))
        keys.insert(0, Key(f"with its {covered} interval", position, marker_of(position)))
    return Charts(
        charts=tuple(charts),
        keys=tuple(keys),
        tables=(_table(part, output, design, courses),),
    )


def _chart(part: Part, output: str, design: str, course: _Course) -> Chart:
    """One statistic against the number of runs."""
    position = part.sources.index(design)
    bounds, runs, figures = course.bounds, course.runs, course.figures()
    lower, upper, is_cut = _ends(bounds)
    said = [f"{counted(n, 'run')}: {figure}" for n, figure in zip(runs, figures, strict=True)]
    middle = len(said) // 2
    return Chart(
        title=course.label,
        summary=f"{capitalized(titled(part, output))} by {design}, {said[0]}; {said[middle]}; "
        f"{said[-1]}.",
        x=logarithmic("runs so far", runs),
        y=Axis(with_unit(course.label, course.unit), (lower, upper)),
        traces=(
            dots(
                bounds,
                np.array(runs),
                position,
                hovers=said,
                name=course.label,
                marker=marker_of(position),
                along="y",
            ),
        ),
        shapes=(level(float(bounds[-1, 0]), "quiet", "dot"),),
        notes=(_CUT,) if is_cut else (),
        height=260,
    )


def _ends(bounds: FloatArray) -> tuple[float, float, bool]:
    """Where the axis ends, by all estimates and what is not too wide; whether it cuts any off."""
    estimates = bounds[np.isfinite(bounds[:, 0]), 0]
    last = bounds[-1]
    half = np.nanmax(np.abs(last[1:] - last[0])) if np.isfinite(last[1:]).any() else np.inf
    sides = bounds[:, 1:][np.isfinite(bounds[:, 1:])]
    kept = np.clip(sides, last[0] - _WIDEST * half, last[0] + _WIDEST * half) if half else sides
    lower, upper = min([*estimates, *kept]), max([*estimates, *kept])
    is_cut = bool((sides < lower).any() or (sides > upper).any())
    return *padded(float(lower), float(upper), 0.05), is_cut


def _table(part: Part, output: str, design: str, courses: Sequence[_Course]) -> OutputTable:
    """What the points are."""
    columns = [with_unit(course.label, course.unit) for course in courses]
    table = OutputTable(f"{titled(part, output)} by {design}, by its runs so far", columns)
    for number, runs in enumerate(courses[0].runs):
        cells = [table.cell(course.estimates[number], course.convert) for course in courses]
        table.rows.append((grouped(runs), cells))
    return table
