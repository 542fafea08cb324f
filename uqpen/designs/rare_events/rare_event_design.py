"""Interface of a design whose runs lead to a rare event."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import RARE_EVENT, RARE_EVENT_METHOD, REPLICATE
from uqpen.core.lookup import family_name
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design, Rounds
from uqpen.designs.rare_events import RARE_EVENT_METHODS
from uqpen.designs.rare_events.limit_state import (
    EventOutcomes,
    LimitState,
    limit_state,
    parse_limit_state,
)
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.distribution import UPPER_TAIL
from uqpen.distributions.joint_distribution import JointDistribution

if TYPE_CHECKING:
    import xarray as xr

# Replicates of a method in standard normal space, which all advance in common rounds.


@dataclass(frozen=True, eq=False)
class RequestedPoints:
    """Points that a replicate asks to be run."""

    points: FloatArray  # (run, random input): in standard normal space
    coordinates: Mapping[str, FloatArray | IntArray]  # (run,): what the analysis needs of each run


@dataclass(frozen=True, eq=False)
class RunOutcomes:
    """Outcomes of the runs at requested points, with the numbers of the runs in the design."""

    runs: IntArray
    outcomes: EventOutcomes


# A replicate yields points, and is sent the outcomes of their runs.
Replicate = Generator[RequestedPoints, RunOutcomes, None]


def advance_together(
    joint: JointDistribution,
    event: LimitState,
    replicates: Sequence[Callable[[], Replicate]],
    described: Mapping[str, str],
) -> Rounds:
    """Yield rounds with the points of all replicates that go on, `described` by attributes.

    Standard normal points become inputs by the inputs' own transformation, so that every
    dependence and truncation of the study is kept.
    """
    going = {number: start() for number, start in enumerate(replicates)}
    wanted = {number: next(replicate) for number, replicate in going.items()}
    first = 0
    while wanted:
        feedback = yield _points(joint, wanted).assign_attrs(described)
        outcomes = event.outcomes(next(iter(feedback.runs.values())))
        following = {}
        start = 0
        for number, points in wanted.items():
            part = np.arange(start, start + len(points.points))
            made = RunOutcomes(first + part, outcomes.of(part))
            with suppress(StopIteration):  # it is at its last level
                following[number] = going[number].send(made)
            start += len(part)
        first += start
        wanted = following


def _points(joint: JointDistribution, wanted: dict[int, RequestedPoints]) -> xr.Dataset:
    sizes = [len(each.points) for each in wanted.values()]
    names = next(iter(wanted.values())).coordinates
    coordinates = {
        REPLICATE: np.repeat(list(wanted), sizes),
        **{
            name: np.concatenate([each.coordinates[name] for each in wanted.values()])
            for name in names
        },
    }
    unit = ndtr(np.concatenate([each.points for each in wanted.values()]))
    return joint.points(unit, coordinates)


@dataclass(frozen=True)
class RareEventDesign(Design):
    """Design whose runs lead to a rare event, each round from the results of the last."""

    sampling = Sampling.TOWARDS_EVENT
    needs_one_model = True

    # The event: ``"depth > 3 m"``, or limits joined by ``and``, or by ``or``.
    event: str = limit_state()

    @property
    def method(self) -> str:
        """Name of the method whose statistics its runs allow; empty for none."""
        return family_name(DESIGNS, self)

    @abstractmethod
    def replicate(self, joint: JointDistribution, event: LimitState, stream: Stream) -> Replicate:
        """Yield the points of a replicate; it is sent the outcomes of their runs.

        Parameters
        ----------
        joint : JointDistribution
            The inputs of the study.
        event : LimitState
            The event.
        stream : Stream
            Source of the replicate's random numbers.
        """

    def gives_quantile(self, output: str, probability: float) -> bool:
        method = RARE_EVENT_METHODS.get(self.method)
        has_levels = method is not None and bool(method.quantiles)
        return has_levels and output in parse_limit_state(self.event).outputs

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        for entry in joint.random:
            if least := entry.distribution.least_upper_tail:
                found = f"{entry.variable.name}, whose upper tail is known down to {least:g} only"
                yield Problem((), found, f"inputs with both tails: {UPPER_TAIL}")

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        for problem in parse_limit_state(self.event).check_outputs(requested):
            yield problem.within("event")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        event, streams = parse_limit_state(self.event), [stream]
        if self.replicate_count > 1:
            numbers = range(self.replicate_count)
            streams = [stream.child("replicate", number) for number in numbers]
        replicates = [partial(self.replicate, joint, event, each) for each in streams]
        described = {RARE_EVENT: str(event), RARE_EVENT_METHOD: self.method}
        yield from advance_together(joint, event, replicates, described)
