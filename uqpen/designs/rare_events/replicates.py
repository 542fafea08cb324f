"""Replicates of a method in standard normal space, which all advance in common rounds."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import REPLICATE
from uqpen.designs.design import Rounds
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.distributions.joint_distribution import JointDistribution

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Replicate", "RequestedPoints", "RunOutcomes", "advance_together"]


@dataclass(frozen=True, eq=False)
class RequestedPoints:
    """Points that a replicate asks to be run.

    Parameters
    ----------
    points : ndarray, shape (run, random input)
        In standard normal space.
    coordinates : mapping of str to ndarray, shape (run,)
        What the analysis needs of each run.
    """

    points: FloatArray
    coordinates: Mapping[str, FloatArray | IntArray]


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
