"""Surrogate of a limit state: a Gaussian process for the excess over each limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.threads import one_blas_thread
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.surrogates.gaussian_process import GaussianProcess
from uqpen.surrogates.gaussian_process_fit import GaussianProcessFit
from uqpen.surrogates.standardised_inputs import StandardisedInputs

__all__ = ["LimitStateSurrogate", "PredictedEvents", "inputs_of", "mean_and_deviation"]

# Points that are predicted at a time: their correlations with the runs stay small in memory.
_PART = 8192


@dataclass(frozen=True, eq=False)
class PredictedEvents:
    """Predictions of an event.

    Parameters
    ----------
    performance : ndarray, shape (point,)
        By the means of the processes; above 0 where the event is predicted.
    probability : ndarray, shape (point,)
        That of the event.
    error_probability : ndarray, shape (point,)
        That of the other outcome than the predicted one.
    """

    performance: FloatArray
    probability: FloatArray
    error_probability: FloatArray

    @property
    def occurs(self) -> BoolArray:
        """True where the event is predicted."""
        return np.asarray(self.performance > 0)


@dataclass(frozen=True, eq=False)
class LimitStateSurrogate:
    """Gaussian processes of the excess of each output over its limit.

    Parameters
    ----------
    joint : JointDistribution
    event : LimitState
    fits : tuple of GaussianProcessFit
        One for each limit, in units of `scales`.
    scales : ndarray, shape (limit,)
        Distances in which limits of different outputs are compared.
    """

    joint: JointDistribution
    event: LimitState
    fits: tuple[GaussianProcessFit, ...]
    scales: FloatArray

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

        Parameters
        ----------
        joint : JointDistribution
        event : LimitState
        points : ndarray, shape (run, random input)
            In standard normal space.
        outcomes : EventOutcomes
        rng : Generator
        """
        completed = outcomes.belongs & ~outcomes.missing
        scales = event.scales(outcomes)
        values = outcomes.excess[:, completed] / scales[:, np.newaxis]
        inputs = inputs_of(joint, points[completed])
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
        return cls(joint, event, tuple(fits), scales)

    def predict_performance(self, points: FloatArray) -> FloatArray:
        """Return the performance by the means, shape (point,), at points of normal space."""
        return self._performance(self._means(points))

    @one_blas_thread()
    def predict(self, points: FloatArray) -> PredictedEvents:
        """Predict the event at points of standard normal space, shape (point, random input)."""
        means, deviations = np.empty((2, len(self.fits), len(points)))
        for start in range(0, len(points), _PART):
            part = slice(start, start + _PART)
            inputs = inputs_of(self.joint, points[part])
            for number, fit in enumerate(self.fits):
                means[number, part], deviations[number, part] = mean_and_deviation(fit, inputs)
        return self._events(means, deviations)

    def _events(self, means: FloatArray, deviations: FloatArray) -> PredictedEvents:
        performance = self._performance(means)
        standardised = means / deviations
        sign = -1 if self.event.is_any else 1
        # Of no limit met, or of all of them, by processes that are independent given the runs.
        together = log_ndtr(sign * standardised).sum(axis=0)
        likely, unlikely = np.exp(together), -np.expm1(together)
        probability = unlikely if self.event.is_any else likely
        otherwise = likely if self.event.is_any else unlikely
        error = np.where(performance > 0, otherwise, probability)
        return PredictedEvents(performance, probability, error)

    @one_blas_thread()
    def _means(self, points: FloatArray) -> FloatArray:
        means = np.empty((len(self.fits), len(points)))
        for start in range(0, len(points), _PART):
            part = slice(start, start + _PART)
            inputs = inputs_of(self.joint, points[part])
            for number, fit in enumerate(self.fits):
                means[number, part] = fit.predict_mean(inputs)
        return means

    def _performance(self, means: FloatArray) -> FloatArray:
        found: FloatArray = means.max(axis=0) if self.event.is_any else means.min(axis=0)
        return found


def mean_and_deviation(
    fit: GaussianProcessFit, inputs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the mean of a process and its standard deviation, above 0, at inputs in SI units."""
    predicted = fit.predict(inputs)
    deviation = np.zeros(len(inputs)) if predicted.std is None else predicted.std
    return predicted.mean, np.maximum(deviation, np.finfo(np.float64).tiny)


def inputs_of(joint: JointDistribution, points: FloatArray) -> FloatArray:
    """Return the random inputs at points of standard normal space, in SI units, alike in shape."""
    values = joint.ppf(joint.conditional_probabilities(ndtr(points), {}))
    names: Sequence[str] = [each.variable.name for each in joint.random]
    return np.column_stack([values[name] for name in names])
