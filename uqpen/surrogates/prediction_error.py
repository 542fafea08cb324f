"""Errors of predictions at runs that a surrogate was not fitted to."""

from __future__ import annotations

import math

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["predictive_q2"]


def predictive_q2(found: FloatArray, truth: FloatArray) -> float:
    """Return one minus the mean square error over the variance; NaN if a value is not finite."""
    if len(truth) < 2:
        return math.nan
    with np.errstate(all="ignore"):
        q2 = 1 - float(np.mean((found - truth) ** 2) / np.var(truth, ddof=1))
    return q2 if math.isfinite(q2) else math.nan
