"""Runs on several processes of this machine: the same results, sooner."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Any, Protocol

import numpy as np

from uqpen.errors import ModelError, Problem, SettingsError, WorkerError
from uqpen.executors.worker import DiedError, Inputs, Worker
from uqpen.labels import Status
from uqpen.model import Results

__all__ = ["Work", "processes"]

# Batches that are under way or wait for an earlier one, for each worker.
_AHEAD = 8

# How often a run, or a worker's start, is tried.
_TRIES = 3


class Work(Protocol):
    """What is done with a batch."""

    def __call__(self, inputs: Any, /) -> Results:
        """The results of a batch."""
        ...

    def lost(self, runs: int, status: Status, reason: str) -> Results:
        """The results of so many runs that were all lost to the same."""
        ...


@contextmanager
def processes(workers: int) -> Iterator[_Pool]:
    """Processes that make runs, as a map like the built-in.

    It takes batches of a `Work` as they are needed, and yields their results in the order of the
    batches. A worker that dies is replaced and its batch tried again, then halved, until the run
    that kills it is alone: that run is lost as *crashed*, and no other.

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
class _Batch:
    """A batch and what has come of it: results by the position that they begin at."""

    runs: int
    parts: dict[int, Results] = field(default_factory=dict)

    @property
    def is_done(self) -> bool:
        return sum(len(part.status) for part in self.parts.values()) == self.runs

    def results(self) -> Results:
        parts = dict(sorted(self.parts.items()))
        first = next(iter(parts.values()))
        if len(parts) == 1:
            return first
        return Results(
            {
                name: np.concatenate([part.outputs[name] for part in parts.values()])
                for name in first.outputs
            },
            np.concatenate([part.status for part in parts.values()]),
            {
                start + run: reason
                for start, part in parts.items()
                for run, reason in part.reasons.items()
            },
            frozenset().union(*(part.files for part in parts.values())),
        )


@dataclass
class _Task:
    """Runs of a batch from a position on, and how many workers they have cost."""

    batch: _Batch
    start: int
    runs: int
    inputs: Inputs
    deaths: int = 0

    def halves(self) -> Iterator[_Task]:
        middle = self.runs // 2
        for begin, end in ((0, middle), (middle, self.runs)):
            inputs = {name: values[begin:end] for name, values in self.inputs.items()}
            # One more death and it is halved again.
            yield _Task(self.batch, self.start + begin, end - begin, inputs, _TRIES - 1)


class _Call:
    """One call of the map: its batches in their order, and the tasks that nobody has begun."""

    def __init__(self, work: Work, batches: Iterable[Inputs], most: int) -> None:
        self._work = work
        self.pickled = _pickled(work)
        self._coming = iter(batches)
        self._most = most
        self._batches: deque[_Batch] = deque()
        self.tasks: deque[_Task] = deque()

    def fill(self) -> bool:
        """Take batches as long as not too many are under way; whether there are any."""
        while len(self._batches) < self._most:
            inputs = next(self._coming, None)
            if inputs is None:
                break
            batch = _Batch(len(next(iter(inputs.values()))))
            self._batches.append(batch)
            self.tasks.append(_Task(batch, 0, batch.runs, inputs))
        return bool(self._batches)

    def finished(self) -> Iterator[Results]:
        """The results of batches that are done, as far as all before them are."""
        while self._batches and self._batches[0].is_done:
            yield self._batches.popleft().results()

    def has_killed(self, task: _Task, reason: str) -> None:
        """Note that a task's worker has died of it."""
        task.deaths += 1
        if task.deaths < _TRIES:
            self.tasks.appendleft(task)
        elif task.runs > 1:
            self.tasks.extendleft(reversed(list(task.halves())))
        else:
            task.batch.parts[task.start] = self._work.lost(1, Status.CRASHED, reason)


class _Pool:
    """Workers, and what they work on; `processes` makes one."""

    def __init__(self, workers: int) -> None:
        self._size = workers
        self._workers: list[Worker] = []
        self._failed_starts = 0

    def __call__(self, work: Work, batches: Iterable[Any]) -> Iterator[Results]:
        """Results of batches, in their order."""
        call = _Call(work, batches, _AHEAD * self._size)
        try:
            while call.fill():
                self.hire()
                for worker in self._workers:
                    if worker.is_idle and call.tasks:
                        task = call.tasks.popleft()
                        worker.give(task, call.pickled, task.inputs)
                self._listen(call)
                yield from call.finished()
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
                worker.task.batch.parts[worker.task.start] = answer
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
