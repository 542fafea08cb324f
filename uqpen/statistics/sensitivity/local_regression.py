"""Local regression: bins of neighbouring runs, and residuals from a straight line in each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.streams import Stream
from uqpen.statistics.intervals import group_sums
from uqpen.statistics.sample import ErrorModel, Sample

# Runs in a bin. More runs reduce the noise; fewer runs reduce the bias from curvature.
_RUNS_IN_A_BIN = 16
# Of more independent runs than this, bins grow with the root of their number. There are bins enough
# for a curve, whose bias falls with the fourth power of their number; noise grows with its root.
# Strata of a low-discrepancy set are not put together: intervals then covered in 53 % of the seeds.
_RUNS_FOR_SMALL_BINS = 2**14
# Pairs of runs in larger bins add less than 3 % to the error of a field's index.
_MOST_RUNS_FOR_PAIRS = 256
# The pairs of so many bins stand for those of all.
_BINS_FOR_PAIRS = 128
# With fewer the mean takes the place of a straight line.
_FEWEST_RUNS_FOR_A_SLOPE = 4


@dataclass(frozen=True)
class RegressionBins:
    """Bins of an input's ranks, and in each the straight line through an output."""

    label: IntArray  # (run,): the bin of each run, numbered through those that are not empty
    # (run,): where in its bin each run lies: of mean 0 and sum of squares 1 in every bin, or 0 in a
    # bin that has too few runs for a slope.
    place: FloatArray
    has_lines: bool = True  # false where each bin has the mean alone, as each of coded texts

    @classmethod
    def from_sample(cls, sample: Sample, column: int, *, halved: bool = False) -> RegressionBins:
        """Return the bins of an input.

        Over replicates a bin is a stratum, which has one point of each replicate, or a part of one.
        Points of one replicate avoid each other in the other inputs too, and in a low-discrepancy
        set, neighbours in one input are far from independent in the others.

        Parameters
        ----------
        sample : Sample
        column : int
            The input, by its number in `Sample.inputs`.
        halved : bool
            True to cut the bins into two, where each half has runs enough for a line.
        """
        values, ordering = sample.columns[column], sample.columns.ordering(column)
        if sample.columns.is_coded(column):  # no text is nearer to one than to another
            label = np.unique(values[sample.used], return_inverse=True)[1].astype(np.int64)
            return cls(label, np.zeros(label.shape), has_lines=False)
        rank = ordering.level
        if ordering.is_above is not None:
            rank = np.empty_like(rank)
            # A table may list runs in an order of the other inputs, and neighbours must be alike in
            # none: equal values are in random order.
            tie_breaker = Stream(0, "analyses", "ties").generator().permutation(len(values))
            rank[np.lexsort((tie_breaker, values))] = np.arange(len(values))
        rank = rank[sample.used]
        in_a_bin, block = _blocks(sample, rank, halved=halved)
        count = np.bincount(block, minlength=len(sample.replicates))
        # Failed runs leave gaps in strata, so these are merged until they fill a bin.
        label = np.floor((np.cumsum(count) - count) / in_a_bin + 1e-9).astype(np.int64)[block]
        if ordering.is_above is None:
            label = (np.cumsum(np.bincount(label) > 0) - 1)[label]
        else:
            # A value that fills a bin by itself is among no others.
            _, level, equal = np.unique(
                values[sample.used], return_inverse=True, return_counts=True
            )
            label = label * (len(equal) + 1) + np.where(equal[level] >= in_a_bin, level + 1, 0)
            label = np.unique(label, return_inverse=True)[1].astype(np.int64)
        size = np.bincount(label)
        place = rank - (np.bincount(label, rank) / size)[label]
        spread = np.sqrt(np.bincount(label, place**2))
        has_slope = size >= _FEWEST_RUNS_FOR_A_SLOPE
        place /= np.where(has_slope, spread, np.inf)[label]
        return cls(label, place)

    @cached_property
    def size(self) -> FloatArray:
        """Number of runs in each bin."""
        return np.bincount(self.label).astype(np.float64)

    @cached_property
    def freedom(self) -> FloatArray:
        """Degrees of freedom of the residuals in each bin."""
        has_slope = self.has_lines & (self.size >= _FEWEST_RUNS_FOR_A_SLOPE)
        return self.size - 1 - np.where(has_slope, 1.0, 0.0)

    @cached_property
    def scale(self) -> FloatArray:
        """Factor that makes a bin's sum of squares unbiased; 0 for a bin of one run."""
        return np.where(self.freedom > 0, self.size / np.maximum(self.freedom, 1), 0)

    @cached_property
    def free_share(self) -> FloatArray:
        """Share of each residual that the leverage leaves; infinite where it leaves nothing."""
        free = self.at_runs(1 - 1 / self.size)
        free -= self.place**2
        free[free <= 0] = np.inf
        return free

    @cached_property
    def slots(self) -> IntArray:
        """Numbers of the runs in some bins, shape (bin, slot); the number of runs for no run.

        These bins stand for all in `ResidualVariance.pair_products`. One that is too large for
        that has no runs.
        """
        size = self.size.astype(np.int64)
        size[size > _MOST_RUNS_FOR_PAIRS] = 0
        order, start = np.argsort(self.label, kind="stable"), np.cumsum(self.size).astype(np.int64)
        slot = np.arange(size.max(initial=0))
        runs = (start - self.size.astype(np.int64))[:, None] + slot
        slots = np.append(order, len(order))[np.where(slot < size[:, None], runs, len(order))]
        return slots[self._bins_for_pairs]

    @cached_property
    def _bins_for_pairs(self) -> IntArray:
        """Bins that stand for all, evenly spread."""
        bins = len(self.size)
        return np.unique(np.linspace(0, bins - 1, min(bins, _BINS_FOR_PAIRS)).round().astype(int))

    def in_slots(self, values: FloatArray) -> FloatArray:
        """Values of the runs in `slots`, shape (..., bin, slot); 0 for no run."""
        none = np.zeros((*values.shape[:-1], 1))
        return np.concatenate([values, none], axis=-1)[..., self.slots]

    def pair_noise(self, products: FloatArray) -> float:
        """Return `ResidualVariance.pair_noise` of a sum of variances, from its pair products."""
        place, bins = self.in_slots(self.place), self._bins_for_pairs
        projection = 1 / self.size[bins, None, None] + place[:, :, None] * place[:, None, :]
        squares = (projection * products) ** 2
        pairs = squares.sum(axis=(1, 2)) - np.einsum("bjj->b", squares)
        variance = 2 * (self.scale[bins] ** 2 * pairs).mean() * len(self.size)
        return float(np.sqrt(variance)) / len(self.label)

    def total(self, values: FloatArray) -> FloatArray:
        """Sums over each bin, shape (..., bin), of values of shape (..., run)."""
        return group_sums(values, self.label, len(self.size))

    def residual(self, values: FloatArray) -> FloatArray:
        """Residuals of variables from the lines of the bins, shape (..., run)."""
        # Large arrays are overwritten, as memory costs more than sums.
        centred = self.at_runs(self.total(values) / self.size)
        np.subtract(values, centred, out=centred)
        line = self.at_runs(self.total(self.place * centred))
        line *= self.place
        centred -= line
        return centred

    def at_runs(self, values: FloatArray) -> FloatArray:
        """Value of its bin for each run, shape (..., run), from values of shape (..., bin)."""
        return np.take(values, self.label, axis=-1)


