"""Formulas for runs with weights, as importance sampling and posterior samples have them.

Weights are relative: every estimate divides by their sum (self-normalised). The errors follow from
the delta method for such a ratio, of independent draws.

Owen, A. B. (2013). Monte Carlo theory, methods and examples, chapter 9.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.intervals import clopper_pearson, student_quantile

__all__ = [
    "effective_size",
    "runs_on_a_side",
    "weighted_cdf",
    "weighted_mean",
    "weighted_mean_error",
    "weighted_probability_interval",
    "weighted_quantile",
]


def effective_size(weights: FloatArray) -> float:
    """Effective sample size (Σw)²/Σw²: the equally weighted draws with the same error.

    >>> effective_size(np.array([1.0, 1.0, 0.0]))
    2.0

    References
    ----------
    Kish, L. (1965). Survey Sampling. Wiley.
    """
    largest = float(weights.max(initial=0.0))
    if not largest > 0:
        return 0.0
    shares = weights / largest  # whose squares neither overflow nor vanish
    return float(shares.sum() ** 2 / (shares**2).sum())


def runs_on_a_side(weights: FloatArray, is_above: BoolArray) -> float:
    """Effective number of runs above or below a value, the smaller of the two."""
    return min(effective_size(weights[is_above]), effective_size(weights[~is_above]))


def weighted_mean(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Self-normalised mean Σwx/Σw along the last axis."""
    return (weights * values).sum(axis=-1) / weights.sum()


def weighted_mean_error(influence: FloatArray, weights: FloatArray) -> FloatArray:
    """Standard error of a self-normalised mean, by the delta method.

    For equal weights it is the error of a mean of independent draws.

    Parameters
    ----------
    influence : ndarray, shape (..., run)
        Values whose mean is estimated, at any places.
    weights : ndarray, shape (run,)
        Relative weights, of an effective size above 1.

    Returns
    -------
    ndarray, shape (...)
    """
    size = effective_size(weights)
    shares = weights / weights.sum()
    deviations = shares * (influence - weighted_mean(influence, weights)[..., np.newaxis])
    return np.sqrt((deviations**2).sum(axis=-1) * size / (size - 1))


def weighted_quantile(
    values: FloatArray, weights: FloatArray, probability: npt.ArrayLike
) -> FloatArray:
    """Quantiles of weighted runs, interpolated between the middles of their weights.

    Parameters
    ----------
    values, weights : ndarray, shape (run,)
        At least one weight is above 0.
    probability : array_like
        Any shape.
    """
    taken = np.flatnonzero(weights > 0)
    order = taken[np.argsort(values[taken], kind="stable")]
    shares = weights[order] / weights.sum()
    found: FloatArray = np.interp(
        np.asarray(probability, dtype=np.float64), np.cumsum(shares) - shares / 2, values[order]
    )
    return found


def weighted_cdf(
    values: FloatArray, weights: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Weight at or below each of some values, and its standard error.

    Parameters
    ----------
    values, weights : ndarray, shape (run,)
        The runs.
    at : ndarray, shape (value,)
        Where to evaluate the distribution function.

    Returns
    -------
    probability, error : ndarray, shape (value,)
    """
    order = np.argsort(values, kind="stable")
    shares = weights[order] / weights.sum()
    places = np.searchsorted(values[order], at, side="right")
    below, squares = (
        np.concatenate([[0.0], np.cumsum(part)])[places] for part in (shares, shares**2)
    )
    below = np.where(places == len(values), 1.0, below)
    variance = (1 - 2 * below) * squares + below**2 * float((shares**2).sum())
    return below, np.sqrt(np.maximum(variance, 0.0))


def weighted_probability_interval(
    probability: npt.ArrayLike, error: npt.ArrayLike, weights: FloatArray, level: float
) -> tuple[FloatArray, FloatArray]:
    """Clopper-Pearson interval at the effective number of runs of a probability.

    That is the number of equally weighted draws with the same error. It exceeds the number of runs
    where the weights were chosen for the event. For equal weights, the interval is Clopper and
    Pearson's own.

    Parameters
    ----------
    probability, error : array_like
        Estimates between 0 and 1, and their standard errors without a correction for the mean.
    weights : ndarray, shape (run,)
        Relative weights.
    level : float
        Two-sided.

    Returns
    -------
    lower, upper : ndarray
        From 0 to 1 where the error is 0: all runs or none say nothing of weights not drawn.

    References
    ----------
    Korn, E. L. & Graubard, B. I. (1998). Survey Methodology 24, 193-201.
    """
    p, e = np.asarray(probability, dtype=np.float64), np.asarray(error, dtype=np.float64)
    freedom = effective_size(weights) - 1
    wider = student_quantile(len(weights) - 1, level) / student_quantile(freedom, level)
    is_known = (e > 0) & (p > 0) & (p < 1)
    runs = np.divide(p * (1 - p), e**2, out=np.ones_like(p), where=is_known) * wider**2
    lower, upper = clopper_pearson(np.where(is_known, p, 0.5) * runs, runs, level)
    return np.where(is_known, lower, 0.0), np.where(is_known, upper, 1.0)
