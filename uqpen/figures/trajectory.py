"""The course of a model at the nominal inputs; several models' together."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from uqpen.archive.read import group
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.figures.style import look
from uqpen.figures.texts import plain, with_unit
from uqpen.labels import TRAJECTORY
from uqpen.units import DIMENSIONLESS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["called", "courses_of", "shared_panels", "shown_unit", "symbol", "trajectory"]

# Quantities of one unit share a panel unless one is this much smaller than the other.
_ALIKE = 8.0
# Smaller units, for what is less than a fiftieth of the larger.
_SMALLER = {"m": ("mm", 1e3), "s": ("ms", 1e3)}
_FEW = 0.02


def trajectory(part: Part) -> Iterator[Panel]:
    """The course at the nominal inputs; several models' together."""
    courses = courses_of(part)
    if not courses:
        return
    first = next(iter(courses.values()))
    for names in shared_panels(first):
        titles = "; ".join(called(first[name]) for name in names)
        yield Panel(titles, partial(_draw, part, courses, names))


def courses_of(part: Part) -> dict[str, xr.Dataset]:
    """The course of each model that tells one."""
    return {
        each.model: told
        for each in (part.others if part.model else [part])
        if (told := group(each.tree, TRAJECTORY))
    }


def shared_panels(course: xr.Dataset) -> list[list[str]]:
    """Quantities that can be read off the same axis."""
    found: list[list[str]] = []
    for name, variable in course.data_vars.items():
        for names in found:
            other = course[names[0]]
            is_same = other.attrs.get("units") == variable.attrs.get("units")
            if is_same and _reach(other) < _ALIKE * _reach(variable) < _ALIKE**2 * _reach(other):
                names.append(str(name))
                break
        else:
            found.append([str(name)])
    return found


def _reach(array: xr.DataArray) -> float:
    return float(np.nanmax(np.abs(array.values), initial=0.0)) or 1.0


def called(array: xr.DataArray) -> str:
    """What a quantity of a course is called."""
    return str(array.attrs.get("long_name", array.name))


def symbol(array: xr.DataArray) -> str:
    """The short symbol that ends what a quantity is called, or all of that without one."""
    text, _, short = called(array).rpartition(", ")
    return short if text and len(short) <= 2 else called(array)


def _draw(
    part: Part, courses: dict[str, xr.Dataset], names: list[str], axes: Axes
) -> Iterator[str]:
    every = [each.model for each in part.others]
    first = next(iter(courses.values()))
    along = str(next(iter(first.dims)))
    unit, factor = shown_unit(first[names[0]])
    for model, course in courses.items():
        depth = part.measure(along).from_si(course[along].values)
        for number, name in enumerate(names):
            appearance = look(every.index(model) if model else number)
            axes.plot(
                depth,
                course[name].values * factor,
                color=appearance.colour,
                linestyle=appearance.line,
                linewidth=0.8 if number and model else 1.5,
                label=_label(course, model, names, number),
            )
            if number and model:
                yield f"thin lines: {called(course[name])}"
    axes.set_xlabel(with_unit(called(first[along]), part.unit(along)))
    axes.set_ylabel(with_unit(", ".join(symbol(first[name]) for name in names), unit))
    axes.set(xlim=(0, None), ylim=(0, None))
    if lacking := [name for name in every if name not in courses]:
        yield f"no course is told by {', '.join(map(plain, lacking))}"
    yield "at the nominal inputs"


def _label(course: xr.Dataset, model: str, names: list[str], number: int) -> str | None:
    """What the legend says of a line; None where it is told by the title or another panel."""
    if model:
        return None if number else plain(model, 40)
    return plain(called(course[names[number]]), 60) if len(names) > 1 else None


def shown_unit(array: xr.DataArray) -> tuple[str, float]:
    """The unit to show a quantity in, and how many of it are one SI unit."""
    unit = str(array.attrs.get("units", DIMENSIONLESS))
    if unit in _SMALLER and _reach(array) < _FEW:
        return _SMALLER[unit]
    return unit, 1.0
