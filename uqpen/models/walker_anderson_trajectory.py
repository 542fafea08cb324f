"""The Walker-Anderson model of an eroding rod, with its trajectory in time as outputs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.errors import TrajectoryError
from uqpen.core.model import (
    Arrays,
    BoolArray,
    Dimension,
    FloatArray,
    Output,
    Results,
    empty_outputs,
)
from uqpen.core.settings import count, number, quantity, validate
from uqpen.core.status import Status
from uqpen.models import rod_and_target
from uqpen.models.rod_trajectory import Rod, integrate_erosion, make_rod
from uqpen.models.source import BuiltInModel

__all__ = ["RodMotion", "WalkerAndersonTrajectory", "rod_motion"]


@dataclass(frozen=True)
class WalkerAndersonTrajectory(BuiltInModel):
    """Trajectory of an eroding rod in a thick target, by time since impact.

    The velocities of its nose and tail, its length, the extent of plastic flow in it and the depth
    of its nose are curves in time. They end where the rod comes to rest. The depth and the time at
    which it rests are numbers. The equations are those of `walker-anderson`, integrated one run at
    a time.

    Parameters
    ----------
    duration : float or str
        The last time of the curves, in seconds, or a text such as ``"2 ms"``.
    times : int
        Number of times, evenly from impact.
    tolerance : float
        Relative error allowed to a step of the integration.

    References
    ----------
    Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876, as in
    `uqpen.models.rod_trajectory`.
    """

    duration: float = quantity(unit="s", above=0, default=2e-3)
    times: int = count(minimum=2, maximum=100_000, default=201)
    tolerance: float = number(above=0, below=1e-2, default=1e-8)
    outputs: tuple[Output, ...] = field(init=False, repr=False, compare=False)

    name = "walker-anderson-trajectory"
    inputs = rod_and_target.INPUTS
    alternatives = rod_and_target.ALTERNATIVES
    vectorized = False

    def __post_init__(self) -> None:
        validate(self)
        coordinates = np.linspace(0.0, self.duration, self.times).tolist()
        # Not "time", which is of a date to those who follow the CF conventions.
        time = Dimension("elapsed_time", "s", "time since impact", "ms", tuple(coordinates))
        object.__setattr__(self, "outputs", _outputs(time))

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        yield from rod_and_target.conditions(inputs)

    def evaluate(self, inputs: Arrays) -> Results:
        columns = {name: values for name, values in inputs.items() if name != _YOUNG_MODULUS}
        columns["projectile_sound_speed"] = rod_and_target.sound_speed(inputs)
        runs = len(columns["projectile_sound_speed"])
        outputs = empty_outputs(self.outputs, runs)
        status = np.full(runs, Status.OK, dtype=np.int8)
        reasons: dict[int, str] = {}
        times = np.array(self.outputs[0].dims[0].values)
        for run in range(runs):
            constants: dict[str, Any] = {name: float(each[run]) for name, each in columns.items()}
            try:
                # What overflows has no number, which is the reason that such a run gets.
                with np.errstate(all="ignore"):
                    motion = rod_motion(make_rod(**constants), times, self.tolerance)
            except TrajectoryError as error:
                status[run], reasons[run] = Status.FAILED, str(error)
            except (OverflowError, ZeroDivisionError) as error:
                status[run], reasons[run] = Status.FAILED, f"inputs too large or too small: {error}"
            else:
                for name, values in motion._asdict().items():
                    outputs[name][run] = values
        return Results(outputs, status, reasons)


_YOUNG_MODULUS = "projectile_young_modulus"


def _outputs(time: Dimension) -> tuple[Output, ...]:
    """Return the curves along a time, and the numbers of the rod at rest."""
    curves = (
        ("nose_velocity", "m s-1", "velocity of the projectile's nose, u"),
        ("tail_velocity", "m s-1", "velocity of the projectile's tail, v"),
        ("length", "m", "length of the projectile, L"),
        ("plastic_extent", "m", "extent of plastic flow in the projectile, s"),
        ("nose_depth", "m", "depth of the projectile's nose, z"),
    )
    return (
        *(Output(*curve, dims=(time,), may_end=True) for curve in curves),
        Output("penetration_depth", "m", "depth of penetration"),
        Output("rest_time", "s", "time at which the projectile comes to rest", "ms"),
    )


class RodMotion(NamedTuple):
    """Motion of one rod: curves of shape (time,), NaN after it rests, then numbers."""

    nose_velocity: FloatArray
    tail_velocity: FloatArray
    length: FloatArray
    plastic_extent: FloatArray
    nose_depth: FloatArray
    penetration_depth: float
    rest_time: float


def rod_motion(rod: Rod, times: FloatArray, tolerance: float) -> RodMotion:
    """Return the motion of a rod at some times.

    Parameters
    ----------
    rod : Rod
        The constants of its equations.
    times : ndarray, shape (time,)
        Since impact, s.
    tolerance : float
        Relative error allowed to a step of the integration.

    Raises
    ------
    TrajectoryError
        If the integration does not reach the end of erosion.
    """
    solution = integrate_erosion(rod, tolerance, dense_output=True)
    u, x, length, z = solution.y[:, -1]
    if solution.t_events[1].size:
        u = 0.0
    rigid = _RigidMotion(
        start=float(solution.t[-1]),
        depth=float(z),
        velocity=float(u),
        inertia=float(rod.density_ratio * length + rod.added_length),
        resistance=rod.resistance,
    )
    curves = np.full((5, len(times)), np.nan)
    eroding = times < rigid.start
    if eroding.any():
        u_then, x_then, length_then, z_then = solution.sol(times[eroding])
        tail, extent = u_then * (1 + x_then), rod.plastic_scale * x_then
        curves[:, eroding] = u_then, tail, length_then, extent, z_then
    moving = ~eroding & (times <= rigid.rest_time)
    velocity = rigid.velocities(times[moving])
    curves[:2, moving] = velocity
    curves[2, moving] = length
    # A rod that stops while it erodes keeps its plastic extent; else x is 0.
    curves[3, moving] = rod.plastic_scale * x if u == 0 else 0.0
    curves[4, moving] = rigid.depths(velocity)
    u_curve, v_curve, length_curve, extent_curve, depth_curve = curves
    return RodMotion(
        nose_velocity=u_curve,
        tail_velocity=v_curve,
        length=length_curve,
        plastic_extent=extent_curve,
        nose_depth=depth_curve,
        penetration_depth=rigid.rest_depth,
        rest_time=rigid.rest_time,
    )


class _RigidMotion(NamedTuple):
    """Motion of a rod that does not erode: 2 K du/dt = -(u² + B), (2.16) with u = v.

    Attributes
    ----------
    start, depth, velocity : float
        Time, depth and velocity where it begins, s, m, m s-1.
    inertia, resistance : float
        K, m, and B, m2 s-2.
    """

    start: float
    depth: float
    velocity: float
    inertia: float
    resistance: float

    @property
    def rest_time(self) -> float:
        """Time at which it comes to rest, s."""
        root = math.sqrt(self.resistance)
        return self.start + 2 * self.inertia / root * math.atan(self.velocity / root)

    @property
    def rest_depth(self) -> float:
        """Depth at which it comes to rest, m."""
        return self.depth + self.inertia * math.log1p(self.velocity**2 / self.resistance)

    def velocities(self, times: FloatArray) -> FloatArray:
        """Return its velocity at some times, m s-1."""
        root = math.sqrt(self.resistance)
        phase = (self.rest_time - times) * root / (2 * self.inertia)
        return np.asarray(root * np.tan(phase))

    def depths(self, velocities: FloatArray) -> FloatArray:
        """Return its depth at some velocities, m."""
        return np.asarray(
            self.rest_depth - self.inertia * np.log1p(velocities**2 / self.resistance)
        )
