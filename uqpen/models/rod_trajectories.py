"""Models of a rod's trajectory: their settings, and curves as outputs."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.model import Dimension, Output, Results, empty_outputs
from uqpen.core.settings import choice, count, number, quantity, validate
from uqpen.core.status import Status
from uqpen.models.dense_integration import MOST_STEPS
from uqpen.models.rod_and_target import (
    RodModel,
    strength_factor_setting,
    transition_problems,
    transition_setting,
)
from uqpen.models.rod_motion import (
    Along,
    Curves,
    RigidMotion,
    Rods,
    Transition,
    at_impact,
    follow_erosion,
    make_rods,
)

# Rods that are followed together, so that their slopes stay in the processor's cache.
_TOGETHER = 1024

_UNSOLVED = f"erosion did not end within {MOST_STEPS} steps"

# In the order of `Curves.values`: name, unit, name for display, unit for display.
_CURVES = (
    ("nose_velocity", "m s-1", "velocity of the projectile's nose, u", "m/s"),
    ("tail_velocity", "m s-1", "velocity of the projectile's tail, v", "m/s"),
    ("length", "m", "length of the projectile, L", "cm"),
    ("plastic_extent", "m", "extent of plastic flow in the projectile, s", "mm"),
    ("nose_depth", "m", "depth of the projectile's nose, z", "cm"),
    ("time", "s", "time since impact", "ms"),
)
# The curve that the coordinates themselves would be.
_COORDINATE = {Along.TIME: "time", Along.DEPTH: "nose_depth"}
_AT_REST = (
    Output("penetration_depth", "m", "depth of penetration", "cm"),
    Output("rest_time", "s", "time at which the projectile comes to rest", "ms"),
)


@dataclass(frozen=True)
class RodTrajectories(RodModel):
    """Base of the models whose outputs are the curves of a rod, by time or by depth.

    The velocities of its nose and tail, its length, the extent of plastic flow in it, and the depth
    of its nose or the time, end where the rod comes to rest. The depth and the time at which it
    rests are numbers.
    """

    # ``"time"``, ``"depth"`` or ``"time and depth"``. The names of the curves by depth end in
    # ``_at_depth``.
    along: str = choice("time", "depth", "time and depth", default="time")
    # The last time since impact, in seconds, or a text such as ``"2 ms"``.
    duration: float = quantity(unit="s", above=0, default=2e-3)
    # Number of times, evenly from impact.
    times: int = count(minimum=2, maximum=100_000, default=201)
    # The last depth of the nose, in metres, or a text such as ``"1 m"``.
    depth_limit: float = quantity(unit="m", above=0, default=1.0)
    # Number of depths, evenly from the surface.
    depths: int = count(minimum=2, maximum=100_000, default=201)
    outputs: tuple[Output, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        validate(self)
        curves = [
            Output(name, *_CURVES[row][1:], dims=(dimension,), may_end=True)
            for along, dimension in self._dimensions().items()
            for row, name in _curve_names(along)
        ]
        object.__setattr__(self, "outputs", (*curves, *_AT_REST))

    def _dimensions(self) -> dict[Along, Dimension]:
        """Return what the curves are along."""
        # Not "time" and "depth", which are of a date and of water to those who follow the CF
        # conventions.
        times = np.linspace(0.0, self.duration, self.times).tolist()
        depths = np.linspace(0.0, self.depth_limit, self.depths).tolist()
        every = {
            Along.TIME: Dimension("elapsed_time", "s", "time since impact", "ms", times),
            Along.DEPTH: Dimension("target_depth", "m", "depth in the target", "cm", depths),
        }
        return {key: value for key, value in every.items() if key.name.lower() in self.along}

    def evaluate(self, inputs: Arrays) -> Results:
        runs = len(inputs["crater_radius"])
        outputs = empty_outputs(self.outputs, runs)
        is_solved = np.ones(runs, dtype=np.bool_)
        for first in range(0, runs, _TOGETHER):
            some = slice(first, first + _TOGETHER)
            # What overflows has no number, which is the reason that such a run gets.
            with np.errstate(all="ignore"):
                rods = make_rods({name: values[some] for name, values in inputs.items()})
                is_solved[some] = self._follow(rods, {n: v[some] for n, v in outputs.items()})
        status = np.where(is_solved, Status.OK, Status.FAILED).astype(np.int8)
        reasons = dict.fromkeys(np.flatnonzero(~is_solved).tolist(), _UNSOLVED)
        return Results(outputs, status, reasons)

    def _follow(self, rods: Rods, outputs: dict[str, FloatArray]) -> BoolArray:
        """Fill the outputs of some rods in, and return whether their erosion ended."""
        curves = [
            Curves.make_empty(along, np.array(dimension.values), rods.length.size)
            for along, dimension in self._dimensions().items()
        ]
        state = self.erode(rods, curves)
        motion = RigidMotion.after(rods, state)
        outputs["penetration_depth"][:] = motion.rest_depth
        outputs["rest_time"][:] = motion.rest_time
        for each in curves:
            each.add_rigid_motion(motion, rods, state)
            for row, name in _curve_names(each.along):
                outputs[name][:] = each.values[row]
        # All of them are NaN where erosion has no end.
        return ~np.isnan(state[0])

    @abstractmethod
    def erode(self, rods: Rods, curves: Sequence[Curves]) -> FloatArray:
        """Fill curves in until erosion ends; see `uqpen.models.rod_motion.follow_erosion`."""


def _curve_names(along: Along) -> Iterator[tuple[int, str]]:
    """Yield the row of each curve in `Curves.values`, and its name as an output."""
    for row, (name, *_) in enumerate(_CURVES):
        if name != _COORDINATE[along]:
            yield row, name if along is Along.TIME else f"{name}_at_depth"


@dataclass(frozen=True)
class WalkerAndersonTrajectory(RodTrajectories):
    """Trajectory of an eroding rod in a thick target, by time since impact or by depth.

    The equations are those of `walker-anderson`; the integration is another one, which follows the
    rods between its steps.

    Parameters
    ----------
    along, duration, times, depth_limit, depths
        The curves; see `RodTrajectories`.
    tolerance : float
        Relative error allowed to a step of the integration; with the default, curves of the
        concrete study are right to 1e-6 of their largest values.
    transition, strength_factor
        When the rod becomes rigid; see `WalkerAnderson`.

    References
    ----------
    Soleng, H. H. & Svinsås, E. (2001). FFI/RAPPORT-2000/05876, as in `uqpen.models.rod_motion`.
    """

    tolerance: float = number(above=0, below=1e-2, default=1e-8)
    transition: str = transition_setting()
    strength_factor: float = strength_factor_setting()

    name = "walker-anderson-trajectory"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate(self, transition_problems(self.transition, self.strength_factor))

    def erode(self, rods: Rods, curves: Sequence[Curves]) -> FloatArray:
        transition = Transition(self.transition, self.strength_factor)
        return follow_erosion(rods, curves, self.tolerance, transition)


@dataclass(frozen=True)
class RigidPenetrationTrajectory(RodTrajectories):
    """Trajectory of a rod that keeps its length, with Walker and Anderson's target.

    It takes the inputs and gives the outputs of `walker-anderson-trajectory`; the projectile's
    strength, its sound speed and the smoothing have no effect.

    Parameters
    ----------
    along, duration, times, depth_limit, depths
        The curves; see `RodTrajectories`.

    References
    ----------
    Soleng & Svinsås (2001), FFI/RAPPORT-2000/05876, section 3.2.2.
    """

    name = "rigid-penetration-trajectory"

    def erode(self, rods: Rods, curves: Sequence[Curves]) -> FloatArray:
        return at_impact(rods)
