"""Map that takes runs from their record in place of making them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from uqpen.core.arrays import Arrays
from uqpen.core.model import Results
from uqpen.core.status import Status
from uqpen.execution.batch import Batch, BatchResult, Map, Work
from uqpen.execution.evaluator import EvaluatorWork


def recorded_map(recorded: Results) -> Map:
    """Return a map that gives batches their recorded results, by the numbers of their runs.

    A point that the constraints of the work exclude is inadmissible, whatever its record says.
    """
    whole = BatchResult(0, recorded)

    def take(work: Work, batches: Iterable[Batch]) -> Iterator[BatchResult]:
        assert isinstance(work, EvaluatorWork)
        for batch in batches:
            part = whole.between(batch.start, batch.start + len(batch))
            results = _admissible(work, batch.inputs, part.results)
            yield BatchResult(batch.start, results)

    return take


def _admissible(work: EvaluatorWork, inputs: Arrays, results: Results) -> Results:
    """Return results without those at inadmissible points."""
    status, reasons = results.status.copy(), dict(results.reasons)
    for violated, reason in work.evaluator.violations(dict(inputs)):
        new = violated & (status != Status.INADMISSIBLE)
        reasons |= dict.fromkeys(np.flatnonzero(new).tolist(), reason)
        status[new] = Status.INADMISSIBLE
    is_ok = status == Status.OK
    outputs = {name: np.where(is_ok, each, np.nan) for name, each in results.outputs.items()}
    return Results(outputs, status, reasons)
