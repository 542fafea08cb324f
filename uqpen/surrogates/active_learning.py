"""Active learning of a limit state: a surrogate from few runs, corrected by weighted ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.special import logsumexp, ndtri
from scipy.stats import qmc

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import (
    CORRECTION_WEIGHT,
    PREDICTED_EVENT,
    PREDICTION_ERROR,
    SEARCH_WEIGHT,
    SURROGATE_PROBABILITY,
    SURROGATE_PROBABILITY_ERROR,
)
from uqpen.core.settings import choice, count, number
from uqpen.core.streams import Stream
from uqpen.core.threads import one_blas_thread
from uqpen.designs.rare_events.importance_sampling import inflation
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.designs.rare_events.rare_event_design import RareEventDesign, Replicate, RequestedPoints
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.limit_state_surrogate import (
    EXPECTED_FEASIBILITY,
    U_FUNCTION,
    LearningCriterion,
    LimitStateSurrogate,
    SurrogateStates,
    choose_batch,
    surrogate_states,
)

__all__ = ["ActiveLearning", "CorrectionPoints", "NormalMixture", "draw_correction"]

# Mixture of normal distributions: an importance density for a rare event.

# Numbers of components that are tried, and steps of each fit.
_COMPONENTS, _STEPS = (1, 2, 4, 8), 25
# Points of a component by coordinate, so that its covariance is known.
_POINTS_PER_INPUT = 20
# Standard deviations of a component grow by this factor: its weights stay bounded where the event
# goes on beyond the points.
_WIDER = 1.2
# Least variance of a component, so that none falls onto a single point.
_LEAST_VARIANCE = 1e-3


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """Mixture of normal distributions.

    Parameters
    ----------
    shares : ndarray, shape (component,)
        They add up to 1.
    means : ndarray, shape (component, input)
    factors : ndarray, shape (component, input, input)
        Lower Cholesky factors of the covariances.
    """

    shares: FloatArray
    means: FloatArray
    factors: FloatArray

    @classmethod
    def of_scales(
        cls, shares: list[float], deviations: list[float], dimension: int
    ) -> NormalMixture:
        """Return a mixture of distributions around the origin, alike in all directions."""
        factors = np.array([each * np.eye(dimension) for each in deviations])
        return cls(np.array(shares), np.zeros((len(shares), dimension)), factors)

    @classmethod
    def fit(
        cls, points: FloatArray, weights: FloatArray, rng: np.random.Generator
    ) -> NormalMixture:
        """Fit weighted points by expectation maximisation, with the best number of components.

        The number is that of the smallest Bayesian information criterion.
        """
        count, dimension = points.shape
        size = weights.sum() ** 2 / (weights**2).sum()
        most = max(1, int(size / (_POINTS_PER_INPUT * dimension)))
        found: list[tuple[float, int, NormalMixture]] = []
        for components in (each for each in _COMPONENTS if each <= min(most, count)):
            mixture = cls._start(points, weights, components, rng)
            for _ in range(_STEPS if components > 1 else 1):
                mixture = mixture._improved(points, weights)
            likelihood = float(mixture.log_density(points) @ weights) / weights.sum() * size
            numbers = components * (1 + dimension + dimension * (dimension + 1) / 2)
            found.append((numbers * math.log(size) - 2 * likelihood, len(found), mixture))
        return min(found)[-1]._wider()

    @staticmethod
    def joined(parts: list[NormalMixture], shares: list[float]) -> NormalMixture:
        """Return the mixture of mixtures."""
        return NormalMixture(
            np.concatenate([a * each.shares for a, each in zip(shares, parts, strict=True)]),
            np.concatenate([each.means for each in parts]),
            np.concatenate([each.factors for each in parts]),
        )

    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the logarithm of the density, shape (point,)."""
        return np.asarray(logsumexp(self._log_parts(points), axis=0))

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return independent draws, shape (point, input)."""
        component = rng.choice(len(self.shares), size=count, p=self.shares / self.shares.sum())
        normal = rng.standard_normal((count, self.means.shape[1]))
        return self.means[component] + np.einsum("nij,nj->ni", self.factors[component], normal)

    def _log_parts(self, points: FloatArray) -> FloatArray:
        constant = 0.5 * points.shape[1] * math.log(2 * math.pi)
        parts = np.empty((len(self.shares), len(points)))
        for row, (mean, factor) in enumerate(zip(self.means, self.factors, strict=True)):
            scaled = linalg.solve_triangular(factor, (points - mean).T, lower=True)
            parts[row] = -0.5 * (scaled**2).sum(axis=0) - np.log(np.diag(factor)).sum()
        return parts + np.log(self.shares)[:, np.newaxis] - constant

    @staticmethod
    def _start(
        points: FloatArray, weights: FloatArray, components: int, rng: np.random.Generator
    ) -> NormalMixture:
        """Return components around points that are far from each other (k-means++)."""
        probabilities = weights / weights.sum()
        chosen = [int(rng.choice(len(points), p=probabilities))]
        distances = np.full(len(points), np.inf)
        for _ in range(components - 1):
            distances = np.minimum(distances, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
            likely = distances * probabilities
            chosen.append(int(rng.choice(len(points), p=likely / likely.sum())))
        covariance = _covariance(points, probabilities) / components
        factor = linalg.cholesky(covariance, lower=True)
        shares = np.full(components, 1 / components)
        return NormalMixture(shares, points[chosen], np.repeat(factor[np.newaxis], components, 0))

    def _improved(self, points: FloatArray, weights: FloatArray) -> NormalMixture:
        parts = self._log_parts(points)
        belongs = np.exp(parts - logsumexp(parts, axis=0)) * (weights / weights.sum())
        shares = np.maximum(belongs.sum(axis=1), 1e-12)
        means = (belongs @ points) / shares[:, np.newaxis]
        factors = [
            linalg.cholesky(_covariance(points - mean, own / share, centred=True), lower=True)
            for own, share, mean in zip(belongs, shares, means, strict=True)
        ]
        return NormalMixture(shares / shares.sum(), means, np.array(factors))

    def _wider(self) -> NormalMixture:
        return NormalMixture(self.shares, self.means, _WIDER * self.factors)


def _covariance(
    points: FloatArray, probabilities: FloatArray, *, centred: bool = False
) -> FloatArray:
    away = points if centred else points - probabilities @ points
    found: FloatArray = (away * probabilities[:, np.newaxis]).T @ away
    return found + _LEAST_VARIANCE * np.eye(points.shape[1])


# Runs that correct a surrogate of a limit state: weighted draws around and far from its limit.

# Draws from the importance density, at which the surrogate alone is evaluated.
_DRAWS = 50_000
# Share of the inflated normal distribution in that density.
_INFLATED = 0.2
# Number of points that a density is fitted to, at least.
_LEAST_STATES = 20
# Times that it is fitted again, and draws that each takes.
_REFITS, _FITTED = 2, 5000


@dataclass(frozen=True, eq=False)
class CorrectionPoints:
    """Points of runs that correct a surrogate, with what it predicts there.

    Parameters
    ----------
    points : ndarray, shape (run, random input)
        In standard normal space.
    weights : ndarray, shape (run,)
        Density of the inputs, over that of all these runs together: a sum of them over the runs
        that are in a set estimates its probability without bias.
    search_weights : ndarray, shape (run,)
        The same by the draws alone which look for what the surrogate does not know.
    occurs : ndarray of bool, shape (run,)
        Where the surrogate predicts the event.
    error_probability : ndarray, shape (run,)
        That of the other outcome, by the surrogate.
    probability, error : float
        Probability of the event by the surrogate alone, and the standard error of its sampling.
    """

    points: FloatArray
    weights: FloatArray
    search_weights: FloatArray
    occurs: BoolArray
    error_probability: FloatArray
    probability: float
    error: float


@one_blas_thread()
def draw_correction(
    surrogate: LimitStateSurrogate | None,
    states: SurrogateStates | None,
    size: int,
    dimension: int,
    stream: Stream,
) -> CorrectionPoints:
    """Draw the points of the runs that correct a surrogate.

    A third are draws from where it predicts the event. A third are draws in proportion to the root
    of the probability that it errs: so the variance of the correction is the least if those
    probabilities are right. A third look for what it does not know, half of them by the inputs' own
    distribution and half by an inflated one. Each run is weighted by all three densities together.

    Parameters
    ----------
    surrogate : LimitStateSurrogate or None
        None where nothing could be fitted: all runs are of the last kind.
    states : SurrogateStates or None
        On the way to its event.
    size : int
        Number of runs.
    dimension : int
        Number of random inputs.
    stream : Stream

    References
    ----------
    Veach, E. & Guibas, L. J. (1995). SIGGRAPH '95, 419-428 (the weights).
    """
    inflated = NormalMixture.of_scales([1.0], [inflation(dimension)], dimension)
    nominal = NormalMixture.of_scales([1.0], [1.0], dimension)
    if surrogate is None or states is None:
        rng = stream.generator("far")
        points = _draw_far(nominal, inflated, size, rng)
        weights = 1 / (size * _far_ratio(points, nominal, inflated))
        nothing = np.zeros(size, dtype=np.bool_)
        return CorrectionPoints(
            points, weights, weights, nothing, np.full(size, np.nan), math.nan, math.nan
        )
    density = _importance_density(surrogate, states, inflated, nominal, stream)
    drawn = density.draw(_DRAWS, stream.generator("draws"))
    ratio = np.exp(nominal.log_density(drawn) - density.log_density(drawn))
    predicted = surrogate.predict(drawn)
    in_event = ratio * predicted.occurs
    doubtful = ratio * np.sqrt(predicted.error_probability)
    counts = _counts(size, has_event=bool(in_event.any()), has_doubt=bool(doubtful.any()))
    chosen = np.concatenate(
        [
            _chosen(in_event, counts[0], stream.generator("event")),
            _chosen(doubtful, counts[1], stream.generator("doubtful")),
        ]
    )
    far = _draw_far(nominal, inflated, counts[2], stream.generator("far"))
    points = np.concatenate([drawn[chosen], far])
    at = surrogate.predict(points)
    by_search = counts[2] * _far_ratio(points, nominal, inflated)
    total = by_search.copy()
    if counts[0]:
        total += counts[0] * at.occurs / in_event.mean()
    if counts[1]:
        total += counts[1] * np.sqrt(at.error_probability) / doubtful.mean()
    return CorrectionPoints(
        points=points,
        weights=1 / total,
        search_weights=1 / by_search,
        occurs=at.occurs,
        error_probability=at.error_probability,
        probability=float(in_event.mean()),
        error=float(in_event.std(ddof=1) / math.sqrt(_DRAWS)),
    )


def _importance_density(
    surrogate: LimitStateSurrogate,
    states: SurrogateStates,
    inflated: NormalMixture,
    nominal: NormalMixture,
    stream: Stream,
) -> NormalMixture:
    """Return a density that is high where the event is predicted or doubtful.

    It is fitted to the states, and then to weighted draws of that, which are independent.
    """
    points, weights = states.points, states.weights
    density = inflated
    for stage in range(1 + _REFITS):
        if stage:
            points = density.draw(_FITTED, stream.generator("fitted", stage))
            weights = np.exp(nominal.log_density(points) - density.log_density(points))
        predicted = surrogate.predict(points)
        wanted = weights * np.maximum(predicted.occurs, np.sqrt(predicted.error_probability))
        used = wanted > 0
        if used.sum() < _LEAST_STATES:
            break
        rng = stream.generator("mixture", stage)
        fitted = NormalMixture.fit(points[used], wanted[used] / wanted[used].max(), rng)
        density = NormalMixture.joined([fitted, inflated], [1 - _INFLATED, _INFLATED])
    return density


def _counts(size: int, *, has_event: bool, has_doubt: bool) -> tuple[int, int, int]:
    third = size // 3
    event, doubtful = third * has_event, third * has_doubt
    return event, doubtful, size - event - doubtful


def _chosen(weights: FloatArray, count: int, rng: np.random.Generator) -> IntArray:
    """Return draws in proportion to weights."""
    if not count:
        return np.empty(0, dtype=np.int64)
    return rng.choice(len(weights), size=count, p=weights / weights.sum())


def _draw_far(
    nominal: NormalMixture, inflated: NormalMixture, count: int, rng: np.random.Generator
) -> FloatArray:
    plain = count // 2
    return np.concatenate([nominal.draw(plain, rng), inflated.draw(count - plain, rng)])


def _far_ratio(points: FloatArray, nominal: NormalMixture, inflated: NormalMixture) -> FloatArray:
    """Return the density of far draws over that of the inputs."""
    ratio: FloatArray = np.exp(inflated.log_density(points) - nominal.log_density(points))
    return 0.5 + 0.5 * ratio


# Runs to learn from where the study states no number: 130 for two inputs.
_LEARNING, _LEARNING_PER_INPUT = 90, 20
# Runs before the first surrogate.
_FIRST, _FIRST_PER_INPUT = 10, 2
# A process takes no more runs.
_MOST_LEARNING = 1500


@dataclass(frozen=True)
class ActiveLearning(RareEventDesign):
    """Active learning of a limit state by Gaussian processes, corrected by weighted runs.

    Parameters
    ----------
    event : str
        The event: ``"depth > 3 m"``, or limits joined by ``and``, or by ``or``.
    learning : int, optional
        Largest number of runs to learn from; by default 90, and 20 for each random input.
    correction : int
        Number of runs that correct the surrogate. The estimate is without bias for any surrogate,
        and its interval follows from these runs.
    batch : int
        Number of runs that are made at once while it learns.
    criterion : str
        Of the next runs: ``"u-function"`` or ``"expected-feasibility"``.
    tolerance : float
        Learning ends where the probability of wrong predictions, as the surrogate itself expects
        it, is at most this share of the probability of the event, after two batches in a row.

    References
    ----------
    Echard, B., Gayton, N. & Lemaire, M. (2011). Structural Safety 33, 145-154 (learning);
    Dubourg, V., Sudret, B. & Deheeger, F. (2013). Probabilistic Engineering Mechanics 33, 47-57
    (a surrogate corrected by importance sampling).
    """

    learning: int | None = count(minimum=20, maximum=_MOST_LEARNING, default=None)
    correction: int = count(minimum=60, maximum=100_000, default=300)
    batch: int = count(maximum=100, default=5)
    criterion: str = choice(U_FUNCTION, EXPECTED_FEASIBILITY, default=U_FUNCTION)
    tolerance: float = number(above=0, below=1, default=0.005)

    @property
    def ends_early(self) -> bool:
        return True

    def run_count(self, joint: JointDistribution) -> int:
        return self._most_learning(joint) + self.correction

    def _most_learning(self, joint: JointDistribution) -> int:
        return self.learning or _LEARNING + _LEARNING_PER_INPUT * len(joint.random)

    def replicate(self, joint: JointDistribution, event: LimitState, stream: Stream) -> Replicate:
        dimension, most = len(joint.random), self._most_learning(joint)
        points = _first_points(min(_FIRST + _FIRST_PER_INPUT * dimension, most), dimension, stream)
        outcomes = (yield _to_learn(points)).outcomes
        converged = 0
        for batch in range(most):
            own = stream.child("batch", batch)
            surrogate = LimitStateSurrogate.fit(
                joint, event, points, outcomes, own.generator("fit")
            )
            states = None
            if surrogate is not None:
                states = surrogate_states(surrogate, dimension, own.generator("states"))
                is_learned = _expected_error(surrogate, states) <= self.tolerance
                converged = converged + 1 if is_learned else 0
            if converged == 2 or len(points) >= most:
                break
            size = min(self.batch, most - len(points))
            further = self._batch(surrogate, states, points, outcomes, size, own)
            made = yield _to_learn(further)
            points = np.concatenate([points, further])
            outcomes = _joined(outcomes, made.outcomes)
        yield _to_correct(
            draw_correction(
                surrogate, states, self.correction, dimension, stream.child("correction")
            )
        )

    def _batch(
        self,
        surrogate: LimitStateSurrogate | None,
        states: SurrogateStates | None,
        points: FloatArray,
        outcomes: EventOutcomes,
        size: int,
        stream: Stream,
    ) -> FloatArray:
        """Return the next points to learn from; without a surrogate, draws of inflated inputs."""
        rng, dimension = stream.generator("points"), points.shape[1]
        drawn: FloatArray = inflation(dimension) * rng.standard_normal((size, dimension))
        if surrogate is None or states is None:
            return drawn
        incomplete = points[outcomes.missing | ~outcomes.belongs]
        criterion = LearningCriterion(self.criterion)
        chosen = choose_batch(surrogate, states, incomplete, size, criterion, len(points))
        drawn[: len(chosen)] = states.points[chosen]
        return drawn


def _first_points(size: int, dimension: int, stream: Stream) -> FloatArray:
    """Return a Latin hypercube of the inflated inputs, in standard normal space."""
    hypercube = qmc.LatinHypercube(dimension, rng=stream.generator("first"))
    found: FloatArray = inflation(dimension) * ndtri(hypercube.random(size))
    return found


def _expected_error(surrogate: LimitStateSurrogate, states: SurrogateStates) -> float:
    """Return the expected probability of wrong predictions, over that of the predicted event."""
    predicted = surrogate.predict(states.points)
    probability = float(states.weights @ predicted.occurs)
    error = float(states.weights @ predicted.error_probability)
    return error / probability if probability > 0 else np.inf


def _joined(one: EventOutcomes, other: EventOutcomes) -> EventOutcomes:
    return EventOutcomes(
        np.concatenate([one.belongs, other.belongs]),
        np.concatenate([one.occurs, other.occurs]),
        np.concatenate([one.missing, other.missing]),
        np.concatenate([one.excess, other.excess], axis=1),
    )


def _to_learn(points: FloatArray) -> RequestedPoints:
    """Return points of runs that no estimate is made from: their weight is 0."""
    unknown = np.full(len(points), np.nan)
    return RequestedPoints(
        points,
        {
            CORRECTION_WEIGHT: np.zeros(len(points)),
            SEARCH_WEIGHT: np.zeros(len(points)),
            PREDICTED_EVENT: np.full(len(points), -1),
            PREDICTION_ERROR: unknown,
            SURROGATE_PROBABILITY: unknown,
            SURROGATE_PROBABILITY_ERROR: unknown,
        },
    )


def _to_correct(runs: CorrectionPoints) -> RequestedPoints:
    size = len(runs.points)
    return RequestedPoints(
        runs.points,
        {
            CORRECTION_WEIGHT: runs.weights,
            SEARCH_WEIGHT: runs.search_weights,
            PREDICTED_EVENT: runs.occurs.astype(np.int64),
            PREDICTION_ERROR: runs.error_probability,
            SURROGATE_PROBABILITY: np.full(size, runs.probability),
            SURROGATE_PROBABILITY_ERROR: np.full(size, runs.error),
        },
    )
