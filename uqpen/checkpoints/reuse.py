"""Finished runs, found by the values of their inputs: looked up, taken and counted."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.checkpoints.identity import depends_on_batch
from uqpen.checkpoints.parts import select_results
from uqpen.checkpoints.sources import RunSource
from uqpen.core.arrays import Arrays, IntArray
from uqpen.core.blocks import LoadedDataset
from uqpen.core.labels import NOT_MADE_AGAIN, RUN
from uqpen.core.model import Model, Results
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.rounds import first_round
from uqpen.distributions.constraints import Constraint
from uqpen.execution import Progress
from uqpen.execution.batch import BatchResult, join_results
from uqpen.execution.batching import BATCH_SIZE
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.study import ValidatedStudy

__all__ = [
    "BY_MACHINE",
    "BatchIndex",
    "IndexedRuns",
    "PointIndex",
    "RunFinder",
    "by_inputs",
    "first_points",
]

# Whether a run ends so may depend on the machine.
BY_MACHINE = (Status.TIMED_OUT, Status.CRASHED)

_LOST_BY_MACHINE = "runs that timed out or crashed in an earlier study"

_Hashes = npt.NDArray[np.uint64]

# Odd, with its bits spread: a multiplication moves each bit of an input into the higher ones.
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)
_SHIFT = np.uint64(29)


def by_inputs(model: Model, sources: Iterable[RunSource]) -> dict[frozenset[str], list[RunSource]]:
    """Return sources of runs by those inputs of a model that their runs were given."""
    names = {variable.name for variable in model.inputs}
    found: dict[frozenset[str], list[RunSource]] = {}
    for source in sources:
        inputs = {name: each for name, each in source.runs.inputs.items() if name in names}
        own = replace(source, runs=replace(source.runs, inputs=inputs))
        found.setdefault(frozenset(inputs), []).append(own)
    return found


class IndexedRuns:
    """Finished runs of a model that were given the same inputs, found by their values.

    Parameters
    ----------
    model : Model
        The model that the runs were made with.
    sources : sequence of RunSource
        One or more, the preferred ones first. All runs have the same inputs and outputs.
    constraints : sequence of Constraint
        Those of the study.
    """

    def __init__(
        self, model: Model, sources: Sequence[RunSource], constraints: Sequence[Constraint]
    ) -> None:
        self._model = model
        self.sources = sources
        self._constraints = constraints
        self._starts = np.cumsum([0, *(len(source.runs.runs) for source in sources)])
        self._is_used = np.zeros(self._starts[-1], dtype=np.bool_)

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of the run at each point, shape (run,); -1 where there is none.

        Of a model whose results may depend on the batch, only runs of whole batches are found. Runs
        at points that the constraints exclude are not.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            Consecutive points of a round in SI units.
        start, size : int
            Number of the first of them in its round, and of all points of the round.
        """
        at = self._index.find(inputs, start, size)
        is_admissible = np.ones(len(at), dtype=np.bool_)
        for constraint in self._constraints:
            is_admissible &= constraint.is_satisfied(inputs)
        is_wrong = ~is_admissible & (self._results.status[at] != Status.INADMISSIBLE)
        return np.where(is_wrong, -1, at)

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
            yield self.sources[number], self._results.status[at[numbers == number]]

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
    def _index(self) -> PointIndex | BatchIndex:
        if not depends_on_batch(self._model):
            return PointIndex(self._inputs)
        batches = [
            start + batch
            for start, source in zip(self._starts, self.sources, strict=False)
            for batch in source.whole_batches()
        ]
        return BatchIndex(self._inputs, batches, BATCH_SIZE)


