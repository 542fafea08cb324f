"""One call of an executor's map: what is to be done, what is done, and what is tried again."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from uqpen.core.errors import ModelError
from uqpen.core.labels import Status
from uqpen.execution.batch import Batch, BatchResult, Work

__all__ = ["TRIES", "Task", "TaskQueue"]

# How often a run, or the start of a worker, is tried: what kills the one may come from outside.
TRIES = 3


@dataclass
class Task:
    """A batch, and what it has cost.

    Parameters
    ----------
    batch : Batch
        What is to be done.
    deaths : int
        How many workers have died of it.
    delays : int
        How often it was ended because its time was over.
    """

    batch: Batch
    deaths: int = 0
    delays: int = 0


class TaskQueue:
    """What nobody has begun, and what is done and not yet told.

    Parameters
    ----------
    work : Work
        What is done with batches.
    batches : iterable of Batch
        Taken as they are needed.
    most : int
        How many may be under way, or taken to be begun next.
    pickled : bytes
        The work as it is sent to workers; empty where it has not been pickled yet.
    """

    def __init__(
        self, work: Work, batches: Iterable[Batch], most: int, pickled: bytes = b""
    ) -> None:
        self.work = work
        self.pickled = pickled or _pickle_work(work)
        self._coming = iter(batches)
        self._most = most
        self._busy = 0
        self._tasks: deque[Task] = deque()
        self._batch_results: list[BatchResult] = []

    def fill(self) -> bool:
        """Take batches as long as not too many are under way; whether there are any."""
        while len(self._tasks) + self._busy < self._most:
            batch = next(self._coming, None)
            if batch is None:
                break
            self._tasks.append(Task(batch))
        return bool(self._tasks) or self._busy > 0

    @property
    def has_tasks(self) -> bool:
        """Whether there is something to begin."""
        return bool(self._tasks)

    def start(self) -> Task:
        """The next task, which somebody works on from now on."""
        self._busy += 1
        return self._tasks.popleft()

    def start_all(self) -> Iterator[Task]:
        """All tasks that are there, which somebody works on from now on."""
        while self._tasks:
            yield self.start()

    def complete(self, batch_result: BatchResult) -> None:
        """Note what came of a task."""
        self._busy -= 1
        self._batch_results.append(batch_result)

    def record_death(self, task: Task, reason: str) -> None:
        """Note that a task's worker has died of it: it is tried again, then halved, then lost."""
        task.deaths += 1
        tries = max(TRIES, 1 + self.work.retries)
        self._retry_or_fail(task, Status.CRASHED, reason, again=task.deaths < tries)

    def record_timeout(self, task: Task) -> None:
        """Note that a task was ended because its time was over."""
        task.delays += 1
        reason = self.work.limits.timeout_reason
        self._retry_or_fail(task, Status.TIMED_OUT, reason, again=task.delays <= self.work.retries)

    def completed(self) -> Iterator[BatchResult]:
        """What is done, once."""
        batch_results, self._batch_results = self._batch_results, []
        yield from batch_results

    def _retry_or_fail(self, task: Task, status: Status, reason: str, *, again: bool) -> None:
        self._busy -= 1
        if again:
            self._tasks.appendleft(task)
        elif len(task.batch) > 1:
            # One more death and it is halved again.
            halves = [Task(half, TRIES - 1, task.delays) for half in task.batch.halves()]
            self._tasks.extendleft(reversed(halves))
        else:
            self._batch_results.append(self.work.failed_result(task.batch, status, reason))


def _pickle_work(work: Work) -> bytes:
    """What workers are sent; a function of the user's own goes as a reference to its file."""
    try:
        return pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ModelError(
            f"this model cannot be sent to another process ({error}): "
            "name its function in a study file, or use one worker"
        ) from None
