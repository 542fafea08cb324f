"""Latin hypercube sampling, replicated so that its error can be estimated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.labels import OPTIMIZED_BY
from uqpen.core.settings import choice, count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.extension import Extension
from uqpen.designs.replicated import ReplicatedDesign, split_replicates
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["LatinHypercube"]

# Time that an optimized hypercube takes, in seconds, and that each of its points adds, measured for
# 500 to 4 000 points; a study is not to say nothing for longer than the most before its first run.
_SECONDS_PER_SET, _SECONDS_PER_POINT, _MOST_SECONDS = 1.0, 2.5e-3, 40.0


@dataclass(frozen=True)
class LatinHypercube(ReplicatedDesign):
    """Replicated Latin hypercubes: one point in each of the equally likely strata of every input.

    The points of one hypercube depend on each other, so only independent replicates show the
    error of estimates.

    Parameters
    ----------
    runs : int
        Number of points in all, a multiple of `replicates`.
    replicates : int
        Number of hypercubes; with one, error bars are wider than necessary, and a note says so.
    optimization : str
        ``"random-cd"`` exchanges coordinates for a lower centred discrepancy, which spreads the
        points over pairs of inputs too; it takes about a second for a hypercube of 1 000 points.
        Other criteria that move points (Lloyd's) leave some strata empty, so there are none.

    References
    ----------
    McKay, M. D., Beckman, R. J. & Conover, W. J. (1979). Technometrics 21, 239-245.
    """

    runs: int = count(minimum=2)
    replicates: int = count(default=10)
    optimization: str = choice("none", "random-cd", default="none")

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        seconds = _SECONDS_PER_SET * self.replicates + _SECONDS_PER_POINT * self.runs
        if self.optimization != "none" and seconds > _MOST_SECONDS:
            found = f'"{self.optimization}" of {self.runs} points in {self.replicates} hypercubes'
            expected = 'fewer points and hypercubes, as these take minutes to optimize, or "none"'
            yield Problem(("optimization",), found, expected)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        for points in super().rounds(joint, stream):
            is_optimized = self.optimization != "none"
            yield points.assign_attrs({OPTIMIZED_BY: self.optimization}) if is_optimized else points

    def scaled(
        self, joint: JointDistribution, runs: int, *, replicated: bool
    ) -> LatinHypercube | None:
        shape = split_replicates(runs, self.replicates, replicated=replicated)
        return replace(self, runs=shape[0], replicates=shape[1]) if shape else None

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        found = super().extension(earlier, joint)
        if not isinstance(earlier, LatinHypercube) or earlier.optimization == self.optimization:
            return found
        return replace(
            found, kept=0, nearest={**found.nearest, "optimization": earlier.optimization}
        )

    def draw(self, rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
        # Imported here: this part of SciPy takes longer to load than the rest.
        from scipy.stats import qmc

        chosen = None if self.optimization == "none" else self.optimization
        return qmc.LatinHypercube(dimension, rng=rng, optimization=chosen).random(points)
