"""The course of the model at the nominal inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.figures.part import Part
from uqpen.figures.texts import after_number, capitalized, with_unit
from uqpen.figures.trajectory import called, courses_of, shared_panels, shown_unit, symbol
from uqpen.report.blocks import Axis, Block, Chart, Charts, Key
from uqpen.report.marks import Trace, dash_of, line, written
from uqpen.summary.table import NOTHING, OutputTable

__all__ = ["course"]

FloatArray = npt.NDArray[np.float64]
Courses = Mapping[str, xr.Dataset]

# Points of a line at the most, and rows of a table.
_MOST_POINTS, _ROWS = 300, 11


def course(part: Part) -> Iterator[Block]:
    """The course of the model at the nominal inputs; of several models, all together."""
    courses = courses_of(part)
    if not courses:
        return
    first = next(iter(courses.values()))
    every = [each.model for each in part.others]
    notes = ["One run at the nominal inputs: it has no scatter, so there are no intervals."]
    if lacking := [name for name in every if name not in courses]:
        notes.append(f"No course is told by {', '.join(lacking)}.")
    yield Charts(
        tuple(_chart(part, courses, names) for names in shared_panels(first)),
        keys=tuple(Key(name, every.index(name), "line") for name in courses if name),
        notes=tuple(notes),
        tables=tuple(_table(part, name, told) for name, told in courses.items()),
    )


def _chart(part: Part, courses: Courses, names: list[str]) -> Chart:
    """Quantities that share an axis, of all models."""
    first = next(iter(courses.values()))
    along = str(next(iter(first.dims)))
    unit, _ = shown_unit(first[names[0]])
    every = [each.model for each in part.others]
    notes = []
    if len(names) > 1:
        patterns = zip(names, ("solid", "dashed", "dotted", *["dashed"] * len(names)), strict=False)
        notes = [f"{pattern}: {called(first[name])}" for name, pattern in patterns]
    return Chart(
        title=capitalized("; ".join(called(first[name]) for name in names)),
        summary=" ".join(_said(part, model, told, names) for model, told in courses.items()),
        x=Axis(with_unit(called(first[along]), part.unit(along))),
        y=Axis(with_unit(", ".join(symbol(first[name]) for name in names), unit)),
        traces=tuple(
            _line(part, told, name, (model, every.index(model) if model else number), number)
            for model, told in courses.items()
            for number, name in enumerate(names)
            if name in told
        ),
        notes=(f"{capitalized('; '.join(notes))}.",) if notes else (),
        height=250,
    )


def _line(part: Part, told: xr.Dataset, name: str, of: tuple[str, int], number: int) -> Trace:
    """A quantity of a model, in a colour and with dashes."""
    model, series = of
    along = str(next(iter(told.dims)))
    x, y, unit = _shown(part, told, name)
    chosen = _spread(x.size, _MOST_POINTS)
    head = f"{written(model, 40)}<br>" if model else ""
    here = (
        f"{written(called(told[along]), 50)} %{{x:.4~g}}{written(after_number(part.unit(along)))}"
    )
    return line(
        x[chosen],
        y[chosen],
        series,
        hover=f"{head}{here}<br>{written(called(told[name]), 50)} %{{y:.4~g}}{written(unit)}",
        name=f"{model} {name}".strip(),
        dash=dash_of(number),
    )


def _shown(part: Part, told: xr.Dataset, name: str) -> tuple[FloatArray, FloatArray, str]:
    """What lies along, a quantity, and what stands behind its numbers."""
    along = str(next(iter(told.dims)))
    unit, factor = shown_unit(told[name])
    x = np.asarray(part.measure(along).from_si(told[along].values), dtype=np.float64)
    return x, np.asarray(told[name].values * factor, dtype=np.float64), after_number(unit)


def _spread(size: int, most: int) -> npt.NDArray[np.int64]:
    """So many positions at the most, the first and the last among them."""
    return np.unique(np.round(np.linspace(0, size - 1, min(size, most))).astype(np.int64))


def _said(part: Part, model: str, told: xr.Dataset, names: list[str]) -> str:
    """Where each quantity begins and ends."""
    said = []
    for name in (each for each in names if each in told):
        _, y, unit = _shown(part, told, name)
        known = y[np.isfinite(y)]
        if known.size:
            ends = f"from {known[0]:.4g} to {known[-1]:.4g}{unit}"
            said.append(f"{called(told[name])} goes {ends}, and is {known.max():.4g} at most")
    text = "; ".join(said) or "no values"
    return f"By {model}, {text}." if model else f"{capitalized(text)}."


def _table(part: Part, model: str, told: xr.Dataset) -> OutputTable:
    """All quantities of a model at some places."""
    along = str(next(iter(told.dims)))
    title = f"Course of {model}" if model else "Course"
    where = with_unit(called(told[along]), part.unit(along))
    table = OutputTable(f"{title}, by {where}", [])
    columns = []
    for name in map(str, told.data_vars):
        unit, _ = shown_unit(told[name])
        table.columns.append(with_unit(called(told[name]), unit))
        x, y, _ = _shown(part, told, name)
        columns.append(y)
    for position in _spread(x.size, _ROWS).tolist():
        cells = [_written(y[position]) for y in columns]
        table.rows.append((f"{x[position]:.4g}", cells))
    return table


def _written(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else NOTHING
