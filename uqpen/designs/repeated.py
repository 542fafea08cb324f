"""Design that runs each of its points several times, as its model has noise of its own."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.errors import Problem
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import POINT, REPEAT, RUN
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Extension, ModelRounds
from uqpen.designs.drawn_points import DrawnPoints, Points, Round, points_of
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import first_repeats

if TYPE_CHECKING:
    import xarray as xr

REPEATS = "repeats"
"""The key of a design with the number of runs at each point."""


@dataclass(frozen=True)
class Repeats:
    """Setting of any design that makes runs."""

    repeats: int = count(
        minimum=1,
        maximum=10_000,
        default=1,
        expected="how many runs each point has, a whole number from 1 to 10 000",
    )


@dataclass(frozen=True)
class RepeatedDesign(Design):
    """Design each of whose points has several runs, one after the other.

    Its runs have two coordinates: ``point``, the number of the point, and ``repeat``, that of the
    run at the point, both from 0. The points are those of the design that makes each run once.
    """

    once: Design
    repeats: int

    def __post_init__(self) -> None:
        for name in (
            *("assumes_independence", "independence_reason", "unordered_reason"),
            *("needs_numbers", "keep"),
        ):
            object.__setattr__(self, name, getattr(self.once, name))

    @property
    def sampling(self) -> Sampling:
        return self.once.sampling

    def rounds(self, joint: JointDistribution, stream: Stream) -> ModelRounds:
        rounds = self.once.rounds(joint, stream)
        drawn, first = next(rounds), 0
        while True:
            points = points_of(drawn)
            repeated = self._repeated(points, first)
            if isinstance(drawn, Round):
                feedback = yield replace(drawn, points=repeated)
            else:
                feedback = yield repeated
            first += points.runs if isinstance(points, DrawnPoints) else points.sizes[RUN]
            runs = {name: first_repeats(each) for name, each in feedback.runs.items()}
            try:
                drawn = rounds.send(replace(feedback, runs=runs))
            except StopIteration:
                return

    def check_settings(self) -> Iterator[Problem]:
        yield from self.once.check_settings()

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        yield from self.once.check_inputs(joint)

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        yield from self.once.check_outputs(requested)

    def check_models(
        self, models: Collection[str], costs: Mapping[str, float]
    ) -> Iterator[Problem]:
        yield from self.once.check_models(models, costs)

    def samples_inputs(self, joint: JointDistribution) -> bool:
        return self.once.samples_inputs(joint)

    @property
    def replicate_count(self) -> int:
        return self.once.replicate_count

    @property
    def ends_early(self) -> bool:
        return self.once.ends_early

    def run_count(self, joint: JointDistribution) -> int:
        return self.repeats * self.once.run_count(joint)

    def files(self) -> tuple[FileSnapshot, ...]:
        return self.once.files()

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        found = self.once.extension(each_point_once(earlier), joint)
        before = earlier.repeats if isinstance(earlier, RepeatedDesign) else 1
        if found.kept is None:
            return found
        kept = found.kept * min(before, self.repeats)
        if before <= self.repeats or not found.nearest:
            return replace(found, kept=kept)
        return replace(found, kept=kept, nearest={**found.nearest, REPEATS: before})

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> Design | None:
        scaled = self.once.scaled(joint, runs // self.repeats, replicated=replicated)
        return scaled and replace(self, once=scaled)

    def _repeated(self, points: Points, first: int) -> Points:
        """Return the points of a round, each as often as it is run; `first` is its number."""

        def draw(start: int, stop: int) -> xr.Dataset:
            run = np.arange(start, stop)
            point, repeat = np.divmod(run, self.repeats)
            if isinstance(points, DrawnPoints):
                before = start // self.repeats
                drawn = points.draw(before, max(-(-stop // self.repeats), before))
                repeated = drawn.isel({RUN: point - before})
            else:
                repeated = points.isel({RUN: point})
            coordinates = {POINT: (RUN, point + first), REPEAT: (RUN, repeat), RUN: run}
            return repeated.drop_vars(RUN, errors="ignore").assign_coords(coordinates)

        if isinstance(points, DrawnPoints):
            return DrawnPoints(points.runs * self.repeats, draw)
        return draw(0, points.sizes[RUN] * self.repeats)


def each_point_once(design: Design) -> Design:
    """Return the design that makes one run at each of the points of a design."""
    return design.once if isinstance(design, RepeatedDesign) else design


def repeat_problem(design: Design) -> tuple[str, str] | None:
    """Return why the points of a design have no repeats, and what is expected; None if they can."""
    if design.results is not None:
        return "repeats of runs that are there", "no repeats: no run can be made"
    if design.sampling is Sampling.TOWARDS_EVENT:
        expected = "no repeats: the method draws inputs and noise together, each run once"
        return "repeats in a search for a rare event", expected
    if design.sampling is Sampling.TOWARDS_BOUNDS:
        expected = "no repeats: runs at the bounds draw inputs and noise together, each once"
        return "repeats in a search for bounds", expected
    if design.sampling in (
        Sampling.AT_EXPERIMENTS,
        Sampling.TOWARDS_MEASUREMENTS,
        Sampling.POSTERIOR,
        Sampling.WEIGHTED_POSTERIOR,
    ):
        expected = "no repeats: each experiment has one run of each draw"
        return "repeats of runs at experiments", expected
    if design.ends_early:
        expected = "a fixed number of points beside repeats"
        return "repeats of a design that decides its own number of runs", expected
    return None
