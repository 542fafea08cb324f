"""The trajectory of a model at the nominal inputs, and velocities in an eroding rod.

References
----------
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.charts.chart import Axis, Chart, Charts, LegendKey
from uqpen.charts.marks import Line, Rule, escape_text, series_dash
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.core.labels import TRAJECTORY
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import number_text
from uqpen.results.texts import capitalized, title_with_unit, unit_suffix

# Quantities of one unit share a chart unless one is this much smaller than the other.
_ALIKE = 8.0
# Smaller units, for values below a fiftieth of the larger unit.
_SMALLER = {"m": ("mm", 1e3), "s": ("ms", 1e3)}
_FEW = 0.02
# Of the velocity along the axis of a rod: what it follows from, the parts of the depth at which the
# rod has stopped eroding, and points of a part of its line.
_NEEDED = ("nose_velocity", "tail_velocity", "plastic_extent")
_NOMINAL = ("crater_radius", "plasticity_radius", "smoothing")
_DEPTHS = (0.1, 0.5, 0.9)
_POINTS = 200


def trajectory_charts(view: ArchiveView, most_points: int | None = None) -> Iterator[Charts]:
    """Trajectory at the nominal inputs; several models' together."""
    trajectories = find_trajectories(view)
    if not trajectories:
        return
    first = next(iter(trajectories.values()))
    every = [each.model for each in view.model_views]
    notes = ["One run at the nominal inputs: it has no scatter, so there are no intervals."]
    if lacking := [name for name in every if name not in trajectories]:
        notes.append(f"Without a trajectory: {', '.join(lacking)}.")
    found: list[list[str]] = []
    for name, variable in first.data_vars.items():
        for names in found:
            other = first[names[0]]
            own, others = _largest_value(variable), _largest_value(other)
            is_same = other.attrs.get("units") == variable.attrs.get("units")
            if is_same and others < _ALIKE * own < _ALIKE**2 * others:
                names.append(str(name))
                break
        else:
            found.append([str(name)])
    yield Charts(
        tuple(_chart(view, trajectories, names, most_points) for names in found),
        keys=tuple(LegendKey(name, every.index(name), "line") for name in trajectories if name),
        notes=tuple(notes),
    )


def find_trajectories(view: ArchiveView) -> dict[str, xr.Dataset]:
    """Return the trajectory of each model that has one."""
    return {
        each.model: trajectory
        for each in (view.model_views if view.model else [view])
        if (trajectory := read_group(each.tree, TRAJECTORY))
    }


def _largest_value(array: xr.DataArray) -> float:
    return float(np.nanmax(np.abs(array.values), initial=0.0)) or 1.0


def _chart(
    view: ArchiveView,
    trajectories: dict[str, xr.Dataset],
    names: list[str],
    most_points: int | None,
) -> Chart:
    first = next(iter(trajectories.values()))
    along = str(next(iter(first.dims)))
    unit, _ = readable_unit(first[names[0]])
    every = [each.model for each in view.model_views]
    notes = []
    if len(names) > 1:
        patterns = zip(names, ("solid", "dashed", "dotted", *["dashed"] * len(names)), strict=False)
        notes = [f"{pattern}: {quantity_name(first[name])}" for name, pattern in patterns]
    return Chart(
        title=capitalized("; ".join(quantity_name(first[name]) for name in names)),
        summary=" ".join(
            _ends_sentence(view, model, dataset, names) for model, dataset in trajectories.items()
        ),
        x=Axis(title_with_unit(quantity_name(first[along]), view.unit(along))),
        y=Axis(title_with_unit(", ".join(_quantity_symbol(first[name]) for name in names), unit)),
        marks=tuple(
            _line(
                view,
                model,
                dataset[name],
                every.index(model) if model else number,
                number,
                most_points,
            )
            for model, dataset in trajectories.items()
            for number, name in enumerate(names)
            if name in dataset
        ),
        notes=(f"{capitalized('; '.join(notes))}.",) if notes else (),
        height=250,
        is_of_all_models=True,
    )


def _line(
    view: ArchiveView,
    model: str,
    array: xr.DataArray,
    series: int,
    number: int,
    most_points: int | None,
) -> Line:
    """Return a quantity of a model, in a colour and with dashes."""
    (along,) = array.dims
    x, y, unit = shown_values(view, array)
    chosen = evenly_spread(x.size, most_points or x.size)
    head = f"{escape_text(model, 40)}<br>" if model else ""
    where, what = (escape_text(quantity_name(each), 50) for each in (array[along], array))
    here = f"{where} %{{x:.4~g}}{escape_text(unit_suffix(view.unit(str(along))))}"
    return Line(
        x[chosen],
        y[chosen],
        series,
        hover=f"{head}{here}<br>{what} %{{y:.4~g}}{escape_text(unit)}",
        name=f"{model} {array.name}".strip(),
        dash=series_dash(number),
    )