@dataclass(frozen=True)
class ResidualVariance:
    """Variance of variables about the lines of an input's bins: the input does not explain it."""

    bins: RegressionBins
    values: FloatArray  # (..., run): of one variable or of several

    @cached_property
    def residual(self) -> FloatArray:
        """Residuals from the lines, shape (..., run)."""
        return self.bins.residual(self.values)

    @cached_property
    def _leave_one_out_products(self) -> FloatArray:
        """The product of each run's residual and of that from the line through all others."""
        return self.residual**2 / self.bins.free_share

    @cached_property
    def _sums(self) -> FloatArray:
        """Unbiased sums of squares over each bin."""
        return self.bins.scale * self.bins.total(self.residual**2)

    @cached_property
    def variance(self) -> FloatArray:
        """The mean variance about the lines, shape (...)."""
        return self._sums.sum(axis=-1) / self.bins.size[self.bins.scale > 0].sum()

    @cached_property
    def influence(self) -> FloatArray:
        """Each run's influence on it, but for a constant, shape (..., run)."""
        # Each run has the scale of its bin. The mean over the bin compensates for a scale above 1.
        bins = self.bins
        scale, mean = bins.at_runs(bins.scale), bins.at_runs(self._sums / bins.size)
        found = self._leave_one_out_products - mean
        found *= scale
        found += mean
        return found

    @cached_property
    def pair_noise(self) -> FloatArray:
        """The part of its standard error from the products of pairs of runs in a bin."""
        bins, products = self.bins, self._leave_one_out_products
        # The squares of 1 / size + place · place, the elements of the projection on the lines.
        pairs = (bins.total(products) / bins.size) ** 2
        at_places = products * bins.place
        pairs += 2 * bins.total(at_places) ** 2 / bins.size
        at_places *= bins.place
        pairs += bins.total(at_places) ** 2
        own = products * bins.at_runs(1 / bins.size)
        own += at_places
        own *= own
        pairs -= bins.total(own)
        variance = 2 * (bins.scale**2 * np.maximum(pairs, 0)).sum(axis=-1)
        return np.sqrt(variance) / self.values.shape[-1]

    def pair_products(self, weights: FloatArray) -> FloatArray:
        """Sum the products of pairs of runs in a bin over several variables.

        Parameters
        ----------
        weights : ndarray, shape (variable,)
            Not below 0.

        Returns
        -------
        ndarray, shape (bin, slot, slot)
            For `RegressionBins.pair_noise`.
        """
        scale = 1 / np.sqrt(self.bins.free_share)
        left_out = self.bins.in_slots(self.residual) * self.bins.in_slots(scale)
        left_out *= np.sqrt(weights)[:, None, None]
        return np.einsum("vbj,vbk->bjk", left_out, left_out)


def _blocks(sample: Sample, rank: IntArray, *, halved: bool) -> tuple[float, IntArray]:
    """Return the number of runs in a bin, and the blocks of runs that are not cut by bins."""
    if sample.error_model is not ErrorModel.REPLICATED:
        in_a_bin: float = _RUNS_IN_A_BIN
        if sample.error_model is ErrorModel.INDEPENDENT:
            in_a_bin *= math.sqrt(max(len(sample.replicates) / _RUNS_FOR_SMALL_BINS, 1.0))
        return in_a_bin / (2 if halved else 1), rank
    replicates = int(sample.replicates.max()) + 1
    pieces = max(1, round(replicates / _RUNS_IN_A_BIN))
    if halved and replicates >= 2 * pieces * _FEWEST_RUNS_FOR_A_SLOPE:
        pieces *= 2
    # Whole strata are cut, so that no bin lies across the border of two.
    return replicates / pieces, rank * pieces // replicates
