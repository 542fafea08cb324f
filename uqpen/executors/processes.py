"""Runs on several processes of this machine: the same results, sooner."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import wait

from uqpen.errors import ModelError, Problem, SettingsError, WorkerError
from uqpen.executors.work import Batch, Piece, Work
from uqpen.executors.worker import DiedError, Worker
from uqpen.labels import Status

__all__ = ["processes"]

# Batches that are under way or taken to be begun next, for each worker.
_AHEAD = 2

# How often a run, or a worker's start, is tried.
_TRIES = 3


@contextmanager
def processes(workers: int) -> Iterator[_Pool]:
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
    pool = _Pool(workers)
    try:
        pool.hire()
        yield pool
        pool.dismiss()
    finally:
        pool.kill()


@dataclass
class _Task:
    """A batch, and how many workers it has cost."""

    batch: Batch
    deaths: int = 0

    def halves(self) -> Iterator[_Task]:
        # One more death and it is halved again.
        yield from (_Task(half, _TRIES - 1) for half in self.batch.halves())


class _Call:
    """One call of the map: what nobody has begun, and what is done and not yet told."""

    def __init__(self, work: Work, batches: Iterable[Batch], most: int) -> None:
        self._work = work
        self.pickled = _pickled(work)
        self._coming = iter(batches)
        self._most = most
        self._busy = 0
        self.tasks: deque[_Task] = deque()
        self.pieces: list[Piece] = []

    def fill(self) -> bool:
        """Take batches as long as not too many are under way; whether there are any."""
        while len(self.tasks) + self._busy < self._most:
            batch = next(self._coming, None)
            if batch is None:
                break
            self.tasks.append(_Task(batch))
        return bool(self.tasks) or self._busy > 0

    def begin(self) -> _Task:
        """The next task, which somebody works on from now on."""
        self._busy += 1
        return self.tasks.popleft()

    def is_done(self, piece: Piece) -> None:
        """Note what came of a task."""
        self._busy -= 1
        self.pieces.append(piece)

    def has_killed(self, task: _Task, reason: str) -> None:
        """Note that a task's worker has died of it."""
        self._busy -= 1
        task.deaths += 1
        if task.deaths < _TRIES:
            self.tasks.appendleft(task)
        elif len(task.batch) > 1:
            self.tasks.extendleft(reversed(list(task.halves())))
        else:
            self.pieces.append(self._work.lost(task.batch, Status.CRASHED, reason))

    def told(self) -> Iterator[Piece]:
        """What is done, once."""
        pieces, self.pieces = self.pieces, []
        yield from pieces


class _Pool:
    """Workers, and what they work on; `processes` makes one."""

    def __init__(self, workers: int) -> None:
        self._size = workers
        self._workers: list[Worker] = []
        self._failed_starts = 0

    def __call__(self, work: Work, batches: Iterable[Batch]) -> Iterator[Piece]:
        """What came of batches, as it comes."""
        call = _Call(work, batches, _AHEAD * self._size)
        try:
            while call.fill():
                self.hire()
                for worker in self._workers:
                    if worker.is_idle and call.tasks:
                        task = call.begin()
                        worker.give(task, call.pickled, task.batch)
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

    def _listen(self, call: _Call) -> None:
        """Wait until workers have answered or died, and note what came of their tasks."""
        speakers = {sign: worker for worker in self._workers for sign in worker.signs}
        for worker in dict.fromkeys(speakers[sign] for sign in wait(list(speakers))):
            try:
                answer = worker.answer()
            except DiedError as death:
                self._bury(worker, call, str(death))
                continue
            if isinstance(answer, BaseException):
                raise answer
            if answer is None:
                worker.is_ready, self._failed_starts = True, 0
            else:
                call.is_done(answer)
                worker.task = None

    def _bury(self, worker: Worker, call: _Call, reason: str) -> None:
        """Do without a worker that has died."""
        self._workers.remove(worker)
        worker.kill()
        if not worker.is_ready:
            self._failed_starts += 1
            if self._failed_starts == _TRIES:
                raise WorkerError(
                    f"no worker process can be started here ({reason}); a script that starts some "
                    'does so under if __name__ == "__main__":'
                )
        elif worker.task is not None:
            call.has_killed(worker.task, reason)


def _pickled(work: Work) -> bytes:
    """What workers are sent; a function of the user's own goes as a reference to its file."""
    try:
        return pickle.dumps(work)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ModelError(
            f"this model cannot be sent to another process ({error}): "
            "name its function in a study file, or use one worker"
        ) from None
