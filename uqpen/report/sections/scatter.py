"""Each output against each input, run by run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group
from uqpen.figures.curves import span
from uqpen.figures.part import Part
from uqpen.figures.scatter import jittered, kinds_of
from uqpen.figures.texts import after_number, with_unit
from uqpen.labels import INPUT, RUN, SENSITIVITY, STATUS, STATUS_TEXT, Status
from uqpen.report.axes import padded
from uqpen.report.blocks import Axis, Block, Chart, Charts, Heading, Key
from uqpen.report.counting import counted
from uqpen.report.marks import Trace, points, written
from uqpen.report.sections.cloud import Cloud
from uqpen.report.sections.evidence import called, leading
from uqpen.summary.digits import sensible
from uqpen.summary.table import NOTHING, OutputTable, unchanged

__all__ = ["scatter"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# Charts of a model at the most.
_MOST_CHARTS = 24
# Characters that stand along the foot of a small chart, and along its side.
_LONGEST, _HIGHEST = 36, 26
_HEIGHT = 230

# What tells how an output goes along with an input: for the table, and to choose inputs by.
_ASSOCIATIONS = (
    ("spearman", "Spearman"),
    ("pearson", "Pearson"),
    ("first_order", "first order"),
)
_CHOSEN_BY = (
    ("spearman", "the strongest rank correlations"),
    ("first_order", "the largest first order"),
    ("category_first_order", "the largest first order"),
)


def scatter(part: Part) -> Iterator[Block]:
    """Each output against each input, run by run."""
    design = leading(part)
    if design is None:
        return
    cloud = Cloud(part, design)
    outputs = [*part.numbers, *part.kinds][:_MOST_CHARTS]
    most = max(1, _MOST_CHARTS // len(outputs))
    for output in outputs:
        inputs, said = _chosen(cloud, output, most)
        if inputs:
            yield Heading(called(part, output))
            yield Charts(
                tuple(_chart(cloud, output, name) for name in inputs),
                keys=tuple(_keys(cloud)),
                notes=tuple(filter(None, (cloud.thinning, said, _cut(cloud, output)))),
                tables=(_table(cloud, output),),
            )


def _keys(cloud: Cloud) -> Iterator[Key]:
    yield Key("run", cloud.part.sources.index(cloud.design), "circle")
    if cloud.lost.sizes[RUN]:
        yield Key("lost run, at the foot", "ink", "x")


def _chosen(cloud: Cloud, output: str, most: int) -> tuple[list[str], str]:
    """The inputs that have a chart, in the study's order, and what is said if not all do."""
    every = cloud.inputs
    if len(every) <= most:
        return every, ""
    sizes, why = _sizes(cloud, output)
    if not why:
        return every[:most], f"Shown are the first {most} of {len(every)} inputs."
    kept = sorted(every, key=lambda name: -sizes.get(name, 0.0))[:most]
    said = f"Shown are the {most} of {len(every)} inputs that have {why} by {cloud.design}."
    return [name for name in every if name in kept], said


def _sizes(cloud: Cloud, output: str) -> tuple[dict[str, float], str]:
    """How much each input counts, and by what that is told; empty where it is not."""
    told = group(cloud.part.tree, SENSITIVITY, cloud.design)
    for suffix, why in _CHOSEN_BY:
        if (name := f"{output}_{suffix}") in told:
            estimates = np.abs(np.nan_to_num(told[name].values[..., 0]))
            largest = estimates.max(axis=0) if estimates.ndim > 1 else estimates
            if largest.any():
                return dict(zip(told[INPUT].values.tolist(), largest.tolist(), strict=True)), why
    return {}, ""


def _chart(cloud: Cloud, output: str, name: str) -> Chart:
    part = cloud.part
    x_ends = _ends(np.concatenate([cloud.values(name, each) for each in (cloud.ok, cloud.lost)]))
    y, axis = _upright(cloud, output)
    x = cloud.values(name, cloud.ok)
    is_number = output in part.numbers
    value = f"<br>{_quantity(part, output, 'y')}" if is_number else "<br>%{text}"
    kinds = {} if is_number else kinds_of(cloud.ok[output])
    drawn = points(
        x,
        y,
        part.sources.index(cloud.design),
        hover=f"run %{{customdata}}<br>{_quantity(part, name, 'x')}{value}",
        name=f"{output}, {name}",
        texts=[kinds.get(c, "") for c in cloud.ok[output].values.tolist()] if kinds else (),
        numbers=cloud.ok["number"].values.tolist(),
    )
    traces = [drawn]
    if cloud.lost.sizes[RUN]:
        traces.append(_lost(cloud, name, axis))
    return Chart(
        title=f"against {name}",
        summary=_summary(cloud, output, name),
        x=Axis(_short(part, name, _LONGEST), x_ends),
        y=axis,
        traces=tuple(traces),
        height=_HEIGHT,
    )


def _short(part: Part, name: str, longest: int) -> str:
    """What a short axis says: the name in place of what is long."""
    long = part.axis(name)
    return long if len(long) <= longest else with_unit(name, part.unit(name))


