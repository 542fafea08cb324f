"""One variable over runs, as a sample of the joint distribution."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.sampling import Sampling
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.input_columns import InputColumns, Ordering, RunInputs
from uqpen.statistics.reweighting import LEAST_SHARE, effective_share
from uqpen.statistics.weights import effective_sizes, weighted_mean

# A column of runs reduced to what the error of its mean follows from.


@dataclass(frozen=True, eq=False)
class Tally:
    """Sums of a column over its replicates, in place of its values.

    Independent draws are one replicate. The methods that arrays have too return the same.
    """

    sizes: IntArray  # (replicate,): number of runs
    sums: FloatArray  # (replicate,): of the column
    squares: float  # sum of the squared deviations from the mean
    smallest: float  # least value of the column
    largest: float  # largest value of the column

    @classmethod
    def of_events(cls, sizes: IntArray, counts: IntArray) -> Tally:
        """Return the tally of an indicator, from the runs and the events of each replicate."""
        runs, events = int(sizes.sum()), int(counts.sum())
        squares = events * (runs - events) / runs if runs else 0.0
        return cls(
            sizes, counts.astype(np.float64), squares, float(events == runs), float(events > 0)
        )

    @property
    def size(self) -> int:
        """Number of runs."""
        return int(self.sizes.sum())

    @property
    def shape(self) -> tuple[int]:
        """Shape of the column."""
        return (self.size,)

    @property
    def ndim(self) -> int:
        """Number of dimensions of the column."""
        return 1

    def sum(self, axis: int = -1) -> FloatArray:
        """Sum over the runs."""
        return np.asarray(self.sums.sum())

    def mean(self, axis: int = -1) -> FloatArray:
        """Mean over the runs."""
        return np.asarray(self.sums.sum() / self.size)

    def std(self, axis: int = -1, ddof: int = 0) -> FloatArray:
        """Standard deviation over the runs."""
        return np.asarray(math.sqrt(self.squares / (self.size - ddof)))

    def all(self, axis: int = -1) -> bool:
        """True for an indicator that is 1 in every run."""
        return self.smallest == 1

    def astype(self, kind: Any) -> Tally:
        """Return itself, as an array of another type has the same sums."""
        return self

    @property
    def deviations(self) -> FloatArray:
        """Sums of the deviations from the mean, shape (replicate,)."""
        return self.sums - self.sizes * self.mean()

    def __sub__(self, other: Tally) -> Tally:
        """Return the indicator of the runs with this event but not with one that implies it."""
        counts = np.rint(self.sums - other.sums).astype(np.int64)
        return Tally.of_events(self.sizes, counts)

    def __and__(self, other: Tally) -> Tally:
        """Return the indicator of two events, one a value's side and one another value's."""
        counts = np.rint(self.sums + other.sums).astype(np.int64) - self.sizes
        return Tally.of_events(self.sizes, np.maximum(counts, 0))

    def with_missing(self, missing: IntArray, *, happened: bool) -> Tally:
        """Return an indicator with further runs of each replicate, all with one outcome."""
        counts = np.rint(self.sums).astype(np.int64)
        return Tally.of_events(self.sizes + missing, counts + missing * happened)

    def pooled(self) -> Tally:
        """Return the tally with all runs as one replicate."""
        return replace(self, sizes=self.sizes.sum(keepdims=True), sums=self.sums.sum(keepdims=True))

    def scaled(self, factor: float) -> Tally:
        """Return the tally of the column times a factor above 0."""
        return replace(
            self,
            sums=self.sums * factor,
            squares=self.squares * factor**2,
            smallest=self.smallest * factor,
            largest=self.largest * factor,
        )


# Error models of samples.


class ErrorModel(StrEnum):
    """Error model: basis on which the error of a sample's statistics is estimated."""

    INDEPENDENT = "independent draws"
    REPLICATED = "independent replicates"
    SINGLE_STRATIFIED_SET = "one stratified set"
    WEIGHTED = "weighted independent draws"
    UNKNOWN = "points of unknown origin"


