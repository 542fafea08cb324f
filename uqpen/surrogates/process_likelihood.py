"""Likelihood of a Gaussian process: its lengths and its nugget from the runs.

The coefficients of the trend and the variance follow from the other parameters. What is maximised
is the restricted likelihood, which allows for the coefficients of the trend, and so does not take
the variance too small where there are few runs.

References
----------
Santner, T. J., Williams, B. J. & Notz, W. I. (2018). The Design and Analysis of Computer
Experiments, 2nd ed. Springer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, optimize

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.surrogates.matern import correlations, correlations_and_slopes

__all__ = [
    "FEW_RUNS",
    "ConditionedProcess",
    "Parameters",
    "ProcessData",
    "improve_parameters",
    "likeliest_parameters",
    "negative_log_likelihood",
]

# Ranges of the lengths, for coordinates of variance 1, and of a nugget that is estimated.
_LENGTHS = (0.01, 300.0)
_NUGGETS = (1e-10, 10.0)

# First searches start from a long length for each input and one of these nuggets, and from lengths
# beside it, at most a factor of e away. The best of them is continued.
_STARTS = 3
_START_NUGGETS = (1e-6, 1e-2, 1e-6)
_FIRST_STEPS, _STEPS = 30, 200
# Of more runs than this, first searches take a part, and the last one fewer steps.
FEW_RUNS = 300
_STEPS_OF_MANY = 15
# A search ends where a step changes the likelihood by less than this share of its logarithm.
_TOLERANCE = 1e-8

# The value where correlations are singular to rounding: worse than any other.
_SINGULAR = 1e10


@dataclass(frozen=True, eq=False)
class Parameters:
    """Parameters that the correlations depend on.

    Parameters
    ----------
    lengths : ndarray, shape (input,)
        In the units of the coordinates.
    nugget : float
        Variance of the noise, as a share of that of the process.
    """

    lengths: FloatArray
    nugget: float


@dataclass(frozen=True, eq=False)
class ProcessData:
    """Runs that a Gaussian process is fitted to.

    Parameters
    ----------
    points : ndarray, shape (run, input)
        Coordinates of variance about 1.
    values : ndarray, shape (run,)
        The output, of variance about 1.
    trend : ndarray, shape (run, term)
        The terms of the trend at the points.
    smoothness : float
        That of the Matérn correlations.
    nugget : float or None
        A given nugget; None if it is estimated.
    """

    points: FloatArray
    values: FloatArray
    trend: FloatArray
    smoothness: float
    nugget: float | None = None

    def part(self, runs: IntArray) -> ProcessData:
        """Return some of the runs."""
        points, values, trend = self.points[runs], self.values[runs], self.trend[runs]
        return replace(self, points=points, values=values, trend=trend)


@dataclass(frozen=True, eq=False)
class ConditionedProcess:
    """Gaussian process given its runs, at some lengths and nugget.

    Parameters
    ----------
    inverse : ndarray, shape (run, run)
        R⁻¹ - R⁻¹H (HᵀR⁻¹H)⁻¹ HᵀR⁻¹, with R the correlations and H the trend: all that a likelihood
        needs of both.
    weights : ndarray, shape (run,)
        It times the values.
    coefficients : ndarray, shape (term,)
        Of the trend, by generalised least squares.
    variance : float
        That of the process.
    log_determinants : float
        ln det R + ln det HᵀR⁻¹H.
    """

    inverse: FloatArray
    weights: FloatArray
    coefficients: FloatArray
    variance: float
    log_determinants: float

    @classmethod
    def of_runs(
        cls, data: ProcessData, parameters: Parameters, correlation: FloatArray | None = None
    ) -> ConditionedProcess | None:
        """Condition a process on its runs; None where they are singular to rounding.

        Parameters
        ----------
        data : ProcessData
        parameters : Parameters
        correlation : ndarray, shape (run, run), optional
            Between the runs without the nugget, if it is known. It is overwritten.
        """
        if correlation is None:
            scaled = data.points / parameters.lengths
            correlation = correlations(scaled, scaled, data.smoothness)
        correlation[np.diag_indices_from(correlation)] += parameters.nugget
        factor, fault = linalg.lapack.dpotrf(correlation.T, lower=True, overwrite_a=True)
        if fault:
            return None
        log_determinant = 2 * np.log(np.diag(factor)).sum()
        # Solved, not multiplied by the inverse: what is left of the values stays near rounding.
        solved = linalg.cho_solve((factor, True), np.column_stack([data.values, data.trend]))
        by_values, by_trend = solved[:, 0], solved[:, 1:]
        trend = linalg.cholesky(data.trend.T @ by_trend, lower=True)
        coefficients = linalg.cho_solve((trend, True), data.trend.T @ by_values)
        weights = by_values - by_trend @ coefficients
        variance = float(data.values @ weights) / (len(data.values) - len(trend))
        if not variance > 0:
            return None
        lower, _ = linalg.lapack.dpotri(factor, lower=True, overwrite_c=True)
        projected = linalg.solve_triangular(trend, by_trend.T, lower=True)
        return cls(
            inverse=np.tril(lower) + np.tril(lower, -1).T - projected.T @ projected,
            weights=weights,
            coefficients=coefficients,
            variance=variance,
            log_determinants=float(log_determinant + 2 * np.log(np.diag(trend)).sum()),
        )


def negative_log_likelihood(data: ProcessData, parameters: Parameters) -> tuple[float, FloatArray]:
    """Return minus twice the restricted log-likelihood, but for a constant, and its gradient.

    Returns
    -------
    value : float
    gradient : ndarray, shape (input + 1,)
        In the logarithms of the lengths and of the nugget.
    """
    scaled = data.points / parameters.lengths
    correlation, slopes = correlations_and_slopes(scaled, data.smoothness)
    process = ConditionedProcess.of_runs(data, parameters, correlation)
    if process is None:
        return _SINGULAR, np.zeros(scaled.shape[1] + 1)
    freedom = len(data.values) - data.trend.shape[1]
    value = freedom * math.log(process.variance) + process.log_determinants
    change = process.inverse
    change -= np.outer(process.weights, process.weights / process.variance)
    by_nugget = parameters.nugget * np.trace(change)
    # A sum over pairs of w (x - x')² is one over points: 2 x² Σ w - 2 x w x'. A point is no pair.
    change *= slopes
    np.fill_diagonal(change, 0.0)
    by_length = 2 * (change.sum(axis=1) @ scaled**2 - (scaled * (change @ scaled)).sum(axis=0))
    return value, np.append(by_length, by_nugget)


def likeliest_parameters(data: ProcessData, rng: np.random.Generator) -> Parameters:
    """Search for the parameters of the largest likelihood.

    The search starts more than once, as a likelihood may have several maxima.

    Parameters
    ----------
    data : ProcessData
    rng : Generator
        For the starts, and the part of many runs that is searched.
    """
    count, inputs = data.points.shape
    is_large = count > FEW_RUNS
    some = data.part(rng.choice(count, FEW_RUNS, replace=False)) if is_large else data
    shifts = np.vstack([np.zeros(inputs), rng.uniform(-1, 1, (_STARTS - 1, inputs))])
    starts = (
        Parameters(2 * math.sqrt(inputs) * np.exp(shift), nugget)
        for shift, nugget in zip(shifts, _START_NUGGETS, strict=True)
    )
    found = [improve_parameters(some, start, _FIRST_STEPS) for start in starts]
    best = min(found, key=lambda each: negative_log_likelihood(some, each)[0])
    return improve_parameters(data, best, _STEPS_OF_MANY if is_large else _STEPS)


def improve_parameters(data: ProcessData, start: Parameters, steps: int) -> Parameters:
    """Search from some parameters on, for a number of steps at most."""
    is_free = data.nugget is None
    inputs = len(start.lengths)

    def parameters(logarithms: FloatArray) -> Parameters:
        nugget = math.exp(logarithms[-1]) if data.nugget is None else data.nugget
        return Parameters(np.exp(logarithms[:inputs]), nugget)

    def objective(logarithms: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = negative_log_likelihood(data, parameters(logarithms))
        return value, gradient[: len(logarithms)]

    found = optimize.minimize(
        objective,
        np.log([*start.lengths, *[start.nugget] * is_free]),
        jac=True,
        method="L-BFGS-B",
        bounds=np.log([*[_LENGTHS] * inputs, *[_NUGGETS] * is_free]),
        options={"maxiter": steps, "ftol": _TOLERANCE},
    )
    return parameters(found.x)
