"""Execution on a Dask cluster: any number of machines on which Dask has been started."""

from __future__ import annotations

import functools
import logging
import pickle
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqpen.core.errors import ClusterError
from uqpen.execution.batch import Batch, BatchResult, Work
from uqpen.execution.child_process import run_in_child
from uqpen.execution.task_queue import Task, TaskQueue

if TYPE_CHECKING:
    from distributed import Client, Future

__all__ = ["Cluster", "cluster"]

# Batches in progress for each thread of the cluster: one to work on, and others on their way.
_AHEAD = 16

# Time limit for reaching the scheduler, in seconds.
_PATIENCE = 15

# Loggers of connections; the second has a level of its own.
_LOGS = ("distributed", "distributed.client", "tornado.application")


@contextmanager
def cluster(scheduler: str) -> Iterator[Cluster]:
    """Connect to a cluster that makes runs; yield it as a map like the built-in.

    Parameters
    ----------
    scheduler : str
        Its address, such as ``tcp://host:8786``, or the path of a scheduler file.

    Raises
    ------
    ClusterError
        If it cannot be reached.
    """
    try:
        from distributed import Client
    except ImportError:
        needed = 'a Dask cluster needs the extra "cluster": pip install "uqpen[cluster]"'
        raise ClusterError(needed) from None
    # Errors report the state of a connection; its log would interrupt the printed tables.
    for name in _LOGS:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    is_file = "://" not in scheduler
    if is_file and not Path(scheduler).is_file():
        raise ClusterError(
            f"--scheduler: found {scheduler}; expected an address such as tcp://host:8786, "
            "or the path of a scheduler file"
        )
    where: dict[str, Any] = {"scheduler_file" if is_file else "address": scheduler}
    try:
        client = Client(**where, timeout=_PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ClusterError(f"no Dask scheduler responds at {scheduler}: {error}") from None
    with client:
        yield Cluster(client)


class Cluster:
    """The workers of a Dask cluster, as a map; `cluster` connects to one."""

    # A task costs the scheduler a millisecond or two, so it should be worth a fifth of a second.
    worth_sending = 0.2

    def __init__(self, client: Client) -> None:
        self._client = client

    def __call__(self, work: Work, batches: Iterable[Batch]) -> Iterator[BatchResult]:
        """Yield the results of batches as they complete."""
        from distributed import as_completed

        if work.is_object:
            raise ClusterError(
                "a model that is a Python object runs in this process or on its own workers, not "
                'on a cluster; name its function in a file: python = "my_model.py:function"'
            )
        threads = max(1, sum(self._client.nthreads().values()))
        call = TaskQueue(work, batches, _AHEAD * threads)
        under_way: dict[Future[BatchResult], Task] = {}
        coming = as_completed(loop=self._client.loop, with_results=True, raise_errors=False)
        try:
            while call.fill():
                tasks = list(call.start_all())
                # Never pure: a batch that is made again must not get its earlier result.
                batches_to_run = [task.batch for task in tasks]
                pickled = [call.pickled] * len(tasks)
                futures = self._client.map(_run_batch, pickled, batches_to_run, pure=False)
                under_way.update(zip(futures, tasks, strict=True))
                coming.update(futures)
                for future, batch_result in coming.next_batch(block=True):
                    self._record(call, future, under_way.pop(future), batch_result)
                yield from call.completed()
        finally:
            if under_way:
                self._client.cancel(list(under_way), force=True)

    def _record(
        self, call: TaskQueue, future: Future[BatchResult], task: Task, batch_result: BatchResult
    ) -> None:
        """Record the result of a task."""
        from distributed import KilledWorker

        if future.status == "finished":
            call.complete(batch_result)
            return
        if future.status == "cancelled":
            raise ClusterError("the Dask scheduler has gone away, or dropped the runs it was given")
        error: BaseException = future.exception()
        if not isinstance(error, KilledWorker):
            raise error
        # The model runs in a child of the worker, so the model did not kill the worker.
        call.record_death(task, "its worker was ended several times")


def _run_batch(pickled: bytes, batch: Batch) -> BatchResult:
    """Run a batch on a worker of the cluster."""
    work = _load_work(pickled)
    return run_in_child(work, batch, pickled) if work.is_untrusted else work(batch)


@functools.lru_cache(maxsize=16)
def _load_work(pickled: bytes) -> Work:
    """Unpickle the work that was sent; a model of the user's own is loaded once."""
    work: Work = pickle.loads(pickled)
    return work
