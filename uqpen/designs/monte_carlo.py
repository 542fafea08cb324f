"""Independent draws of the inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.drawn_points import DrawnPoints
from uqpen.designs.extension import Extension
from uqpen.designs.stopping.doubling import FIRST_LOOK, doubling_rounds
from uqpen.designs.stopping.stopping_rule import RequestedOutput, StoppingRule, stopping_rule
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["MonteCarlo"]

_RUNS = "a whole number, at least 1 and at most 100_000_000"


@dataclass(frozen=True)
class MonteCarlo(Design):
    """Plain Monte Carlo: independent draws from the joint distribution of the inputs.

    Parameters
    ----------
    runs : int, optional
        Number of points. A larger number keeps the points of a smaller one.
    until : StoppingRule, optional
        In place of `runs`: the rule that decides after 512 runs, and whenever their number has
        doubled, whether they are enough.
    at_most : int, optional
        With `until`, the largest number of runs.
    """

    sampling = Sampling.INDEPENDENT

    runs: int | None = count(default=None)
    until: StoppingRule | None = stopping_rule("until")
    at_most: int | None = count(minimum=2 * FIRST_LOOK, default=None)

    def check_settings(self) -> Iterator[Problem]:
        has_rule = self.until is not None
        if has_rule and self.runs is not None:
            yield Problem(("runs",), str(self.runs), "at_most, beside until")
        elif has_rule and self.at_most is None:
            yield Problem(("at_most",), "nothing", "the largest number of runs, beside until")
        elif not has_rule and self.at_most is not None:
            expected = "runs in its place, or until beside it"
            yield Problem(("at_most",), str(self.at_most), expected)
        elif not has_rule and self.runs is None:
            yield Problem(("runs",), "nothing", f"{_RUNS}; or until with at_most")

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        if self.until is not None:
            for problem in self.until.check_outputs(requested):
                yield problem.within("until")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        def points(first: int, end: int) -> DrawnPoints:
            def draw(start: int, stop: int) -> xr.Dataset:
                unit = _draw(stream, len(joint.random), first + start, first + stop)
                return joint.points(unit, {})

            return DrawnPoints(end - first, draw)

        if self.until is None:
            yield points(0, self._most)
        else:
            yield from doubling_rounds(self.until, self._most, points)

    @property
    def ends_early(self) -> bool:
        return self.until is not None

    def run_count(self, joint: JointDistribution) -> int:
        return self._most

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        if not isinstance(earlier, MonteCarlo):
            return super().extension(earlier, joint)
        setting = "runs" if self.until is None else "at_most"
        nearest = {setting: max(self._most, earlier._most)}
        return Extension(min(self._most, earlier._most), nearest, "no fewer runs")

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> MonteCarlo | None:
        return None if replicated else MonteCarlo(runs)

    @property
    def _most(self) -> int:
        """Number of runs, or the largest possible number."""
        most = self.runs if self.until is None else self.at_most
        assert most is not None  # as the settings are valid
        return most


def _draw(stream: Stream, dimension: int, start: int, end: int) -> FloatArray:
    """Draw points of the unit cube from one number to another, each block by its own generator."""
    blocks = []
    for block in range(start // BLOCK, -(-end // BLOCK)):
        first = block * BLOCK
        unit = stream.generator("points", block).random((min(BLOCK, end - first), dimension))
        blocks.append(unit[max(start - first, 0) :])
    return np.concatenate(blocks)
