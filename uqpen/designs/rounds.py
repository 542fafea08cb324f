"""Rounds of a design: its points, their runs, and a clear error where a user's own design fails."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np
import xarray as xr

from uqpen.core.errors import StudyError, UqpenError
from uqpen.core.labels import RUN, WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.feedback import Estimates, Feedback
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.models.user_code import error_text

__all__ = ["draw_rounds", "no_estimates", "run_rounds", "weight_fault"]

# Runs of a round by the name of a model.
RoundRuns = Mapping[str, xr.Dataset]


def no_estimates(
    model: str, output: str, *, only: Collection[str] | None = None
) -> Mapping[str, xr.DataArray]:
    """Return no estimates, for designs that do not ask for any."""
    return {}


def run_rounds(
    design: Design,
    joint: JointDistribution,
    stream: Stream,
    make_runs: Callable[[xr.Dataset, int], RoundRuns],
    make_estimates: Callable[[tuple[RoundRuns, ...]], Estimates] = lambda rounds: no_estimates,
) -> list[RoundRuns]:
    """Make the runs of all rounds of a design.

    Parameters
    ----------
    design : Design
        The design.
    joint : JointDistribution
        The inputs.
    stream : Stream
        Source of the design's random numbers.
    make_runs : callable
        Returns the runs of each model at the points of a round, given the number of the round.
    make_estimates : callable
        Returns the estimates of the rounds so far. It is called after each round, so it should
        compute nothing before it is asked.

    Raises
    ------
    StudyError
        As `draw_rounds` does.
    """
    generator = draw_rounds(design, joint, stream)
    rounds = [make_runs(next(generator), 0)]
    while True:
        feedback = Feedback(rounds[-1], make_estimates(tuple(rounds)))
        try:
            points = generator.send(feedback)
        except StopIteration:
            return rounds
        rounds.append(make_runs(points, len(rounds)))


def draw_rounds(design: Design, joint: JointDistribution, stream: Stream) -> Rounds:
    """Yield the rounds of a design as `Design.rounds` does.

    Raises
    ------
    StudyError
        If a design from outside the package raises an error, or yields anything but points.
    """
    rounds = design.rounds(joint, stream)
    feedback: Feedback | None = None
    before: xr.Dataset | None = None
    while True:
        try:
            points = rounds.send(feedback)  # type: ignore[arg-type]
        except StopIteration:
            if feedback is None:
                raise _error(design, "it yields no points") from None
            return
        except Exception as error:
            if isinstance(error, UqpenError) or type(design).__module__.startswith("uqpen."):
                raise
            raise _error(design, error_text(error)) from error
        fault = _fault(points, joint) or weight_fault(points, design.sampling)
        if fault := fault or _round_fault(points, before):
            raise _error(design, fault)
        before = points
        feedback = yield points


def _fault(points: object, joint: JointDistribution) -> str:
    """Return why what a design yields is no points; empty where it is."""
    if not isinstance(points, xr.Dataset):
        return f"it yields an object of class {type(points).__name__}, not a dataset"
    names = [each.variable.name for each in joint.inputs if isinstance(each, RandomInput)]
    absent = [name for name in names if name not in points]
    if RUN not in points.dims or absent:
        return f"its points lack {', '.join(absent) or 'the dimension run'}"
    is_input = any(each.variable.name == WEIGHT for each in joint.inputs)
    if WEIGHT in points.data_vars and not is_input:
        return f"its {WEIGHT} is a variable of its points, expected a coordinate (assign_coords)"
    return ""


def _round_fault(points: xr.Dataset, before: xr.Dataset | None) -> str:
    """Return why a round cannot follow the one before; empty where it can."""
    if before is None:
        return ""
    along_run = [
        {name for name, each in of.coords.items() if RUN in each.dims} - {RUN}
        for of in (before, points)
    ]
    differing = sorted(map(str, along_run[0] ^ along_run[1]))
    return f"some of its rounds have a {differing[0]}, others none" if differing else ""


def weight_fault(points: xr.Dataset, sampling: Sampling) -> str:
    """Return what is wrong with the weights of points; empty where nothing is."""
    if WEIGHT not in points.coords:
        return ""
    if sampling not in (Sampling.INDEPENDENT, Sampling.USER_SUPPLIED):
        return f"it weights points that are {sampling}, and weights are of independent draws"
    weights = points[WEIGHT]
    if weights.dims != (RUN,) or weights.dtype.kind not in "iuf":
        return f"its {WEIGHT} is not a number for each run"
    if not (np.isfinite(weights) & (weights >= 0)).all() or not (weights > 0).any():
        return f"its {WEIGHT} is not finite, below 0, or 0 everywhere"
    return ""


def _error(design: Design, reason: str) -> StudyError:
    return StudyError(f"the design {type(design).__name__} fails: {reason}")
