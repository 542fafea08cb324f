"""Runs bin by bin, for residuals of variables by a compiled loop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.ordering import Numbers
from uqpen.statistics.sensitivity.kernels import residuals_in_bins
from uqpen.statistics.sensitivity.local_regression import FEWEST_RUNS_FOR_A_SLOPE, RegressionBins

__all__ = ["CompiledVariance", "SortedBins"]


@dataclass(frozen=True, eq=False)
class SortedBins:
    """Runs bin by bin, and where in its bin each lies, as `residuals_in_bins` takes them."""

    runs: Numbers
    first: IntArray
    place: FloatArray

    @classmethod
    def of(cls, bins: RegressionBins) -> SortedBins:
        """Return the runs of bins in the order of these."""
        size = len(bins.label)
        words = bins.label * size + np.arange(size)
        words.sort()
        runs: Numbers = words % size
        runs = runs.astype(np.int32) if size < 2**31 else runs
        first = np.concatenate([[0], np.cumsum(np.bincount(bins.label))])
        return cls(runs, first, bins.place[runs])

    @cached_property
    def informative(self) -> int:
        """Number of runs in bins that leave degrees of freedom to residuals."""
        size = np.diff(self.first)
        return int(size[size - 1 - (size >= FEWEST_RUNS_FOR_A_SLOPE) > 0].sum())


@dataclass(frozen=True, eq=False)
class CompiledVariance:
    """Residual variance of one variable, found in one go over its runs.

    Parameters
    ----------
    variance, pair_noise : ndarray, shape ()
    influence : ndarray, shape (run,)
    """

    variance: FloatArray
    pair_noise: FloatArray
    influence: FloatArray

    @classmethod
    def about(cls, bins: SortedBins, values: FloatArray) -> CompiledVariance:
        """Return the variance of a variable, shape (run,), about the lines of bins."""
        influence = np.empty(len(values))
        left, pairs = residuals_in_bins(
            bins.runs, bins.first, bins.place, values, FEWEST_RUNS_FOR_A_SLOPE, influence
        )
        noise = math.sqrt(2 * pairs) / len(values)
        return cls(np.asarray(left / bins.informative), np.asarray(noise), influence)
