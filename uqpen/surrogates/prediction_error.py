"""Errors of predictions at runs that a surrogate was not fitted to."""

from __future__ import annotations

import math

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["predictive_q2"]


def predictive_q2(found: FloatArray, truth: FloatArray, weights: FloatArray | None = None) -> float:
    """Return one minus the mean square error over the variance; NaN if a value is not finite.

    Weights of runs are on average 1; without them, all are 1.
    """
    if len(truth) < 2:
        return math.nan
    with np.errstate(all="ignore"):
        if weights is None:
            error, variance = np.mean((found - truth) ** 2), np.var(truth, ddof=1)
        else:
            mean = np.average(truth, weights=weights)
            error, variance = (
                np.average((each - truth) ** 2, weights=weights) for each in (found, mean)
            )
        q2 = 1 - float(error / variance)
    return q2 if math.isfinite(q2) else math.nan
