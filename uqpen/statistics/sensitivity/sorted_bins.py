"""Runs bin by bin, for residuals of variables by a compiled loop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.kernels import residuals_in_bins
from uqpen.statistics.ordering import Numbers
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity.local_regression import (
    FEWEST_RUNS_FOR_A_SLOPE,
    bin_labels,
    labels_of_ranks,
)
from uqpen.statistics.tally import Tally

__all__ = ["CompiledVariance", "SortedBins"]


@dataclass(frozen=True, eq=False)
class SortedBins:
    """Runs bin by bin, as `residuals_in_bins` takes them.

    Parameters
    ----------
    runs : ndarray of int, shape (run,)
        Numbers of the runs.
    first : ndarray of int, shape (bin + 1,)
        Where each bin begins, and the last one ends.
    rank : ndarray of int, shape (run,)
        Rank of the input in each of `runs`.
    """

    runs: Numbers
    first: IntArray
    rank: Numbers

    @classmethod
    def from_sample(cls, sample: Sample, column: int, *, halved: bool = False) -> SortedBins:
        """Return the bins of an input, those that `RegressionBins` has."""
        ordering = sample.columns.ordering(column)
        if ordering.is_above is not None:
            return cls._of_ties(*bin_labels(sample, column, halved=halved))
        # Bins ascend with the input, so its order is that of the bins.
        runs = sample.run_inputs.ordering(column).order
        rank = sample.run_inputs.ranks_of_untied(column)
        return cls(runs, _first(labels_of_ranks(sample, rank, halved=halved)), rank)

    @classmethod
    def _of_ties(cls, label: IntArray, rank: IntArray) -> SortedBins:
        runs = np.argsort(label, kind="stable")
        kind = np.int32 if len(runs) < 2**31 else np.int64
        return cls(runs.astype(kind), _first(label[runs]), rank[runs].astype(kind))

    @cached_property
    def informative(self) -> int:
        """Number of runs in bins that leave degrees of freedom to residuals."""
        size = np.diff(self.first)
        return int(size[size - 1 - (size >= FEWEST_RUNS_FOR_A_SLOPE) > 0].sum())


def _first(ascending: IntArray) -> IntArray:
    """Return where each of some ascending labels begins, and the last one ends."""
    changes = np.flatnonzero(ascending[1:] != ascending[:-1]) + 1
    return np.concatenate([[0], changes, [len(ascending)]])


@dataclass(frozen=True, eq=False)
class CompiledVariance:
    """Residual variance of one variable, found in one go over its runs.

    Parameters
    ----------
    variance, pair_noise : ndarray, shape ()
    influence : ndarray, shape (run,) or (0,)
        Empty where it is not asked for.
    sums : ndarray, shape (7,)
        The last that `residuals_in_bins` returns.
    """

    variance: FloatArray
    pair_noise: FloatArray
    influence: FloatArray
    sums: FloatArray

    @classmethod
    def about(
        cls, bins: SortedBins, values: FloatArray, *, has_influence: bool = True
    ) -> CompiledVariance:
        """Return the variance of a variable, shape (run,), about the lines of bins."""
        influence = np.empty(len(values) if has_influence else 0)
        left, pairs, *sums = residuals_in_bins(
            bins.runs, bins.first, bins.rank, values, FEWEST_RUNS_FOR_A_SLOPE, influence
        )
        noise = math.sqrt(2 * pairs) / len(values)
        variance = np.asarray(left / bins.informative)
        return cls(variance, np.asarray(noise), influence, np.array(sums))

    def share_tally(self, ratio: float, runs: int) -> Tally:
        """Return the tally of each run's influence on what is left of the variance, times -1.

        Parameters
        ----------
        ratio : float
            What is left over the variance.
        runs : int
            Number of independent runs.
        """
        square, left, squares, lefts, differences, with_left, with_difference = self.sums
        if ratio < 0.5:
            total = ratio * square - left
            sum_of_squares = ratio**2 * squares - 2 * ratio * with_left + lefts
        else:
            rest = 1 - ratio
            total = square - left - rest * square
            sum_of_squares = differences - 2 * rest * with_difference + rest**2 * squares
        return Tally(
            sizes=np.array([runs]),
            sums=np.array([total]),
            squares=max(float(sum_of_squares - total**2 / runs), 0.0),
            smallest=math.nan,
            largest=math.nan,
        )
