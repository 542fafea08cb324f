"""Evaluation of a model over points, as a dataset of its runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np
import xarray as xr

from uqpen.core.blocks import BlockedDataset, LoadedDataset
from uqpen.core.errors import StudyError, WorkerError
from uqpen.core.labels import RUN, WEIGHT
from uqpen.core.model import Model
from uqpen.core.progress import Progress
from uqpen.execution.batch import Batch, BatchResult, Map, PacedMap
from uqpen.execution.batching import WORTH_SENDING, Pace, scalar_batches, vectorized_batches
from uqpen.execution.checkpoint import Checkpoint
from uqpen.execution.evaluator import Evaluator, EvaluatorWork
from uqpen.execution.failures import FailureCount, FailurePolicy
from uqpen.execution.first_runs import FirstRuns
from uqpen.execution.open_blocks import BlockRecord, OpenBlocks
from uqpen.execution.runs import runs_dataset


@dataclass(frozen=True)
class EvaluationOptions:
    """Execution and reports of the runs of a model; only `failures` can change a result."""

    map: Map = map  # like the built-in; it makes the runs of batches
    label: str = ""  # the name of the model in a study with several, for progress reports
    progress: Progress = field(default_factory=Progress)  # receives progress reports
    # Restores runs made before, and stores finished ones.
    checkpoint: Checkpoint = field(default_factory=Checkpoint)
    # Retries of missing runs, and how many may be missing.
    failures: FailurePolicy = field(default_factory=FailurePolicy)
    # The model's first runs in a study, for a trial run and an early end; none of it otherwise.
    first_runs: FirstRuns | None = None


def evaluate(
    evaluator: Evaluator,
    points: xr.Dataset | BlockedDataset,
    display_units: Mapping[str, str],
    options: EvaluationOptions | None = None,
) -> xr.Dataset:
    """Run a model over points.

    Parameters
    ----------
    evaluator : Evaluator
        The model with its constraints.
    points : Dataset or BlockedDataset
        A variable for each input, along ``run`` or a scalar.
    display_units : mapping of str to str
        The unit to show an input or output in, where it is not the model's own.
    options : EvaluationOptions, optional
        Execution and reports of the runs; by default, one process and no reports.

    Returns
    -------
    Dataset
        The points, a variable for each output along ``run`` and its own dimensions,
        ``status(run)``, and the reasons of failed runs along their own dimension. A checkpoint may
        leave the values of many runs in a file.

    Raises
    ------
    StudyError
        If the points are weighted and an output is named ``weight``.
    TooManyFailedError
        If more runs are missing than allowed, or the first ones have all failed alike.
    WorkerError
        If the map leaves out some runs.
    """
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    options = options or EvaluationOptions()
    blocks = evaluate_blocks(evaluator, blocked, display_units, options)
    return options.checkpoint.collect(blocks, blocked.size)


def evaluate_blocks(
    evaluator: Evaluator,
    points: BlockedDataset,
    display_units: Mapping[str, str],
    options: EvaluationOptions | None = None,
) -> Iterator[xr.Dataset]:
    """Run a model over points; yield the runs by blocks of 65 536, in order.

    The parameters and errors are those of `evaluate`. A block of points is drawn when a batch needs
    it, and its runs are yielded as soon as all of them and those of the blocks before are done. So
    memory is needed for the blocks under way, not for all. Workers do not wait for the end of a
    block, unless the runs of a whole block have been restored.

    Yields
    ------
    Dataset
        As `evaluate` returns it, with the reasons of failed runs even where no run failed. The
        numbers of failed runs are those in the whole.
    """
    options = options or EvaluationOptions()
    # Without them, nothing is decided and no run is made on trial.
    none = FirstRuns(evaluator.model, FailurePolicy(stop_after=0, trial=False))
    first_runs = options.first_runs or none
    under_way = _RunsUnderWay(evaluator.model, points, display_units, options, first_runs)
    worth_sending = (
        options.map.worth_sending if isinstance(options.map, PacedMap) else WORTH_SENDING
    )
    has_limits = bool(evaluator.model.enforced_limits)
    pace = Pace(worth_sending, is_alone=has_limits)
    work = EvaluatorWork(evaluator, options.failures.retry)
    blocks = under_way.blocks
    while True:
        batches = _batches(blocks, evaluator.model, pace)
        if first_runs.is_trial_due:
            alone = Pace(worth_sending, is_alone=True)
            batches = islice(_batches(blocks, evaluator.model, alone), 1)
        if first_runs.is_observation_due:
            batches = _with_first_observed(batches)
        for batch_result in options.map(work, batches):
            pace.record(len(batch_result))
            under_way.add(batch_result)
            pace.is_alone = has_limits or first_runs.are_undecided
            yield from under_way.pop_complete()
        if blocks.under_way > 0:
            raise WorkerError(f"the map has returned no result of {blocks.under_way} runs")
        yield from under_way.pop_complete()
        if blocks.position >= blocks.size:  # else the batches ended before a restored block
            return


class _RunsUnderWay:
    """Runs of a model at the points of a round: restored, counted, stored, handed over in order."""

    def __init__(
        self,
        model: Model,
        points: BlockedDataset,
        display_units: Mapping[str, str],
        options: EvaluationOptions,
        first_runs: FirstRuns,
    ) -> None:
        self._model, self._display_units = model, display_units
        self._label, self._progress = options.label, options.progress
        self._checkpoint, self._first_runs = options.checkpoint, first_runs
        self._failure_count = FailureCount(options.failures.at_most, points.size)
        if restored := self._checkpoint.prepare(points.size):
            self._progress.count_restored(restored)
        first_runs.start_round(points.size, restored)
        self.blocks = OpenBlocks(points, model.outputs, self._restore)
        self._progress.start_runs(self._label, self._finished_runs)

    def add(self, batch_result: BatchResult) -> None:
        """Insert the results of a batch, and store them."""
        self.blocks.add(batch_result)
        # Before it is stored, as it may be of another version of the model.
        self._model.record_files(batch_result.results.files)
        start, runs = batch_result.start, len(batch_result)
        inputs = self.blocks.columns(start, start + runs)
        self._checkpoint.save(inputs, batch_result)
        for warning in batch_result.warnings:
            self._progress.warn(warning)
        failed = self._failure_count.add(batch_result)
        self._progress.advance(runs, failed, self.blocks.under_way)
        self._first_runs.add(inputs, batch_result, is_made=True)

    def pop_complete(self) -> Iterator[xr.Dataset]:
        """Yield the runs of complete blocks in order, and forget them."""
        for block in self.blocks.pop_complete():
            self._failure_count.forget(block.stop)
            runs = self._dataset(block)
            self._progress.end_block(self._label, runs)
            yield runs

    def _restore(self, block: BlockRecord) -> None:
        outputs = {output.name for output in self._model.all_outputs}
        if WEIGHT in block.points.coords and WEIGHT in outputs:
            raise StudyError(f'weighted points cannot go to a model with an output "{WEIGHT}"')
        for batch_result in self._checkpoint.restore(block.start, block.columns):
            block.add(batch_result)
            self._failure_count.add(batch_result)
            first = batch_result.start - block.start
            places = slice(first, first + len(batch_result))
            inputs = {name: values[places] for name, values in block.columns.items()}
            self._first_runs.add(inputs, batch_result)
            self._model.record_files(batch_result.results.files)

    def _finished_runs(self) -> list[xr.Dataset]:
        """Return the finished runs of each block under way, with their numbers along ``run``."""
        found = []
        for block in self.blocks.open_blocks():
            done = np.flatnonzero(block.done)
            runs = self._dataset(block).isel({RUN: done})
            found.append(runs.assign_coords({RUN: block.start + done}))
        return found

    def _dataset(self, block: BlockRecord) -> xr.Dataset:
        results = block.variables(self._model)
        return runs_dataset(block.points, results, self._model, self._display_units)


def _batches(blocks: OpenBlocks, model: Model, pace: Pace) -> Iterator[Batch]:
    """Return batches of the runs that are not done."""
    if model.vectorized:
        return vectorized_batches(blocks, model)
    return scalar_batches(blocks, pace)


def _with_first_observed(batches: Iterator[Batch]) -> Iterator[Batch]:
    for first in islice(batches, 1):
        yield replace(first, is_observed=True)
    yield from batches
