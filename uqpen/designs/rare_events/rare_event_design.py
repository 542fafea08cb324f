"""Interface of a design whose runs lead to a rare event."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from uqpen.core.errors import Problem
from uqpen.core.labels import RARE_EVENT, RARE_EVENT_METHOD
from uqpen.core.lookup import family_name
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design, Rounds
from uqpen.designs.rare_events.limit_state import LimitState, limit_state, parse_limit_state
from uqpen.designs.rare_events.replicates import Replicate, advance_together
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["RareEventDesign"]


@dataclass(frozen=True)
class RareEventDesign(Design):
    """Design whose runs lead to a rare event, each round from the results of the last.

    Parameters
    ----------
    event : str
        The event: ``"depth > 3 m"``, or limits joined by ``and``, or by ``or``.
    """

    sampling = Sampling.TOWARDS_EVENT

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

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        for problem in parse_limit_state(self.event).check_outputs(requested):
            yield problem.within("event")

    def check_models(
        self, models: Collection[str], costs: Mapping[str, float]
    ) -> Iterator[Problem]:
        if len(models) > 1:
            found = f"a study of {len(models)} models"
            expected = "a study of one model: its results decide where the next runs are"
            yield Problem(("kind",), found, expected)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        event, streams = parse_limit_state(self.event), [stream]
        if self.replicate_count > 1:
            numbers = range(self.replicate_count)
            streams = [stream.child("replicate", number) for number in numbers]
        replicates = [partial(self.replicate, joint, event, each) for each in streams]
        described = {RARE_EVENT: str(event), RARE_EVENT_METHOD: self.method}
        yield from advance_together(joint, event, replicates, described)
