"""One variable over runs, as a sample of the input law."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.labels import (
    DEPENDENCE,
    MATRIX,
    OPTIMIZED_BY,
    REPLICATE,
    ROLE,
    ROUND,
    RUN,
    SAMPLING,
    STATUS,
    Sampling,
    Status,
)
from uqpen.designs.pick_freeze import MATRIX_A, MATRIX_B

__all__ = ["ErrorModel", "Sample", "input_sample"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class ErrorModel(StrEnum):
    """How a sample's error can be told."""

    INDEPENDENT = "independent draws"
    REPLICATED = "independent replicates"
    SINGLE_STRATIFIED_SET = "one stratified set"
    UNKNOWN = "points of unknown origin"


_NO_DRAWS = "the points are no draws from the law"


def input_sample(runs: xr.Dataset) -> xr.Dataset:
    """Those runs of a design whose points are a sample of the input law.

    All of them, but for pick-freeze blocks: there, the rows of the first two matrices as they were
    drawn at first.

    Parameters
    ----------
    runs : Dataset
        Of a design whose `Sampling` is that of a sample.
    """
    if Sampling(runs.attrs[SAMPLING]) is not Sampling.PICK_FREEZE:
        return runs
    drawn = np.isin(runs[MATRIX].values, (MATRIX_A, MATRIX_B))
    if ROUND in runs.coords:
        drawn &= runs[ROUND].values == 0
    return runs.isel({RUN: drawn})


@dataclass(frozen=True)
class Sample:
    """One variable over the runs of a design that came back.

    The design's points are kept whole: what is stratified are all of them, not those that came
    back.

    Parameters
    ----------
    values : ndarray, shape (run,)
        In the variable's SI unit.
    used : ndarray of int, shape (run,)
        Which of the points came back.
    missing : ndarray of int, shape (lost,)
        Which of them were lost for reasons that may have to do with the answer: every loss but
        that of an inadmissible point.
    points : ndarray, shape (point, random input)
        All points of the design.
    inputs : tuple of str
        The random inputs, in the order of the columns of `point_trace`.
    replicates : ndarray of int, shape (point,)
        The replicate of each point, from 0.
    sampling : Sampling
        How the design drew its points.
    dependence : str
        How the inputs depend on each other; empty where they do not.
    optimized_by : str
        The criterion by which the points of a replicate were moved apart; empty for none.
    """

    values: FloatArray
    used: IntArray
    missing: IntArray
    points: FloatArray
    inputs: tuple[str, ...]
    replicates: IntArray
    sampling: Sampling
    dependence: str = ""
    optimized_by: str = ""

    @classmethod
    def from_runs(cls, runs: xr.Dataset, name: str) -> Sample:
        """The sample of a variable in a runs dataset."""
        return cls.several_from_runs(runs, [name])[name]

    @classmethod
    def several_from_runs(cls, runs: xr.Dataset, names: Iterable[str]) -> dict[str, Sample]:
        """The samples of several variables, by name; they share one copy of the points."""
        used = np.flatnonzero(runs[STATUS].values == Status.OK)
        whole = cls._from_values(runs, np.full(used.shape, np.nan), used)
        return {
            name: replace(whole, values=runs[name].values[used].astype(np.float64))
            for name in names
        }

    @classmethod
    def from_statuses(cls, runs: xr.Dataset) -> Sample:
        """The sample of the runs' statuses, in which none is lost."""
        values = runs[STATUS].values.astype(np.float64)
        return cls._from_values(runs, values, np.arange(len(values)))

    @classmethod
    def _from_values(cls, runs: xr.Dataset, values: FloatArray, used: IntArray) -> Sample:
        status = runs[STATUS].values
        failed = np.flatnonzero((status != Status.OK) & (status != Status.INADMISSIBLE))
        random = {
            str(name): variable.values
            for name, variable in runs.data_vars.items()
            if variable.attrs.get(ROLE) == "input" and variable.dims == (RUN,)
        }
        replicates = np.zeros(len(status), dtype=np.int64)
        if REPLICATE in runs.coords:
            replicates = runs[REPLICATE].values.astype(np.int64)
        return cls(
            values=values,
            used=used,
            missing=np.setdiff1d(failed, used, assume_unique=True),
            points=np.column_stack([*random.values()]) if random else np.empty((len(status), 0)),
            inputs=tuple(random),
            replicates=replicates,
            sampling=Sampling(runs.attrs[SAMPLING]),
            dependence=str(runs.attrs.get(DEPENDENCE, "")),
            optimized_by=str(runs.attrs.get(OPTIMIZED_BY, "")),
        )

    def with_missing(self) -> Sample:
        """The same sample with its missing runs at the end, their values not a number."""
        used = np.concatenate([self.used, self.missing])
        values = np.concatenate([self.values, np.full(self.missing.shape, np.nan)])
        return replace(self, values=values, used=used, missing=self.missing[:0])

    @property
    def size(self) -> int:
        """How many runs there are."""
        return len(self.values)

    @cached_property
    def sorted_values(self) -> FloatArray:
        """The values, ascending."""
        return np.sort(self.values)

    @property
    def is_constant(self) -> bool:
        """Whether all values are the same."""
        return self.size > 0 and bool(self.sorted_values[0] == self.sorted_values[-1])

    @cached_property
    def replicate(self) -> IntArray:
        """The replicate of each run, numbered through those that are not empty."""
        _, numbered = np.unique(self.replicates[self.used], return_inverse=True)
        return numbered.astype(np.int64)

    @property
    def replicate_count(self) -> int:
        """How many replicates are not empty."""
        return int(self.replicate.max(initial=-1)) + 1

    @property
    def error_model(self) -> ErrorModel:
        """How its error can be told."""
        if self.sampling is Sampling.USER_SUPPLIED or not self.sampling.is_sample:
            return ErrorModel.UNKNOWN
        if self.sampling is Sampling.INDEPENDENT:
            return ErrorModel.INDEPENDENT
        return (
            ErrorModel.REPLICATED
            if self.replicates.max(initial=0) > 0
            else ErrorModel.SINGLE_STRATIFIED_SET
        )

    @property
    def reason_without_intervals(self) -> str:
        """Why no interval at all can be told; empty where one can."""
        if not self.sampling.is_sample:
            return _NO_DRAWS
        if self.error_model is ErrorModel.UNKNOWN:
            return "the table does not say that its points are independent (independent = true)"
        if self.size == 0:
            blocks = self.sampling is Sampling.PICK_FREEZE
            return "no run of the matrices A and B came back" if blocks else "no run came back"
        if self.size == 1:
            return "a single run has no scatter"
        if self.error_model is ErrorModel.REPLICATED and self.replicate_count < 2:
            return "the runs that came back are all of one replicate"
        return ""

    @property
    def too_few_runs(self) -> str:
        """That there are too few runs, where that is the reason for something."""
        return "a single run is too few" if self.size == 1 else f"{self.size} runs are too few"

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of a standard error over independent draws or replicates."""
        return (
            self.replicate_count if self.error_model is ErrorModel.REPLICATED else self.size
        ) - 1