# A column of runs, shape (..., run): its values, or what the error of its mean follows from.
Column = npt.NDArray[Any] | Tally

# With a smaller effective size, the coverage of intervals of weighted draws was below nominal.
_SMALLEST_EFFECTIVE_SIZE = 20

# Replicates whose counts at the values of a distribution function are in memory together: 8 MB.
_COUNTED_TOGETHER = 1024


@dataclass(frozen=True)
class Sample:
    """One variable over the completed runs of a design.

    All points of the design are kept, since the design stratifies all its points, not the
    completed ones alone.

    An analysis of a distribution asks for events, ordered values, counts and the shape, never for
    the values: so it serves a sample whose runs go by blocks as well.
    """

    # (run,): in the variable's SI unit. Of a field that of all runs has the shape (run, *dims); at
    # places of a field that exist in the same runs it has the shape (place, run).
    values: FloatArray
    used: IntArray  # (run,): numbers of the points with a completed run
    # (missing,): numbers of the points whose run failed for a reason that may depend on the output:
    # every failed run except at inadmissible points.
    missing: IntArray
    columns: InputColumns  # the random inputs at all points of the design
    replicates: IntArray  # (point,): the replicate of each point, from 0
    sampling: Sampling  # how the design drew its points
    dependence: str = ""  # how the inputs depend on each other; empty where they do not
    # The criterion by which the points of a replicate were moved apart; empty for none.
    optimized_by: str = ""
    # (point,): relative weight of each point, where the points are draws of another distribution
    # than the study's: the ratio of the two densities, up to a factor.
    weights: FloatArray | None = None
    level: float = LEVEL  # confidence level of the intervals of its statistics
    # True if the weights were not chosen for what is asked: the points are of another study.
    is_reweighted: bool = False

    def with_missing(self) -> Sample:
        """Return the sample with its missing runs at the end, their values NaN."""
        used = np.concatenate([self.used, self.missing])
        lost = np.full((*self.values.shape[:-1], self.missing.size), np.nan)
        values = np.concatenate([self.values, lost], axis=-1)
        return replace(self, values=values, used=used, missing=self.missing[:0])

    @property
    def points(self) -> FloatArray:
        """All points of the design, shape (point, random input); made at the first use."""
        return self.columns.matrix

    @property
    def inputs(self) -> tuple[str, ...]:
        """The random inputs, in the order of the columns of `points`."""
        return self.columns.names

    @cached_property
    def run_inputs(self) -> RunInputs:
        """The random inputs of the completed runs, shared by all samples of these runs."""
        return self.columns.at(self.used)

    @cached_property
    def ordering(self) -> Ordering:
        """The order of the values of one variable."""
        return Ordering.of(self.values)

    @property
    def size(self) -> int:
        """Number of completed runs."""
        return len(self.used)

    @property
    def is_at_places(self) -> bool:
        """True if it has the values at several places of a field."""
        return self.values.ndim > 1

    @cached_property
    def run_weights(self) -> FloatArray | None:
        """Weight of each run over the largest; None where all count the same."""
        if self.weights is None:
            return None
        weights = self.weights[self.used]
        return weights / weights.max(initial=0.0)  # so squares neither overflow nor vanish

    @cached_property
    def effective_size(self) -> float:
        """Kish's effective sample size (Σw)²/Σw²; without weights, the number of runs."""
        return self.size if self.run_weights is None else float(effective_sizes(self.run_weights))

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the mean of values of shape (..., run), at least one, by the runs' weights."""
        if self.run_weights is None:
            return np.asarray(values.mean(axis=-1))
        return weighted_mean(values, self.run_weights)

    def event(self, compare: Callable[[Any, Any], Any], value: npt.ArrayLike) -> Column:
        """Return whether each value compares so with a number, or with that of its place.

        The comparison is a function of `operator`, such as ``operator.gt``.
        """
        return np.asarray(compare(self.values, np.asarray(value)[..., np.newaxis]))

    def events_with_missing(self, events: Column, *, happened: bool) -> Column:
        """Return an event over the runs of `with_missing`, with one outcome of the missing ones."""
        assert isinstance(events, np.ndarray)
        missing = np.full((*events.shape[:-1], self.missing.size), happened)
        return np.concatenate([events, missing], axis=-1)

    def count_up_to(self, values: FloatArray) -> IntArray:
        """Count the runs at or below each value, shape (value,)."""
        return np.searchsorted(self.sorted_values, values, side="right")

    def counts_by_replicate(self, values: FloatArray) -> Iterator[IntArray]:
        """Yield the counts of `count_up_to` of the next replicates, shape (replicate, value)."""
        ends = np.cumsum(self.replicate_sizes)[:-1]
        replicates = iter(np.split(self.values[np.argsort(self.replicate, kind="stable")], ends))
        while some := [np.sort(part) for part in islice(replicates, _COUNTED_TOGETHER)]:
            yield np.array([np.searchsorted(part, values, side="right") for part in some])

    @cached_property
    def replicate_sizes(self) -> IntArray:
        """Number of runs of each replicate that has any."""
        return np.bincount(self.replicate)

    @cached_property
    def sorted_values(self) -> FloatArray:
        """The values, ascending along the runs."""
        return np.sort(self.values, axis=-1)

    def ordered(self, positions: IntArray) -> FloatArray:
        """Return the values at positions from 0 among the ascending ones.

        They are of shape (position,) for all places, or (place, position).
        """
        if positions.ndim < self.values.ndim or not self.is_at_places:
            return self.sorted_values[..., positions]
        return np.take_along_axis(self.sorted_values, positions, axis=-1)

    @cached_property
    def is_constant(self) -> BoolArray:
        """True where all values are equal, shape () or (place,)."""
        if not self.size:
            return np.zeros(self.values.shape[:-1], dtype=np.bool_)
        return np.asarray(self.smallest == self.largest)

    @cached_property
    def smallest(self) -> FloatArray:
        """The smallest value, shape () or (place,)."""
        return np.asarray(self.values.min(axis=-1))

    @cached_property
    def largest(self) -> FloatArray:
        """The largest value, shape () or (place,)."""
        return np.asarray(self.values.max(axis=-1))

    @cached_property
    def replicate(self) -> IntArray:
        """The replicate of each run, numbered through those that are not empty."""
        if not self.replicates.any():
            return np.zeros(self.size, dtype=np.int64)  # takes no memory while it is only read
        replicates = self.replicates[self.used]
        if not replicates.any():
            return replicates
        return np.unique(replicates, return_inverse=True)[1].astype(np.int64)

    @property
    def replicate_count(self) -> int:
        """Number of replicates with a completed run."""
        return self.replicate_sizes.size

    @cached_property
    def error_model(self) -> ErrorModel:
        """Error model of the sample."""
        if self.sampling is Sampling.GIVEN or not self.sampling.is_sample:
            return ErrorModel.UNKNOWN
        if self.sampling is Sampling.INDEPENDENT:
            return ErrorModel.INDEPENDENT if self.weights is None else ErrorModel.WEIGHTED
        if self.replicates.max(initial=0) > 0:
            return ErrorModel.REPLICATED
        return ErrorModel.SINGLE_STRATIFIED_SET

    @cached_property
    def reason_without_intervals(self) -> str:
        """Reason why no interval can be computed; empty where one can."""
        if not self.sampling.is_sample:
            return texts.NOT_A_SAMPLE
        if self.error_model is ErrorModel.UNKNOWN:
            return texts.NOT_DECLARED_INDEPENDENT
        if self.size == 0:
            blocks = self.sampling is Sampling.PICK_FREEZE
            return texts.NO_RUN_OF_A_AND_B if blocks else texts.NO_RUN
        if self.size == 1:
            return texts.SINGLE_RUN
        if self.error_model is ErrorModel.REPLICATED and self.replicate_count < 2:
            return texts.SINGLE_REPLICATE
        is_weighted = self.error_model is ErrorModel.WEIGHTED
        is_small = self.effective_size < _SMALLEST_EFFECTIVE_SIZE
        if self.effective_share < LEAST_SHARE:
            return texts.SMALL_SHARE.format(share=100 * self.effective_share)
        return self.too_few_runs if is_weighted and is_small else ""

    @cached_property
    def effective_share(self) -> float:
        """Effective size of reweighted points over their number; 1 for all others."""
        if self.weights is None or not self.is_reweighted:
            return 1.0
        return float(effective_share(self.weights))

    @property
    def too_few_runs(self) -> str:
        """Text of the reason that there are too few runs."""
        if self.weights is not None and self.is_at_places:
            return texts.SMALL_EFFECTIVE_SIZE_AT_PLACES
        if self.weights is not None:
            return texts.SMALL_EFFECTIVE_SIZE.format(size=self.effective_size)
        if self.size == 1:
            return texts.ONE_IS_TOO_FEW
        if self.is_at_places:
            return texts.TOO_FEW_RUNS_AT_PLACES
        return texts.TOO_FEW_RUNS.format(runs=self.size)

    @property
    def residual_method(self) -> str:
        """Name of an interval of one stratified set."""
        return texts.STUDENT_ON_RESIDUALS

    @cached_property
    def shape(self) -> SampleShape:
        """Deviations from the mean, and the influence of few runs on them."""
        # Of a copy: two objects that refer to each other would keep their arrays for too long.
        return SampleShape(replace(self))

    @property
    def degrees_of_freedom(self) -> float:
        """Degrees of freedom of a standard error over independent draws or replicates."""
        is_replicated = self.error_model is ErrorModel.REPLICATED
        return (self.replicate_count if is_replicated else self.effective_size) - 1


