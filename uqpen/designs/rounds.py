"""Rounds of a design: its points, their runs, and a clear error where a design fails."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.core.errors import StudyError, UqpenError
from uqpen.core.labels import RUN, WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import DrawnPoints, Points, Round, points_of
from uqpen.designs.feedback import Estimates, Feedback
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.models.user_code import error_text

_INVALID_WEIGHT = f"its {WEIGHT} is not finite, below 0, or 0 everywhere"

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
    make_runs: Callable[[Points | Round, int], RoundRuns],
    make_estimates: Callable[[tuple[RoundRuns, ...]], Estimates] = lambda rounds: no_estimates,
    costs: Mapping[str, float] | None = None,
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
        Returns the runs of each model at the points of a round, given the number of the round: of
        all models, or of those that a `Round` names.
    make_estimates : callable
        Returns the estimates of the rounds so far. It is called after each round, so it should
        compute nothing before it is asked.
    costs : mapping of str to float, optional
        Cost of a run of each model, relative to the first; 1 without it.

    Raises
    ------
    StudyError
        As `draw_rounds` does.
    """
    generator = draw_rounds(design, joint, stream)
    rounds = [make_runs(next(generator), 0)]
    costs = costs or dict.fromkeys(rounds[0], 1.0)
    while True:
        feedback = Feedback(rounds[-1], make_estimates(tuple(rounds)), costs)
        try:
            drawn = generator.send(feedback)
        except StopIteration:
            return rounds
        rounds.append(make_runs(drawn, len(rounds)))


def draw_rounds(
    design: Design, joint: JointDistribution, stream: Stream
) -> Generator[Points | Round, Feedback, None]:
    """Yield the rounds of a design, as `Design.rounds` does; points of one block are in memory.

    Raises
    ------
    StudyError
        If a user-defined design raises an error, or yields anything but points. The
        first block of a round is checked at once, another one when it is drawn.
    """
    rounds = design.rounds(joint, stream)
    feedback: Feedback | None = None
    check = _PointsCheck(design, joint)
    while True:
        try:
            with check.errors():
                points = rounds.send(feedback)  # type: ignore[arg-type]
        except StopIteration:
            if feedback is None:
                raise check.error("it yields no points") from None
            return
        feedback = yield check.checked_round(points)


def first_round(design: Design, joint: JointDistribution, stream: Stream) -> Points:
    """Return the points of the first round of a design, which all models run.

    Raises
    ------
    StudyError
        As `draw_rounds` does.
    """
    return points_of(next(draw_rounds(design, joint, stream)))


class _PointsCheck:
    """Check of what a design yields, each round and each block against those before."""

    def __init__(self, design: Design, joint: JointDistribution) -> None:
        self._design, self._joint = design, joint
        self._labels: set[str] | None = None

    def checked_round(self, drawn: object) -> Points | Round:
        """Return what a design yields, its points checked."""
        if not isinstance(drawn, Round):
            return self.checked(drawn)
        if self._labels is None:
            raise self.error("not all models run its first round")
        return replace(drawn, points=self.checked(drawn.points))

    def checked(self, points: object) -> Points:
        """Return the points of a round; blocks of them are checked when they are drawn."""
        if not isinstance(points, DrawnPoints):
            whole = self._checked_part(points, "rounds")
            self._check_sum_of_weights([whole])
            return whole
        if points.runs < 1:
            raise self.error("it yields no points")
        head = self._draw(points, 0, min(points.runs, BLOCK), "rounds")

        def draw(start: int, stop: int) -> xr.Dataset:
            is_head = (start, stop) == (0, head.sizes[RUN])
            return head if is_head else self._draw(points, start, stop, "blocks")

        drawn = DrawnPoints(points.runs, draw)
        self._check_sum_of_weights(drawn.blocks())
        return drawn.dataset() if points.runs <= BLOCK else drawn

    def error(self, reason: str) -> StudyError:
        """Return the error of a design."""
        return StudyError(f"the design {type(self._design).__name__} fails: {reason}")

    @contextmanager
    def errors(self) -> Iterator[None]:
        """Report any error of a user-defined design as one of the study."""
        try:
            yield
        except (StopIteration, UqpenError):
            raise
        except Exception as error:
            if type(self._design).__module__.startswith("uqpen."):
                raise
            raise self.error(error_text(error)) from error

    def _draw(self, points: DrawnPoints, start: int, stop: int, parts: str) -> xr.Dataset:
        with self.errors():
            part = points.draw(start, stop)
        checked = self._checked_part(part, parts)
        if (drawn := checked.sizes[RUN]) != stop - start:
            raise self.error(f"it draws {drawn} points from {start} to {stop}")
        return checked

    def _checked_part(self, points: object, parts: str) -> xr.Dataset:
        """Return points that can follow those before; anything else is an error."""
        fault = _fault(points, self._joint)
        if fault or not isinstance(points, xr.Dataset):
            raise self.error(fault)
        labels = {str(name) for name, each in points.coords.items() if RUN in each.dims} - {RUN}
        fault = _weight_fault(points, self._design.sampling)
        if differing := sorted(labels ^ (labels if self._labels is None else self._labels)):
            fault = fault or f"some of its {parts} have a {differing[0]}, others none"
        if fault:
            raise self.error(fault)
        self._labels = labels
        return points

    def _check_sum_of_weights(self, parts: Iterable[xr.Dataset]) -> None:
        """Check, before any run, that points count for something; look no further than needed."""
        for part in parts:
            if WEIGHT not in part.coords or (part[WEIGHT].values > 0).any():
                return
        raise self.error(_INVALID_WEIGHT)


def _fault(points: object, joint: JointDistribution) -> str:
    """Return why a yielded object is not a set of points; empty where it is one."""
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


def _weight_fault(points: xr.Dataset, sampling: Sampling) -> str:
    """Return what is wrong with the weights of points; empty where nothing is."""
    if WEIGHT not in points.coords:
        return ""
    if sampling not in (Sampling.INDEPENDENT, Sampling.GIVEN):
        return f"it weights points that are {sampling}, and weights are of independent draws"
    weights = points[WEIGHT]
    if weights.dims != (RUN,) or weights.dtype.kind not in "iuf":
        return f"its {WEIGHT} is not a number for each run"
    if not (np.isfinite(weights) & (weights >= 0)).all():
        return _INVALID_WEIGHT
    return ""
