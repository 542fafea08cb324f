"""Designs that SALib draws, each for an analysis of SALib's; none is a sample of the inputs."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import BLOCK_NUMBER, HARMONICS, POSITION, RUN
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, number
from uqpen.core.streams import Stream
from uqpen.designs.design import (
    NO_STEP_BETWEEN_LABELS,
    Design,
    Rounds,
    steps_of_single_values,
)
from uqpen.designs.one_at_a_time import add_move_coordinates
from uqpen.distributions.joint_distribution import JointDistribution

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class SalibDesign(Design):
    """Design whose points SALib draws in the unit cube; settings have the names that it gives."""

    assumes_independence = True
    independence_reason = "its analysis is one of inputs that vary independently"

    sampler: ClassVar[str]

    def _points(
        self, joint: JointDistribution, unit: FloatArray, block: IntArray, position: IntArray
    ) -> xr.Dataset:
        """Return the points of a design at their quantiles, numbered as its analysis needs them."""
        points = joint.points(unit, {}).assign_coords(
            {BLOCK_NUMBER: (RUN, block), POSITION: (RUN, position)}
        )
        points[BLOCK_NUMBER].attrs = {"units": "1", "long_name": f"block of {self.sampler}"}
        points[POSITION].attrs = {"units": "1", "long_name": "place of the run in its block"}
        return points

    def _draw(self, joint: JointDistribution, **settings: Any) -> FloatArray:
        """Return what the sampler draws in the unit cube, shape (run, random input)."""
        inputs = len(joint.random)
        names = [f"x{column}" for column in range(inputs)]
        problem = {"num_vars": inputs, "names": names, "bounds": [[0.0, 1.0]] * inputs}
        sampler = importlib.import_module(f"SALib.sample.{self.sampler}")
        return np.asarray(sampler.sample(problem, **settings), dtype=np.float64)[:, :inputs]


def _with_moves(
    points: xr.Dataset, joint: JointDistribution, moved: IntArray, by: FloatArray
) -> xr.Dataset:
    names = [entry.variable.name for entry in joint.random]
    return add_move_coordinates(points, names, moved, by, measure="in probability")


@dataclass(frozen=True)
class FastSampler(SalibDesign):
    """Curves through the inputs' space for FAST: one for each input, which moves fastest along it.

    Parameters
    ----------
    N : int
        Number of points of a curve.
    M : int
        Number of harmonics of each input's frequency that its index sums.
    """

    sampling = Sampling.SEARCH_CURVES
    sampler = "fast_sampler"

    N: int = count(minimum=5, maximum=1_000_000)
    M: int = count(maximum=100, default=4)

    def check_settings(self) -> Iterator[Problem]:
        if self.N <= 4 * self.M**2:
            yield Problem(("N",), str(self.N), f"more than {4 * self.M**2}, as M is {self.M}")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        inputs, seed = len(joint.random), int(stream.generator("points").integers(1, 2**31))
        unit = self._draw(joint, N=self.N, M=self.M, seed=seed)
        of_curve = np.repeat(np.arange(inputs), self.N)
        points = self._points(joint, unit, of_curve, np.tile(np.arange(self.N), inputs))
        points[POSITION].attrs[HARMONICS] = self.M
        yield _with_moves(points, joint, of_curve, np.zeros(len(unit)))

    def run_count(self, joint: JointDistribution) -> int:
        return self.N * len(joint.random)


@dataclass(frozen=True)
class FiniteDifferences(SalibDesign):
    """Points of a Sobol' sequence, each with a small step of every input, for derivatives.

    SALib draws the same points for every seed.

    Parameters
    ----------
    N : int
        Number of points that steps start from.
    delta : float
        Step of an input's probability, relative to that probability.
    """

    unordered_reason = NO_STEP_BETWEEN_LABELS

    sampling = Sampling.FINITE_DIFFERENCES
    sampler = "finite_diff"

    N: int = count(minimum=2, maximum=1_000_000)
    delta: float = number(above=0, below=1, default=0.01)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        yield from steps_of_single_values(joint)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        inputs = len(joint.random)
        unit = self._draw(joint, N=self.N, delta=self.delta)
        position = np.tile(np.arange(inputs + 1), self.N)
        base = np.repeat(unit[:: inputs + 1], inputs + 1, axis=0)
        points = self._points(joint, unit, np.repeat(np.arange(self.N), inputs + 1), position)
        yield _with_moves(points, joint, position - 1, (unit - base).sum(axis=1))

    def run_count(self, joint: JointDistribution) -> int:
        return self.N * (len(joint.random) + 1)


@dataclass(frozen=True)
class FractionalFactorial(SalibDesign):
    """Two levels of each input, in a fractional factorial design with its mirror image.

    Parameters
    ----------
    low, high : float
        Probabilities below the two levels: no distribution has values at 0 or 1, which SALib takes.
    """

    unordered_reason = "it has two levels of an input, low and high"

    sampling = Sampling.TWO_LEVELS
    sampler = "ff"

    low: float = number(above=0, below=1, default=0.16)
    high: float = number(above=0, below=1, default=0.84)

    def check_settings(self) -> Iterator[Problem]:
        if not self.low < self.high:
            yield Problem(("high",), f"{self.high:g}", "a probability above low")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        unit = np.where(self._draw(joint) > 0.5, self.high, self.low)
        runs = len(unit)
        points = self._points(joint, unit, np.zeros(runs, dtype=np.int64), np.arange(runs))
        yield _with_moves(points, joint, np.full(runs, -1), np.zeros(runs))

    def run_count(self, joint: JointDistribution) -> int:
        return 2 << max(len(joint.random) - 1, 0).bit_length()
