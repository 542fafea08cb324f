"""Predictions that folds use for quantiles: one choice for all values of an interval."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns
from uqpen.statistics.surrogate.correction.disagreements import FoldChoice

__all__ = ["QuantileChoices"]


@dataclass(frozen=True, eq=False)
class QuantileChoices:
    """Choices of all folds, each for the probabilities of a piece of 0 to 1.

    Parameters
    ----------
    ends : ndarray, shape (piece,)
        The last probability of each piece, ascending; that of the last piece is 1. A piece has its
        end, and not that of the one before.
    choice : FoldChoice
        Of shape (fold, piece).
    """

    ends: FloatArray
    choice: FoldChoice

    @classmethod
    def of(cls, runs: CorrectionRuns, grid: FloatArray, choice: FoldChoice) -> QuantileChoices:
        """Return the choices at the quantiles of the other folds, which are order statistics.

        Parameters
        ----------
        runs : CorrectionRuns
        grid : ndarray, shape (value,)
            Values, ascending, with those of all runs.
        choice : FoldChoice
            At these values, shape (fold, value).
        """
        folds = range(len(runs.draws))
        if len(folds) == 1:
            return cls(np.ones(1), choice.at(np.zeros(1, dtype=np.int64)))
        others = [np.sort(runs.values[runs.fold != number]) for number in folds]
        steps = [np.arange(1, each.size + 1) / each.size for each in others]
        ends = np.unique(np.concatenate(steps))
        places = [
            np.searchsorted(grid, values[np.searchsorted(step, ends)])
            for values, step in zip(others, steps, strict=True)
        ]
        uses_fit, otherwise = (
            np.array([row[place] for row, place in zip(rows, places, strict=True)])
            for rows in (choice.uses_fit, choice.otherwise)
        )
        # Neighbours with the same choice are one piece.
        table = np.concatenate([uses_fit, otherwise])
        kept = np.append(np.flatnonzero((table[:, 1:] != table[:, :-1]).any(axis=0)), len(ends) - 1)
        return cls(ends[kept], FoldChoice(uses_fit[:, kept], otherwise[:, kept]))

    def parts(self) -> Iterator[tuple[FoldChoice, Callable[[FloatArray], FloatArray]]]:
        """Yield each different choice, shape (fold, 1), with a function of probabilities.

        It returns how much of the pieces with this choice lies at or below a probability.
        """
        table = np.concatenate([self.choice.uses_fit, self.choice.otherwise])
        _, first, number_of = np.unique(table, axis=1, return_index=True, return_inverse=True)
        widths = np.diff(self.ends, prepend=0.0)
        for number, piece in enumerate(first):
            widths_of_choice = np.where(number_of.ravel() == number, widths, 0.0)
            below = np.concatenate([[0.0], np.cumsum(widths_of_choice)])
            yield self.choice.at(np.array([piece])), partial(self._part, below)

    def _part(self, below: FloatArray, probability: FloatArray) -> FloatArray:
        """Return what lies below probabilities, from what lies below the ends of all pieces."""
        ends = np.concatenate([[0.0], self.ends])
        return np.asarray(np.interp(probability, ends, below), dtype=np.float64)
