"""One variable over runs, as a sample, and the standard error that their design allows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.intervals import additive_residual_error, ratio_error
from uqpen.labels import REPLICATE, ROLE, RUN, SAMPLING, STATUS, Sampling, Status

__all__ = ["Plan", "Sample"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class Plan(StrEnum):
    """How a sample's error can be told."""

    INDEPENDENT = "independent draws"
    REPLICATED = "independent replicates"
    SINGLE = "one stratified set"
    UNKNOWN = "points of unknown origin"


@dataclass(frozen=True)
class Sample:
    """One variable over the runs of a design, usually those that came back.

    Parameters
    ----------
    values : ndarray, shape (run,)
        In the variable's SI unit.
    points : ndarray, shape (point, random input)
        The points, those of lost runs too.
    used : ndarray of int, shape (run,)
        Which of the points came back.
    replicate : ndarray of int, shape (run,)
        The replicate of each run, from 0.
    replicates : int
        How many there were.
    sampling : Sampling
        How the design drew its points.
    """

    values: FloatArray
    points: FloatArray
    used: IntArray
    replicate: IntArray
    replicates: int
    sampling: Sampling

    @classmethod
    def of(cls, runs: xr.Dataset, name: str, *, with_lost: bool = False) -> Sample:
        """The sample of a variable in a runs dataset; lost runs are left out unless asked for."""
        used = np.flatnonzero((runs[STATUS].values == Status.OK) | with_lost)
        random = [
            variable.values
            for variable in runs.data_vars.values()
            if variable.attrs.get(ROLE) == "input" and variable.dims == (RUN,)
        ]
        total = runs.sizes[RUN]
        points = np.column_stack(random) if random else np.empty((total, 0))
        replicate = np.zeros(total, dtype=np.int64)
        if REPLICATE in runs.coords:
            replicate = runs[REPLICATE].values.astype(np.int64)
        return cls(
            values=runs[name].values[used].astype(np.float64),
            points=points,
            used=used,
            replicate=replicate[used],
            replicates=int(replicate.max(initial=0)) + 1,
            sampling=Sampling(runs.attrs[SAMPLING]),
        )

    @property
    def size(self) -> int:
        """How many runs there are."""
        return len(self.values)

    @cached_property
    def ordered(self) -> FloatArray:
        """The values, ascending."""
        return np.sort(self.values)

    @property
    def plan(self) -> Plan:
        """How its error can be told."""
        if self.sampling is Sampling.GIVEN:
            return Plan.UNKNOWN
        if self.sampling is Sampling.INDEPENDENT:
            return Plan.INDEPENDENT
        return Plan.REPLICATED if self.replicates > 1 else Plan.SINGLE

    @property
    def rounding_error(self) -> float:
        """Standard error that a share may have because runs are counted whole, at most.

        Over strata a replicate's count is one of two whole numbers, so it scatters by half a run
        at most; where the replicates happen to agree, their scatter tells nothing of it.
        """
        return 0.5 * math.sqrt(self.replicates) / self.size

    def standard_error(self, influence: FloatArray) -> tuple[float, float]:
        """Standard error of a mean over the sample, and its degrees of freedom.

        Parameters
        ----------
        influence : ndarray, shape (run,)
            Values whose mean is estimated, or each run's influence on an estimate.

        Returns
        -------
        error, freedom : float
            NaN and 0 where the design allows none.
        """
        if self.size < 2 or self.plan is Plan.UNKNOWN:
            return math.nan, 0
        if self.plan is Plan.REPLICATED:
            return ratio_error(influence, self.replicate, self.replicates)
        if self.plan is Plan.SINGLE:
            return self._single_error(influence)
        return float(influence.std(ddof=1)) / math.sqrt(self.size), self.size - 1

    def _single_error(self, influence: FloatArray) -> tuple[float, float]:
        # What is stratified are all the points: with lost runs the mean is a ratio of sums over
        # them, and a lost run adds nothing to either.
        deviation = np.zeros(len(self.points))
        deviation[self.used] = influence - influence.mean()
        error, freedom = additive_residual_error(deviation, self.points)
        return error * len(self.points) / self.size, freedom

    def counts(self, thresholds: FloatArray) -> IntArray:
        """How many values lie at or below each threshold, by replicate.

        Returns
        -------
        ndarray of int, shape (replicate, threshold)
        """
        return np.array(
            [np.searchsorted(part, thresholds, side="right") for part in self._ordered_replicates()]
        )

    def replicate_sizes(self) -> IntArray:
        """How many runs of each replicate came back."""
        return np.bincount(self.replicate, minlength=self.replicates)

    def _ordered_replicates(self) -> Iterator[FloatArray]:
        if self.replicates == 1:
            yield self.ordered
            return
        for replicate in range(self.replicates):
            yield np.sort(self.values[self.replicate == replicate])
