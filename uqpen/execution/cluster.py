"""Execution on a Dask cluster: any number of machines on which Dask has been started."""

from __future__ import annotations

import functools
import logging
import math
import os
import pickle
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from uqpen.core.errors import ClusterError
from uqpen.core.processors import use_one_thread
from uqpen.execution.batch import Batch, BatchResult, Work
from uqpen.execution.processes import run_in_child
from uqpen.execution.task_queue import Task, TaskQueue

if TYPE_CHECKING:
    from distributed import Client, Future, as_completed

# Workers of a cluster: reports on a study that has none.

# Seconds without a worker before the first report; each later one waits twice as long.
_FIRST_REPORT = 10.0


class Attendance:
    """Presence of workers, with reports on how long there has been none.

    Parameters
    ----------
    report : callable
        Receives the text of a report.
    clock : callable
        Returns the time in seconds.
    """

    def __init__(
        self, report: Callable[[str], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._report = report
        self._clock = clock
        self._absent_since: float | None = None
        self._next_report = _FIRST_REPORT

    def record(self, workers: int) -> None:
        """Record the number of workers, and report where there have been none for a while."""
        now = self._clock()
        if self._absent_since is None:
            self._absent_since = None if workers else now
            return
        absent = now - self._absent_since
        duration = timedelta(seconds=round(absent))
        if workers:
            if self._next_report > _FIRST_REPORT:
                self._report(f"the cluster has workers again, after {duration} without")
            self._absent_since, self._next_report = None, _FIRST_REPORT
        elif absent >= self._next_report:
            self._report(f"the cluster has had no worker for {duration}; the study waits for one")
            self._next_report = 2 * absent


# Time that a batch system leaves to a worker, so that no run is begun that cannot end.

# Environment variable of a worker: the end of its job, in seconds since 1970; empty if unknown.
ENDS_AT = "UQPEN_ENDS_AT"

# Seconds for the result of the run before to be fetched. It goes with this worker, and where no
# other is there to keep it, its run is made again.
_UNTIL_FETCHED = 2.0

# A run may take a fifth longer than the longest before.
_MARGIN = 1.2


def leave_if_late(seconds: float) -> None:
    """Give a task back to the scheduler and end this Dask worker, if its job ends too soon.

    Parameters
    ----------
    seconds : float
        The expected duration of the task; 0 for a worker that does not know it, and tries.

    Raises
    ------
    Reschedule
        If it is too late; Dask then gives the task to another worker.
    """
    if seconds and _MARGIN * seconds > _seconds_left():
        from distributed import Reschedule, get_worker

        time.sleep(_UNTIL_FETCHED)
        worker = get_worker()
        worker.loop.add_callback(worker.close_gracefully)
        raise Reschedule


def _seconds_left() -> float:
    try:
        return float(os.environ[ENDS_AT]) - time.time()
    except (KeyError, ValueError):
        return math.inf


# Batches in progress for each thread of the cluster: one to work on, and others on their way.
_AHEAD = 16

# Time limit for reaching the scheduler, in seconds.
_PATIENCE = 15

# Seconds between two looks at the workers, and the longest wait for a result before one.
_BETWEEN_LOOKS, _LONGEST_WAIT = 1.0, 0.1

# Dask warns of tasks that are large together; batches of a fast model are.
_LARGE_BATCHES = {"distributed.admin.large-graph-warning-threshold": "1 TB"}

_GONE = "the Dask scheduler has gone away, or dropped the runs it was given"

# Loggers of connections; the second has a level of its own.
_LOGS = ("distributed", "distributed.client", "tornado.application")


class Jobs(Protocol):
    """Jobs of a batch system that are workers: how many, and their replacement."""

    size: int

    def renew(self, completed: int) -> None:
        """Replace the jobs that have ended; `completed` is the number of batches so far."""


@contextmanager
def cluster(scheduler: str, report: Callable[[str], None] = lambda text: None) -> Iterator[Cluster]:
    """Connect to a cluster that makes runs; yield it as a map like the built-in.

    Parameters
    ----------
    scheduler : str
        Its address, such as ``tcp://host:8786``, or the path of a scheduler file.
    report : callable
        Receives reports on a study without workers.

    Raises
    ------
    ClusterError
        If it cannot be reached.
    """
    distributed = import_distributed("cluster")
    is_file = "://" not in scheduler
    if is_file and not Path(scheduler).is_file():
        raise ClusterError(
            f"--scheduler: found {scheduler}; expected an address such as tcp://host:8786, "
            "or the path of a scheduler file"
        )
    where: dict[str, Any] = {"scheduler_file" if is_file else "address": scheduler}
    try:
        client = distributed.Client(**where, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ClusterError(f"no Dask scheduler responds at {scheduler}: {error}") from None
    with client:
        yield Cluster(client, report)


def import_distributed(extra: str) -> Any:
    """Import Dask's package; a ClusterError says what to install."""
    try:
        import distributed
    except ImportError:
        needed = f'a Dask cluster needs the extra "{extra}": pip install "uqpen[{extra}]"'
        raise ClusterError(needed) from None
    # Errors report the state of a connection; its log would interrupt the printed tables.
    for name in _LOGS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return distributed


class Cluster:
    """The workers of a Dask cluster, as a map; `cluster` connects to one."""

    # A task costs the scheduler a millisecond or two, so it should be worth a fifth of a second.
    worth_sending = 0.2

    def __init__(
        self,
        client: Client,
        report: Callable[[str], None] = lambda text: None,
        jobs: Jobs | None = None,
    ) -> None:
        self._client = client
        self._attendance = Attendance(report)
        self._jobs = jobs
        self._looked_at = -_BETWEEN_LOOKS
        self._completed = 0

    def __call__(self, work: Work, batches: Iterable[Batch]) -> Iterator[BatchResult]:
        """Yield the results of batches as they complete."""
        from distributed import as_completed

        if work.is_object:
            raise ClusterError(
                "a model that is a Python object runs in this process or on its own workers, not "
                'on a cluster; name its function in a file: python = "my_model.py:function"'
            )
        call = TaskQueue(work, batches, _AHEAD)
        under_way: dict[Future[BatchResult], Task] = {}
        coming = as_completed(loop=self._client.loop, with_results=True, raise_errors=False)
        try:
            while True:
                self._look(call)
                if not call.fill():
                    break
                if call.has_tasks:
                    under_way |= self._send(call, coming)
                if not coming.has_ready():
                    with coming.thread_condition:
                        coming.thread_condition.wait(_LONGEST_WAIT)
                for future, batch_result in coming.next_batch(block=False):
                    self._record(call, future, under_way.pop(future), batch_result)
                yield from call.completed()
        finally:
            if under_way:
                self._client.cancel(list(under_way), force=True)

    def _look(self, call: TaskQueue) -> None:
        """Look at the workers now and then: more of them take more batches."""
        if time.monotonic() - self._looked_at < _BETWEEN_LOOKS:
            return
        try:
            threads = sum(self._client.nthreads().values())
        except (OSError, TimeoutError):
            raise ClusterError(_GONE) from None
        self._looked_at = time.monotonic()
        self._attendance.record(threads)
        call.most = _AHEAD * max(1, threads, self._jobs.size if self._jobs else 0)
        if self._jobs:
            self._jobs.renew(self._completed)

    def _send(self, call: TaskQueue, coming: as_completed) -> dict[Future[BatchResult], Task]:
        """Send all waiting tasks."""
        import dask

        tasks = list(call.start_all())
        batches = [task.batch for task in tasks]
        with dask.config.set(_LARGE_BATCHES):
            # Never pure: a batch that is made again must not get its earlier result.
            futures = self._client.map(_run_batch, [call.pickled] * len(tasks), batches, pure=False)
        coming.update(futures)
        return dict(zip(futures, tasks, strict=True))

    def _record(
        self, call: TaskQueue, future: Future[BatchResult], task: Task, batch_result: BatchResult
    ) -> None:
        """Record the result of a task."""
        from distributed import KilledWorker

        if future.status == "finished":
            self._completed += 1
            self._attendance.record(1)  # a worker at least, also where none was at the last look
            call.complete(batch_result)
            return
        if future.status == "cancelled":
            raise ClusterError(_GONE)
        error: BaseException = future.exception()
        if not isinstance(error, KilledWorker):
            raise error
        # The model runs in a child of the worker, so the model did not kill the worker.
        call.record_death(task, "its worker was ended several times")


def _run_batch(pickled: bytes, batch: Batch) -> BatchResult:
    """Run a batch on a worker of the cluster; near the end of its job, leave it to another."""
    use_one_thread()
    loaded = _load_work(pickled)
    leave_if_late(loaded.longest_run * len(batch))
    work, began = loaded.work, time.monotonic()
    result = run_in_child(work, batch, pickled) if work.is_untrusted else work(batch)
    loaded.longest_run = max(loaded.longest_run, (time.monotonic() - began) / len(batch))
    return result


@dataclass
class _LoadedWork:
    """Work on a worker, with the duration of its longest run there in seconds."""

    work: Work
    longest_run: float = 0.0


@functools.lru_cache(maxsize=16)
def _load_work(pickled: bytes) -> _LoadedWork:
    """Unpickle the work that was sent; a user-defined model is loaded once."""
    return _LoadedWork(pickle.loads(pickled))
