"""A model over points: a dataset of its runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.evaluation.batches import WORTH_SENDING, Pace, one_by_one, vectorized
from uqpen.evaluation.evaluator import Batchwise, Evaluator
from uqpen.evaluation.failures import Failures, Losses
from uqpen.evaluation.keeper import Keeper
from uqpen.evaluation.progress import Progress
from uqpen.executors.work import Batch, Map, Piece
from uqpen.labels import LOST, REASON, REPLICATE, ROLE, RUN, STATUS, Status
from uqpen.model import Category, Model, Output

__all__ = ["evaluate"]


def evaluate(
    evaluator: Evaluator,
    points: xr.Dataset,
    display_units: Mapping[str, str],
    *,
    map: Map = map,
    progress: Progress | None = None,
    keeper: Keeper | None = None,
    failures: Failures | None = None,
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
        Like the built-in: where batches of points become runs.
    progress : Progress, optional
        Told how far it is.
    keeper : Keeper, optional
        Who has kept runs before, and keeps those that are done.
    failures : Failures, optional
        What is done about runs that are lost.

    Returns
    -------
    Dataset
        The points with an output variable each along ``run``, ``status(run)``, and the reasons of
        lost runs along their own dimension.

    Raises
    ------
    TooManyLostError
        If more runs were lost than are allowed.
    """
    progress, keeper, failures = progress or Progress(), keeper or Keeper(), failures or Failures()
    model, total = evaluator.model, points.sizes[RUN]
    columns = {str(name): np.broadcast_to(points[name].values, total) for name in points.data_vars}
    made = _Made(model.outputs, total)
    losses = Losses(failures.at_most, total)
    for piece in keeper.found(columns):
        made.add(piece)
        losses.add(piece)
        model.consists_of(piece.results.files)
    if made.done.any():
        progress.found(int(made.done.sum()))
    pace = Pace(getattr(map, "worth_sending", WORTH_SENDING), is_alone=bool(model.supervision))
    batches = made.counted(
        vectorized(columns, made.done.copy())
        if model.vectorized
        else one_by_one(columns, made.done.copy(), pace)
    )
    for piece in map(Batchwise(evaluator, failures.retry), batches):
        pace.returned(len(piece))
        made.under_way -= len(piece)
        made.add(piece)
        # Before it is kept, as it may be of another version of the model.
        model.consists_of(piece.results.files)
        keeper.keep(columns, piece)
        for warning in piece.warnings:
            progress.warned(warning)
        progress.advance(len(piece), losses.add(piece), made.under_way)
    runs = points.assign(made.variables(model.outputs))
    _describe(runs, model, display_units)
    return runs


class _Made:
    """Runs as they are made: what has come of each so far."""

    def __init__(self, outputs: Sequence[Output], runs: int) -> None:
        self.done = np.zeros(runs, dtype=np.bool_)
        self.under_way = 0
        self._outputs = {output.name: np.full(runs, np.nan) for output in outputs}
        self._status = np.zeros(runs, dtype=np.int8)
        self._reasons: dict[int, str] = {}

    def counted(self, batches: Iterator[Batch]) -> Iterator[Batch]:
        """Batches, their runs counted as under way."""
        for batch in batches:
            self.under_way += len(batch)
            yield batch

    def add(self, piece: Piece) -> None:
        """Put what came of some runs where it belongs."""
        runs, results = slice(piece.start, piece.start + len(piece)), piece.results
        if self.done[runs].any():
            # A batch of which some runs were kept before is made as a whole.
            for run in range(piece.start, piece.start + len(piece)):
                self._reasons.pop(run, None)
        self.done[runs] = True
        for name, values in results.outputs.items():
            self._outputs[name][runs] = values
        self._status[runs] = results.status
        self._reasons |= {piece.start + run: reason for run, reason in results.reasons.items()}

    def variables(self, outputs: Sequence[Output]) -> dict[str, Any]:
        """All runs as variables of a dataset."""
        variables: dict[str, Any] = {}
        for output in outputs:
            values: npt.NDArray[Any] = self._outputs[output.name]
            if output.categories:
                # A lost run is of no kind, which is a kind of its own among whole numbers.
                values = np.where(np.isnan(values), -1, values).astype(np.int8)
            variables[output.name] = (RUN, values)
        variables[STATUS] = (RUN, self._status)
        lost = sorted(self._reasons)
        if not lost:
            return variables
        reasons = np.array([self._reasons[run] for run in lost], dtype=object)
        lost_runs = (LOST, np.array(lost, dtype=np.int64))
        return {**variables, LOST: lost_runs, REASON: (LOST, reasons)}


def _describe(runs: xr.Dataset, model: Model, display_units: Mapping[str, str]) -> None:
    """Say of every variable what it is, as the CF conventions do."""
    for role, variables in (("input", model.inputs), ("output", model.outputs)):
        for variable in variables:
            if variable.name in runs:
                shown = display_units.get(variable.name, variable.shown_unit)
                measure = {"units": variable.unit, "display_units": shown}
                kinds = variable.categories if isinstance(variable, Output) else ()
                runs[variable.name].attrs = {
                    **runs[variable.name].attrs,
                    "long_name": variable.title,
                    ROLE: role,
                    **(_kinds(kinds) if kinds else measure),
                }
    runs[STATUS].attrs = {"long_name": "what became of the run"}
    runs[STATUS].attrs |= _flags(list(Status), [status.meaning for status in Status])
    runs[RUN].attrs = {
        "standard_name": "realization",
        "units": "1",
        "long_name": "number of the run",
    }
    if REPLICATE in runs:
        runs[REPLICATE].attrs = {"units": "1", "long_name": "number of the run's replicate"}
    if LOST in runs:
        runs[LOST].attrs = {"long_name": "number of a lost run"}
        runs[REASON].attrs = {"long_name": "why the run was lost"}


def _kinds(categories: Sequence[Category]) -> dict[str, Any]:
    """Attributes of an output with kinds; those of no kind are the lost runs."""
    flags = _flags(range(-1, len(categories)), ["lost", *(kind.flag for kind in categories)])
    return {**flags, "flag_labels": ["lost", *(kind.label for kind in categories)]}


def _flags(values: Sequence[int], meanings: Sequence[str]) -> dict[str, Any]:
    return {"flag_values": np.array(values, dtype=np.int8), "flag_meanings": " ".join(meanings)}
