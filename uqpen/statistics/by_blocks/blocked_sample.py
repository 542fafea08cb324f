"""A sample without its values: it answers analyses of distributions from counts and sums."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.sampling import Sampling
from uqpen.statistics.by_blocks.cells import CellCounts, OrderedValues
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.sample import ErrorModel, Sample, SampleShape, shape_of
from uqpen.statistics.tally import Tally

__all__ = ["BlockedSample", "BlockedShape", "PowerSums"]


@dataclass(frozen=True, eq=False)
class PowerSums:
    """Number, mean, and sums of the powers of deviations of a column, by group of its runs.

    Parameters
    ----------
    sizes : ndarray of int, shape (group,)
        Number of runs.
    means : ndarray, shape (group,)
        0 for a group without runs.
    powers : ndarray, shape (3, group)
        Sums of the second, third and fourth powers of the deviations from the mean of the group.
    smallest, largest : ndarray, shape (group,)
        Infinite for a group without runs.

    References
    ----------
    Pebay, P. (2008). Formulas for robust, one-pass parallel computation of covariances and
    arbitrary-order statistical moments. Sandia report SAND2008-6212.
    """

    sizes: IntArray
    means: FloatArray
    powers: FloatArray
    smallest: FloatArray
    largest: FloatArray

    @classmethod
    def empty(cls, groups: int) -> PowerSums:
        """Return the sums of no runs."""
        ends = np.full(groups, np.inf)
        return cls(np.zeros(groups, np.int64), np.zeros(groups), np.zeros((3, groups)), ends, -ends)

    @classmethod
    def of_values(cls, values: FloatArray) -> PowerSums:
        """Return the sums of one group, of at least one run."""
        mean = values.mean()
        deviations = values - mean
        squares = deviations * deviations
        powers = [squares.sum(), (squares * deviations).sum(), (squares * squares).sum()]
        return cls(
            np.array([values.size]),
            np.array([mean]),
            np.array(powers)[:, np.newaxis],
            np.array([values.min()]),
            np.array([values.max()]),
        )

    def add(self, group: int, values: FloatArray) -> None:
        """Add runs to a group, in place."""
        if not values.size:
            return
        merged = self[group].merge(PowerSums.of_values(values))
        for mine, other in zip(self._columns, merged._columns, strict=True):
            mine[..., group : group + 1] = other

    def __getitem__(self, group: int) -> PowerSums:
        """Return one group."""
        return PowerSums(*(column[..., group : group + 1] for column in self._columns))

    def first(self, groups: int) -> PowerSums:
        """Return the first groups."""
        return PowerSums(*(column[..., :groups] for column in self._columns))

    def merge(self, other: PowerSums) -> PowerSums:
        """Return the sums of the runs of both, group by group."""
        one, two = self.sizes.astype(np.float64), other.sizes.astype(np.float64)
        runs = np.maximum(one + two, 1.0)
        a, b, step = one / runs, two / runs, other.means - self.means
        (squares, cubes, fourths), (more_squares, more_cubes, more_fourths) = (
            self.powers,
            other.powers,
        )
        powers = [
            squares + more_squares + step**2 * one * b,
            cubes
            + more_cubes
            + step**3 * one * b * (a - b)
            + 3 * step * (a * more_squares - b * squares),
            fourths
            + more_fourths
            + step**4 * one * b * (a**2 - a * b + b**2)
            + 6 * step**2 * (a**2 * more_squares + b**2 * squares)
            + 4 * step * (a * more_cubes - b * cubes),
        ]
        return PowerSums(
            self.sizes + other.sizes,
            np.where(one > 0, self.means + step * b, other.means),
            np.array(powers),
            np.minimum(self.smallest, other.smallest),
            np.maximum(self.largest, other.largest),
        )

    @cached_property
    def whole(self) -> PowerSums:
        """The sums of all groups together, merged in order."""
        merged = self[0]
        for group in range(1, self.sizes.size):
            merged = merged.merge(self[group])
        return merged

    def deviations(self) -> Tally:
        """Return the tally of the deviations from the mean of all runs."""
        whole = self.whole
        return Tally(
            self.sizes,
            self.sizes * (self.means - whole.means),
            float(whole.powers[0, 0]),
            float((whole.smallest - whole.means)[0]),
            float((whole.largest - whole.means)[0]),
        )

    def squared_deviations(self) -> Tally:
        """Return the tally of their squares; the smallest one is not known and 0."""
        squares, _, fourths = self.whole.powers[:, 0]
        runs, ends = int(self.sizes.sum()), self.deviations()
        sums = self.powers[0] + self.sizes * (self.means - self.whole.means) ** 2
        largest = max(ends.smallest**2, ends.largest**2)
        scatter = max(float(fourths - squares**2 / runs), 0.0)
        return Tally(self.sizes, sums, scatter, 0.0, largest)

    @property
    def _columns(self) -> tuple[Any, ...]:
        return self.sizes, self.means, self.powers, self.smallest, self.largest


_NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False, kw_only=True)
class BlockedSample(Sample):
    """A sample of an output over groups of its runs, whose values are in no array.

    In place of what is not known yet it gives what is known near it, and asks for it: after a
    further pass over the runs, the same analysis finds it.

    Parameters
    ----------
    cells : CellCounts
        The distribution of the output, by group.
    powers : PowerSums
        Its power sums, by group; of the same groups or the first of them.
    missing_counts : ndarray of int, shape (group,)
        The missing runs of each group.
    is_replicated : bool
        True if the groups are replicates of a stratified design.
    sizes : ndarray of int, shape (group,)
        The completed runs of each group.
    """

    cells: CellCounts
    powers: PowerSums
    missing_counts: IntArray
    is_replicated: bool
    sizes: IntArray

    @classmethod
    def of_first(
        cls,
        groups: int,
        cells: CellCounts,
        powers: PowerSums,
        missing_counts: IntArray,
        sampling: Sampling,
        *,
        is_replicated: bool,
        level: float = LEVEL,
    ) -> BlockedSample:
        """Return the sample of the first groups."""
        values = _ComparedValues(cells, groups, is_replicated)
        return cls(
            values=cast(FloatArray, values),
            used=_NONE,
            missing=cast(IntArray, np.broadcast_to(0, int(missing_counts[:groups].sum()))),
            columns=InputColumns.none(0),
            replicates=_NONE,
            sampling=sampling,
            level=level,
            cells=cells,
            powers=powers.first(groups),
            missing_counts=missing_counts[:groups],
            is_replicated=is_replicated,
            sizes=cells.sizes[:groups],
        )

    def with_missing(self) -> BlockedSample:
        """Return the sample with its missing runs; of its values nothing is known then."""
        missing_counts = np.zeros_like(self.missing_counts)
        return replace(
            self,
            sizes=self.sizes + self.missing_counts,
            missing_counts=missing_counts,
            missing=_NONE,
        )

    def events_with_missing(self, events: BoolArray | Tally, *, happened: bool) -> BoolArray:
        """Return an event over the runs of `with_missing`, with one outcome of the missing ones."""
        missing_counts = (
            self.missing_counts if self.is_replicated else self.missing_counts.sum(keepdims=True)
        )
        return cast(BoolArray, cast(Tally, events).with_missing(missing_counts, happened=happened))

    def count_up_to(self, values: FloatArray) -> IntArray:
        """Count the runs at or below each value, shape (value,)."""
        return self._counts_by_group(values).sum(axis=0)

    def counts_by_replicate(self, values: FloatArray) -> Iterator[IntArray]:
        """Yield the counts of `count_up_to` of all replicates, shape (replicate, value)."""
        yield self._counts_by_group(values)[self.sizes > 0]

    def _counts_by_group(self, values: FloatArray) -> IntArray:
        groups = len(self.sizes)
        columns = [self.cells.counts_below(each, or_equal=True)[:groups] for each in values]
        return np.stack(columns, axis=1)

    @property
    def replicate_sizes(self) -> IntArray:
        """Number of runs of each replicate that has any."""
        return self.sizes[self.sizes > 0] if self.is_replicated else self.sizes.sum(keepdims=True)

    @property
    def size(self) -> int:
        """Number of completed runs."""
        return int(self.sizes.sum())

    @property
    def replicate_count(self) -> int:
        """Number of replicates with a completed run."""
        return int((self.replicate_sizes > 0).sum())

    @cached_property
    def sorted_values(self) -> FloatArray:
        """The values, ascending; those that are asked for are found."""
        return cast(FloatArray, OrderedValues.of_first(self.cells, len(self.sizes)))

    @cached_property
    def is_constant(self) -> BoolArray:
        """True where all values are equal."""
        whole = self.powers.whole
        return np.asarray(whole.smallest[0] == whole.largest[0])

    @cached_property
    def error_model(self) -> ErrorModel:
        """Error model of the sample."""
        if self.sampling is Sampling.GIVEN:
            return ErrorModel.UNKNOWN
        if self.sampling is Sampling.INDEPENDENT:
            return ErrorModel.INDEPENDENT
        return ErrorModel.REPLICATED if self.is_replicated else ErrorModel.SINGLE_STRATIFIED_SET


class _ComparedValues:
    """The values of a sample, which can only be compared with a number."""

    def __init__(self, cells: CellCounts, groups: int, is_replicated: bool) -> None:
        self._cells, self._groups, self._is_replicated = cells, groups, is_replicated

    @property
    def shape(self) -> tuple[int]:
        return (int(self._sizes.sum()),)

    @property
    def ndim(self) -> int:
        return 1

    def __le__(self, value: npt.ArrayLike) -> Tally:
        return self._tally(self._below(value, or_equal=True))

    def __lt__(self, value: npt.ArrayLike) -> Tally:
        return self._tally(self._below(value, or_equal=False))

    def __gt__(self, value: npt.ArrayLike) -> Tally:
        return self._tally(self._sizes - self._below(value, or_equal=True))

    def __ge__(self, value: npt.ArrayLike) -> Tally:
        return self._tally(self._sizes - self._below(value, or_equal=False))

    def __eq__(self, value: Any) -> Any:
        both = (self._below(value, or_equal=or_equal) for or_equal in (True, False))
        return self._tally(next(both) - next(both))

    __hash__ = None  # type: ignore[assignment]

    @property
    def _sizes(self) -> IntArray:
        return self._cells.sizes[: self._groups]

    def _below(self, value: npt.ArrayLike, *, or_equal: bool) -> IntArray:
        (number,) = np.ravel(np.asarray(value, dtype=np.float64)).tolist()
        return self._cells.counts_below(number, or_equal=or_equal)[: self._groups]

    def _tally(self, counts: IntArray) -> Tally:
        if self._is_replicated:
            return Tally.of_events(self._sizes, counts)
        return Tally.of_events(self._sizes.sum(keepdims=True), counts.sum(keepdims=True))


@dataclass(frozen=True, eq=False)
class BlockedShape(SampleShape):
    """The shape of a sample's tail, from power sums of its values."""

    powers: PowerSums

    @cached_property
    def mean(self) -> FloatArray:
        """The mean."""
        if not self.sample.size:
            return np.asarray(np.nan)
        whole = self.powers.whole
        is_constant = whole.smallest[0] == whole.largest[0]
        return np.asarray(whole.smallest[0] if is_constant else whole.means[0])

    @cached_property
    def scale(self) -> FloatArray:
        """The largest deviation."""
        if not self.sample.size:
            return np.asarray(np.nan)
        whole = self.powers.whole
        return np.asarray(max(whole.largest[0] - self.mean, self.mean - whole.smallest[0]))

    @cached_property
    def deviations(self) -> FloatArray:
        """Deviations from the mean over `scale`, as a tally that can be squared."""
        factor = 1 / float(self.scale) if self.scale > 0 else 0.0
        ones, squares = self.powers.deviations(), self.powers.squared_deviations()
        if not getattr(self.sample, "is_replicated", False):
            ones, squares = ones.pooled(), squares.pooled()
        return cast(FloatArray, _Deviations.of(ones.scaled(factor), squares.scaled(factor**2)))

    @cached_property
    def skewness(self) -> FloatArray:
        """The third standardized moment."""
        return self._standardized(3)

    @cached_property
    def kurtosis(self) -> FloatArray:
        """The fourth standardized moment."""
        return self._standardized(4)

    def _standardized(self, power: int) -> FloatArray:
        if not self.scale > 0:
            return np.asarray(np.nan)
        sums, scale = self.powers.whole.powers[:, 0], float(self.scale)
        moment, variance = (
            float(sums[each - 2]) / self.sample.size / scale**each for each in (power, 2)
        )
        return np.asarray(moment / variance ** (power / 2))


@dataclass(frozen=True, eq=False)
class _Deviations(Tally):
    """Tally of deviations from the mean, with that of their squares."""

    squared: Tally

    @classmethod
    def of(cls, ones: Tally, squares: Tally) -> _Deviations:
        return cls(**vars(ones), squared=squares)

    def __pow__(self, power: int) -> Tally:
        return self.squared


@shape_of.register
def _(sample: BlockedSample) -> SampleShape:
    return BlockedShape(sample, sample.powers)
