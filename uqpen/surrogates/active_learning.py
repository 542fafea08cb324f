"""Active learning of a limit state: a surrogate from few runs, corrected by weighted ones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.special import logsumexp, ndtri
from scipy.stats import qmc

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import (
    CORRECTION_WEIGHT,
    PREDICTED_EVENT,
    PREDICTION_ERROR,
    SEARCH_WEIGHT,
    SURROGATE_PROBABILITY,
    SURROGATE_PROBABILITY_ERROR,
)
from uqpen.core.processors import one_blas_thread
from uqpen.core.settings import choice, count, number
from uqpen.core.streams import Stream
from uqpen.designs.design import NO_STEP_BETWEEN_LABELS
from uqpen.designs.rare_events.importance_sampling import inflation
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.designs.rare_events.rare_event_design import RareEventDesign, Replicate, RequestedPoints
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.limit_state_surrogate import (
    EXPECTED_FEASIBILITY,
    U_FUNCTION,
    LimitStateSurrogate,
    SurrogateStates,
    choose_batch,
    surrogate_states,
)

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
    """Mixture of normal distributions."""

    shares: FloatArray  # (component,): they add up to 1
    means: FloatArray  # (component, input)
    factors: FloatArray  # (component, input, input): lower Cholesky factors of the covariances

    @classmethod
    def around_origin(cls, deviation: float, dimension: int) -> NormalMixture:
        """Return one distribution around the origin, alike in all directions."""
        return cls(np.ones(1), np.zeros((1, dimension)), deviation * np.eye(dimension)[np.newaxis])

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
        best = min(found)[-1]
        return cls(best.shares, best.means, _WIDER * best.factors)

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


@one_blas_thread()
def draw_correction(
    surrogate: LimitStateSurrogate | None,
    states: SurrogateStates | None,
    size: int,
    dimension: int,
    stream: Stream,
) -> RequestedPoints:
    """Draw the points of the runs that correct a surrogate.

    A third are draws from where it predicts the event. A third are draws in proportion to the root
    of the probability that it errs: so the variance of the correction is the least if those
    probabilities are right. A third look for what it does not know, half of them by the inputs' own
    distribution and half by an inflated one. Each run is weighted by all three densities together:
    a sum of the weights over the runs that are in a set estimates its probability without bias.

    Parameters
    ----------
    surrogate : LimitStateSurrogate or None
        None where nothing could be fitted: all runs are of the last kind.
    states : SurrogateStates or None
        On the way to its event.
    size, dimension : int
        Numbers of runs and of random inputs.

    References
    ----------
    Veach, E. & Guibas, L. J. (1995). SIGGRAPH '95, 419-428 (the weights).
    """
    inflated = NormalMixture.around_origin(inflation(dimension), dimension)
    nominal = NormalMixture.around_origin(1.0, dimension)

    def far_points(count: int) -> FloatArray:
        rng = stream.generator("far")
        return np.concatenate(
            [nominal.draw(count // 2, rng), inflated.draw(count - count // 2, rng)]
        )

    def far_ratio(points: FloatArray) -> FloatArray:
        """Return the density of far draws over that of the inputs."""
        ratio: FloatArray = np.exp(inflated.log_density(points) - nominal.log_density(points))
        return 0.5 + 0.5 * ratio

    if surrogate is None or states is None:
        points = far_points(size)
        weights = 1 / (size * far_ratio(points))
        return _requested(points, weights=weights, search_weights=weights, occurs=0)
    density = _importance_density(surrogate, states, inflated, nominal, stream)
    drawn = density.draw(_DRAWS, stream.generator("draws"))
    ratio = np.exp(nominal.log_density(drawn) - density.log_density(drawn))
    predicted = surrogate.predict(drawn)
    in_event = ratio * predicted.occurs
    doubtful = ratio * np.sqrt(predicted.error_probability)
    events, doubts = (size // 3 * bool(each.any()) for each in (in_event, doubtful))
    searches = size - events - doubts
    chosen = [
        stream.generator(purpose).choice(_DRAWS, size=count, p=weights / weights.sum())
        for purpose, count, weights in (("event", events, in_event), ("doubtful", doubts, doubtful))
        if count
    ]
    points = np.concatenate([*(drawn[each] for each in chosen), far_points(searches)])
    at = surrogate.predict(points)
    by_search = searches * far_ratio(points)
    total = by_search.copy()
    if events:
        total += events * at.occurs / in_event.mean()
    if doubts:
        total += doubts * np.sqrt(at.error_probability) / doubtful.mean()
    return _requested(
        points,
        weights=1 / total,
        search_weights=1 / by_search,
        occurs=at.occurs.astype(np.int64),
        error_probability=at.error_probability,
        probability=float(in_event.mean()),
        error=float(in_event.std(ddof=1) / math.sqrt(_DRAWS)),
    )


def _requested(
    points: FloatArray,
    *,
    weights: FloatArray | float = 0.0,
    search_weights: FloatArray | float = 0.0,
    occurs: IntArray | int = -1,
    error_probability: FloatArray | float = math.nan,
    probability: float = math.nan,
    error: float = math.nan,
) -> RequestedPoints:
    """Return points with what their analysis needs; by default of runs without an estimate.

    Parameters
    ----------
    points : ndarray, shape (run, random input)
        In standard normal space.
    weights : ndarray, shape (run,)
        Density of the inputs, over that of all these runs together.
    search_weights : ndarray, shape (run,)
        The same by the draws alone which look for what the surrogate does not know.
    occurs, error_probability : ndarray, shape (run,)
        Whether the surrogate predicts the event (-1: unknown), and that it is wrong.
    probability, error : float
        Probability of the event by the surrogate alone, and the standard error of its sampling.
    """
    columns = {
        CORRECTION_WEIGHT: weights,
        SEARCH_WEIGHT: search_weights,
        PREDICTED_EVENT: occurs,
        PREDICTION_ERROR: error_probability,
        SURROGATE_PROBABILITY: probability,
        SURROGATE_PROBABILITY_ERROR: error,
    }
    return RequestedPoints(
        points, {key: np.full(len(points), each) for key, each in columns.items()}
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
        parts = ((1 - _INFLATED, fitted), (_INFLATED, inflated))
        density = NormalMixture(
            np.concatenate([share * each.shares for share, each in parts]),
            np.concatenate([each.means for _, each in parts]),
            np.concatenate([each.factors for _, each in parts]),
        )
    return density


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

    unordered_reason = NO_STEP_BETWEEN_LABELS

    needs_numbers = True

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
        # A Latin hypercube of the inflated inputs.
        hypercube = qmc.LatinHypercube(dimension, rng=stream.generator("first"))
        first = min(_FIRST + _FIRST_PER_INPUT * dimension, most)
        points: FloatArray = inflation(dimension) * ndtri(hypercube.random(first))
        outcomes = (yield _requested(points)).outcomes
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
            made = (yield _requested(further)).outcomes
            points = np.concatenate([points, further])
            # Runs are the last axis of all of them.
            outcomes = EventOutcomes(
                *(np.concatenate(pair, axis=-1) for pair in zip(outcomes, made, strict=True))
            )
        yield draw_correction(
            surrogate, states, self.correction, dimension, stream.child("correction")
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
        chosen = choose_batch(surrogate, states, incomplete, size, self.criterion, len(points))
        drawn[: len(chosen)] = states.points[chosen]
        return drawn


def _expected_error(surrogate: LimitStateSurrogate, states: SurrogateStates) -> float:
    """Return the expected probability of wrong predictions, over that of the predicted event."""
    predicted = surrogate.predict(states.points)
    probability = float(states.weights @ predicted.occurs)
    error = float(states.weights @ predicted.error_probability)
    return error / probability if probability > 0 else np.inf
