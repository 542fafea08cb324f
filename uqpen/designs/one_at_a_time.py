"""Designs that move one input at a time: up and down from the nominal point, and trajectories."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import (
    BLOCK_NUMBER,
    MOVED_BY,
    MOVED_INPUT,
    MOVED_UNCERTAINTY,
    POSITION,
    RELATIVE_TO_SPREAD,
    RUN,
)
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, count, flag, number
from uqpen.core.streams import Stream
from uqpen.designs.design import (
    NO_STEP_BETWEEN_LABELS,
    Design,
    Extension,
    Rounds,
    steps_of_single_values,
)
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.distributions.orthogonal_polynomials import recurrence

if TYPE_CHECKING:
    import xarray as xr

# Labels of the runs of a design that moves inputs: writing and reading them.

# Stands for no input, in the runs that move none; names of inputs begin with a letter.
_NONE = "_none"


def add_move_coordinates(
    points: xr.Dataset,
    inputs: Sequence[str],
    moved_inputs: IntArray,
    by: FloatArray,
    *,
    measure: str,
) -> xr.Dataset:
    """Add the coordinates of the moves to points.

    Parameters
    ----------
    points : Dataset
        Along ``run``.
    inputs : sequence of str
        The inputs that can be moved.
    moved_inputs : ndarray of int, shape (run,)
        Position of the moved input in `inputs`; -1 for none.
    by : ndarray, shape (run,)
        The signed step.
    measure : str
        Scale of the steps in words, for their ``long_name``.
    """
    flags = {
        "long_name": "input that is moved in the run",
        "flag_values": np.arange(-1, len(inputs), dtype=np.int16),
        "flag_meanings": " ".join([_NONE, *inputs]),
    }
    described = {"units": "1", "long_name": f"how far it is moved, {measure}"}
    number = (RUN, moved_inputs.astype(np.int16), flags)
    return points.assign_coords({MOVED_INPUT: number, MOVED_BY: (RUN, by, described)})


def moved_input_numbers(runs: xr.Dataset) -> dict[str, int]:
    """Return the inputs that vary over some runs, with their numbers among the moved ones.

    Of several models, one may not take an input, or have a value of its own for it.
    """
    _, *names = str(runs[MOVED_INPUT].attrs["flag_meanings"]).split()
    return {
        name: number for number, name in enumerate(names) if name in runs and RUN in runs[name].dims
    }


# One input at a time, moved a little up and down from the nominal point.

# Half of the range between them is about one standard deviation.
_LOW, _HIGH = 0.16, 0.84

# The steps of each kind of difference.
_SIDES = {"central": (-1, 1), "backward": (-1,), "forward": (1,)}


@dataclass(frozen=True)
class OneAtATime(Design):
    """One-at-a-time design: relative differences at the nominal point.

    The nominal point, and for each random input two more, at its nominal value times 1 - `step`
    and 1 + `step`, or one of these. Where that value is 0, the step is relative to half the input's
    16 % to 84 % range. A point outside the model's domain is inadmissible, as any point is.

    Parameters
    ----------
    step : float
        The step of an input, relative to its nominal value.
    fixed : bool
        Whether the fixed inputs are moved too, all but those that are 0.
    difference : str
        ``"central"``: steps down and up. ``"backward"`` or ``"forward"``: the step down or up
        alone, whose error is of the order of the step and not of its square.
    """

    unordered_reason = NO_STEP_BETWEEN_LABELS

    sampling = Sampling.ONE_AT_A_TIME

    step: float = number(above=0, below=1, default=0.01)
    fixed: bool = flag(default=False)
    difference: str = choice(*_SIDES, default="central")

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        yield from steps_of_single_values(joint)
        for name in joint.implicit_inputs:
            found = f"steps of {name}, whose own distribution is not known"
            yield Problem((), found, "inputs with a distribution of their own")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        moves = list(self._moves(joint))
        sides = _SIDES[self.difference]
        runs = 1 + len(sides) * len(moves)
        nominal = joint.nominal()
        moved_names = [name for name, _, _ in moves]
        names = {entry.variable.name for entry in joint.random}.union(moved_names)
        values = {name: np.full(runs, nominal[name]) for name in nominal if name in names}
        moved, by = np.full(runs, -1), np.zeros(runs)
        uncertainty = np.zeros(runs)
        for position, (name, reference, std) in enumerate(moves):
            start = 1 + len(sides) * position
            own = slice(start, start + len(sides))
            by[own] = [side * self.step for side in sides]
            moved[own] = position
            uncertainty[own] = std / abs(reference)
            values[name][own] += by[own] * reference
        points = points_dataset(joint, values, {MOVED_UNCERTAINTY: uncertainty}, runs=runs)
        points[MOVED_UNCERTAINTY].attrs = {
            "units": "1",
            "long_name": "standard deviation of the input that is moved, on the scale of moved_by",
        }
        measure = "relative to its nominal value"
        points = add_move_coordinates(points, moved_names, moved, by, measure=measure)
        spreads = [name for name in moved_names if not nominal[name]]
        if spreads:
            points[MOVED_BY].attrs[RELATIVE_TO_SPREAD] = " ".join(spreads)
        yield points

    def run_count(self, joint: JointDistribution) -> int:
        return 1 + len(_SIDES[self.difference]) * len(list(self._moves(joint)))

    def _moves(self, joint: JointDistribution) -> Iterator[tuple[str, float, float]]:
        """Yield each input to move, the reference of its step, and its standard deviation."""
        for entry in joint.random:
            low, high = entry.distribution.ppf(np.array([_LOW, _HIGH])).tolist()
            std = recurrence(entry.distribution, 1).std
            yield entry.variable.name, entry.nominal or (high - low) / 2, std
        for given in joint.fixed:
            if self.fixed and given.value:
                yield given.variable.name, given.value, 0.0


# Morris's trajectories: every input moved once, one after the other, from random starts.


@dataclass(frozen=True)
class Morris(Design):
    """Trajectories through a grid of levels, for elementary effects.

    The levels are equally spaced in probability and inside the support: 1/5, 2/5, 3/5 and 4/5
    where there are four. The lowest and highest of Morris's own levels are the ends of the support,
    which may be infinite. Each step moves one input by half of the levels, up or down.

    Parameters
    ----------
    trajectories : int
        Number of trajectories; each takes one run more than there are random inputs. A larger
        number keeps the trajectories of a smaller one.
    levels : int
        Number of levels of each input, an even number.

    References
    ----------
    Morris, M. D. (1991). Technometrics 33, 161-174.
    """

    unordered_reason = NO_STEP_BETWEEN_LABELS

    sampling = Sampling.TRAJECTORIES
    assumes_independence = True
    independence_reason = "it moves an input while the others stay, which only independent ones do"

    trajectories: int = count(minimum=2)
    levels: int = count(minimum=2, default=4)

    def check_settings(self) -> Iterator[Problem]:
        if self.levels % 2:
            yield Problem(("levels",), str(self.levels), "an even number, such as 4")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        inputs = len(joint.random)
        # Not the medians of equally likely strata: steps by half of the probability would miss an
        # effect of that period, as Ishigami's second input has.
        places, moved, steps = zip(
            *(
                _trajectory(stream.generator("points", number), inputs, self.levels)
                for number in range(self.trajectories)
            ),
            strict=True,
        )
        points = joint.points(
            (np.concatenate(places) + 1) / (self.levels + 1),
            {
                BLOCK_NUMBER: np.repeat(np.arange(self.trajectories), inputs + 1),
                POSITION: np.tile(np.arange(inputs + 1), self.trajectories),
            },
        )
        points[BLOCK_NUMBER].attrs = {"units": "1", "long_name": "number of the run's trajectory"}
        points[POSITION].attrs = {"units": "1", "long_name": "place of the run in its trajectory"}
        yield add_move_coordinates(
            points,
            [entry.variable.name for entry in joint.random],
            np.concatenate(moved),
            np.concatenate(steps) / (self.levels + 1),
            measure="in probability",
        )

    def run_count(self, joint: JointDistribution) -> int:
        return self.trajectories * (len(joint.random) + 1)

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        if not isinstance(earlier, Morris):
            return super().extension(earlier, joint)
        common = replace(self, trajectories=min(self.trajectories, earlier.trajectories))
        kept = common.run_count(joint) if self.levels == earlier.levels else 0
        most = max(self.trajectories, earlier.trajectories)
        nearest = {"trajectories": most, "levels": earlier.levels}
        return Extension(kept, nearest, "the same levels")


def _trajectory(
    rng: np.random.Generator, inputs: int, levels: int
) -> tuple[IntArray, IntArray, IntArray]:
    """Return each input's level along a trajectory, the input moved at each place, and its step."""
    start = rng.integers(levels, size=inputs)
    order = rng.permutation(inputs)
    # Half of the levels up from the lower half of them, or down from the upper.
    jump = np.where(start < levels // 2, levels // 2, -(levels // 2))
    moves = np.zeros((inputs + 1, inputs), dtype=np.int64)
    moves[np.arange(1, inputs + 1), order] = jump[order]
    moved, steps = np.full(inputs + 1, -1), np.zeros(inputs + 1, dtype=np.int64)
    moved[1:], steps[1:] = order, jump[order]
    return start + moves.cumsum(axis=0), moved, steps
