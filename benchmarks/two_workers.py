"""A Dask scheduler with two workers over loopback, in processes of their own."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection

__all__ = ["processor_time", "two_workers"]


@contextmanager
def two_workers() -> Iterator[tuple[str, int]]:
    """Start them; yield the address of the scheduler and the id of its process."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there,))
    process.start()
    try:
        address = here.recv()
        assert process.pid is not None
        yield address, process.pid
    finally:
        here.send("end")
        process.join()


def processor_time(process: int) -> float:
    """Seconds of processor time that a process has taken so far."""
    import psutil

    return float(sum(psutil.Process(process).cpu_times()[:2]))


def _serve(pipe: Connection) -> None:
    """Run a scheduler until it is told to end; its workers are processes of their own."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as local:
        pipe.send(local.scheduler_address)
        pipe.recv()
