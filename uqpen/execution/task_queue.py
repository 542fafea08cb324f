"""State of one call of an executor's map: tasks to start, results, and retries."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from uqpen.core.errors import ModelError
from uqpen.core.status import Status
from uqpen.execution.batch import Batch, BatchResult, Work

# Attempts at a run, or at the start of a worker: its death may have an external cause.
TRIES = 3


@dataclass
class Task:
    """Batch with its failed attempts: workers that died while running it, and time-outs."""

    batch: Batch
    deaths: int = 0
    delays: int = 0


class TaskQueue:
    """Queue of tasks to start, and of results not yet fetched.

    It takes batches as they are needed: at most `most` are in progress or waiting, which may change
    meanwhile. `pickled` is the work as it is sent to workers, if it has been pickled before.
    """

    def __init__(
        self, work: Work, batches: Iterable[Batch], most: int, pickled: bytes = b""
    ) -> None:
        self.work = work
        self.pickled = pickled or _pickle_work(work)
        self._coming = iter(batches)
        self.most = most
        self._busy = 0
        self._tasks: deque[Task] = deque()
        self._batch_results: list[BatchResult] = []

    def fill(self) -> bool:
        """Take batches up to the limit; return True if there are tasks to start or in progress."""
        while len(self._tasks) + self._busy < self.most:
            batch = next(self._coming, None)
            if batch is None:
                break
            self._tasks.append(Task(batch))
        return bool(self._tasks) or self._busy > 0

    @property
    def has_tasks(self) -> bool:
        """True if there is a task to start."""
        return bool(self._tasks)

    def start(self) -> Task:
        """Return the next task and count it as in progress."""
        self._busy += 1
        return self._tasks.popleft()

    def start_all(self) -> Iterator[Task]:
        """Yield all waiting tasks and count them as in progress."""
        while self._tasks:
            yield self.start()

    def requeue(self, task: Task) -> None:
        """Count a task as waiting again, as it has not begun."""
        self._busy -= 1
        self._tasks.appendleft(task)

    def complete(self, batch_result: BatchResult) -> None:
        """Record the result of a task."""
        self._busy -= 1
        self._batch_results.append(batch_result)

    def record_death(self, task: Task, reason: str) -> None:
        """Record that a task killed its worker: it is tried again, then halved, then failed."""
        task.deaths += 1
        tries = max(TRIES, 1 + self.work.retries)
        self._retry_or_fail(task, Status.CRASHED, reason, again=task.deaths < tries)

    def record_timeout(self, task: Task) -> None:
        """Record that a task was ended because its time was over."""
        task.delays += 1
        reason = self.work.limits.timeout_reason
        self._retry_or_fail(task, Status.TIMED_OUT, reason, again=task.delays <= self.work.retries)

    def completed(self) -> Iterator[BatchResult]:
        """Yield each new result once."""
        batch_results, self._batch_results = self._batch_results, []
        yield from batch_results

    def _retry_or_fail(self, task: Task, status: Status, reason: str, *, again: bool) -> None:
        if again:
            self.requeue(task)
            return
        self._busy -= 1
        if len(task.batch) > 1:
            # One more death and it is halved again.
            halves = [Task(half, TRIES - 1, task.delays) for half in task.batch.halves()]
            self._tasks.extendleft(reversed(halves))
        else:
            self._batch_results.append(self.work.failed_result(task.batch, status, reason))


def _pickle_work(work: Work) -> bytes:
    """Pickle the work for workers; a user-defined function becomes a reference to its file."""
    try:
        return pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ModelError(
            f"this model cannot be sent to another process ({error}): "
            "name its function in a study file, or use one worker"
        ) from None