# The shape of a sample's tail: whether a few runs decide its spread.

# Limits for the interval of the standard deviation, from its coverage in simulations. Beyond the
# first two, the tail is so heavy that only a few runs decide the variance. With few runs, a heavy
# tail can remain hidden: usually below the third limit, sometimes up to the fourth.
_HEAVY_KURTOSIS = 6.0
FEWEST_EFFECTIVE_RUNS = 1000.0
FEWEST_RUNS_FOR_TAILS = 200
ENOUGH_RUNS_FOR_TAILS = 1000
# With fewer runs, a tail that no run has met may be long enough to move any mean.
ENOUGH_RUNS_FOR_MEANS = 2000
# A distribution with a heavier tail may give a sample below the former limit, seldom below this.
DOUBTFUL_KURTOSIS = 4.5


@dataclass(frozen=True)
class SampleShape:
    """A sample's deviations from its mean, and the influence of few runs on them.

    Every number is an array of shape (...), as the sample has values of shape (..., run).
    """

    sample: Sample

    @cached_property
    def mean(self) -> FloatArray:
        """The mean, also of values near the end of the numbers."""
        values = self.sample.values
        if not self.sample.size:
            return np.full(values.shape[:-1], np.nan)
        # The sum of values over their largest cannot overflow.
        largest = np.maximum(self.sample.largest, -self.sample.smallest)
        largest = np.where(largest > 0, largest, 1.0)
        means = self.sample.mean(values / largest[..., np.newaxis]) * largest
        return np.where(self.sample.is_constant, values[..., 0], means)

    @cached_property
    def scale(self) -> FloatArray:
        """The largest deviation; powers of values divided by it neither overflow nor vanish."""
        if not self.sample.size:
            return np.full(self.mean.shape, np.nan)
        # Rounding is monotonic, so the largest deviation is that of an end.
        return np.maximum(self.sample.largest - self.mean, self.mean - self.sample.smallest)

    def powers(self, power: int) -> Column:
        """Return the deviations over `scale`, or their squares."""
        return self.deviations if power == 1 else self.deviations**power

    @cached_property
    def deviations(self) -> FloatArray:
        """Deviations from the mean over `scale`, shape (..., run)."""
        varies = self.scale > 0
        scale = np.where(varies, self.scale, 1.0)
        deviations: FloatArray = self.sample.values - self.mean[..., np.newaxis]
        deviations /= scale[..., np.newaxis]
        deviations[~varies] = 0.0
        return deviations

    def moment(self, power: int) -> FloatArray:
        """Mean of a power of the deviations over `scale`; NaN where these are all 0."""
        if not self.sample.size:
            return self.scale
        # Products, as a power takes twenty times as long.
        powers = self.deviations**2
        if power > 2:
            powers = powers * (self.deviations if power == 3 else powers)
        return np.where(self.scale > 0, self.sample.mean(powers), np.nan)

    @property
    def std(self) -> FloatArray:
        """The standard deviation in the unit of the values, without weights; 0 of a constant."""
        return self.scale * self.deviations.std(axis=-1)

    @cached_property
    def skewness(self) -> FloatArray:
        """The third standardized moment."""
        return self.moment(3) / _power(self.moment(2), 1.5)

    @cached_property
    def kurtosis(self) -> FloatArray:
        """Fourth standardized moment; 3 for a normal distribution."""
        return self.moment(4) / _power(self.moment(2), 2)

    @cached_property
    def effective_runs(self) -> FloatArray:
        """(Σd²)²/Σd⁴ of the deviations d, times the weights: the runs that decide the variance."""
        if self.sample.run_weights is None:
            return self.sample.size / self.kurtosis
        return effective_sizes((self.sample.run_weights * self.deviations) ** 2)

    @property
    def has_few_effective_runs(self) -> BoolArray:
        """True if the effective runs are too few for a heavy tail."""
        return self.effective_runs < FEWEST_EFFECTIVE_RUNS

    @property
    def is_heavy(self) -> BoolArray:
        """True if a few runs dominate the variance, so that no interval of it is reliable."""
        return (self.kurtosis > _HEAVY_KURTOSIS) & self.has_few_effective_runs

    @property
    def may_be_heavy(self) -> BoolArray:
        """True if the runs are a heavy tail's, or may be: no interval of the spread is reliable."""
        return (self.kurtosis > DOUBTFUL_KURTOSIS) & self.has_few_effective_runs

    @cached_property
    def is_uncertain(self) -> BoolArray:
        """True where the scatter of the runs does not show the error of the variance."""
        return bool(self.hidden_tail) | self.is_heavy

    @property
    def is_small(self) -> bool:
        """True if there are so few runs that any of them may hide a heavy tail."""
        return self.sample.effective_size < ENOUGH_RUNS_FOR_TAILS

    @property
    def is_doubtful(self) -> BoolArray:
        """True if the distribution may have a heavier tail than these runs show."""
        return self.is_small | self.may_be_heavy

    @property
    def hidden_tail(self) -> str:
        """Reason why the runs cannot show a heavy tail; empty where there are enough."""
        if self.sample.effective_size >= FEWEST_RUNS_FOR_TAILS:
            return ""
        is_weighted = self.sample.weights is not None
        text = texts.HIDDEN_TAIL_OF_WEIGHTED if is_weighted else texts.HIDDEN_TAIL
        return text.format(runs=FEWEST_RUNS_FOR_TAILS)

    @property
    def tail_note(self) -> str:
        """Kurtosis and effective runs of a heavy tail, as text."""
        if self.sample.is_at_places:
            return texts.HEAVY_TAIL_AT_PLACES
        return texts.HEAVY_TAIL.format(kurtosis=self.kurtosis, runs=self.effective_runs)


class DistanceShape(SampleShape):
    """The shape of distances, which are deviations from a mean as they are."""

    @cached_property
    def mean(self) -> FloatArray:
        """Zero."""
        return np.zeros(self.sample.values.shape[:-1])


def _power(base: FloatArray, exponent: float) -> FloatArray:
    """Return powers by the C library, whose last digits do not depend on the shape of an array."""
    return np.asarray(np.frompyfunc(lambda each: each**exponent, 1, 1)(base), dtype=np.float64)
