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


def effective_sizes(weights: FloatArray) -> FloatArray:
    """Effective sample sizes (Σw)²/Σw²: the equally weighted draws with the same error.

    They are those of the rows of weights, shape (...) of (..., run).

    >>> float(effective_sizes(np.array([1.0, 1.0, 0.0])))
    2.0

    References
    ----------
    Kish, L. (1965). Survey Sampling. Wiley.
    """
    largest = weights.max(axis=-1, initial=0.0, keepdims=True)
    shares = weights / np.where(largest > 0, largest, 1.0)  # squares neither overflow nor vanish
    squares = (shares**2).sum(axis=-1)
    return np.asarray(shares.sum(axis=-1) ** 2 / np.where(squares > 0, squares, 1.0))


def runs_on_a_side(weights: FloatArray, is_above: BoolArray) -> FloatArray:
    """Effective number of runs above or below a value, the smaller of the two, at any places."""
    sides = effective_sizes(weights * is_above), effective_sizes(weights * ~is_above)
    return np.minimum(*sides)


def fewest_on_a_side(values: FloatArray, weights: FloatArray, at: FloatArray) -> FloatArray:
    """Effective number of runs up to or above each of some values, the smaller of the two.

    Parameters
    ----------
    values, weights : ndarray, shape (run,)
        The runs.
    at : ndarray, shape (value,)
    """
    order = np.argsort(values, kind="stable")
    places = np.searchsorted(values[order], at, side="right")
    sums, squares = (
        np.concatenate([[0.0], np.cumsum(part)]) for part in (weights[order], weights[order] ** 2)
    )
    sides = (
        (total**2, np.maximum(square, np.finfo(float).tiny))
        for total, square in (
            (sums[places], squares[places]),
            (sums[-1] - sums[places], squares[-1] - squares[places]),
        )
    )
    return np.minimum(*(total / square for total, square in sides))


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
    size = float(effective_sizes(weights))
    shares = weights / weights.sum()
    deviations = shares * (influence - weighted_mean(influence, weights)[..., np.newaxis])
    return np.sqrt((deviations**2).sum(axis=-1) * size / (size - 1))


def weighted_quantile(
    values: FloatArray, weights: FloatArray, probability: npt.ArrayLike
) -> FloatArray:
    """Quantiles of weighted runs, interpolated between the middles of their weights.

    Parameters
    ----------
    values : ndarray, shape (..., run)
        At any places.
    weights : ndarray, shape (run,)
        At least one is above 0.
    probability : array_like
        Of shape (p,) for all places, or (..., p).

    Returns
    -------
    ndarray, shape (..., p)
    """
    taken = np.flatnonzero(weights > 0)
    order = np.argsort(values[..., taken], axis=-1, kind="stable")
    shares = weights[taken][order] / weights.sum()
    middles = np.cumsum(shares, axis=-1) - shares / 2
    ascending = np.take_along_axis(values[..., taken], order, axis=-1)
    wanted = np.asarray(probability, dtype=np.float64)
    found = [_interpolated(column, middles, ascending) for column in np.moveaxis(wanted, -1, 0)]
    return np.stack(found, axis=-1)


def _interpolated(at: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return y at a position among ascending x, linear between two and constant beyond the ends.

    It is NumPy's ``interp`` with x and y of shape (..., point), and one position for each row.
    """
    last = x.shape[-1] - 1
    place = (x <= at[..., np.newaxis]).sum(axis=-1) - 1
    left = np.clip(place, 0, max(last - 1, 0))[..., np.newaxis]
    right = np.minimum(left + 1, last)
    x0, x1, y0, y1 = (
        np.take_along_axis(each, position, axis=-1)[..., 0]
        for each, position in ((x, left), (x, right), (y, left), (y, right))
    )
    step = np.where(x1 > x0, x1 - x0, 1.0)
    inside = (y1 - y0) / step * (at - x0) + y0
    return np.where(place < 0, y[..., 0], np.where(place >= last, y[..., -1], inside))


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


def weighted_share(events: BoolArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weight of the runs with an event, and its standard error as that of `weighted_cdf`.

    Parameters
    ----------
    events : ndarray of bool, shape (..., run)
        At any places.
    weights : ndarray, shape (run,)

    Returns
    -------
    probability, error : ndarray, shape (...)
    """
    shares = weights / weights.sum()
    share, squares = (np.where(events, part, 0.0).sum(axis=-1) for part in (shares, shares**2))
    share = np.where(events.all(axis=-1), 1.0, share)
    variance = (1 - 2 * share) * squares + share**2 * float((shares**2).sum())
    return share, np.sqrt(np.maximum(variance, 0.0))


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
    freedom = float(effective_sizes(weights)) - 1
    wider = student_quantile(len(weights) - 1, level) / student_quantile(freedom, level)
    is_known = (e > 0) & (p > 0) & (p < 1)
    runs = np.divide(p * (1 - p), e**2, out=np.ones_like(p), where=is_known) * wider**2
    lower, upper = clopper_pearson(np.where(is_known, p, 0.5) * runs, runs, level)
    return np.where(is_known, lower, 0.0), np.where(is_known, upper, 1.0)
