"""Handle of a worker process in the process that has started it."""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import ForkServerContext, SpawnContext
from typing import Any

from uqpen.core.limits import Limits
from uqpen.execution.batch import BatchResult
from uqpen.execution.worker_process import run_batches

# Time that a run has, in seconds, from when it first imports a module; some packages take tens of
# seconds from a shared disk. A run that then was longer than its limit is made again.
_IMPORT_SECONDS = 60.0

# The system allows 107 bytes for a socket's path; Python's own names need up to 33 of them.
_LONGEST_FOLDER = 70

# Tasks that a worker may have: one in progress, and one that it begins without waiting for us.
_MOST_TASKS = 2

# Seconds of a task that is sent alone. The wait for the next one is nothing beside it, and at the
# end of a round another worker could be free before this one. All of the last tasks count.
_LONG = 1.0
_WINDOW = 8

# Time that a worker may take to end once it is asked to, in seconds.
_PATIENCE = 5.0

# Modules that workers need, which the server loads once for all of them.
_PRELOADED = ["uqpen.execution.evaluator", "uqpen.models.python_function", "cf_units"]


class WorkerDiedError(Exception):
    """Death of a worker; the message gives the cause."""


class Worker:
    """Handle of a worker process, which makes the tasks it is sent one after another.

    It is never a fork of this process, whose state, threads and random numbers cannot get into a
    run.
    """

    def __init__(self) -> None:
        context = _start_context()
        self.connection, inside = context.Pipe()
        self._process = context.Process(target=run_batches, args=(inside,), name="uqpen worker")
        with _defer_interrupts(), _allow_children():
            self._process.start()
        inside.close()
        # Without an answer so far; the first is in progress.
        self.tasks: deque[Any] = deque()
        self.is_ready = False
        self.late_at = math.inf
        self._seconds = math.inf
        self._begun_at = math.inf
        self._durations = deque([math.inf], _WINDOW)
        self._has_imported = False
        self._known: set[bytes] = set()

    def can_take(self, limits: Limits) -> bool:
        """Check that it may be sent a task of runs with these limits.

        One with limits is sent alone, as its time begins when it is sent.
        """
        if not self.tasks:
            return self.is_ready
        return len(self.tasks) < _MOST_TASKS and not limits and max(self._durations) < _LONG

    @property
    def waitables(self) -> tuple[Any, int]:
        """Objects to wait on: its connection, for a message, and its sentinel, for its end."""
        return self.connection, self._process.sentinel

    @property
    def has_message(self) -> bool:
        """True if it has sent a message or has ended."""
        return bool(wait(self.waitables, 0))

    def send(self, task: Any, work: bytes, limits: Limits, *, allow_imports: bool = True) -> None:
        """Send `work`, a pickled callable, and the batch of a task to it.

        The time of the task begins when the worker has loaded the callable, which it does once.
        If the run imports modules, it has more time, unless `allow_imports` is False.
        """
        self.tasks.append(task)
        self._has_imported = False
        self._seconds = math.inf if limits.seconds is None else limits.seconds
        if work not in self._known:
            self._known.add(work)
            self._durations = deque([math.inf], _WINDOW)
        elif len(self.tasks) == 1:
            self._begin()
        # If it is dead, its end is noticed later, as that of any worker with a task.
        with contextlib.suppress(OSError):
            has_more_time = allow_imports and self._seconds < _IMPORT_SECONDS
            self.connection.send((work, task.batch, limits.bytes, has_more_time))

    def mark_started(self) -> None:
        """Record that it is ready, and has begun its task."""
        self.is_ready = True
        self._begin()

    def mark_importing(self) -> None:
        """Record that its run imports a module, which gives it more time."""
        self._has_imported = True
        self.late_at = max(self.late_at, time.monotonic() + _IMPORT_SECONDS)

    @property
    def needs_repetition(self) -> bool:
        """True if the run that it has answered took longer than allowed, but imported modules.

        The modules are loaded now. Only the time of a run without them decides if it is too
        long, so that it does not matter in which process a run is made.
        """
        return self._has_imported and time.monotonic() - self._begun_at > self._seconds

    def end_task(self) -> Any:
        """Record that it has answered the task in progress, and return the task."""
        task = self.tasks.popleft()
        self._durations.append(time.monotonic() - self._begun_at)
        self._begin()
        return task

    def receive(self) -> BatchResult | BaseException | str | None:
        """Receive its message.

        None means only that it is ready, and a text that its run imports a module.

        Raises
        ------
        WorkerDiedError
            If it has sent nothing because it has ended.
        """
        try:
            if self.connection.poll():
                answer: BatchResult | BaseException | str | None = self.connection.recv()
                return answer
        except (EOFError, OSError):
            pass  # it was killed while it sent
        self._process.join(_PATIENCE)
        raise WorkerDiedError(_exit_text(self._process.exitcode))

    def stop(self) -> None:
        """Ask the worker to end after its tasks."""
        with contextlib.suppress(OSError):
            self.connection.send(None)

    def join(self) -> None:
        """Wait a short time for its end."""
        self._process.join(_PATIENCE)
        self.kill()

    def kill(self) -> None:
        """Kill it and all processes that its run has started."""
        # If it has ended already, its number may be that of another group.
        if sys.platform != "win32" and self._process.pid and self._process.is_alive():
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self.connection.close()

    def _begin(self) -> None:
        """Begin the time of the task in progress, if there is one."""
        self._begun_at = time.monotonic()
        self.late_at = self._begun_at + self._seconds if self.tasks else math.inf


def _start_context() -> ForkServerContext | SpawnContext:
    """Return the start method: a new process, or on Linux a fork of a server made for this."""
    # The server listens at a path in the folder of temporary files, which must not be too long.
    if sys.platform != "linux" or len(os.fsencode(tempfile.gettempdir())) > _LONGEST_FOLDER:
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    return context


@contextlib.contextmanager
def _allow_children() -> Iterator[None]:
    """Allow a daemonic process to start child processes within this context.

    A worker of Dask is daemonic. Python forbids children of daemonic processes, as these are killed
    without cleanup and leave their children behind. Our children end by themselves.
    """
    configuration: dict[str, Any] = getattr(multiprocessing.current_process(), "_config", {})
    is_daemon = configuration.pop("daemon", None)
    try:
        yield
    finally:
        if is_daemon is not None:
            configuration["daemon"] = is_daemon


@contextlib.contextmanager
def _defer_interrupts() -> Iterator[None]:
    """Defer Ctrl-C within this context; a process started here defers it until it is ready."""
    if sys.platform == "win32":
        yield
        return
    # If it were started later, it would let interrupts through.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _exit_text(code: int | None) -> str:
    """Describe the end of a process in words.

    >>> _exit_text(-9), _exit_text(3)
    ('the run ended its process: Killed', 'the run ended its process: exit code 3')
    """
    how = f"exit code {code}"
    if code is not None and code < 0:
        how = signal.strsignal(-code) or f"signal {-code}"
    return f"the run ended its process: {how}"
