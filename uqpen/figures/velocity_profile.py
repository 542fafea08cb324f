"""The velocity along the axis of an eroding rod and of its target, at some depths.

References
----------
Soleng, H. H. & Svinsås, E. (2001). Penetration modelling with uncertainty quantification using the
Walker-Anderson model. FFI/RAPPORT-2000/05876. Its equation numbers stand in brackets.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from uqpen.archive.read import read_group
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import TRAJECTORY
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_style import GREY, source_style

__all__ = ["axial_velocity", "velocity_profile_panels"]


_NEEDED = ("nose_velocity", "tail_velocity", "plastic_extent")
_NOMINAL = ("crater_radius", "plasticity_radius", "smoothing")
# Parts of the depth at which the rod has stopped eroding.
_DEPTHS = (0.1, 0.5, 0.9)
_POINTS = 200


def velocity_profile_panels(view: ArchiveView) -> Iterator[Panel]:
    """Velocity along the axis of an eroding rod and its target."""
    trajectory = read_group(view.tree, TRAJECTORY)
    has_all = all(name in trajectory for name in _NEEDED) and all(
        f"nominal_{name}" in trajectory.attrs for name in _NOMINAL
    )
    if has_all and (trajectory["plastic_extent"].values > 0).any():
        yield Panel(view.title("velocity along the axis"), partial(_draw, trajectory), height=3.0)


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
        R, S (m) and ε.
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


def _draw(course: xr.Dataset, axes: Axes) -> Iterator[str]:
    (along,) = course.dims
    depth = course[str(along)].values
    extent = course["plastic_extent"].values
    eroding = depth[extent > 0].max()
    R, S, epsilon = (float(course.attrs[f"nominal_{name}"]) for name in _NOMINAL)
    axes.axvline(0, color=GREY, linewidth=0.8)
    for number, fraction in enumerate(_DEPTHS):
        at = int(np.argmin(np.abs(depth - fraction * eroding)))
        u, v = (float(course[name].values[at]) for name in _NEEDED[:2])
        places, velocities = axial_velocity((u, v), float(extent[at]), (R, S, epsilon))
        appearance = source_style(number)
        axes.plot(
            1e3 * places,
            velocities,
            color=appearance.colour,
            linestyle=appearance.line,
            label=f"nose at a depth of {1e3 * depth[at]:.0f} mm",
        )
    axes.set(xlabel="distance ahead of the nose [mm]", ylabel="velocity [m s⁻¹]")
    axes.set_ylim(0, 1.1 * float(course["tail_velocity"].max()))
    across = axes.get_xaxis_transform()
    for text, side, shift in (("rod", "right", -4), ("target", "left", 4)):
        axes.annotate(text, (0, 1), (shift, -1), across, "offset points", ha=side, va="top")
    yield "at the nominal inputs"
