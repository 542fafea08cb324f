"""Active learning of a limit state: a surrogate from few runs, corrected by weighted ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from uqpen.core.arrays import FloatArray
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
from uqpen.designs.rare_events.gaussian_mixture import inflation
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.designs.rare_events.rare_event_design import RareEventDesign
from uqpen.designs.rare_events.replicates import Replicate, RequestedPoints
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.active_learning.correction import CorrectionPoints, draw_correction
from uqpen.surrogates.active_learning.learning_points import (
    EXPECTED_FEASIBILITY,
    U_FUNCTION,
    LearningCriterion,
    choose_batch,
)
from uqpen.surrogates.active_learning.limit_state_surrogate import LimitStateSurrogate
from uqpen.surrogates.active_learning.surrogate_states import SurrogateStates, surrogate_states

__all__ = ["ActiveLearning"]

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
