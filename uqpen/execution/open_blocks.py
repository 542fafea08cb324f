"""Blocks of runs under way: drawn when a batch needs them, complete when all runs have results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.blocks import BlockedDataset
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, RUN, STATUS
from uqpen.core.model import Model, Output, empty_outputs
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK
from uqpen.execution.batch import Batch, BatchResult
from uqpen.execution.invalid_values import invalid_runs


class BlockRecord:
    """Record of the points and the results so far of a block of runs."""

    def __init__(self, start: int, points: xr.Dataset, outputs: Sequence[Output]) -> None:
        runs = points.sizes[RUN]
        self.start, self.stop = start, start + runs
        self.points = points
        self.columns = {
            str(name): np.broadcast_to(points.variables[name].values, runs)
            for name in points.data_vars
        }
        self.done = np.zeros(runs, dtype=np.bool_)
        # Runs of batches that are still to come; one of them may be done, see `vectorized_batches`.
        self.pending = np.ones(runs, dtype=np.bool_)
        self._outputs = empty_outputs(outputs, runs)
        self._status = np.zeros(runs, dtype=np.int8)
        self._reasons: dict[int, str] = {}

    def add(self, batch_result: BatchResult) -> None:
        """Insert the results of some runs of the block."""
        begin, results = batch_result.start - self.start, batch_result.results
        runs = slice(begin, begin + len(batch_result))
        if self.done[runs].any():
            # A batch with some restored runs is made as a whole.
            for run in range(batch_result.start, batch_result.start + len(batch_result)):
                self._reasons.pop(run, None)
        self.done[runs] = True
        for name, values in results.outputs.items():
            self._outputs[name][runs] = values
        self._status[runs] = results.status
        self._reasons |= {batch_result.start + run: text for run, text in results.reasons.items()}

    def variables(self, model: Model) -> dict[str, Any]:
        """Return the results of a model, and the outputs derived from them, as variables.

        Failed runs have their numbers in all. A run fails, too, if a derived output overflows.
        """
        variables: dict[str, Any] = {}
        found = self._derive(model)
        for output in model.all_outputs:
            values: npt.NDArray[Any] = found[output.name]
            if output.categories:
                # A failed run has no category, which integers express as a category of its own.
                values = np.where(np.isnan(values), -1, values).astype(np.int8)
            variables[output.name] = ((RUN, *(dim.name for dim in output.dims)), values)
        failed = sorted(self._reasons)
        reasons = np.array([self._reasons[run] for run in failed], dtype=object)
        return {
            **variables,
            STATUS: (RUN, self._status),
            FAILED_RUN: (FAILED_RUN, np.array(failed, dtype=np.int64)),
            FAILURE_REASON: (FAILED_RUN, reasons),
        }

    def _derive(self, model: Model) -> dict[str, FloatArray]:
        """Return the values of all outputs; a run fails where a derived one is not finite."""
        found = model.derive(self._outputs, self._status, self.columns)
        is_ok = self.done & (self._status == Status.OK)
        reasons = {
            run: f"{reason}, from {each.source}"
            for each in model.derived
            for run, reason in invalid_runs(
                each.output, np.where(is_ok, found[each.output.name], 0.0)
            )
        }
        if not reasons:
            return found
        lost = list(reasons)
        self._status[lost] = Status.NOT_FINITE
        self._reasons |= {self.start + run: reason for run, reason in reasons.items()}
        for values in self._outputs.values():
            values[lost] = np.nan
        return model.derive(self._outputs, self._status, self.columns)


class OpenBlocks:
    """Blocks of a round from the first incomplete one to the last one that a batch has needed.

    Parameters
    ----------
    points : BlockedDataset
        The points of the round.
    outputs : sequence of Output
        The outputs of the model.
    restore : callable
        Adds the results of runs that were made before to a block that has been drawn.
    """

    def __init__(
        self,
        points: BlockedDataset,
        outputs: Sequence[Output],
        restore: Callable[[BlockRecord], None],
    ) -> None:
        self.size = points.size
        # Number of the first run that is in no batch yet, and of runs in progress.
        self.position = self.under_way = 0
        self._points, self._outputs, self._restore = points, outputs, restore
        self._open: dict[int, BlockRecord] = {}
        self._drawn = 0
        if not self.size:
            self._open[0] = BlockRecord(0, points.read(0, 0), outputs)

    def block(self, run: int) -> BlockRecord:
        """Return the block of a run; it is drawn if no run of it has been needed yet."""
        while self._drawn <= run:
            stop = min(self._drawn + BLOCK, self.size)
            record = BlockRecord(self._drawn, self._points.read(self._drawn, stop), self._outputs)
            self._restore(record)
            self._open[self._drawn // BLOCK] = record
            self._drawn = stop
        return self._open[run // BLOCK]

    def done(self, start: int, stop: int) -> BoolArray:
        """Return a mask of the runs that have results."""
        return _joined([block.done[part] for block, part in self._parts(start, stop)])

    def columns(self, start: int, stop: int) -> dict[str, FloatArray]:
        """Return the inputs of some runs."""
        parts = list(self._parts(start, stop))
        names = parts[0][0].columns
        return {name: _joined([block.columns[name][at] for block, at in parts]) for name in names}

    def start_batch(self, stop: int) -> Batch:
        """Return a batch of the next runs up to a number, and count them as in progress."""
        start, self.position = self.position, stop
        self.under_way += stop - start
        return Batch(start, self.columns(start, stop))

    def skip(self, stop: int) -> bool:
        """Make no batch of the next runs, as they are done; return True if a block is complete."""
        start, self.position = self.position, stop
        return self._settle(start, stop)

    def add(self, batch_result: BatchResult) -> None:
        """Insert the results of runs that were in progress."""
        start, stop = batch_result.start, batch_result.start + len(batch_result)
        self.under_way -= stop - start
        for block, _ in self._parts(start, stop):
            block.add(batch_result.between(block.start, block.stop))
        self._settle(start, stop)

    def open_blocks(self) -> tuple[BlockRecord, ...]:
        """Return the blocks that have been drawn, and are not complete."""
        return tuple(self._open.values())

    def pop_complete(self) -> Iterator[BlockRecord]:
        """Yield complete blocks in order, up to the first that is not, and forget them."""
        while self._open:
            first = next(iter(self._open))
            if self._open[first].pending.any():
                return
            yield self._open.pop(first)

    def _settle(self, start: int, stop: int) -> bool:
        """Mark runs as not pending; return True if a block has no more pending ones."""
        is_complete = False
        for block, part in self._parts(start, stop):
            block.pending[part] = False
            is_complete |= not block.pending.any()
        return is_complete

    def _parts(self, start: int, stop: int) -> Iterator[tuple[BlockRecord, slice]]:
        """Yield the blocks of some runs, with the places of the runs in each."""
        while start < stop:
            block = self.block(start)
            end = min(stop, block.stop)
            yield block, slice(start - block.start, end - block.start)
            start = end


def _joined(parts: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