def shown_values(view: ArchiveView, array: xr.DataArray) -> tuple[FloatArray, FloatArray, str]:
    """Return the values along the axis, those of a quantity, and the suffix of its unit."""
    (along,) = array.dims
    unit, factor = readable_unit(array)
    x = np.asarray(view.scale(str(along)).from_si(array[along].values), dtype=np.float64)
    return x, np.asarray(array.values * factor, dtype=np.float64), unit_suffix(unit)


def readable_unit(array: xr.DataArray) -> tuple[str, float]:
    """Return the unit to show a quantity in, and the factor to it from SI."""
    unit = str(array.attrs.get("units", DIMENSIONLESS))
    if unit in _SMALLER and _largest_value(array) < _FEW:
        return _SMALLER[unit]
    return unit, 1.0


def quantity_name(array: xr.DataArray) -> str:
    """Return the name of a quantity of a trajectory."""
    return str(array.attrs.get("long_name", array.name))


def _quantity_symbol(array: xr.DataArray) -> str:
    """Return the short symbol at the end of a quantity's name, or the whole name without one."""
    text, _, short = quantity_name(array).rpartition(", ")
    return short if text and len(short) <= 2 else quantity_name(array)


def _ends_sentence(view: ArchiveView, model: str, dataset: xr.Dataset, names: list[str]) -> str:
    texts = []
    for name in (each for each in names if each in dataset):
        _, y, unit = shown_values(view, dataset[name])
        known = y[np.isfinite(y)]
        if known.size:
            goes = f"goes from {number_text(known[0])} to {number_text(known[-1])}{unit}"
            most = number_text(known.max())
            texts.append(f"{quantity_name(dataset[name])} {goes}, and is {most} at most")
    text = "; ".join(texts) or "no values"
    return f"By {model}, {text}." if model else f"{capitalized(text)}."


def velocity_profile_chart(view: ArchiveView) -> Iterator[Chart]:
    """Velocity along the axis of an eroding rod and its target."""
    course = read_group(view.tree, TRAJECTORY)
    has_all = all(name in course for name in _NEEDED) and all(
        f"nominal_{name}" in course.attrs for name in _NOMINAL
    )
    if not has_all or not (course["plastic_extent"].values > 0).any():
        return
    (along,) = course.dims
    depth = course[str(along)].values
    extent = course["plastic_extent"].values
    eroding = depth[extent > 0].max()
    R, S, epsilon = (float(course.attrs[f"nominal_{name}"]) for name in _NOMINAL)
    lines, keys, told = [], [], []
    for series, fraction in enumerate(_DEPTHS):
        at = int(np.argmin(np.abs(depth - fraction * eroding)))
        u, v = (float(course[name].values[at]) for name in _NEEDED[:2])
        places, velocities = axial_velocity((u, v), float(extent[at]), (R, S, epsilon))
        name, dash = f"nose at a depth of {1e3 * depth[at]:.0f} mm", series_dash(series)
        lines.append(Line(1e3 * places, velocities, series, name=name, dash=dash))
        keys.append(LegendKey(name, series, "line", dash))
        told.append(f"{name}: {number_text(v)} at the tail and {number_text(u)} at the nose")
    yield Chart(
        title="Velocity along the axis",
        summary=f"{capitalized('; '.join(told))} [m/s].",
        x=Axis("distance ahead of the nose [mm]"),
        y=Axis("velocity [m s⁻¹]", (0.0, 1.1 * float(course["tail_velocity"].max()))),
        marks=(
            Rule(0.0, "quiet", label="rod", is_before=True),
            Rule(0.0, "quiet", label="target"),
            *lines,
        ),
        keys=tuple(keys),
        notes=("At the nominal inputs.",),
    )


def axial_velocity(
    velocities: tuple[float, float], s: float, nominal: tuple[float, float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return distances from the nose, m, and the velocities there, m s-1.

    Parameters
    ----------
    velocities : tuple of float
        u of the nose and v of the tail, m s-1.
    s : float
        Extent of plastic flow in the rod, m.
    nominal : tuple of float
        Radius R of the crater, m; radius S of the plastic zone, m; parameter ε of the smoothing.
    """
    u, v = velocities
    R, S, epsilon = nominal
    inside = np.linspace(-s, 0.0, _POINTS)
    power = s * (-inside / s) ** (2 / epsilon) if epsilon else np.zeros_like(inside)
    in_rod = u + (u - v) / (s * (2 - epsilon)) * (2 * inside + epsilon * power)  # (2.4)
    r = np.linspace(R, S, _POINTS)
    in_target = u * ((S / r) ** 2 - 1) / ((S / R) ** 2 - 1)  # (2.6)
    places = np.concatenate([[-2 * s], inside, r - R, [S - R + s]])
    return places, np.concatenate([[v], in_rod, in_target, [0.0]])
