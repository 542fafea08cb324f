"""One input at a time, moved a little up and down from the nominal point."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.errors import Problem
from uqpen.core.labels import MOVED_BY, MOVED_UNCERTAINTY, RELATIVE_TO_SPREAD
from uqpen.core.sampling import Sampling
from uqpen.core.settings import flag, number
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.moves import add_move_coordinates
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.distributions.orthogonal_polynomials import recurrence

__all__ = ["OneAtATime"]

# Half of the range between them is about one standard deviation.
_LOW, _HIGH = 0.16, 0.84


@dataclass(frozen=True)
class OneAtATime(Design):
    """One-at-a-time design: relative central differences at the nominal point.

    The nominal point, and for each random input two more, at its nominal value times 1 - `step`
    and 1 + `step`. Where that value is 0, the step is relative to half the input's 16 % to 84 %
    range. A point outside the model's domain is inadmissible, as any point is.

    Parameters
    ----------
    step : float
        The step of an input, relative to its nominal value.
    fixed : bool
        Whether the fixed inputs are moved too, all but those that are 0.
    """

    sampling = Sampling.ONE_AT_A_TIME

    step: float = number(above=0, below=1, default=0.01)
    fixed: bool = flag(default=False)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        for entry in joint.random:
            if entry.distribution.is_discrete:
                found = f"steps of {entry.variable.name}, which has single values"
                yield Problem((), found, "inputs with a continuous distribution")
        for name in joint.implicit_inputs:
            found = f"steps of {name}, whose own distribution is not known"
            yield Problem((), found, "inputs with a distribution of their own")

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        moves = list(self._moves(joint))
        runs = 1 + 2 * len(moves)
        nominal = joint.nominal()
        names = {entry.variable.name for entry in joint.random} | {move.name for move in moves}
        values = {name: np.full(runs, nominal[name]) for name in nominal if name in names}
        moved, by = np.full(runs, -1), np.zeros(runs)
        uncertainty = np.zeros(runs)
        for position, move in enumerate(moves):
            pair = slice(1 + 2 * position, 3 + 2 * position)
            by[pair] = -self.step, self.step
            moved[pair] = position
            uncertainty[pair] = move.std / abs(move.reference)
            values[move.name][pair] += by[pair] * move.reference
        points = points_dataset(joint, values, {MOVED_UNCERTAINTY: uncertainty}, runs=runs)
        points[MOVED_UNCERTAINTY].attrs = {
            "units": "1",
            "long_name": "standard deviation of the input that is moved, on the scale of moved_by",
        }
        points = add_move_coordinates(
            points,
            [move.name for move in moves],
            moved,
            by,
            measure="relative to its nominal value",
        )
        spreads = [move.name for move in moves if not nominal[move.name]]
        if spreads:
            points[MOVED_BY].attrs[RELATIVE_TO_SPREAD] = " ".join(spreads)
        yield points

    def run_count(self, joint: JointDistribution) -> int:
        return 1 + 2 * len(list(self._moves(joint)))

    def _moves(self, joint: JointDistribution) -> Iterator[_Move]:
        for entry in joint.random:
            reference = entry.nominal or _half_spread(entry.distribution)
            std = recurrence(entry.distribution, 1).std
            yield _Move(entry.variable.name, reference, std)
        for given in joint.fixed:
            if self.fixed and given.value:
                yield _Move(given.variable.name, given.value, 0.0)


@dataclass(frozen=True)
class _Move:
    """Input that is moved: the reference of its relative step, and its standard deviation."""

    name: str
    reference: float
    std: float


def _half_spread(distribution: Distribution) -> float:
    low, high = distribution.ppf(np.array([_LOW, _HIGH]))
    return float(high - low) / 2
