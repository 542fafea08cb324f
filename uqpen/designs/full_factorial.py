"""Full factorial design: every combination of a few levels of each input."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.errors import Problem
from uqpen.core.labels import QUADRATURE_WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.grids import tensor_grid, too_many_nodes
from uqpen.designs.quadrature import WEIGHT_ATTRIBUTES
from uqpen.distributions.input_group import SampleDistribution
from uqpen.distributions.joint_distribution import JointDistribution


@dataclass(frozen=True)
class FullFactorial(Design):
    """Full factorial design over the medians of equally likely strata of each input.

    Every point has the same weight: as an integration rule, it is the midpoint rule over the unit
    cube of probabilities.

    Parameters
    ----------
    levels : int
        Number of values of each random input.
    """

    sampling = Sampling.QUADRATURE

    levels: int = count(minimum=2)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        for group in joint.groups:
            if isinstance(group, SampleDistribution):
                # Levels of the probability that selects a row are rows of any kind.
                found = f"levels of {', '.join(group.inputs)}, which are rows of a sample"
                yield Problem((), found, "a sample, such as monte-carlo or latin-hypercube")
        inputs = len(joint.random)
        yield from too_many_nodes("levels", self.levels, self.levels**inputs, inputs)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        medians = (np.arange(self.levels) + 0.5) / self.levels
        unit = np.stack(tensor_grid([medians] * len(joint.random)), axis=1).astype(np.float64)
        weights = np.full(len(unit), 1 / len(unit))
        points = joint.points(unit, {QUADRATURE_WEIGHT: weights})
        points[QUADRATURE_WEIGHT].attrs = WEIGHT_ATTRIBUTES
        yield points

    def run_count(self, joint: JointDistribution) -> int:
        return int(self.levels ** len(joint.random))
