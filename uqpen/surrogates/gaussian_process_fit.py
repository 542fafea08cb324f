"""Fit of a Gaussian process to one output: its mean and standard deviation given the runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.surrogates.diagnostics import Diagnostic
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.matern import correlations
from uqpen.surrogates.output_fit import OutputFit
from uqpen.surrogates.standardised_inputs import StandardisedInputs

__all__ = ["GaussianProcessFit", "trend_terms"]

# Of a logarithm: a larger one has no lognormal deviation among floating-point numbers.
_LARGEST_DEVIATION = 15.0


@dataclass(frozen=True, eq=False)
class GaussianProcessFit(OutputFit):
    """Gaussian process given the runs of an output, or of its logarithm.

    Parameters
    ----------
    input_is_logarithm, input_location, input_scale : ndarray, shape (input,)
        Map from the inputs to coordinates; see `StandardisedInputs`.
    points : ndarray, shape (run, input)
        Coordinates of the training runs, in units of `lengths`.
    lengths : ndarray, shape (input,)
        Correlation lengths, in standard deviations of the input over the training runs.
    nugget : float
        Variance of the noise, as a share of that of the process.
    weights : ndarray, shape (run,)
        Factors of the correlations with the training runs in the mean.
    trend : ndarray, shape (term,)
        Coefficients of the constant and, of a linear trend, of each coordinate.
    std : float
        Standard deviation of the process, with the factor that runs left out give it.
    std_factor : float
        That factor.
    centre, scale : float
        The fitted variable is `centre` plus `scale` times the process.
    smoothness : float
        That of the Matérn correlations.
    q2 : float
        Share of the variance predicted at runs left out.
    of_logarithm : int
        1 where the process is of the logarithm.
    """

    input_is_logarithm: IntArray
    input_location: FloatArray
    input_scale: FloatArray
    points: FloatArray
    lengths: FloatArray
    nugget: float
    weights: FloatArray
    trend: FloatArray
    std: float
    std_factor: float
    centre: float
    scale: float
    smoothness: float
    q2: float
    of_logarithm: int

    @property
    def is_of_logarithm(self) -> bool:
        """True if it was fitted to the logarithm of the output."""
        return bool(self.of_logarithm)

    def predict(self, points: FloatArray) -> Prediction:
        """Predict the output of a run; see `OutputFit.predict`.

        The deviation contains the noise. Where the logarithm was fitted, the mean is the median of
        the output, as its own mean would hang on the tail of the process.
        """
        scaled = self.scaled_coordinates(points)
        kernel = correlations(scaled, self.points, self.smoothness)
        terms = self._terms(scaled)
        mean = self._mean(kernel, terms)
        deviation = self.scale * self.std * np.sqrt(self._variances(kernel, terms))
        if not self.of_logarithm:
            return Prediction(mean, deviation)
        return Prediction(np.exp(mean), np.exp(mean) * _lognormal_deviations(deviation))

    def predict_mean(self, points: FloatArray) -> FloatArray:
        """Predict without the deviations, which take far longer; see `OutputFit.predict_mean`."""
        scaled = self.scaled_coordinates(points)
        kernel = correlations(scaled, self.points, self.smoothness)
        mean = self._mean(kernel, self._terms(scaled))
        return np.exp(mean) if self.of_logarithm else mean

    def diagnostics(self) -> Iterator[Diagnostic]:
        """Yield its error at runs left out, its noise, and the factor of its deviations."""
        yield Diagnostic("q2", self.q2, "Q², runs left out")
        yield Diagnostic("nugget", self.nugget, "nugget")
        yield Diagnostic("std_factor", self.std_factor, "factor of std")

    def scaled_coordinates(self, points: FloatArray) -> FloatArray:
        """Return the coordinates of points in units of `lengths`, as `points` has them."""
        inputs = StandardisedInputs(self.input_is_logarithm, self.input_location, self.input_scale)
        return inputs.coordinates(points) / self.lengths

    def _terms(self, scaled: FloatArray) -> FloatArray:
        return trend_terms(scaled * self.lengths, is_linear=len(self.trend) > 1)

    def _mean(self, kernel: FloatArray, terms: FloatArray) -> FloatArray:
        return self.centre + self.scale * (terms @ self.trend + kernel @ self.weights)

    def _variances(self, kernel: FloatArray, terms: FloatArray) -> FloatArray:
        """Return the variances given the runs, as shares of that of the process."""
        matrix = correlations(self.points, self.points, self.smoothness)
        matrix[np.diag_indices_from(matrix)] += self.nugget
        factor = linalg.cholesky(matrix, lower=True)
        among = linalg.solve_triangular(factor, self._terms(self.points), lower=True)
        known = linalg.solve_triangular(factor, kernel.T, lower=True)
        unknown = terms.T - among.T @ known
        trend = linalg.cholesky(among.T @ among, lower=True)
        by_trend = linalg.solve_triangular(trend, unknown, lower=True)
        left = 1 + self.nugget - (known**2).sum(axis=0) + (by_trend**2).sum(axis=0)
        # What is left of 1 next to a run may be below 0 by rounding.
        return np.maximum(left, 0.0)


def trend_terms(coordinates: FloatArray, *, is_linear: bool) -> FloatArray:
    """Return the terms of the trend at points, shape (run, term): 1 and, if linear, coordinates."""
    constant = np.ones((len(coordinates), 1))
    return np.hstack([constant, coordinates]) if is_linear else constant


def _lognormal_deviations(deviations: FloatArray) -> FloatArray:
    """Return the standard deviations of lognormal variables of median 1."""
    variances = np.minimum(deviations, _LARGEST_DEVIATION) ** 2
    return np.sqrt(np.expm1(variances) * np.exp(variances))
