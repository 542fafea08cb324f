"""Trajectories at the nominal inputs; several models' together."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.labels import TRAJECTORY
from uqpen.core.units import DIMENSIONLESS
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_style import source_style
from uqpen.results.texts import plain_text, title_with_unit

__all__ = [
    "find_trajectories",
    "quantity_name",
    "quantity_symbol",
    "readable_unit",
    "shared_panels",
    "trajectory_panels",
]

# Quantities of one unit share a panel unless one is this much smaller than the other.
_ALIKE = 8.0
# Smaller units, for values below a fiftieth of the larger unit.
_SMALLER = {"m": ("mm", 1e3), "s": ("ms", 1e3)}
_FEW = 0.02


def trajectory_panels(view: ArchiveView) -> Iterator[Panel]:
    """Trajectory at the nominal inputs; several models' together."""
    trajectories = find_trajectories(view)
    if not trajectories:
        return
    first = next(iter(trajectories.values()))
    for names in shared_panels(first):
        titles = "; ".join(quantity_name(first[name]) for name in names)
        yield Panel(titles, partial(_draw, view, trajectories, names))


def find_trajectories(view: ArchiveView) -> dict[str, xr.Dataset]:
    """Return the trajectory of each model that has one."""
    return {
        each.model: trajectory
        for each in (view.model_views if view.model else [view])
        if (trajectory := read_group(each.tree, TRAJECTORY))
    }


def shared_panels(course: xr.Dataset) -> list[list[str]]:
    """Quantities that can be read off the same axis."""
    found: list[list[str]] = []
    for name, variable in course.data_vars.items():
        for names in found:
            other = course[names[0]]
            own, others = _largest_value(variable), _largest_value(other)
            is_same = other.attrs.get("units") == variable.attrs.get("units")
            if is_same and others < _ALIKE * own < _ALIKE**2 * others:
                names.append(str(name))
                break
        else:
            found.append([str(name)])
    return found


def _largest_value(array: xr.DataArray) -> float:
    return float(np.nanmax(np.abs(array.values), initial=0.0)) or 1.0


def quantity_name(array: xr.DataArray) -> str:
    """Return the name of a quantity of a trajectory."""
    return str(array.attrs.get("long_name", array.name))


def quantity_symbol(array: xr.DataArray) -> str:
    """The short symbol at the end of a quantity's name, or the whole name without one."""
    text, _, short = quantity_name(array).rpartition(", ")
    return short if text and len(short) <= 2 else quantity_name(array)


def _draw(
    view: ArchiveView, trajectories: dict[str, xr.Dataset], names: list[str], axes: Axes
) -> Iterator[str]:
    every = [each.model for each in view.model_views]
    first = next(iter(trajectories.values()))
    along = str(next(iter(first.dims)))
    unit, factor = readable_unit(first[names[0]])
    for model, trajectory in trajectories.items():
        depth = view.scale(along).from_si(trajectory[along].values)
        for number, name in enumerate(names):
            appearance = source_style(every.index(model) if model else number)
            axes.plot(
                depth,
                trajectory[name].values * factor,
                color=appearance.colour,
                linestyle=appearance.line,
                linewidth=0.8 if number and model else 1.5,
                label=_label(trajectory, model, names, number),
            )
            if number and model:
                yield f"thin lines: {quantity_name(trajectory[name])}"
    axes.set_xlabel(title_with_unit(quantity_name(first[along]), view.unit(along)))
    symbols = ", ".join(quantity_symbol(first[name]) for name in names)
    axes.set_ylabel(title_with_unit(symbols, unit))
    axes.set(xlim=(0, None), ylim=(0, None))
    if lacking := [name for name in every if name not in trajectories]:
        yield f"no trajectory of {', '.join(map(plain_text, lacking))}"
    yield "at the nominal inputs"


def _label(course: xr.Dataset, model: str, names: list[str], number: int) -> str | None:
    """Return the legend of a line; None where the title or another panel states it."""
    if model:
        return None if number else plain_text(model, 40)
    return plain_text(quantity_name(course[names[number]]), 60) if len(names) > 1 else None


def readable_unit(array: xr.DataArray) -> tuple[str, float]:
    """The unit to show a quantity in, and the factor to it from SI."""
    unit = str(array.attrs.get("units", DIMENSIONLESS))
    if unit in _SMALLER and _largest_value(array) < _FEW:
        return _SMALLER[unit]
    return unit, 1.0
