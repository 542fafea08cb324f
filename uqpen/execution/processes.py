"""Execution on several processes of this machine; results do not depend on them."""

from __future__ import annotations

import atexit
import math
import os
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import wait

from uqpen.core.errors import Problem, SettingsError, WorkerError
from uqpen.execution.batch import Batch, BatchResult, Work, join_results
from uqpen.execution.task_queue import TRIES, Task, TaskQueue
from uqpen.execution.worker import Worker, WorkerDiedError

# Batches that are drawn for each worker: one in progress, and one to begin next.
_AHEAD = 2


@contextmanager
def processes(workers: int) -> Iterator[ProcessPool]:
    """Start processes that make runs; yield them as a map like the built-in.

    The map takes batches as they are needed, and yields their results as they complete. A worker
    that dies is replaced. Its batch is tried again, then halved, until the run that kills it is
    alone: that run fails as *crashed*, and no other.

    Raises
    ------
    SettingsError
        If the number of workers is less than 1.
    """
    if workers < 1:
        problem = Problem(("workers",), str(workers), "a number of processes, 1 or more")
        raise SettingsError([problem])
    pool = ProcessPool(workers)
    try:
        pool.start_workers()
        yield pool
        pool.stop_workers()
    finally:
        pool.kill_workers()


class ProcessPool:
    """Pool of workers and their tasks; `processes` makes one."""

    def __init__(self, workers: int) -> None:
        self._size = workers
        self._workers: list[Worker] = []
        self._failed_starts = 0

    def __call__(
        self, work: Work, batches: Iterable[Batch], pickled: bytes = b""
    ) -> Iterator[BatchResult]:
        """Yield the results of batches as they complete."""
        call = TaskQueue(work, batches, _AHEAD * self._size, pickled)
        try:
            while call.fill():
                self.start_workers()
                self._send_tasks(call)
                self._wait_for_workers(call)
                yield from call.completed()
        finally:
            # A worker is still busy only if the results are no longer wanted.
            for worker in [worker for worker in self._workers if worker.tasks]:
                self._remove(worker)

    def start_workers(self) -> None:
        """Start as many workers as are missing."""
        while len(self._workers) < self._size:
            self._workers.append(Worker())

    def stop_workers(self) -> None:
        """Ask all workers to end."""
        for worker in self._workers:
            worker.stop()
        for worker in self._workers:
            worker.join()
        self._workers.clear()

    def kill_workers(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.kill()
        self._workers.clear()

    def _remove(self, worker: Worker) -> None:
        self._workers.remove(worker)
        worker.kill()

    def _end_task(self, worker: Worker, call: TaskQueue) -> Task:
        """Remove a worker, and return the task in progress; others that it was sent wait again."""
        self._remove(worker)
        in_progress, *waiting = worker.tasks
        for task in reversed(waiting):
            call.requeue(task)
        return in_progress

    def _send_tasks(self, call: TaskQueue) -> None:
        """Send waiting tasks to workers that can take one, first to those that have none."""
        limits = call.work.limits
        while call.has_tasks:
            free = [worker for worker in self._workers if worker.can_take(limits)]
            if not free:
                return
            least_busy = min(free, key=lambda worker: len(worker.tasks))
            least_busy.send(call.start(), call.pickled, limits)

    def _wait_for_workers(self, call: TaskQueue) -> None:
        """Wait until workers have answered or died, and record the results of their tasks."""
        workers = {waitable: worker for worker in self._workers for waitable in worker.waitables}
        late_at = min(worker.late_at for worker in self._workers)
        patience = None if late_at == math.inf else max(0.0, late_at - time.monotonic())
        ready = wait(list(workers), patience)
        for worker in dict.fromkeys(workers[waitable] for waitable in ready):
            self._receive(worker, call)
        now = time.monotonic()
        for worker in [worker for worker in self._workers if worker.late_at < now]:
            if not worker.has_message:
                call.record_timeout(self._end_task(worker, call))

    def _receive(self, worker: Worker, call: TaskQueue) -> None:
        """Record the answer of a worker, or its death."""
        try:
            answer = worker.receive()
        except WorkerDiedError as death:
            self._remove_dead(worker, call, str(death))
            return
        if isinstance(answer, BaseException):
            raise answer
        if answer is None:
            self._failed_starts = 0
            worker.mark_started()
        elif isinstance(answer, str):
            worker.mark_importing()
        elif worker.needs_repetition:
            worker.send(worker.end_task(), call.pickled, call.work.limits, allow_imports=False)
        else:
            worker.end_task()
            call.complete(answer)

    def _remove_dead(self, worker: Worker, call: TaskQueue, reason: str) -> None:
        """Remove a worker that has died, and record its death."""
        if worker.tasks:
            call.record_death(self._end_task(worker, call), reason)
            return
        self._remove(worker)
        if not worker.is_ready:
            self._failed_starts += 1
            if self._failed_starts == TRIES:
                raise WorkerError(
                    f"no worker process can be started here ({reason}); a script that starts some "
                    'does so under if __name__ == "__main__":'
                )


# Execution of runs in a child of this process, which can be killed.

_children: dict[int, ProcessPool] = {}
# A cluster's worker may have several threads, and they share the child.
_one_at_a_time = threading.Lock()


def run_in_child(work: Work, batch: Batch, pickled: bytes = b"") -> BatchResult:
    """Run a batch in a child of this process; the first call starts it, later ones use it again.

    The limits of the work are enforced. A run that kills the child fails as *crashed*, and no
    other. `pickled` is the work as it is sent to the child, if it has been pickled before.
    """
    # Limits are those of one run.
    batches = batch.singles() if work.limits else [batch]
    process = os.getpid()  # a fork has no child of its own yet
    with _one_at_a_time:
        if process not in _children:
            _children[process] = ProcessPool(1)
            atexit.register(_children[process].kill_workers)
        batch_results = list(_children[process](work, batches, pickled))
    batch_results.sort(key=lambda part: part.start)
    warnings = dict.fromkeys(text for part in batch_results for text in part.warnings)
    results = join_results([part.results for part in batch_results])
    return BatchResult(batch.start, results, tuple(warnings))
