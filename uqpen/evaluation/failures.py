"""What is done about runs that are lost."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from uqpen.errors import TooManyLostError
from uqpen.executors.work import Piece
from uqpen.labels import STATUS_TEXT, Status

__all__ = ["Failures", "Losses"]

_ROUNDING = 1e-12


@dataclass(frozen=True)
class Failures:
    """How often lost runs are made again, and how many of them are one too many.

    Parameters
    ----------
    retry : int
        How often a run that was lost is made again; one that is inadmissible never is.
    at_most : float
        The share of a design's runs that may be lost, from 0 to 1.
    """

    retry: int = 0
    at_most: float = 1.0


@dataclass
class Losses:
    """The runs that a model has lost in a design so far.

    Parameters
    ----------
    allowed : float
        The share that may be lost, from 0 to 1.
    runs : int
        How many runs there are in all.
    """

    allowed: float
    runs: int
    statuses: Counter[Status] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    counted: set[int] = field(default_factory=set)

    def add(self, piece: Piece) -> int:
        """Count those of a piece that are new; how many it has.

        A batch of a vectorised model is made again as a whole where some of it is missing.

        Raises
        ------
        TooManyLostError
            If there are now more than are allowed.
        """
        status = piece.results.status
        lost = [
            run
            for run in np.flatnonzero(status > Status.INADMISSIBLE).tolist()
            if piece.start + run not in self.counted
        ]
        self.counted.update(piece.start + run for run in lost)
        self.statuses.update(Status(int(status[run])) for run in lost)
        self.reasons.update(piece.results.reasons[run] for run in lost)
        # 29 of 100 are no more than 0.29, whatever that times 100 is.
        if lost and self.statuses.total() > self.allowed * self.runs * (1 + _ROUNDING):
            raise TooManyLostError(self._told())
        return len(lost)

    def _told(self) -> str:
        kinds = ", ".join(
            f"{count} {STATUS_TEXT[status]}" for status, count in sorted(self.statuses.items())
        )
        reason, count = self.reasons.most_common(1)[0]
        return (
            f"{self.statuses.total()} of {self.runs} runs were lost so far ({kinds}), more than "
            f"the {100 * self.allowed:g} % that [failures] at_most allows\n"
            f"  the most frequent reason, {count} times: {reason}"
        )
