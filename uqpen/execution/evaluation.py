"""Evaluation of a model over points, as a dataset of its runs."""

from __future__ import annotations

import builtins
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.blocks import BlockedDataset, LoadedDataset, join_blocks
from uqpen.core.errors import StudyError, WorkerError
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, REPLICATE, ROLE, RUN, STATUS, WEIGHT
from uqpen.core.model import Category, Dimension, Model, Output
from uqpen.core.progress import Progress
from uqpen.core.status import Status
from uqpen.execution.batch import Batch, BatchResult, Map, PacedMap
from uqpen.execution.batching import WORTH_SENDING, Pace, scalar_batches, vectorized_batches
from uqpen.execution.checkpoint import Checkpoint
from uqpen.execution.evaluator import Evaluator, EvaluatorWork
from uqpen.execution.failures import FailureCount, FailurePolicy
from uqpen.execution.open_blocks import BlockRecord, OpenBlocks

__all__ = ["evaluate", "evaluate_blocks"]

# Attribute of a curve that may end before its dimension does.
_END = {"comment": "NaN after the end of the curve"}


def evaluate(
    evaluator: Evaluator,
    points: xr.Dataset | BlockedDataset,
    display_units: Mapping[str, str],
    *,
    map: Map = map,
    label: str = "",
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    failures: FailurePolicy | None = None,
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
    map : callable
        Like the built-in; it makes the runs of batches.
    label : str
        The name of the model in a study with several, for progress reports.
    progress : Progress, optional
        Receives progress reports.
    checkpoint : Checkpoint, optional
        Restores runs made before, and stores finished ones.
    failures : FailurePolicy, optional
        Retries of missing runs, and how many may be missing.

    Returns
    -------
    Dataset
        The points, a variable for each output along ``run`` and its own dimensions,
        ``status(run)``, and the reasons of failed runs along their own dimension.

    Raises
    ------
    StudyError
        If the points are weighted and an output is named ``weight``.
    TooManyFailedError
        If more runs are missing than allowed.
    WorkerError
        If the map leaves out some runs.
    """
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    blocks = evaluate_blocks(
        evaluator,
        blocked,
        display_units,
        map=map,
        label=label,
        progress=progress,
        checkpoint=checkpoint,
        failures=failures,
    )
    return join_blocks(blocks, blocked.size)


def evaluate_blocks(
    evaluator: Evaluator,
    points: BlockedDataset,
    display_units: Mapping[str, str],
    *,
    map: Map = map,
    label: str = "",
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    failures: FailurePolicy | None = None,
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
    progress, checkpoint = progress or Progress(), checkpoint or Checkpoint()
    failures, model = failures or FailurePolicy(), evaluator.model
    failure_count = FailureCount(failures.at_most, points.size)
    if restored := checkpoint.prepare(points.size):
        progress.count_restored(restored)

    def restore(block: BlockRecord) -> None:
        _check_names(block.points, model)
        for batch_result in checkpoint.restore(block.start, block.columns):
            block.add(batch_result)
            failure_count.add(batch_result)
            model.record_files(batch_result.results.files)

    def store(batch_result: BatchResult) -> None:
        blocks.add(batch_result)
        # Before it is stored, as it may be of another version of the model.
        model.record_files(batch_result.results.files)
        start, runs = batch_result.start, len(batch_result)
        checkpoint.save(blocks.columns(start, start + runs), batch_result)
        for warning in batch_result.warnings:
            progress.warn(warning)
        progress.advance(runs, failure_count.add(batch_result), blocks.under_way)

    def dataset(block: BlockRecord) -> xr.Dataset:
        runs = _dataset(block, model, display_units)
        progress.end_block(label, runs)
        return runs

    worth_sending = map.worth_sending if isinstance(map, PacedMap) else WORTH_SENDING
    pace = Pace(worth_sending, is_alone=bool(model.enforced_limits))
    blocks = OpenBlocks(points, model.outputs, restore)
    progress.start_runs(label, lambda: _finished_runs(blocks, model, display_units))
    work = EvaluatorWork(evaluator, failures.retry)
    while True:
        for batch_result in map(work, _batches(blocks, model, pace)):
            pace.record(len(batch_result))
            store(batch_result)
            yield from builtins.map(dataset, _pop_complete(blocks, failure_count))
        if blocks.under_way > 0:
            raise WorkerError(f"the map has returned no result of {blocks.under_way} runs")
        yield from builtins.map(dataset, _pop_complete(blocks, failure_count))
        if blocks.position >= blocks.size:  # else the batches ended before a restored block
            return


def _pop_complete(blocks: OpenBlocks, failure_count: FailureCount) -> Iterator[BlockRecord]:
    """Yield complete blocks in order, and forget the numbers of their runs."""
    for block in blocks.pop_complete():
        failure_count.forget(block.stop)
        yield block


def _batches(blocks: OpenBlocks, model: Model, pace: Pace) -> Iterator[Batch]:
    """Return batches of the runs that are not done."""
    if model.vectorized:
        return vectorized_batches(blocks, is_batch_independent=model.is_batch_independent)
    return scalar_batches(blocks, pace)


def _check_names(points: xr.Dataset, model: Model) -> None:
    """Check that no output has the name of the weights of points.

    Raises
    ------
    StudyError
        If one has.
    """
    if WEIGHT in points.coords and any(output.name == WEIGHT for output in model.outputs):
        raise StudyError(f'weighted points cannot go to a model with an output "{WEIGHT}"')


def _dataset(block: BlockRecord, model: Model, display_units: Mapping[str, str]) -> xr.Dataset:
    """Return the runs of a block."""
    runs = block.points.assign(block.variables(model.outputs))
    runs = runs.assign_coords(_coordinates(model))
    _add_attributes(runs, model, display_units)
    return runs


def _finished_runs(
    blocks: OpenBlocks, model: Model, display_units: Mapping[str, str]
) -> list[xr.Dataset]:
    """Return the finished runs of each block under way, with their numbers along ``run``."""
    found = []
    for block in blocks.open_blocks():
        done = np.flatnonzero(block.done)
        runs = _dataset(block, model, display_units).isel({RUN: done})
        found.append(runs.assign_coords({RUN: block.start + done}))
    return found


def _coordinates(model: Model) -> dict[str, Any]:
    """Return the coordinates of the model's fields, by dimension."""
    dimensions = {each.name: each for output in model.outputs for each in output.dims}
    return {
        name: (name, np.array(each.values), _measure(each)) for name, each in dimensions.items()
    }


def _measure(dimension: Dimension) -> dict[str, str]:
    """Return the attributes of a coordinate."""
    return {
        "units": dimension.unit,
        "display_units": dimension.preferred_unit,
        "long_name": dimension.title,
    }


def _add_attributes(runs: xr.Dataset, model: Model, display_units: Mapping[str, str]) -> None:
    """Add attributes to every variable, following the CF conventions."""
    for role, variables in (("input", model.inputs), ("output", model.outputs)):
        for variable in variables:
            if variable.name in runs:
                shown = display_units.get(variable.name, variable.preferred_unit)
                measure = {"units": variable.unit, "display_units": shown}
                categories = variable.categories if isinstance(variable, Output) else ()
                runs[variable.name].attrs |= {
                    "long_name": variable.title,
                    ROLE: role,
                    **(_category_attributes(categories) if categories else measure),
                    **(_END if isinstance(variable, Output) and variable.may_end else {}),
                }
    runs[STATUS].attrs = {"long_name": "what became of the run"}
    runs[STATUS].attrs |= _flag_attributes(list(Status), [status.meaning for status in Status])
    number = {"units": "1", "long_name": "number of the run"}
    runs[RUN].attrs = {"standard_name": "realization", **number}
    if WEIGHT in runs.coords:
        runs[WEIGHT].attrs = {"units": "1", "long_name": "relative weight of the run"}
    if REPLICATE in runs:
        runs[REPLICATE].attrs = {"units": "1", "long_name": "number of the run's replicate"}
    if FAILED_RUN in runs:
        runs[FAILED_RUN].attrs = {"long_name": "number of a lost run"}
        runs[FAILURE_REASON].attrs = {"long_name": "why the run was lost"}


def _category_attributes(categories: Sequence[Category]) -> dict[str, Any]:
    """Return the attributes of a categorical output; failed runs have a category of their own."""
    meanings = ["lost", *(category.flag for category in categories)]
    labels = ["lost", *(category.label for category in categories)]
    return {**_flag_attributes(range(-1, len(categories)), meanings), "flag_labels": labels}


def _flag_attributes(values: Sequence[int], meanings: Sequence[str]) -> dict[str, Any]:
    return {"flag_values": np.array(values, dtype=np.int8), "flag_meanings": " ".join(meanings)}