class RunFinder:
    """Finished runs of the models of a study, and a record of those that it takes.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    sources : mapping of str to sequence of RunSource
        The sources of runs by the name of a model, the preferred ones first.
    progress : Progress
        Receives the numbers of runs that are taken.
    """

    def __init__(
        self,
        study: ValidatedStudy,
        sources: Mapping[str, Sequence[RunSource]],
        progress: Progress,
    ) -> None:
        self.sources = sources
        self._study = study
        self._progress = progress
        self._indexed = {
            name: {
                inputs: IndexedRuns(model, own, study.constraints)
                for inputs, own in by_inputs(model, found).items()
            }
            for name, found in sources.items()
            for model in [study.models[name].model]
        }
        self._made_with: set[str] = set()
        self._not_made_again: set[tuple[str, str]] = set()

    def checkpoint(self, own: Checkpoint, design: str, model: str) -> Checkpoint:
        """Return a checkpoint that restores these runs, too, of a model in a round of a design.

        `own` has the round's own runs, and gets those that are made.
        """
        return _ReusingCheckpoint(self, own, design, model) if self._indexed[model] else own

    def indexed_runs(self, model: str, inputs: Arrays) -> IndexedRuns | None:
        """Return the runs of a model with those inputs that points have; None for none."""
        names = {variable.name for variable in self._study.models[model].model.inputs}
        return self._indexed[model].get(frozenset(names.intersection(inputs)))

    def count(self, found: IndexedRuns, at: IntArray, design: str, model: str) -> None:
        """Record the runs that a design takes, given their positions."""
        label = f"{model}: {design}" if model else design
        for source, statuses in found.use(at):
            self._progress.count_reused(len(statuses), source.place)
            self._made_with.update(f"{label}: {text}" for text in source.made_with)
            if np.isin(statuses, BY_MACHINE).any():
                self._made_with.add(f"{label}: {_LOST_BY_MACHINE}")
            if (model, source.place) in self._not_made_again:
                self.record_not_made_again(design, model)

    def mark_not_made_again(self, model: str, place: str) -> None:
        """Note that none of a model's runs from a place was made again before they are taken."""
        self._not_made_again.add((model, place))

    def record_not_made_again(self, design: str, model: str) -> None:
        """Record that such runs of a design are taken."""
        label = f"{model}: {design}" if model else design
        self._made_with.add(f"{label}: {NOT_MADE_AGAIN}")

    def used_places(self, model: str, inputs: Arrays) -> set[str]:
        """Return the places of a model's runs that are at the first points of a round."""
        found = self.indexed_runs(model, inputs)
        if found is None:
            return set()
        at = found.find(inputs, 0, len(next(iter(inputs.values()))))
        return {source.place for source in found.sources_of(at)}

    def used_folders(self) -> set[Path]:
        """Return the folders all of whose runs have been taken."""
        runs = [each for found in self._indexed.values() for each in found.values()]
        used = Counter(source.folder for each in runs for source in each.used_up())
        every = Counter(source.folder for each in runs for source in each.sources)
        return {folder for folder in used if folder and used[folder] == every[folder]}

    def record(self) -> str:
        """Return what the taken runs were made with, a line each; empty if all would be alike here.

        Runs that timed out or crashed might not do so here.
        """
        return "\n".join(sorted(self._made_with))


def first_points(study: ValidatedStudy, design: str, model: str) -> Arrays:
    """Return the first points of a design, at most 65 536, as a model takes them.

    Returns
    -------
    mapping of str to ndarray, shape (run,)
        SI values by input.
    """
    stream = Stream(study.seed, "designs", design)
    drawn = first_round(study.designs[design], study.joint, stream)
    points = drawn.assign(study.models[model].given)
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    head = blocked.read(0, min(blocked.size, BLOCK))
    return {str(key): head[key].broadcast_like(head[RUN]).values for key in head.data_vars}


