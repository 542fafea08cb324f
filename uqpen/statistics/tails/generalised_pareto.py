"""Generalised Pareto distribution of excesses over a threshold, by maximum likelihood."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import FloatArray

__all__ = ["TailFit", "fit_tails", "log_likelihood"]

# The search goes over the logarithm of 1 + ξ x/σ at the largest excess x.
_ENDS, _GRID, _REFINEMENTS = (-9.0, 14.0), 47, 26
_GOLDEN = (5**0.5 - 1) / 2
# Nearer to an exponential distribution, its formulas are used.
_EXPONENTIAL = 1e-8


class TailFit(NamedTuple):
    """Generalised Pareto distributions of samples of excesses, shape (...).

    Parameters
    ----------
    shape : ndarray
        Above 0 for a tail like a power, 0 for an exponential one, below 0 for one that ends.
    scale : ndarray
        In the unit of the excesses.
    anderson_darling : ndarray
        Anderson and Darling's statistic of the fit.
    """

    shape: FloatArray
    scale: FloatArray
    anderson_darling: FloatArray


def fit_tails(excesses: FloatArray) -> TailFit:
    """Fit a generalised Pareto distribution to each sample of excesses.

    The likelihood is that of one parameter, the ratio of the shape to the scale (Grimshaw, S. D.
    (1993). Technometrics 35, 185-191): the shape is the mean logarithm of 1 + ratio · excess.

    Parameters
    ----------
    excesses : ndarray, shape (..., run)
        Above 0.
    """
    largest = excesses.max(axis=-1, keepdims=True)
    grid = np.linspace(*_ENDS, _GRID)
    found = np.stack([_profile(excesses, largest, np.array([at])) for at in grid])
    best = np.clip(found.argmax(axis=0), 1, _GRID - 2)
    low, high = grid[best - 1][..., np.newaxis], grid[best + 1][..., np.newaxis]
    for _ in range(_REFINEMENTS):
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        is_left = _profile(excesses, largest, left) > _profile(excesses, largest, right)
        is_left = is_left[..., np.newaxis]
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
    ratio = np.expm1((low + high) / 2) / largest
    logarithms = np.log1p(ratio * excesses)
    shape = logarithms.mean(axis=-1)
    is_exponential = np.abs(shape) < _EXPONENTIAL
    safe = np.where(is_exponential, 1.0, ratio[..., 0])
    scale = np.where(is_exponential, excesses.mean(axis=-1), shape / safe)
    return TailFit(shape, scale, _anderson_darling(np.sort(excesses, axis=-1), shape, scale))


def _profile(excesses: FloatArray, largest: FloatArray, at: FloatArray) -> FloatArray:
    """Return the log-likelihood for a ratio of shape and scale, over the number of excesses."""
    ratio = np.expm1(at) / largest
    shape = np.log1p(ratio * excesses).mean(axis=-1)
    ratio = np.broadcast_to(ratio[..., 0], shape.shape)
    is_exponential = np.abs(shape) < _EXPONENTIAL
    scale = np.where(
        is_exponential, excesses.mean(axis=-1), shape / np.where(is_exponential, 1.0, ratio)
    )
    # The likelihood has no maximum where the shape is below -1.
    return np.where(shape > -1, -np.log(scale) - shape - 1, -np.inf)


def _anderson_darling(ordered: FloatArray, shape: FloatArray, scale: FloatArray) -> FloatArray:
    runs = ordered.shape[-1]
    survival = _log_survival(ordered, shape[..., np.newaxis], scale[..., np.newaxis])
    below = np.log(np.maximum(-np.expm1(survival), np.finfo(np.float64).tiny))
    weights = (2 * np.arange(1, runs + 1) - 1) / runs
    return -runs - (weights * (below + survival[..., ::-1])).sum(axis=-1)


def _log_survival(excess: FloatArray, shape: FloatArray, scale: FloatArray) -> FloatArray:
    standard = excess / scale
    is_exponential = np.abs(shape) < _EXPONENTIAL
    safe = np.where(is_exponential, 1.0, shape)
    inside = np.maximum(1 + safe * standard, np.finfo(np.float64).tiny)
    return np.where(is_exponential, -standard, -np.log(inside) / safe)


def log_likelihood(excesses: FloatArray, shape: float, scale: npt.ArrayLike) -> float:
    """Return the log-likelihood of a sample; minus infinity outside of its support."""
    size = float(scale)  # type: ignore[arg-type]
    if not size > 0:
        return -np.inf
    standard = excesses / size
    if abs(shape) < _EXPONENTIAL:
        return float(-len(excesses) * np.log(size) - standard.sum())
    inside = 1 + shape * standard
    if not inside.min() > 0:
        return -np.inf
    return float(-len(excesses) * np.log(size) - (1 + 1 / shape) * np.log(inside).sum())
