"""Latin hypercube sampling, replicated so that its error can be estimated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.labels import OPTIMIZED_BY
from uqpen.core.limits import MOST_REPLICATES, MOST_RUNS
from uqpen.core.settings import choice, count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Extension, keep_setting
from uqpen.designs.drawn_points import DrawnPoints
from uqpen.designs.replicated import ReplicatedDesign, split_replicates
from uqpen.designs.stopping.stopping_rule import StoppingRule, stopping_rule
from uqpen.distributions.joint_distribution import JointDistribution

# Time that an optimized hypercube takes, in seconds, and that each of its points adds, measured for
# 500 to 4 000 points; a study is not to say nothing for longer than the most before its first run.
_SECONDS_PER_SET, _SECONDS_PER_POINT, _MOST_SECONDS = 1.0, 2.5e-3, 40.0

# Numbers of a hypercube, which is drawn whole: half a GB, with that much for the next, and 6 s.
_MOST_NUMBERS = 2**26


@dataclass(frozen=True)
class LatinHypercube(ReplicatedDesign):
    """Replicated Latin hypercubes: one point in each of the equally likely strata of every input.

    The points of one hypercube depend on each other, so only independent replicates show the
    error of estimates.

    Parameters
    ----------
    runs : int, optional
        Number of points in all, a multiple of `replicates`. With `until`, at the first look: 512 or
        the next that is possible by default, and no fewer. A hypercube is drawn whole: its points
        times the random inputs are at most 67 108 864 numbers.
    replicates : int, optional
        Number of hypercubes, by default 10; with one, error bars are wider than necessary, and a
        note says so. With `until`, at the first look: by default 20, and no fewer. At most 10 000.
    optimization : str
        ``"random-cd"`` exchanges coordinates for a lower centred discrepancy, which spreads the
        points over pairs of inputs too; it takes about a second for a hypercube of 1 000 points.
        Other criteria that move points (Lloyd's) leave some strata empty, so there are none.
    until : StoppingRule, optional
        The rule that decides whether the points are enough, whenever the number of hypercubes has
        doubled.
    at_most : int, optional
        With `until`, the largest number of points in all.
    keep : str
        ``"statistics"`` leaves the runs out of the archive, which then has their statistics, their
        number by status and their hashes.

    References
    ----------
    McKay, M. D., Beckman, R. J. & Conover, W. J. (1979). Technometrics 21, 239-245.
    """

    default_replicates = 10
    least_stopped = 20

    runs: int | None = count(minimum=2, maximum=MOST_RUNS, default=None)
    replicates: int | None = count(maximum=MOST_REPLICATES, default=None)
    optimization: str = choice("none", "random-cd", default="none")
    until: StoppingRule | None = stopping_rule("until")
    at_most: int | None = count(default=None)
    keep: str = keep_setting()

    def check_settings(self) -> Iterator[Problem]:
        yield from super().check_settings()
        if self.until is not None and self.optimization != "none":
            expected = '"none" beside until, as so many hypercubes take minutes to optimize'
            yield Problem(("optimization",), f'"{self.optimization}"', expected)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        runs, replicates = self.run_count(joint), self.replicate_count
        each, inputs = self._points_of_each, len(joint.random)
        if each * inputs > _MOST_NUMBERS:
            found = f"{self.runs}: {replicates} hypercubes of {each} points"
            expected = f"at most {_MOST_NUMBERS // inputs} points in each, as it is drawn whole: "
            expected += "more replicates, or fewer runs"
            yield Problem(("runs",), found, expected)
        seconds = _SECONDS_PER_SET * replicates + _SECONDS_PER_POINT * runs
        if self.optimization != "none" and seconds > _MOST_SECONDS:
            found = f'"{self.optimization}" of {runs} points in {replicates} hypercubes'
            expected = 'fewer points and hypercubes, as these take minutes to optimize, or "none"'
            yield Problem(("optimization",), found, expected)

    def drawn_points(
        self, joint: JointDistribution, stream: Stream, start: int, end: int
    ) -> DrawnPoints:
        points = super().drawn_points(joint, stream, start, end)
        is_optimized = self.optimization != "none"
        return points.assign_attrs({OPTIMIZED_BY: self.optimization}) if is_optimized else points

    def scaled(
        self, joint: JointDistribution, runs: int, *, replicated: bool
    ) -> LatinHypercube | None:
        shape = split_replicates(runs, self.replicate_count, replicated=replicated)
        return LatinHypercube(*shape, self.optimization) if shape else None

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        found = super().extension(earlier, joint)
        if not isinstance(earlier, LatinHypercube) or earlier.optimization == self.optimization:
            return found
        nearest = {**found.nearest, "optimization": earlier.optimization} if found.nearest else {}
        return replace(found, kept=0, nearest=nearest)

    def draw(self, rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
        if self.optimization == "none":
            return hypercube(rng, points, dimension)
        # Imported here: this part of SciPy takes longer to load than the rest.
        from scipy.stats import qmc

        return qmc.LatinHypercube(dimension, rng=rng, optimization=self.optimization).random(points)


def hypercube(rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
    """Draw the points of `scipy.stats.qmc.LatinHypercube`, in half its time and a third of memory.

    SciPy copies the generator, which takes longer than a small hypercube, and holds three further
    arrays of a large one.
    """
    (child,) = rng.spawn(1)
    unit: FloatArray = child.uniform(size=(points, dimension))
    for column in unit.T:
        strata = np.arange(1, points + 1)
        child.shuffle(strata)
        np.subtract(strata, column, out=column)
    unit /= points
    return unit
