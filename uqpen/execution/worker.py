"""Worker process: its own loop, and its handle in the process that started it."""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import pickle
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext, SpawnContext
from typing import Any

import numpy as np

from uqpen.core.interrupts import exit_at_interrupt
from uqpen.core.limits import Limits
from uqpen.core.processors import use_one_thread
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.execution.batch import Batch, BatchResult, Work
from uqpen.execution.import_signal import ImportSignal
from uqpen.execution.memory_limit import limit_memory
from uqpen.execution.process_role import mark_as_child_process

__all__ = ["IMPORTING", "Worker", "WorkerDiedError", "preload_in_workers"]

# Message of a worker: its run looks for a module that is not loaded yet.
IMPORTING = "importing"

# Time that a run has, in seconds, from when it first imports a module; some packages take tens of
# seconds from a shared disk. A run that then was longer than its limit is made again.
_IMPORT_SECONDS = 60.0

# Number of models, each loaded once, that a worker keeps.
_KNOWN = 16

# The system allows 107 bytes for a socket's path; Python's own names need up to 33 of them.
_LONGEST_FOLDER = 70

# Time that a worker may take to end once it is asked to, in seconds.
_PATIENCE = 5.0

# Exit code; nobody is left to read it.
_ORPHANED = 1

# Modules that take most of a worker's start-up; the program that starts it may name others.
_preloaded = ["uqpen.execution"]


def preload_in_workers(module: str) -> None:
    """Preload the main module of the program in all workers that are started from now on."""
    if module not in _preloaded:
        _preloaded.append(module)


class WorkerDiedError(Exception):
    """Death of a worker; the message gives the cause."""


class Worker:
    """Handle of a worker process, which receives one batch at a time.

    It is never a fork of this process, whose state, threads and random numbers cannot get into a
    run.
    """

    def __init__(self) -> None:
        context = _start_context()
        self.connection, inside = context.Pipe()
        self._process = context.Process(target=_worker_loop, args=(inside,), name="uqpen worker")
        with _defer_interrupts(), _allow_children():
            self._process.start()
        inside.close()
        self.task: Any = None
        self.is_ready = False
        self.late_at = math.inf
        self._seconds = math.inf
        self._begun_at = math.inf
        self._has_imported = False
        self._known: set[bytes] = set()

    @property
    def is_idle(self) -> bool:
        """True if it is ready and has no task."""
        return self.is_ready and self.task is None

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
        self.task, self._has_imported = task, False
        self._seconds = math.inf if limits.seconds is None else limits.seconds
        if work in self._known:
            self.mark_started()
        self._known.add(work)
        # If it is dead, its end is noticed later, as that of any worker with a task.
        with contextlib.suppress(OSError):
            has_more_time = allow_imports and self._seconds < _IMPORT_SECONDS
            self.connection.send((work, task.batch, limits.bytes, has_more_time))

    def mark_started(self) -> None:
        """Record that it is ready, and has begun its task."""
        self.is_ready = True
        if self.task is not None:
            self._begun_at = time.monotonic()
            self.late_at = self._begun_at + self._seconds

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

    def mark_done(self) -> None:
        """Record that it has answered."""
        self.task, self.late_at = None, math.inf

    def receive(self) -> BatchResult | BaseException | str | None:
        """Receive its message; None only means that it is ready, and see `IMPORTING`.

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
        """Ask the worker to end after its current task."""
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


def _worker_loop(connection: Connection[Any, Any]) -> None:
    """Run batches until asked to end, or until the parent process is gone."""
    exit_at_interrupt()
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    _start_process_group()
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    mark_as_child_process()
    use_one_thread()
    # A model with noise of its own must not find the same noise in every worker.
    np.random.seed()  # noqa: NPY002 - the one that a model shares with others
    known: dict[bytes, Work] = {}
    imports = ImportSignal(lambda: connection.send(IMPORTING))
    sys.meta_path.insert(0, imports)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        connection.send(None)
        while (message := connection.recv()) is not None:
            connection.send(_run_batch(connection, known, imports, *message))


def _start_process_group() -> None:
    """Lead a process group, so that this process and those that its runs start end at once."""
    parent = multiprocessing.parent_process()
    if sys.platform == "win32" or parent is None:
        return
    os.setsid()
    if sys.platform == "linux":
        import fcntl

        # Compiled code may let no thread of ours run. Then the system ends the group by a signal,
        # when the pipe from the parent is closed.
        fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, -os.getpid())
        fcntl.fcntl(parent.sentinel, fcntl.F_SETSIG, signal.SIGKILL)
        flags = fcntl.fcntl(parent.sentinel, fcntl.F_GETFL)
        fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, flags | os.O_ASYNC)


def _exit_with_parent() -> None:
    """End this process, even during a run, if its parent process has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        if sys.platform != "win32":
            os.killpg(0, signal.SIGKILL)
        os._exit(_ORPHANED)


def _run_batch(
    connection: Connection[Any, Any],
    known: dict[bytes, Work],
    imports: ImportSignal,
    pickled: bytes,
    batch: Batch,
    memory: int | None,
    has_more_time: bool,
) -> BatchResult | BaseException:
    """Return the result of a batch, or the exception that was raised instead."""
    try:
        if pickled not in known:
            while len(known) >= _KNOWN:
                known.pop(next(iter(known)))
            known[pickled] = pickle.loads(pickled)
            scale(DIMENSIONLESS)  # loads the units library, which is no part of the time of a run
            connection.send(None)
        with limit_memory(memory), imports.armed(armed=has_more_time):
            return known[pickled](batch)
    except BaseException as error:  # it is raised again where the study runs
        error.add_note("in a worker:\n" + "".join(traceback.format_exception(error)))
        return error


def _start_context() -> ForkServerContext | SpawnContext:
    """Return the start method: a new process, or on Linux a fork of a server made for this."""
    # The server listens at a path in the folder of temporary files, which must not be too long.
    if sys.platform != "linux" or len(os.fsencode(tempfile.gettempdir())) > _LONGEST_FOLDER:
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_preloaded)
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
