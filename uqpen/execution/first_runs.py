"""First runs of a model in a study: its trial run, and the end of a study that cannot succeed."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from pathlib import Path
from typing import NamedTuple

from uqpen.core.arrays import Arrays
from uqpen.core.dependency import OBSERVED, Dependency
from uqpen.core.errors import FirstRunsFailedError
from uqpen.core.model import Model, Results
from uqpen.core.status import STATUS_TEXT, Status, mask_numbers
from uqpen.execution.batch import BatchResult
from uqpen.execution.failures import FailurePolicy

_OBSERVED = Dependency(OBSERVED, "run").line


class _FailedRun(NamedTuple):
    """Failure of a run, and the folder in which its files are kept, if any."""

    status: Status
    reason: str
    folder: Path | None

    @property
    def text(self) -> str:
        """The reason, and the folder, each on a line of its own."""
        status = "" if self.status is Status.FAILED else f"{STATUS_TEXT[self.status]}: "
        said = f"  {status}{self.reason}"
        return f"{said}\n  its files are in {self.folder}" if self.folder else said


class FirstRuns:
    """First runs of a model in a study, in the order of their numbers.

    They are looked at until one is ok or two fail in different ways. Inadmissible runs do not
    count. The order is that of the designs and of the runs in them, so that it does not matter in
    which order runs complete.

    Parameters
    ----------
    model : Model
        The model, which knows where the files of failed runs are kept.
    policy : FailurePolicy
        Whether there is a trial run, and how many runs end the study if all fail alike.
    report : callable, optional
        Receives the text on a trial run that has failed.
    is_observed : bool
        Whether one run is to be observed, for what the runs of the model depend on. It is the trial
        run, or the first that this start makes, where none of those restored was. A run that fails
        may have ended early, so the first of those after it is observed, too.
    repeat : callable, optional
        Receives inputs and results of a trial run that was made and is ok, to make it again.
    """

    def __init__(
        self,
        model: Model,
        policy: FailurePolicy,
        report: Callable[[str], None] = lambda text: None,
        *,
        is_observed: bool = False,
        repeat: Callable[[Arrays, Results], None] = lambda inputs, results: None,
    ) -> None:
        self._model, self._policy, self._report = model, policy, report
        self._repeat = repeat
        self._failed: list[_FailedRun] = []
        self._is_over = False
        self._next = self._runs = self._added = 0
        # A heap by the number of the first run, then by the order of completion.
        self._waiting: list[tuple[int, int, Arrays, BatchResult]] = []
        # True if the next batch is made alone, as the trial run is still to be made.
        self.is_trial_due = policy.trial
        # True if the next batch is observed, as no run has said what runs of the model depend on.
        self.is_observation_due = is_observed

    @property
    def are_undecided(self) -> bool:
        """True if the next runs may end the study."""
        return self._policy.stop_after > 0 and not self._is_over

    def start_round(self, runs: int, restored: int = 0) -> None:
        """Begin a round; give its number of runs, and of those that were restored."""
        self._next, self._runs = 0, runs
        self._waiting.clear()
        if restored:
            self.is_trial_due = False

    def add(self, inputs: Arrays, batch_result: BatchResult, *, is_made: bool = False) -> None:
        """Look at the results of a batch as soon as those of all runs before are known.

        It says if they were made now, not restored.

        Raises
        ------
        FirstRunsFailedError
            If as many runs as the policy names have failed alike.
        """
        results = batch_result.results
        if _OBSERVED in results.files and (results.status == Status.OK).any():
            self.is_observation_due = False
        if is_made and self.is_trial_due and results.status[0] == Status.OK:
            start, inputs_of_one = batch_result.start, {key: inputs[key][:1] for key in inputs}
            self._repeat(inputs_of_one, batch_result.between(start, start + 1).results)
        if self._is_over:
            return
        self._added += 1
        heappush(self._waiting, (batch_result.start, self._added, inputs, batch_result))
        while self._waiting and self._waiting[0][0] <= self._next:
            _, _, columns, first = heappop(self._waiting)
            self._examine_batch(columns, first)

    def _examine_batch(self, inputs: Arrays, batch_result: BatchResult) -> None:
        stop = batch_result.start + len(batch_result)
        for run in range(self._next, stop):
            if self._is_over:
                self._waiting.clear()
                return
            position = run - batch_result.start
            status = Status(int(batch_result.results.status[position]))
            if status is not Status.INADMISSIBLE:
                reason = batch_result.results.reasons.get(position, "")
                self._examine(status, reason, inputs, position)
                are_left = run + 1 < self._runs  # others of the round, which an end would save
                if are_left and not self._is_over and len(self._failed) >= self._policy.stop_after:
                    raise FirstRunsFailedError(self._message())
        self._next = max(self._next, stop)

    def _examine(self, status: Status, reason: str, inputs: Arrays, position: int) -> None:
        """Look at the next run that was made."""
        is_trial, self.is_trial_due = self.is_trial_due, False
        if status is Status.OK:
            self._is_over = True
            return
        one = {name: float(values[position]) for name, values in inputs.items()}
        failed = _FailedRun(status, reason, self._model.run_folder(one))
        if is_trial:
            self._report(f"the trial run has failed:\n{failed.text}")
        self._failed.append(failed)
        kinds = {(each.status, mask_numbers(each.reason)) for each in (self._failed[0], failed)}
        self._is_over = self._policy.stop_after == 0 or len(kinds) > 1

    def _message(self) -> str:
        first = self._failed[0]
        lines = [
            f"the first {len(self._failed)} runs have all failed alike, for example",
            first.text,
        ]
        if first.folder and len(self._failed) > 1:
            lines.append("  those of the others are beside it; --read-again reads them, after a")
            lines.append("  correction in [model.read]")
        return "\n".join(lines)
