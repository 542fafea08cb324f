"""One variable over runs, as a sample of the joint distribution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import TypeVar, cast

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.sampling import Sampling
from uqpen.statistics import texts
from uqpen.statistics.error_model import ErrorModel
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.input_columns import InputColumns, RunInputs
from uqpen.statistics.ordering import Ordering
from uqpen.statistics.weights import effective_size, weighted_mean

__all__ = ["ErrorModel", "Sample"]

Made = TypeVar("Made")

# With a smaller effective size, the coverage of intervals of weighted draws was below nominal.
_SMALLEST_EFFECTIVE_SIZE = 20

# Replicates whose counts at the values of a distribution function are in memory together: 8 MB.
_COUNTED_TOGETHER = 1024


@dataclass(frozen=True)
class Sample:
    """One variable over the completed runs of a design.

    All points of the design are kept, since the design stratifies all its points, not the
    completed ones alone.

    Parameters
    ----------
    values : ndarray, shape (run,)
        In the variable's SI unit. Of a field that of all runs has the shape (run, *dims); at places
        of a field that exist in the same runs it has the shape (place, run).
    used : ndarray of int, shape (run,)
        Numbers of the points with a completed run.
    missing : ndarray of int, shape (missing,)
        Numbers of the points whose run failed for a reason that may depend on the output: every
        failed run except at inadmissible points.
    columns : InputColumns
        The random inputs at all points of the design.
    replicates : ndarray of int, shape (point,)
        The replicate of each point, from 0.
    sampling : Sampling
        How the design drew its points.
    dependence : str
        How the inputs depend on each other; empty where they do not.
    optimized_by : str
        The criterion by which the points of a replicate were moved apart; empty for none.
    weights : ndarray, shape (point,), optional
        Relative weight of each point, where the points are draws of another distribution than the
        study's: the ratio of the two densities, up to a factor.
    level : float
        Confidence level of the intervals of its statistics.
    """

    values: FloatArray
    used: IntArray
    missing: IntArray
    columns: InputColumns
    replicates: IntArray
    sampling: Sampling
    dependence: str = ""
    optimized_by: str = ""
    weights: FloatArray | None = None
    level: float = LEVEL

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
        return self.size if self.run_weights is None else effective_size(self.run_weights)

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the mean of values of shape (..., run), at least one, by the runs' weights."""
        if self.run_weights is None:
            return np.asarray(values.mean(axis=-1))
        return weighted_mean(values, self.run_weights)

    def events_with_missing(self, events: BoolArray, *, happened: bool) -> BoolArray:
        """Return an event over the runs of `with_missing`, with one outcome of the missing ones."""
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

    @property
    def replicate_sizes(self) -> IntArray:
        """Number of runs of each replicate."""
        return np.bincount(self.replicate)

    @cached_property
    def sorted_values(self) -> FloatArray:
        """The values, ascending along the runs."""
        return np.sort(self.values, axis=-1)

    @cached_property
    def is_constant(self) -> BoolArray:
        """True where all values are equal, shape () or (place,)."""
        if not self.size:
            return np.zeros(self.values.shape[:-1], dtype=np.bool_)
        return np.asarray(self.values.min(axis=-1) == self.values.max(axis=-1))

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
        return int(self.replicate.max(initial=-1)) + 1

    def once(self, name: str, make: Callable[[], Made]) -> Made:
        """Return what follows from the sample alone; of a single variable it is made once.

        At places of a field it would be as large as the field.
        """
        if self.is_at_places:
            return make()
        if name not in self._made:
            self._made[name] = make()
        return cast(Made, self._made[name])

    @cached_property
    def _made(self) -> dict[str, object]:
        return {}

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
        return self.too_few_runs if is_weighted and is_small else ""

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
    def degrees_of_freedom(self) -> float:
        """Degrees of freedom of a standard error over independent draws or replicates."""
        is_replicated = self.error_model is ErrorModel.REPLICATED
        return (self.replicate_count if is_replicated else self.effective_size) - 1
