"""Points from which a surrogate of a limit state learns the most: the batches of active learning.

References
----------
Echard, B., Gayton, N. & Lemaire, M. (2011). Structural Safety 33, 145-154.
Bichon, B. J. et al. (2008). AIAA Journal 46, 2459-2468.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg
from scipy.special import log_ndtr, ndtr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.processors import one_blas_thread
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.designs.rare_events.subset_simulation import ConditionalSampling
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.gaussian_process import GaussianProcess
from uqpen.surrogates.gaussian_process_fit import (
    GaussianProcessFit,
    StandardisedInputs,
    correlations,
)

# Surrogate of a limit state: a Gaussian process for the excess over each limit.

# Points that are predicted at a time: their correlations with the runs stay small in memory.
_PART = 8192


class PredictedEvents(NamedTuple):
    """Predictions of an event."""

    occurs: BoolArray  # (point,): true where the means of the processes predict the event
    error_probability: FloatArray  # (point,): that of the other outcome than the predicted one


@dataclass(frozen=True, eq=False)
class LimitStateSurrogate:
    """Gaussian processes of the excess of each output over its limit."""

    joint: JointDistribution
    event: LimitState
    # One for each limit, in units of the distances in which limits are compared.
    fits: tuple[GaussianProcessFit, ...]

    @classmethod
    @one_blas_thread()
    def fit(
        cls,
        joint: JointDistribution,
        event: LimitState,
        points: FloatArray,
        outcomes: EventOutcomes,
        rng: np.random.Generator,
    ) -> LimitStateSurrogate | None:
        """Fit the completed runs; None where they are too few or all alike.

        The points, of shape (run, random input), are in standard normal space.
        """
        completed = outcomes.belongs & ~outcomes.missing
        scales = event.scales(outcomes)
        values = outcomes.excess[:, completed] / scales[:, np.newaxis]
        inputs = _inputs_of(joint, points[completed])
        distributions = [each.distribution for each in joint.random]
        fits = []
        for own in values:
            if not len(own) or not np.ptp(own) > 0 or not np.isfinite(own).all():
                return None
            coordinates = StandardisedInputs.of_runs(distributions, inputs)
            fit = GaussianProcess(design="learning").fit_values(coordinates, inputs, own, rng)
            if isinstance(fit, str):
                return None
            fits.append(fit)
        return cls(joint, event, tuple(fits))

    @one_blas_thread()
    def predict_performance(self, points: FloatArray) -> FloatArray:
        """Return the performance by the means, shape (point,), at points of normal space.

        It is above 0 where the event is predicted.
        """
        means = np.empty((len(self.fits), len(points)))
        for part, inputs in self._parts(points):
            for number, fit in enumerate(self.fits):
                means[number, part] = fit.predict_mean(inputs)
        return self._performance(means)

    @one_blas_thread()
    def predict(self, points: FloatArray) -> PredictedEvents:
        """Predict the event at points of standard normal space, shape (point, random input)."""
        means, deviations = np.empty((2, len(self.fits), len(points)))
        for part, inputs in self._parts(points):
            for number, fit in enumerate(self.fits):
                means[number, part], deviations[number, part] = _mean_and_deviation(fit, inputs)
        occurs = self._performance(means) > 0
        sign = -1 if self.event.is_any else 1
        # Of no limit met, or of all of them, by processes that are independent given the runs.
        together = log_ndtr(sign * (means / deviations)).sum(axis=0)
        likely, unlikely = np.exp(together), -np.expm1(together)
        return PredictedEvents(occurs, np.where(occurs == self.event.is_any, likely, unlikely))

    def _parts(self, points: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
        """Yield parts of the points, with their inputs in SI units."""
        for start in range(0, len(points), _PART):
            part = slice(start, start + _PART)
            yield part, _inputs_of(self.joint, points[part])

    def _performance(self, means: FloatArray) -> FloatArray:
        found: FloatArray = means.max(axis=0) if self.event.is_any else means.min(axis=0)
        return found


def _mean_and_deviation(
    fit: GaussianProcessFit, inputs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the mean of a process and its standard deviation, above 0, at inputs in SI units."""
    predicted = fit.predict(inputs)
    deviation = np.zeros(len(inputs)) if predicted.std is None else predicted.std
    return predicted.mean, np.maximum(deviation, np.finfo(np.float64).tiny)


def _inputs_of(joint: JointDistribution, points: FloatArray) -> FloatArray:
    """Return the random inputs at points of standard normal space, in SI units, alike in shape."""
    values = joint.ppf(joint.conditional_probabilities(ndtr(points), {}))
    names: Sequence[str] = [each.variable.name for each in joint.random]
    return np.column_stack([values[name] for name in names])


# States on the way to the event, by subset simulation of a surrogate of the limit state.

