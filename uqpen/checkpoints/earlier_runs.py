"""Finished runs of a model from earlier studies, found by the values of their inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from uqpen.checkpoints.identity import depends_on_batch
from uqpen.checkpoints.parts import select_results
from uqpen.checkpoints.point_index import BatchIndex, Index, PointIndex
from uqpen.checkpoints.sources import RunSource
from uqpen.core.arrays import Arrays, IntArray
from uqpen.core.model import Model, Results
from uqpen.execution.batch import BatchResult, join_results
from uqpen.execution.batching import BATCH_SIZE

__all__ = ["EarlierRuns"]


class EarlierRuns:
    """Finished runs of a model from earlier studies.

    Parameters
    ----------
    model : Model
        The model that the runs were made with.
    sources : sequence of RunSource
        One or more, the preferred ones first. All runs have the same inputs and outputs.
    """

    @classmethod
    def by_inputs(
        cls, model: Model, sources: Sequence[RunSource]
    ) -> dict[frozenset[str], EarlierRuns]:
        """Return the runs by those inputs of the model that they were given."""
        names = {variable.name for variable in model.inputs}
        given: dict[frozenset[str], list[RunSource]] = {}
        for source in sources:
            inputs = {name: each for name, each in source.runs.inputs.items() if name in names}
            own = replace(source, runs=replace(source.runs, inputs=inputs))
            given.setdefault(frozenset(inputs), []).append(own)
        return {inputs: cls(model, found) for inputs, found in given.items()}

    def __init__(self, model: Model, sources: Sequence[RunSource]) -> None:
        self._model = model
        self.sources = sources
        self._starts = np.cumsum([0, *(len(source.runs.runs) for source in sources)])
        self._is_used = np.zeros(self._starts[-1], dtype=np.bool_)

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of the run at each point, shape (run,); -1 where there is none.

        Of a model whose results may depend on the batch, only runs of whole batches are found.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            Consecutive points of a round in SI units.
        start, size : int
            Number of the first of them in its round, and of all points of the round.
        """
        return self._index.find(inputs, start, size)

    def statuses(self, at: IntArray) -> IntArray:
        """Return the statuses of runs, given their positions."""
        return self._results.status[at].astype(np.int64)

    def batch_results(self, start: int, at: IntArray) -> Iterator[BatchResult]:
        """Yield runs as batch results; the runs of each are consecutive.

        Parameters
        ----------
        start : int
            Number of the first point.
        at : ndarray of int, shape (run,)
            The position of the run at each point; -1 for none.
        """
        ends = np.flatnonzero(np.diff(at >= 0)) + 1
        for begin, end in pairwise([0, *ends.tolist(), len(at)]):
            if at[begin] >= 0:
                yield BatchResult(start + begin, select_results(self._results, at[begin:end]))

    def use(self, at: IntArray) -> Iterator[tuple[RunSource, IntArray]]:
        """Record that runs are taken, given positions or -1; yield their sources and statuses."""
        at = at[at >= 0]
        self._is_used[at] = True
        numbers = self._source_numbers(at)
        for number in np.unique(numbers).tolist():
            yield self.sources[number], self.statuses(at[numbers == number])

    def sources_of(self, at: IntArray) -> list[RunSource]:
        """Return the sources of runs, given their positions or -1."""
        numbers = np.unique(self._source_numbers(at[at >= 0]))
        return [self.sources[number] for number in numbers.tolist()]

    def _source_numbers(self, at: IntArray) -> IntArray:
        return np.searchsorted(self._starts, at, side="right") - 1

    def used_up(self) -> Iterator[RunSource]:
        """Yield the sources all of whose runs have been taken."""
        for source, start in zip(self.sources, self._starts, strict=False):
            if self._is_used[start : start + len(source.runs.runs)].all():
                yield source

    @cached_property
    def _inputs(self) -> Arrays:
        names = self.sources[0].runs.inputs
        parts = [source.runs.inputs for source in self.sources]
        return {name: np.concatenate([part[name] for part in parts]) for name in names}

    @cached_property
    def _results(self) -> Results:
        return join_results([source.runs.results for source in self.sources])

    @cached_property
    def _index(self) -> Index:
        if not depends_on_batch(self._model):
            return PointIndex(self._inputs)
        batches = [
            start + batch
            for start, source in zip(self._starts, self.sources, strict=False)
            for batch in source.whole_batches()
        ]
        return BatchIndex(self._inputs, batches, BATCH_SIZE)