def _quantity(part: Part, name: str, along: str) -> str:
    """A line under a pointer."""
    return f"{written(name, 40)} %{{{along}:.4~g}}{written(after_number(part.unit(name)))}"


def _ends(values: FloatArray) -> tuple[float, float]:
    """Where an axis of an input begins and ends, so that no run lies on its frame."""
    finite = values[np.isfinite(values)]
    lower, upper = float(finite.min()), float(finite.max())
    return padded(lower, upper)


def _upright(cloud: Cloud, output: str) -> tuple[FloatArray, Axis]:
    """Where the runs stand along the vertical axis, and that."""
    if output in cloud.part.numbers:
        lower, upper, _ = _span(cloud, output)
        title = _short(cloud.part, output, _HIGHEST)
        return cloud.values(output, cloud.ok), Axis(title, (lower, upper))
    kinds = kinds_of(cloud.ok[output])
    rows = jittered(cloud.ok[output].values, kinds)
    return rows, Axis("", rows=tuple(kinds.values()))


def _span(cloud: Cloud, output: str) -> tuple[float, float, bool]:
    return span([cloud.values(output, cloud.ok)])


def _cut(cloud: Cloud, output: str) -> str:
    if output in cloud.part.numbers and _span(cloud, output)[2]:
        return "The axis of the output ends where all but 1 % of the runs shown lie inside."
    return ""


def _lost(cloud: Cloud, name: str, axis: Axis) -> Trace:
    """Lost runs, which have no output, at the foot of a chart."""
    foot = len(axis.rows) - 0.58 if axis.ends is None else _near(*axis.ends)
    statuses = [Status(code) for code in cloud.lost[STATUS].values.tolist()]
    x = cloud.values(name, cloud.lost)
    return points(
        x,
        np.full(x.size, foot),
        "ink",
        hover=f"run %{{customdata}}, lost: %{{text}}<br>{_quantity(cloud.part, name, 'x')}",
        name=f"lost, {name}",
        texts=[STATUS_TEXT[status] for status in statuses],
        numbers=cloud.lost["number"].values.tolist(),
        marker="x",
        size=6,
        opacity=0.8,
    )


def _near(lower: float, upper: float) -> float:
    return lower + 0.025 * (upper - lower)


def _told(cloud: Cloud, output: str, name: str) -> Iterator[tuple[str, xr.DataArray]]:
    """What the design tells of how an output goes along with an input."""
    told = group(cloud.part.tree, SENSITIVITY, cloud.design)
    for suffix, label in _ASSOCIATIONS:
        if (variable := f"{output}_{suffix}") in told:
            known = told[INPUT].values.tolist()
            if name in known:
                yield label, told[variable][known.index(name)]


def _summary(cloud: Cloud, output: str, name: str) -> str:
    """How they go along, where that is told; else where the runs lie."""
    for label, array in _told(cloud, output, name):
        if np.isfinite(array.values[0]):
            what = "rank correlation" if label == "Spearman" else label
            said = sensible(*array.values.tolist())
            return f"{output} and {name} by {cloud.design}: {what} {said}."
    return f"{name} ranges over {_range(cloud, name, cloud.came_back)} in the runs."


def _range(cloud: Cloud, name: str, which: BoolArray) -> str:
    values = cloud.values(name, cloud.runs)[which]
    values = values[np.isfinite(values)]
    return f"{values.min():.4g} … {values.max():.4g}" if values.size else NOTHING


def _table(cloud: Cloud, output: str) -> OutputTable:
    """Measures of association where they are told, else where the runs lie."""
    first = [label for label, _ in _told(cloud, output, (cloud.inputs or [""])[0])]
    if not first:
        return _range_table(cloud, output)
    table = OutputTable(f"{output} and its inputs, by {cloud.design}", first)
    for name in cloud.inputs:
        found = dict(_told(cloud, output, name))
        table.rows.append((name, [table.cell(found.get(label), unchanged) for label in first]))
    return table


def _range_table(cloud: Cloud, output: str) -> OutputTable:
    """Between which values each lies: in all runs that came back, or by the output's kind."""
    part = cloud.part
    which = {"all runs that came back": cloud.came_back}
    names: Sequence[str] = [*cloud.inputs, output]
    if output in part.kinds:
        codes = cloud.runs[output].values
        kinds = kinds_of(cloud.runs[output]).items()
        which |= {label: cloud.came_back & (codes == code) for code, label in kinds}
        names = cloud.inputs
    columns = [f"{label}\n{counted(int(runs.sum()), 'run')}" for label, runs in which.items()]
    table = OutputTable(f"Smallest and largest values, by {cloud.design}", columns)
    note = table.mark("ranges of these runs, not estimates; so they have no intervals")
    for name in names:
        cells = [_range(cloud, name, runs) for runs in which.values()]
        table.rows.append((part.axis(name), [cell + note * (cell != NOTHING) for cell in cells]))
    return table
