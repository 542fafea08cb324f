"""One input at a time, moved a little up and down from the nominal point."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.designs.design import Design, Rounds
from uqpen.designs.moves import with_moves
from uqpen.inputs.distribution import Distribution
from uqpen.inputs.law import InputLaw, points_dataset
from uqpen.inputs.recurrence import recurrence
from uqpen.labels import MOVED_BY, MOVED_UNCERTAINTY, RELATIVE_TO_SPREAD, Sampling
from uqpen.settings import flag, number
from uqpen.streams import Stream

__all__ = ["OneAtATime"]

# Half of the range between them is about one standard deviation.
_LOW, _HIGH = 0.16, 0.84


@dataclass(frozen=True)
class OneAtATime(Design):
    """Central differences at the nominal point, relative ones.

    The nominal point, and for each random input two more, at its nominal value times 1 - `step`
    and 1 + `step`. Where that value is 0, the step is relative to half the input's 16 % to 84 %
    range. A point outside the model's domain is inadmissible, as any point is.

    Parameters
    ----------
    step : float
        How far an input is moved, relative to its nominal value.
    fixed : bool
        Whether the fixed inputs are moved too, all but those that are 0.
    """

    step: float = number(above=0, below=1, default=0.01)
    fixed: bool = flag(default=False)

    @property
    def sampling(self) -> Sampling:
        return Sampling.STEPS

    def rounds(self, law: InputLaw, stream: Stream) -> Rounds:
        moves = list(self._moves(law))
        runs = 1 + 2 * len(moves)
        nominal = law.nominal()
        names = {entry.variable.name for entry in law.random} | {move.name for move in moves}
        values = {name: np.full(runs, nominal[name]) for name in nominal if name in names}
        moved, by = np.full(runs, -1), np.zeros(runs)
        uncertainty = np.zeros(runs)
        for position, move in enumerate(moves):
            pair = slice(1 + 2 * position, 3 + 2 * position)
            by[pair] = -self.step, self.step
            moved[pair] = position
            uncertainty[pair] = move.std / abs(move.reference)
            values[move.name][pair] += by[pair] * move.reference
        points = points_dataset(law, values, {MOVED_UNCERTAINTY: uncertainty}, runs=runs)
        points[MOVED_UNCERTAINTY].attrs = {
            "units": "1",
            "long_name": "standard deviation of the input that is moved, on the scale of moved_by",
        }
        points = with_moves(
            points,
            [move.name for move in moves],
            moved,
            by,
            measured="relative to its nominal value",
        )
        spreads = [move.name for move in moves if not nominal[move.name]]
        if spreads:
            points[MOVED_BY].attrs[RELATIVE_TO_SPREAD] = " ".join(spreads)
        yield points

    def size(self, law: InputLaw) -> int:
        return 1 + 2 * len(list(self._moves(law)))

    def _moves(self, law: InputLaw) -> Iterator[_Move]:
        for entry in law.random:
            reference = entry.nominal or _half_spread(entry.distribution)
            std = recurrence(entry.distribution, 1).std
            yield _Move(entry.variable.name, reference, std)
        for given in law.fixed:
            if self.fixed and given.value:
                yield _Move(given.variable.name, given.value, 0.0)


@dataclass(frozen=True)
class _Move:
    """An input that is moved: what its step is relative to, and its standard deviation."""

    name: str
    reference: float
    std: float


def _half_spread(distribution: Distribution) -> float:
    low, high = distribution.quantile(np.array([_LOW, _HIGH]))
    return float(high - low) / 2
