"""A model with the domain of its inputs: every run ends with a status, and none ends the study."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from uqpen.executors.work import Batch, Piece
from uqpen.inputs.constraints import Constraint
from uqpen.labels import Status
from uqpen.model import Model, Results, inadmissible

__all__ = ["Batchwise", "Evaluator"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Evaluator:
    """A model with the domain of its inputs, as one call over a batch.

    Parameters
    ----------
    model : Model
        What is run.
    constraints : sequence of Constraint
        Where the input law ends; points outside are inadmissible and not run.
    """

    model: Model
    constraints: Sequence[Constraint] = ()

    def __call__(self, inputs: dict[str, FloatArray]) -> Results:
        """Results of a batch of points, given in SI units."""
        runs = len(next(iter(inputs.values())))
        status = np.full(runs, Status.OK, dtype=np.int8)
        reasons: dict[int, str] = {}
        for violated, reason in self._violations(inputs):
            for run in np.flatnonzero(violated & (status == Status.OK)).tolist():
                reasons[run] = reason
            status[violated] = Status.INADMISSIBLE
        outputs = {output.name: np.full(runs, np.nan) for output in self.model.outputs}
        files: frozenset[str] = frozenset()
        admissible = np.flatnonzero(status == Status.OK)
        if admissible.size:
            # A constraint may be on an input that this model of several does not take.
            taken = [variable.name for variable in self.model.inputs if variable.name in inputs]
            some = {name: inputs[name][admissible] for name in taken}
            results = self.model.evaluate(some)
            self._fill(admissible, results, outputs, status, reasons)
            files = results.files
        return Results(outputs, status, reasons, files)

    def _violations(self, inputs: dict[str, FloatArray]) -> Iterator[tuple[Any, str]]:
        yield from inadmissible(self.model, inputs)
        for constraint in self.constraints:
            yield ~constraint.holds(inputs), constraint.text

    def _fill(
        self,
        runs: npt.NDArray[np.int64],
        results: Results,
        outputs: dict[str, FloatArray],
        status: npt.NDArray[np.int8],
        reasons: dict[int, str],
    ) -> None:
        """Put a model's results where they belong, and look for what is not finite."""
        status[runs] = results.status
        reasons.update({int(runs[run]): reason for run, reason in results.reasons.items()})
        for name, values in results.outputs.items():
            outputs[name][runs] = values
            broken = runs[~np.isfinite(values) & (status[runs] == Status.OK)]
            status[broken] = Status.NOT_FINITE
            for run in broken.tolist():
                reasons[run] = f"{name} is {outputs[name][run]}"
        for values in outputs.values():
            values[status != Status.OK] = np.nan


@dataclass(frozen=True)
class Batchwise:
    """An evaluator as work for an executor.

    Parameters
    ----------
    evaluator : Evaluator
        What makes the runs of a batch.
    """

    evaluator: Evaluator

    def __call__(self, batch: Batch) -> Piece:
        """What came of a batch."""
        return Piece(batch.start, self.evaluator(dict(batch.inputs)))

    def lost(self, batch: Batch, status: Status, reason: str) -> Piece:
        """What comes of a batch whose runs were all lost to the same."""
        runs = len(batch)
        outputs = {output.name: np.full(runs, np.nan) for output in self.evaluator.model.outputs}
        statuses = np.full(runs, status, dtype=np.int8)
        reasons = dict.fromkeys(range(runs), reason)
        return Piece(batch.start, Results(outputs, statuses, reasons))
