"""Model with the domain of its inputs: every run gets a status, and none ends the study."""

from __future__ import annotations

import random
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.labels import RANDOM_SEED
from uqpen.core.limits import Limits
from uqpen.core.model import Model, Results, RunWarning, empty_outputs, violated_conditions
from uqpen.core.status import Status
from uqpen.distributions.constraints import Constraint
from uqpen.execution.batch import Batch, BatchResult, Map, Work, join_results
from uqpen.execution.invalid_values import invalid_runs
from uqpen.execution.processes import run_in_child
from uqpen.execution.worker_process import is_child_process

# Most warnings of one batch; a model may warn at every run.
_MOST_WARNINGS = 16


@dataclass(frozen=True)
class Evaluator:
    """Model with the domain of its inputs, as one call over a batch."""

    model: Model  # the model to run
    # Constraints on the inputs; points that violate one are inadmissible and not run.
    constraints: Sequence[Constraint] = ()
    # Adds inputs that follow from others; None where the points have them.
    complete: Callable[[Arrays], dict[str, FloatArray]] | None = None

    def __call__(self, inputs: dict[str, FloatArray], *, is_observed: bool = False) -> Results:
        """Return the results of a batch of points, given in SI units.

        If it is observed, they say what the model's runs depend on.
        """
        if self.needs_child:
            return run_in_child(EvaluatorWork(self), Batch(0, inputs)).results
        inputs = self.complete(inputs) if self.complete else inputs
        runs = len(next(iter(inputs.values())))
        is_admissible = np.ones(runs, dtype=np.bool_)
        reasons: dict[int, str] = {}
        for violated, reason in self.violations(inputs):
            if violated.any():
                reasons |= dict.fromkeys(np.flatnonzero(violated & is_admissible).tolist(), reason)
                is_admissible &= ~violated
        status = np.full(runs, Status.INADMISSIBLE, dtype=np.int8)
        outputs = empty_outputs(self.model.outputs, runs)
        admissible = np.flatnonzero(is_admissible)
        if not admissible.size:
            return Results(outputs, status, reasons)
        # A constraint may be on an input that this model of several does not take.
        taken = [variable.name for variable in self.model.inputs if variable.name in inputs]
        call = self.model.evaluate_observed if is_observed else self.model.evaluate
        own = {name: inputs[name][admissible] for name in taken}
        if RANDOM_SEED in inputs and RANDOM_SEED not in taken:
            results = _seeded_results(call, own, inputs[RANDOM_SEED][admissible])
        else:
            results = call(own)
        status[admissible] = results.status
        reasons |= {int(admissible[run]): reason for run, reason in results.reasons.items()}
        for name, values in results.outputs.items():
            outputs[name][admissible] = values
            for position, reason in invalid_runs(self.model.output(name), values):
                run = int(admissible[position])
                if status[run] == Status.OK:
                    status[run], reasons[run] = Status.NOT_FINITE, reason
        has_failed = status != Status.OK
        for values in outputs.values():
            values[has_failed] = np.nan
        return Results(outputs, status, reasons, results.files)

    @property
    def needs_child(self) -> bool:
        """True if limits of its runs can be enforced in a child of this process only."""
        if is_child_process():
            return False
        is_main = threading.current_thread() is threading.main_thread()
        return bool(self.model.enforced_limits) or (self.model.needs_main_thread and not is_main)

    def violations(self, inputs: dict[str, FloatArray]) -> Iterator[tuple[Any, str]]:
        """Yield each condition on a batch of points, with a mask of those that violate it."""
        inputs = self.complete(inputs) if self.complete else inputs
        yield from violated_conditions(self.model, inputs)
        for constraint in self.constraints:
            yield ~constraint.is_satisfied(inputs), constraint.text


@dataclass(frozen=True)
class EvaluatorWork:
    """Evaluator as work for an executor, with a number of further attempts at a missing run."""

    evaluator: Evaluator
    retries: int = 0

    @property
    def limits(self) -> Limits:
        """Resource limits of one run."""
        return self.evaluator.model.enforced_limits

    @property
    def is_untrusted(self) -> bool:
        """True if the model can hang or kill the process it is called in."""
        return self.evaluator.model.is_untrusted

    @property
    def is_object(self) -> bool:
        """True if the model is an object of this process."""
        return self.evaluator.model.is_object

    def __call__(self, batch: Batch) -> BatchResult:
        """Return the result of a batch."""
        if self.evaluator.needs_child:
            return run_in_child(self, batch)
        with warnings.catch_warnings(record=True) as caught:
            results = join_results([*map(self._evaluate_with_retries, self._parts(batch))])
        messages = dict.fromkeys(map(_warning_text, caught))
        return BatchResult(batch.start, results, tuple(messages)[:_MOST_WARNINGS])

    def failed_result(self, batch: Batch, status: Status, reason: str) -> BatchResult:
        """Return the result of a batch whose runs all failed for one reason."""
        runs = len(batch)
        outputs = empty_outputs(self.evaluator.model.outputs, runs)
        statuses = np.full(runs, status, dtype=np.int8)
        reasons = dict.fromkeys(range(runs), reason)
        return BatchResult(batch.start, Results(outputs, statuses, reasons))

    def _parts(self, batch: Batch) -> Iterator[Batch]:
        """Yield a batch, or first the run in it that is observed alone."""
        if batch.is_observed and len(batch) > 1 and not self.evaluator.model.vectorized:
            yield batch.between(0, 1)
            yield batch.between(1, len(batch))
        else:
            yield batch

    def _evaluate_with_retries(self, batch: Batch) -> Results:
        """Return the results of a batch; retry its missing runs, each by itself."""
        inputs = batch.inputs
        results = self.evaluator(dict(inputs), is_observed=batch.is_observed)
        for _ in range(self.retries):
            for run in np.flatnonzero(results.status > Status.INADMISSIBLE).tolist():
                one = {name: values[run : run + 1] for name, values in inputs.items()}
                results = _replace_run(results, run, self.evaluator(one))
        return results


def _seeded_results(
    call: Callable[[Arrays], Results], inputs: Arrays, seeds: FloatArray
) -> Results:
    """Make runs one by one, and set the generators that all code of this process shares before."""
    kept = random.getstate(), np.random.get_state()  # noqa: NPY002 - the one that a model draws from
    found = []
    try:
        for run, seed in enumerate(seeds.tolist()):
            random.seed(int(seed))
            np.random.seed(int(seed))  # noqa: NPY002
            found.append(call({name: values[run : run + 1] for name, values in inputs.items()}))
    finally:
        random.setstate(kept[0])
        np.random.set_state(kept[1])  # noqa: NPY002
    return join_results(found)


def _replace_run(results: Results, run: int, one: Results) -> Results:
    """Return results with those of a single run replaced."""
    outputs = {name: values.copy() for name, values in results.outputs.items()}
    status, reasons = results.status.copy(), dict(results.reasons)
    for name, values in one.outputs.items():
        outputs[name][run] = values[0]
    status[run] = one.status[0]
    reasons.pop(run, None)
    if one.reasons:
        reasons[run] = one.reasons[0]
    return Results(outputs, status, reasons, results.files | one.files)


def _warning_text(warning: warnings.WarningMessage) -> str:
    text = " ".join(str(warning.message).split())
    if issubclass(warning.category, RunWarning):
        return text
    return f"{warning.category.__name__}: {text} ({Path(warning.filename).name}:{warning.lineno})"


# Map that takes runs from their record in place of making them.


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
