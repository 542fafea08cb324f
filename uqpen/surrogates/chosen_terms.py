"""Terms of an expansion whose truncation, order and number of terms are chosen together."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.surrogates.forward_selection import Selection, forward_selection
from uqpen.surrogates.regression import FOLDS, least_squares
from uqpen.surrogates.term_selection import (
    FitPoints,
    Terms,
    dependent_terms_problem,
    run_count_problem,
    size_problem,
    unseen_error,
)

__all__ = ["TRUNCATIONS", "chosen_terms"]


# From few interactions to all of them.
TRUNCATIONS = (0.4, 0.5, 0.6, 0.75, 0.9, 1.0)
# Parts of the runs in cross-validation. Of few runs, a fit needs nearly all, and how they are
# divided would decide: they are divided into more parts, twice.
_FEW_RUNS, _PARTS_OF_FEW, _DIVISIONS_OF_FEW = 200, 10, 2
# Orders are tried until this number of them in a row have been worse than the best one.
_PATIENCE = 3
# Below this error, a share of the variance, no figure is worth another fit.
_EXACT = 1e-16
# A matrix has at most this number of entries: the pairs of 100 inputs at 1 000 runs.
_MOST_ENTRIES = 6_000_000


@dataclass(frozen=True, eq=False)
class _Choice:
    """Terms chosen from those of one truncation and order.

    Parameters
    ----------
    points : FitPoints
        With the truncation.
    order : int
        The order.
    indices : ndarray of int, shape (term, input)
        Degrees of all the terms that they were chosen from.
    selection : Selection
        The choice.
    """

    points: FitPoints
    order: int
    indices: IntArray
    selection: Selection

    @property
    def error(self) -> float:
        """Error at runs left out, as a share of the variance."""
        return self.selection.least_error

    def fitted(self, values: FloatArray) -> Terms | str:
        """Return the terms with coefficients from all runs, or the reason why there are none."""
        indices = self.indices[self.selection.best]
        fit = least_squares(self.points.matrix(indices), values)
        if fit is None:
            return dependent_terms_problem(self.order)
        return Terms(
            indices,
            fit.coefficients,
            self.order,
            self.points.truncation,
            fit.leave_one_out,
            unseen_error(fit, self.error),
        )


def chosen_terms(
    points: FitPoints,
    values: FloatArray,
    order: int | None,
    rng: np.random.Generator,
    truncations: Sequence[float] = TRUNCATIONS,
) -> Terms | str:
    """Find the terms with the least error at runs left out, or the reason why there are none.

    Of several truncations with the same error, it is the one with the fewest interactions.

    Parameters
    ----------
    points : FitPoints
        The points of the runs; other truncations take the place of theirs.
    values : ndarray, shape (run,)
        The values to fit; not constant.
    order : int, optional
        The order; without it, the best one.
    rng : Generator
        Divides the runs for cross-validation.
    truncations : sequence of float
        Those to choose from, ascending.
    """
    if problem := run_count_problem(points):
        return problem
    fewest = replace(points, truncation=truncations[0])
    if order is not None and (problem := size_problem(fewest, order)):
        return problem
    is_in = _parts(points.run_count, rng)
    # Truncations have the same terms at many orders.
    known: dict[bytes, Selection] = {}

    def select(indices: IntArray) -> Selection:
        key = indices.tobytes()
        if key not in known:
            known[key] = forward_selection(points.matrix(indices), values, is_in)
        return known[key]

    best: _Choice | None = None
    for truncation in truncations:
        found = _best_order(replace(points, truncation=truncation), order, select)
        if found and (best is None or found.error < best.error):
            best = found
        if best and best.error < _EXACT:
            break
    return best.fitted(values) if best else dependent_terms_problem(order or 1)


def _best_order(
    points: FitPoints, order: int | None, select: Callable[[IntArray], Selection]
) -> _Choice | None:
    """Return the choice with the least error for one truncation."""
    best: _Choice | None = None
    for tried, indices in _candidates(points, order):
        found = _Choice(points, tried, indices, select(indices))
        if best is None or found.error < best.error:
            best = found
        if best.error < _EXACT or tried - best.order >= _PATIENCE:
            break
    return best


def _candidates(points: FitPoints, order: int | None) -> Iterator[tuple[int, IntArray]]:
    """Yield orders and their terms."""
    if order is None:
        yield from points.orders(most_entries=_MOST_ENTRIES)
    elif not size_problem(points, order):
        yield order, points.basis.indices(order, points.truncation)


def _parts(runs: int, rng: np.random.Generator) -> BoolArray:
    """Return the runs of each fit, shape (fit, run): all but a part of them, and in the end all."""
    parts, divisions = (_PARTS_OF_FEW, _DIVISIONS_OF_FEW) if runs <= _FEW_RUNS else (FOLDS, 1)
    folds = np.array([rng.permutation(np.arange(runs) % parts) for _ in range(divisions)])
    is_in = folds[:, None] != np.arange(parts)[:, None]
    return np.vstack([is_in.reshape(-1, runs), np.ones(runs, dtype=np.bool_)])
