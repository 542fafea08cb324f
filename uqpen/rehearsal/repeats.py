"""Repeats of a study as work for an executor: a batch is made of numbers of repeats."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.benchmark.statistics import BenchmarkStatistic
from uqpen.core.arrays import FloatArray
from uqpen.core.errors import WorkerError
from uqpen.core.labels import BOUNDS
from uqpen.core.limits import Limits
from uqpen.core.model import Results
from uqpen.core.status import Status
from uqpen.execution import Map
from uqpen.execution.batch import Batch, BatchResult
from uqpen.rehearsal.sources import RehearsedSource
from uqpen.study.study import ValidatedStudy

__all__ = ["Repeat", "RepeatWork", "make_repeats"]

_REPEAT, _RUNS, _ESTIMATES = "repeat", "runs", "estimates"


@dataclass(frozen=True)
class Repeat:
    """Estimates of one repeat of a study.

    Parameters
    ----------
    number : int
        Its number, from 0.
    runs : ndarray, shape (source,)
        Number of runs of each source.
    estimates : ndarray, shape (source, entry, bound)
        In SI units, the entries of all statistics one after the other; NaN for none.
    """

    number: int
    runs: FloatArray
    estimates: FloatArray


@dataclass(frozen=True)
class RepeatWork:
    """Work of an executor: repeats of a study by all its sources.

    Parameters
    ----------
    study : ValidatedStudy
        Of a single model, which costs next to nothing.
    sources : tuple of RehearsedSource
    statistics : tuple of BenchmarkStatistic
    """

    study: ValidatedStudy
    sources: tuple[RehearsedSource, ...]
    statistics: tuple[BenchmarkStatistic, ...]
    limits: Limits = Limits()
    is_untrusted: bool = False
    retries: int = 0

    @property
    def is_object(self) -> bool:
        """True if the model is an object of this process."""
        return self.study.model.is_object

    def __call__(self, batch: Batch) -> BatchResult:
        """Return the result of a batch of repeats."""
        made = [self._repeat(int(number)) for number in batch.inputs[_REPEAT]]
        runs, estimates = (np.stack(each) for each in zip(*made, strict=True))
        return BatchResult(batch.start, Results.all_ok({_RUNS: runs, _ESTIMATES: estimates}))

    def failed_result(self, batch: Batch, status: Status, reason: str) -> BatchResult:
        """Raise an error: a repeat that kills its process says nothing of the intervals."""
        raise WorkerError(f"repeat {batch.start} has ended its process: {reason}")

    def _repeat(self, number: int) -> tuple[FloatArray, FloatArray]:
        found = [source.estimates(self.study, number) for source in self.sources]
        rows = [
            np.concatenate([each.estimates(estimates) for each in self.statistics])
            for _, estimates in found
        ]
        return np.array([runs for runs, _ in found], dtype=np.float64), np.stack(rows)


def make_repeats(work: RepeatWork, numbers: range, map: Map) -> Iterator[Repeat]:
    """Make repeats of a study; yield each as it is done, in any order."""
    batches = (Batch(number, {_REPEAT: np.array([float(number)])}) for number in numbers)
    for done in map(work, batches):
        outputs = done.results.outputs
        for position in range(len(done)):
            estimates = outputs[_ESTIMATES][position]
            assert estimates.shape[-1] == len(BOUNDS)
            yield Repeat(done.start + position, outputs[_RUNS][position], estimates)