# States at each level, chains of each, and the largest number of levels: 1e-12 is as small as
# standard normal distributions have room for beyond the runs.
_STATES, _CHAINS, _LEVELS = 1000, 100, 12


@dataclass(frozen=True, eq=False)
class SurrogateStates:
    """States of all levels."""

    points: FloatArray  # (state, input): in standard normal space
    # (state,): probability that each stands for; that of the states before the last level without
    # those that have reached the next one.
    weights: FloatArray


def surrogate_states(
    surrogate: LimitStateSurrogate, dimension: int, rng: np.random.Generator
) -> SurrogateStates:
    """Move states towards the event of a surrogate, until it is no longer rare among them."""
    points = rng.standard_normal((_STATES, dimension))
    performance = surrogate.predict_performance(points)
    sampling = ConditionalSampling()
    probability, visited, weights = 1.0, [], []
    for level in range(_LEVELS):
        excluded = performance < np.partition(performance, -_CHAINS)[-_CHAINS]
        threshold = min(float(performance.max(where=excluded, initial=-math.inf)), 0.0)
        reached = performance > threshold
        is_last = threshold == 0 or level == _LEVELS - 1 or not excluded.any()
        visited.append(points)
        weights.append(np.where(reached & (not is_last), 0.0, probability / _STATES))
        if is_last:
            break
        probability *= float(reached.mean())
        seeds = rng.permutation(np.flatnonzero(reached))[:_CHAINS]
        points, performance = points[seeds], performance[seeds]
        of_chains, shares = [(points, performance)], []
        for _ in range(math.ceil(_STATES / _CHAINS) - 1):
            candidates = sampling.candidates(points, rng)
            new = surrogate.predict_performance(candidates)
            accepted = new > threshold
            points = np.where(accepted[:, np.newaxis], candidates, points)
            performance = np.where(accepted, new, performance)
            shares.append(float(accepted.mean()))
            of_chains.append((points, performance))
        points, performance = map(np.concatenate, zip(*of_chains, strict=True))
        sampling = sampling.following(float(np.mean(shares)))
    return SurrogateStates(np.concatenate(visited), np.concatenate(weights))


U_FUNCTION, EXPECTED_FEASIBILITY = "u-function", "expected-feasibility"

# Candidates that are compared by either measure, the likeliest errors of all.
_CANDIDATES = 1000


def learning_criterion(name: str, means: FloatArray, deviations: FloatArray) -> FloatArray:
    """Return how much a run at each candidate would teach, of the shape of the means.

    It is ``"u-function"``, the probability that the predicted sign is wrong, or
    ``"expected-feasibility"``: how much of the process lies near the limit.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        standardised = np.where(deviations > 0, np.abs(means) / deviations, np.inf)
    if name == U_FUNCTION:
        return np.asarray(ndtr(-standardised))
    return deviations * _expected_feasibility(standardised)


def choose_batch(
    surrogate: LimitStateSurrogate,
    states: SurrogateStates,
    incomplete: FloatArray,
    size: int,
    criterion: str,
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
    states : SurrogateStates
        The candidates.
    incomplete : ndarray, shape (run, random input)
        Where runs did not complete.
    size : int
        Number of points; fewer where no other candidate teaches anything.
    criterion : str
        As `learning_criterion` takes it.

    Returns
    -------
    ndarray of int, shape (point,)
    """
    error = surrogate.predict(states.points).error_probability
    orders = (np.argsort(-each, kind="stable") for each in (error, error * states.weights))
    considered = np.unique(np.concatenate([each[:_CANDIDATES] for each in orders]))
    weights = states.weights[considered]
    with one_blas_thread():
        inputs = _inputs_of(surrogate.joint, states.points[considered])
        without = _inputs_of(surrogate.joint, incomplete)
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
        self.means, self._deviations = _mean_and_deviation(fit, inputs)
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
    surrogate: LimitStateSurrogate, processes: Sequence[_Candidates], criterion: str
) -> FloatArray:
    """Return the criterion of all limits together, shape (candidate,).

    Where an outcome needs all limits to be as predicted, the most doubtful one counts; where one
    limit suffices for it, the surest.
    """
    means = np.array([each.means for each in processes])
    deviations = np.array([each.deviations for each in processes])
    each = learning_criterion(criterion, means, deviations)
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

    def below(t: FloatArray) -> FloatArray:
        return np.asarray(ndtr(-t))

    def density(t: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):
            return np.asarray(np.exp(-0.5 * t**2) / np.sqrt(2 * np.pi))

    # The parts on both sides of the limit, each an integral of a line times the density.
    near = wide * (below(low) - below(high))
    slopes = centre * (2 * below(centre) - below(high) - below(low))
    found: FloatArray = near + slopes - (2 * density(centre) - density(high) - density(low))
    return np.maximum(np.nan_to_num(found, nan=0.0), 0.0)
