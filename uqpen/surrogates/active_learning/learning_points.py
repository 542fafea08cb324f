"""Points from which a surrogate of a limit state learns the most: the batches of active learning.

References
----------
Echard, B., Gayton, N. & Lemaire, M. (2011). Structural Safety 33, 145-154.
Bichon, B. J. et al. (2008). AIAA Journal 46, 2459-2468.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import linalg
from scipy.special import ndtr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.threads import one_blas_thread
from uqpen.surrogates.active_learning.limit_state_surrogate import (
    LimitStateSurrogate,
    inputs_of,
    mean_and_deviation,
)
from uqpen.surrogates.active_learning.surrogate_states import SurrogateStates
from uqpen.surrogates.gaussian_process_fit import GaussianProcessFit
from uqpen.surrogates.matern import correlations

__all__ = ["EXPECTED_FEASIBILITY", "U_FUNCTION", "LearningCriterion", "choose_batch"]

U_FUNCTION, EXPECTED_FEASIBILITY = "u-function", "expected-feasibility"

# Candidates that are compared by either measure, the likeliest errors of all.
_CANDIDATES = 1000


class LearningCriterion:
    """Criterion by which candidates are compared: how much a run there would teach.

    Parameters
    ----------
    name : str
        ``"u-function"``: the probability that the predicted sign is wrong.
        ``"expected-feasibility"``: how much of the process lies near the limit.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def values(self, means: FloatArray, deviations: FloatArray) -> FloatArray:
        """Return the criterion, larger where a run teaches more, of the same shape."""
        with np.errstate(divide="ignore", invalid="ignore"):
            standardised = np.where(deviations > 0, np.abs(means) / deviations, np.inf)
        if self._name == U_FUNCTION:
            return np.asarray(ndtr(-standardised))
        return deviations * _expected_feasibility(standardised)


def choose_batch(
    surrogate: LimitStateSurrogate,
    states: SurrogateStates,
    incomplete: FloatArray,
    size: int,
    criterion: LearningCriterion,
    runs: int,
) -> IntArray:
    """Return the states of the next batch, one after the other by the criterion.

    Every second point is chosen by the criterion times the probability that a state stands for.
    Otherwise the points near the limit, as there are always some, would keep all others from
    being run, where a small doubt concerns far more inputs.

    A run takes its share of the deviations around it before its result is known, as they do not
    depend on that. So the points of a batch avoid each other, and those of runs that did not
    complete.

    Parameters
    ----------
    surrogate : LimitStateSurrogate
    states : SurrogateStates
        The candidates.
    incomplete : ndarray, shape (run, random input)
        Where runs did not complete.
    size : int
        Number of points; fewer where no other candidate teaches anything.
    criterion : LearningCriterion
    runs : int
        Number of runs so far.

    Returns
    -------
    ndarray of int, shape (point,)
    """
    error = surrogate.predict(states.points).error_probability
    orders = (np.argsort(-each, kind="stable") for each in (error, error * states.weights))
    considered = np.unique(np.concatenate([each[:_CANDIDATES] for each in orders]))
    weights = states.weights[considered]
    with one_blas_thread():
        inputs = inputs_of(surrogate.joint, states.points[considered])
        without = inputs_of(surrogate.joint, incomplete)
        processes = [_Candidates(fit, inputs, without) for fit in surrogate.fits]
        chosen: list[int] = []
        for number in range(size):
            values = _combined(surrogate, processes, criterion)
            values *= weights if (runs + number) % 2 else 1.0
            values[chosen] = 0.0
            best = int(values.argmax())
            if not values[best] > 0:
                break
            chosen.append(best)
            for each in processes:
                each.run_at(best)
    return considered[chosen]


class _Candidates:
    """Candidates as one process sees them, and further runs among them."""

    def __init__(self, fit: GaussianProcessFit, inputs: FloatArray, without: FloatArray) -> None:
        self._fit = fit
        self.means, self._deviations = mean_and_deviation(fit, inputs)
        self._points, self._runs = fit.scaled_coordinates(inputs), fit.points
        among = correlations(fit.points, fit.points, fit.smoothness)
        among[np.diag_indices_from(among)] += fit.nugget
        self._factor = linalg.cholesky(among, lower=True)
        self._rows = self._solved(self._points)
        self._left = self._variances(self._points, self._rows)
        self._first = self._left.copy()
        for point in fit.scaled_coordinates(without):
            self._add(point)

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations, given all runs so far and the points chosen."""
        share: FloatArray = np.sqrt(np.maximum(self._left, 0.0) / self._first)
        return self._deviations * share

    def run_at(self, candidate: int) -> None:
        """Take a candidate for a run."""
        self._add(self._points[candidate])

    def _add(self, point: FloatArray) -> None:
        known = self._solved(point[np.newaxis])
        left = float(self._variances(point[np.newaxis], known)[0])
        between = correlations(point[np.newaxis], self._points, self._fit.smoothness)[0]
        row = (between - known[:, 0] @ self._rows) / np.sqrt(left)
        self._left = self._left - row**2
        self._rows = np.vstack([self._rows, row])
        size = len(self._factor)
        larger = np.zeros((size + 1, size + 1))
        larger[:size, :size] = self._factor
        larger[size, :size], larger[size, size] = known[:, 0], np.sqrt(left)
        self._factor = larger
        self._runs = np.vstack([self._runs, point])

    def _solved(self, points: FloatArray) -> FloatArray:
        between = correlations(self._runs, points, self._fit.smoothness)
        found: FloatArray = linalg.solve_triangular(self._factor, between, lower=True)
        return found

    def _variances(self, points: FloatArray, known: FloatArray) -> FloatArray:
        """Return shares of the variance that are left; at least the noise, which runs keep."""
        least = max(self._fit.nugget, float(np.finfo(np.float64).eps))
        return np.maximum(1 + self._fit.nugget - (known**2).sum(axis=0), least)


def _combined(
    surrogate: LimitStateSurrogate, processes: Sequence[_Candidates], criterion: LearningCriterion
) -> FloatArray:
    """Return the criterion of all limits together, shape (candidate,).

    Where an outcome needs all limits to be as predicted, the most doubtful one counts; where one
    limit suffices for it, the surest.
    """
    means = np.array([each.means for each in processes])
    deviations = np.array([each.deviations for each in processes])
    each = criterion.values(means, deviations)
    met = means > 0
    occurs = met.any(axis=0) if surrogate.event.is_any else met.all(axis=0)
    suffices = np.where(occurs == surrogate.event.is_any, met == occurs, False)
    surest = np.where(suffices, each, np.inf).min(axis=0)
    found: FloatArray = np.where(suffices.any(axis=0), surest, each.max(axis=0))
    return found


def _expected_feasibility(standardised: FloatArray) -> FloatArray:
    """Return E max(ε - |z|, 0) of a normal variable z of deviation 1 and ε = 2 (Bichon, 17)."""
    wide = 2.0
    centre, low, high = standardised, standardised - wide, standardised + wide
    density = _density

    def below(t: FloatArray) -> FloatArray:
        return np.asarray(ndtr(-t))

    # The parts on both sides of the limit, each an integral of a line times the density.
    near = wide * (below(low) - below(high))
    slopes = centre * (2 * below(centre) - below(high) - below(low))
    found: FloatArray = near + slopes - (2 * density(centre) - density(high) - density(low))
    return np.maximum(np.nan_to_num(found, nan=0.0), 0.0)


def _density(t: FloatArray) -> FloatArray:
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(-0.5 * t**2) / np.sqrt(2 * np.pi))
