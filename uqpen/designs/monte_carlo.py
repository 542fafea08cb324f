"""Independent draws of the inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.design import Design, Rounds
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["MonteCarlo"]


@dataclass(frozen=True)
class MonteCarlo(Design):
    """Plain Monte Carlo: independent draws from the joint distribution of the inputs.

    Parameters
    ----------
    runs : int
        Number of points. A larger number keeps the points of a smaller one.
    """

    sampling = Sampling.INDEPENDENT

    runs: int = count()

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        dimension = len(joint.random)
        blocks: list[FloatArray] = [
            stream.generator("points", block).random((min(BLOCK, self.runs - start), dimension))
            for block, start in enumerate(range(0, self.runs, BLOCK))
        ]
        yield joint.points(np.concatenate(blocks), {})

    def run_count(self, joint: JointDistribution) -> int:
        return self.runs

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> MonteCarlo | None:
        return None if replicated else MonteCarlo(runs)
