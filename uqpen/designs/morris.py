"""Morris's trajectories: every input moved once, one after the other, from random starts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from uqpen.core.arrays import IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import BLOCK_NUMBER, POSITION
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.extension import Extension
from uqpen.designs.moves import add_move_coordinates
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["Morris"]


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
