"""Evaluation of a model over points, as a dataset of its runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.errors import StudyError
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, REPLICATE, ROLE, RUN, STATUS, WEIGHT
from uqpen.core.model import Category, Dimension, Model, Output, empty_outputs
from uqpen.core.progress import Progress
from uqpen.core.status import Status
from uqpen.execution.batch import Batch, BatchResult, Map, PacedMap
from uqpen.execution.batching import WORTH_SENDING, Pace, scalar_batches, vectorized_batches
from uqpen.execution.checkpoint import Checkpoint
from uqpen.execution.evaluator import Evaluator, EvaluatorWork
from uqpen.execution.failures import FailureCount, FailurePolicy

__all__ = ["evaluate"]

# Attribute of a curve that may end before its dimension does.
_END = {"comment": "NaN after the end of the curve"}


def evaluate(
    evaluator: Evaluator,
    points: xr.Dataset,
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
    points : Dataset
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
    """
    progress, checkpoint = progress or Progress(), checkpoint or Checkpoint()
    failures = failures or FailurePolicy()
    model, total = evaluator.model, points.sizes[RUN]
    if WEIGHT in points.coords and any(output.name == WEIGHT for output in model.outputs):
        raise StudyError(f'weighted points cannot go to a model with an output "{WEIGHT}"')
    columns = {str(name): np.broadcast_to(points[name].values, total) for name in points.data_vars}
    record = _RunRecord(model.outputs, total)
    failure_count = FailureCount(failures.at_most, total)

    def finished_runs() -> xr.Dataset:
        at = np.flatnonzero(record.done)
        is_partial = at.size < total
        some = {RUN: points[RUN].values[at]}
        runs = points.isel({RUN: at}).assign_coords(some) if is_partial else points
        runs = runs.assign(record.variables(model.outputs)).assign_coords(_coordinates(model))
        _add_attributes(runs, model, display_units)
        return runs

    progress.start_runs(label, finished_runs)
    for batch_result in checkpoint.restore(columns):
        record.add(batch_result)
        failure_count.add(batch_result)
        model.record_files(batch_result.results.files)
    if record.done.any():
        progress.count_restored(int(record.done.sum()))
    worth_sending = map.worth_sending if isinstance(map, PacedMap) else WORTH_SENDING
    pace = Pace(worth_sending, is_alone=bool(model.enforced_limits))
    done = record.done.copy()
    batches = (
        vectorized_batches(columns, done, is_batch_independent=model.is_batch_independent)
        if model.vectorized
        else scalar_batches(columns, done, pace)
    )
    work = EvaluatorWork(evaluator, failures.retry)
    for batch_result in map(work, record.count_batches(batches)):
        pace.record(len(batch_result))
        record.under_way -= len(batch_result)
        record.add(batch_result)
        # Before it is stored, as it may be of another version of the model.
        model.record_files(batch_result.results.files)
        checkpoint.save(columns, batch_result)
        for warning in batch_result.warnings:
            progress.warn(warning)
        progress.advance(len(batch_result), failure_count.add(batch_result), record.under_way)
    return finished_runs()


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


class _RunRecord:
    """Record of the results of all runs so far."""

    def __init__(self, outputs: Sequence[Output], runs: int) -> None:
        self.done = np.zeros(runs, dtype=np.bool_)
        self.under_way = 0
        self._outputs = empty_outputs(outputs, runs)
        self._status = np.zeros(runs, dtype=np.int8)
        self._reasons: dict[int, str] = {}

    def count_batches(self, batches: Iterator[Batch]) -> Iterator[Batch]:
        """Yield batches and count their runs as in progress."""
        for batch in batches:
            self.under_way += len(batch)
            yield batch

    def add(self, batch_result: BatchResult) -> None:
        """Insert the results of some runs."""
        start, results = batch_result.start, batch_result.results
        runs = slice(start, start + len(batch_result))
        if self.done[runs].any():
            # A batch with some restored runs is made as a whole.
            for run in range(runs.start, runs.stop):
                self._reasons.pop(run, None)
        self.done[runs] = True
        for name, values in results.outputs.items():
            self._outputs[name][runs] = values
        self._status[runs] = results.status
        self._reasons |= {start + run: reason for run, reason in results.reasons.items()}

    def variables(self, outputs: Sequence[Output]) -> dict[str, Any]:
        """Return the finished runs as variables of a dataset."""
        variables: dict[str, Any] = {}
        done: Any = ... if self.done.all() else self.done
        for output in outputs:
            values: npt.NDArray[Any] = self._outputs[output.name][done]
            if output.categories:
                # A failed run has no category, which integers express as a category of its own.
                values = np.where(np.isnan(values), -1, values).astype(np.int8)
            variables[output.name] = ((RUN, *(dim.name for dim in output.dims)), values)
        variables[STATUS] = (RUN, self._status[done])
        failed = sorted(self._reasons)
        if not failed:
            return variables
        reasons = np.array([self._reasons[run] for run in failed], dtype=object)
        failed_runs = (FAILED_RUN, np.array(failed, dtype=np.int64))
        return {**variables, FAILED_RUN: failed_runs, FAILURE_REASON: (FAILED_RUN, reasons)}


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
