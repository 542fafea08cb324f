"""Runs on several processes of this machine: the same results, sooner."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import wait

from uqpen.errors import Problem, SettingsError, WorkerError
from uqpen.executors.call import TRIES, Call
from uqpen.executors.work import Batch, Piece, Work
from uqpen.executors.worker import DiedError, Worker

__all__ = ["Pool", "processes"]

# Batches that are under way or taken to be begun next, for each worker.
_AHEAD = 2


@contextmanager
def processes(workers: int) -> Iterator[Pool]:
    """Processes that make runs, as a map like the built-in.

    It takes batches as they are needed, and yields what came of them as it comes. A worker that
    dies is replaced and its batch tried again, then halved, until the run that kills it is alone:
    that run is lost as *crashed*, and no other.

    Parameters
    ----------
    workers : int
        How many. No result depends on it.

    Raises
    ------
    SettingsError
        If it is less than 1.
    """
    if workers < 1:
        problem = Problem(("workers",), str(workers), "a number of processes, 1 or more")
        raise SettingsError([problem])
    pool = Pool(workers)
    try:
        pool.hire()
        yield pool
        pool.dismiss()
    finally:
        pool.kill()


class Pool:
    """Workers, and what they work on; `processes` makes one."""

    def __init__(self, workers: int) -> None:
        self._size = workers
        self._workers: list[Worker] = []
        self._failed_starts = 0

    def __call__(
        self, work: Work, batches: Iterable[Batch], pickled: bytes = b""
    ) -> Iterator[Piece]:
        """What came of batches, as it comes."""
        call = Call(work, batches, _AHEAD * self._size, pickled)
        try:
            while call.fill():
                self.hire()
                for worker in self._workers:
                    if worker.is_idle and call.has_tasks:
                        worker.give(call.begin(), call.pickled, work.limits)
                self._listen(call)
                yield from call.told()
        finally:
            # Only where the results are wanted no longer is anyone still busy.
            for worker in [worker for worker in self._workers if worker.task is not None]:
                self._workers.remove(worker)
                worker.kill()

    def hire(self) -> None:
        """Start as many workers as are missing."""
        while len(self._workers) < self._size:
            self._workers.append(Worker())

    def dismiss(self) -> None:
        """Let all workers leave."""
        for worker in self._workers:
            worker.dismiss()
        for worker in self._workers:
            worker.leave()
        self._workers.clear()

    def kill(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.kill()
        self._workers.clear()

    def _listen(self, call: Call) -> None:
        """Wait until workers have answered or died, and note what came of their tasks."""
        speakers = {sign: worker for worker in self._workers for sign in worker.signs}
        late_at = min(worker.late_at for worker in self._workers)
        patience = None if late_at == math.inf else max(0.0, late_at - time.monotonic())
        for worker in dict.fromkeys(speakers[sign] for sign in wait(list(speakers), patience)):
            self._hear(worker, call)
        now = time.monotonic()
        for worker in [worker for worker in self._workers if worker.late_at < now]:
            if not worker.has_spoken:
                self._workers.remove(worker)
                worker.kill()
                call.is_late(worker.task)

    def _hear(self, worker: Worker, call: Call) -> None:
        """Note what a worker has answered, or that it has died."""
        try:
            answer = worker.answer()
        except DiedError as death:
            self._bury(worker, call, str(death))
            return
        if isinstance(answer, BaseException):
            raise answer
        if answer is None:
            self._failed_starts = 0
            worker.begins()
        else:
            worker.is_done()
            call.is_done(answer)

    def _bury(self, worker: Worker, call: Call, reason: str) -> None:
        """Do without a worker that has died."""
        self._workers.remove(worker)
        worker.kill()
        if not worker.is_ready:
            self._failed_starts += 1
            if self._failed_starts == TRIES:
                raise WorkerError(
                    f"no worker process can be started here ({reason}); a script that starts some "
                    'does so under if __name__ == "__main__":'
                )
        elif worker.task is not None:
            call.has_killed(worker.task, reason)