class _ReusingCheckpoint(Checkpoint):
    """Checkpoint of a round that also restores runs of other places."""

    def __init__(self, finder: RunFinder, own: Checkpoint, design: str, model: str) -> None:
        self._finder, self._own = finder, own
        self._design, self._model = design, model
        self._size = 0

    def prepare(self, runs: int) -> int:
        self._size = runs
        return self._own.prepare(runs)

    def restore(self, start: int, inputs: Arrays) -> Iterator[BatchResult]:
        found = self._finder.indexed_runs(self._model, inputs)
        if found is None:
            yield from self._own.restore(start, inputs)
            return
        at = found.find(inputs, start, self._size)
        for batch_result in self._own.restore(start, inputs):
            first = batch_result.start - start
            at[first : first + len(batch_result)] = -1
            yield batch_result
        yield from found.batch_results(start, at)
        self._finder.count(found, at, self._design, self._model)

    def save(self, inputs: Arrays, batch_result: BatchResult) -> None:
        self._own.save(inputs, batch_result)

    def collect(self, blocks: Iterable[xr.Dataset], runs: int) -> xr.Dataset:
        return self._own.collect(blocks, runs)


class PointIndex:
    """Index of single points; of equal ones it finds the first.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (run,)
        The known points.
    """

    def __init__(self, inputs: Arrays) -> None:
        self._names = list(inputs)
        self._columns = _bits(inputs, self._names)
        hashes = _hashes(self._columns)
        self._order = np.argsort(hashes, kind="stable")
        self._hashes = hashes[self._order]

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of each point among the known ones, shape (run,); -1 for none.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            Consecutive points of a round.
        start, size : int
            Number of the first of them in its round, and of all points of the round.
        """
        columns = _bits(inputs, self._names)
        hashes = _hashes(columns)
        found = np.full(len(hashes), -1)
        # In ascending order a search takes a tenth of the time.
        left = np.argsort(hashes)
        place = np.empty(len(hashes), dtype=np.int64)
        place[left] = np.searchsorted(self._hashes, hashes[left])
        # Points of one hash stand side by side. They are nearly always equal.
        while left.size:
            left = left[place[left] < len(self._hashes)]
            left = left[self._hashes[place[left]] == hashes[left]]
            known = self._order[place[left]]
            is_equal = np.ones(len(left), dtype=np.bool_)
            for own, other in zip(self._columns, columns, strict=True):
                is_equal &= own[known] == other[left]
            found[left[is_equal]] = known[is_equal]
            left = left[~is_equal]
            place[left] += 1
        return found


class BatchIndex:
    """Index of whole batches, for a model whose results may depend on the batch.

    Parameters
    ----------
    inputs : mapping of str to ndarray, shape (run,)
        The known points.
    batches : sequence of ndarray
        The positions of the points of each batch, in their order.
    size : int
        Number of points of a batch; the last one of a round may have fewer.
    """

    def __init__(self, inputs: Arrays, batches: Sequence[IntArray], size: int) -> None:
        self._names = list(inputs)
        self._size = size
        columns = _bits(inputs, self._names)
        self._batches: dict[bytes, IntArray] = {}
        for batch in batches:
            self._batches.setdefault(_digest([column[batch] for column in columns]), batch)

    def find(self, inputs: Arrays, start: int, size: int) -> IntArray:
        """Return the position of each point among the known ones, as `PointIndex.find` does."""
        columns = _bits(inputs, self._names)
        stop = start + len(columns[0])
        found = np.full(stop - start, -1)
        # A batch may begin in an earlier block, and end in a later one; such a one is not found.
        for first in range(start + -start % self._size, stop, self._size):
            end = min(first + self._size, size)
            if end > stop:
                break
            part = slice(first - start, end - start)
            batch = self._batches.get(_digest([column[part] for column in columns]))
            if batch is not None:
                found[part] = batch
        return found


def _bits(inputs: Arrays, names: Sequence[str]) -> list[_Hashes]:
    """Return the bits of each input as whole numbers: -0 is not 0."""
    return [np.ascontiguousarray(inputs[name], dtype=np.float64).view(np.uint64) for name in names]


def _hashes(columns: Sequence[_Hashes]) -> _Hashes:
    hashes = np.zeros_like(columns[0])
    for column in columns:
        hashes ^= column
        hashes *= _MULTIPLIER
        hashes ^= hashes >> _SHIFT
    return hashes


def _digest(columns: Sequence[_Hashes]) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for column in columns:
        digest.update(column.tobytes())
    return digest.digest()
