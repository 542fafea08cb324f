"""Accuracy of estimates, its convergence rate and its comparison: formulas over repeats.

All formulas use logarithms of root mean square errors, because methods differ by factors. The
errors of estimates are usually far from normal, so their squares do not follow a chi-square
distribution. The standard error of a logarithm is estimated by the jackknife over repeats.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import student_quantile

__all__ = [
    "Accuracy",
    "ErrorRatio",
    "convergence_slope",
    "error_ratio",
    "root_mean_square_errors",
]


# With a kurtosis of the errors above this, too few repeats dominate their mean square for a
# reliable interval; for normally distributed errors the kurtosis is 3.
_HEAVY_KURTOSIS = 6.0


@dataclass(frozen=True)
class Accuracy:
    """Root mean square errors.

    Parameters
    ----------
    logarithm : ndarray
        Natural logarithm of each; minus infinity where no repeat has an error, NaN where some
        repeat has no estimate.
    error : ndarray
        Standard error of each logarithm; NaN where it cannot be estimated.
    is_heavy : ndarray of bool
        True where a few of the repeats dominate it, so that rarer ones may make it larger.
    repeats : int
        Number of repeats.
    """

    logarithm: FloatArray
    error: FloatArray
    is_heavy: BoolArray
    repeats: int

    def __getitem__(self, at: Any) -> Accuracy:
        return Accuracy(self.logarithm[at], self.error[at], self.is_heavy[at], self.repeats)

    @property
    def reliable_error(self) -> FloatArray:
        """Standard error of each logarithm; NaN where a few of the repeats decide."""
        return np.where(self.is_heavy, np.nan, self.error)

    @property
    def bounds(self) -> FloatArray:
        """Root mean squares and their `reliable_error` bounds, along a last axis."""
        half = student_quantile(self.repeats - 1, LEVEL) * self.reliable_error
        ends = [self.logarithm, self.logarithm - half, self.logarithm + half]
        return np.asarray(np.exp(np.stack(ends, axis=-1)))


@dataclass(frozen=True)
class ErrorRatio:
    """Factor by which one method's error is below another's, and its interval."""

    factor: float
    lower: float
    upper: float

    @property
    def is_significant(self) -> bool:
        """True if the interval lies above 1."""
        return self.lower > 1


def root_mean_square_errors(errors: FloatArray) -> Accuracy:
    """Return root mean squares over repeats, with the jackknife's errors of their logarithms.

    Parameters
    ----------
    errors : ndarray, shape (..., repeat)
        Estimates less the truth.

    References
    ----------
    Efron, B. & Stein, C. (1981). Ann. Stat. 9, 586-596.
    """
    repeats = errors.shape[-1]
    squares = errors**2
    total = squares.sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(total / repeats) / 2
        # The differences of large numbers may come out below zero by rounding.
        others = np.maximum(total[..., np.newaxis] - squares, 0.0)
        without = np.log(others / (repeats - 1)) / 2
        deviations = without - without.mean(axis=-1, keepdims=True)
        variance = (deviations**2).sum(axis=-1) * (repeats - 1) / repeats
        # Over the largest, as the squares of squares of what is small vanish.
        scaled = squares / squares.max(axis=-1, keepdims=True)
        kurtosis = repeats * (scaled**2).sum(axis=-1) / scaled.sum(axis=-1) ** 2
    error = np.sqrt(np.where(np.isfinite(variance), variance, np.nan))
    return Accuracy(logarithm, error, kurtosis > _HEAVY_KURTOSIS, repeats)


def convergence_slope(
    logarithm: FloatArray, error: FloatArray, runs: FloatArray, repeats: int
) -> FloatArray:
    """Return the slope of the straight line through logarithms of errors over those of runs.

    The line is fitted by least squares. The interval covers the noise of the errors only: it is the
    interval of the line through these budgets, even if the errors do not lie on a line.

    Parameters
    ----------
    logarithm, error : ndarray, shape (budget, ...)
        Of `Accuracy`.
    runs : ndarray, shape (budget,)
        Number of runs.
    repeats : int
        Number of repeats of each error.

    Returns
    -------
    ndarray, shape (..., 3)
        Estimate, lower and upper bound; NaN with fewer than two budgets.
    """
    distance = np.log(runs) - np.log(runs).mean()
    square = float((distance**2).sum())
    if not square > 0:
        return np.full((*logarithm.shape[1:], 3), np.nan)
    weights = distance / square
    with np.errstate(invalid="ignore"):
        estimate = np.einsum("b,b...", weights, logarithm)
    half = student_quantile(repeats - 1, LEVEL) * np.sqrt(np.einsum("b,b...", weights**2, error**2))
    estimate = np.where(np.isfinite(estimate), estimate, np.nan)
    return np.stack([estimate, estimate - half, estimate + half], axis=-1)


def error_ratio(
    ahead: tuple[float, float], behind: tuple[float, float], repeats: int
) -> ErrorRatio:
    """Estimate the factor between two errors whose repeats are independent of each other.

    Each is given by its logarithm and the standard error of that.

    References
    ----------
    Welch, B. L. (1947). Biometrika 34, 28-35.
    """
    if ahead[0] == behind[0]:  # both may be minus infinity
        return ErrorRatio(1.0, math.nan, math.nan)
    difference = behind[0] - ahead[0]
    if math.isinf(difference):
        return ErrorRatio(math.inf, math.inf, math.inf)
    variance = ahead[1] ** 2 + behind[1] ** 2
    if not variance > 0:
        certain = math.exp(difference) if variance == 0 else math.nan
        return ErrorRatio(math.exp(difference), certain, certain)
    freedom = (repeats - 1) * variance**2 / (ahead[1] ** 4 + behind[1] ** 4)
    half = student_quantile(freedom, LEVEL) * math.sqrt(variance)
    return ErrorRatio(
        math.exp(difference), math.exp(difference - half), math.exp(difference + half)
    )
