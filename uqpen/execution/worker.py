"""A process that makes runs, as it sees itself and as it is seen by the one that started it."""

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

from uqpen.core.limits import Limits
from uqpen.execution.batch import Batch, BatchResult, Work
from uqpen.execution.child_process import mark_as_child_process
from uqpen.execution.memory_limit import limit_memory

__all__ = ["Worker", "WorkerDiedError"]

# How many models, each loaded once, a worker keeps.
_KNOWN = 16

# The system takes 107 bytes for a socket's path, of which Python's own names need up to 33.
_LONGEST_FOLDER = 70

# How long a worker may take to leave once it is told to, in seconds.
_PATIENCE = 5.0

# Exit codes that nobody is left to read.
_INTERRUPTED, _ORPHANED = 130, 1

# What most of the start-up of a worker is spent on: models, and the program that started it.
_PRELOADED = ["uqpen.execution", "uqpen.cli.main"]


class WorkerDiedError(Exception):
    """A worker is no more; the message says what became of it."""


class Worker:
    """A process of its own, which is sent one batch at a time.

    Never a fork of this process: nothing of its state, its threads or its random numbers can get
    into a run.
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
        self._known: set[bytes] = set()

    @property
    def is_idle(self) -> bool:
        """Whether it waits for something to do."""
        return self.is_ready and self.task is None

    @property
    def waitables(self) -> tuple[Any, int]:
        """What to wait for: an answer, or its end."""
        return self.connection, self._process.sentinel

    @property
    def has_message(self) -> bool:
        """Whether there is an answer, or its end."""
        return bool(wait(self.waitables, 0))

    def send(self, task: Any, work: bytes, limits: Limits) -> None:
        """Have `work`, a pickled callable, done on the batch of a task.

        Its time begins when it has been loaded there, which it is once.
        """
        self.task = task
        self._seconds = math.inf if limits.seconds is None else limits.seconds
        if work in self._known:
            self.mark_started()
        self._known.add(work)
        # If it is dead, its end is noticed as that of any other worker with a task.
        with contextlib.suppress(OSError):
            self.connection.send((work, task.batch, limits.bytes))

    def mark_started(self) -> None:
        """Note that it is ready, and has begun what it was given."""
        self.is_ready = True
        if self.task is not None:
            self.late_at = time.monotonic() + self._seconds

    def mark_done(self) -> None:
        """Note that it has answered."""
        self.task, self.late_at = None, math.inf

    def receive(self) -> BatchResult | BaseException | None:
        """What it has sent, None if that is only that it is ready.

        Raises
        ------
        WorkerDiedError
            If it has sent nothing, which is so only after its end.
        """
        try:
            if self.connection.poll():
                answer: BatchResult | BaseException | None = self.connection.recv()
                return answer
        except (EOFError, OSError):
            pass  # it was killed while it sent
        self._process.join(_PATIENCE)
        raise WorkerDiedError(_exit_text(self._process.exitcode))

    def stop(self) -> None:
        """Tell it to leave when it is done."""
        with contextlib.suppress(OSError):
            self.connection.send(None)

    def join(self) -> None:
        """Wait for it to leave, but not for long."""
        self._process.join(_PATIENCE)
        self.kill()

    def kill(self) -> None:
        """End it, whatever it does, and what its run has started."""
        # If it has ended already, its number may be that of another group.
        if sys.platform != "win32" and self._process.pid and self._process.is_alive():
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self.connection.close()


def _worker_loop(connection: Connection[Any, Any]) -> None:
    """Make batches of runs until told to leave, or nobody is left to tell."""
    signal.signal(signal.SIGINT, lambda *_: os._exit(_INTERRUPTED))
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    _start_process_group()
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    mark_as_child_process()
    # A model with noise of its own must not find the same noise in every worker.
    np.random.seed()  # noqa: NPY002 - the one that a model shares with others
    known: dict[bytes, Work] = {}
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        connection.send(None)
        while (message := connection.recv()) is not None:
            connection.send(_run_batch(connection, known, *message))


def _start_process_group() -> None:
    """Make what runs start one group with this process, so that both can be ended at once."""
    parent = multiprocessing.parent_process()
    if sys.platform == "win32" or parent is None:
        return
    os.setsid()
    if sys.platform == "linux":
        import fcntl

        # Compiled code may let no thread of ours run: then the system ends the group, by a signal
        # when the pipe from the parent is closed.
        fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, -os.getpid())
        fcntl.fcntl(parent.sentinel, fcntl.F_SETSIG, signal.SIGKILL)
        flags = fcntl.fcntl(parent.sentinel, fcntl.F_GETFL)
        fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, flags | os.O_ASYNC)


def _exit_with_parent() -> None:
    """End this process in the middle of a run, if the one that wants its results has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        if sys.platform != "win32":
            os.killpg(0, signal.SIGKILL)
        os._exit(_ORPHANED)


def _run_batch(
    connection: Connection[Any, Any],
    known: dict[bytes, Work],
    pickled: bytes,
    batch: Batch,
    memory: int | None,
) -> BatchResult | BaseException:
    """What came of a batch, or what was raised in its place."""
    try:
        if pickled not in known:
            while len(known) >= _KNOWN:
                known.pop(next(iter(known)))
            known[pickled] = pickle.loads(pickled)
            connection.send(None)
        with limit_memory(memory):
            return known[pickled](batch)
    except BaseException as error:  # it is raised again where the study runs
        error.add_note("in a worker:\n" + "".join(traceback.format_exception(error)))
        return error


def _start_context() -> ForkServerContext | SpawnContext:
    """How workers start: anew, or on Linux as forks of a server that has done nothing else."""
    # The server listens at a path in the folder of temporary files, which must not be too long.
    if sys.platform != "linux" or len(os.fsencode(tempfile.gettempdir())) > _LONGEST_FOLDER:
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    return context


@contextlib.contextmanager
def _allow_children() -> Iterator[None]:
    """While this lasts, a process may start another even if it is somebody's daemon.

    A worker of Dask is. The rule is there since daemons are killed without further ado and leave
    their children behind; those of ours leave by themselves.
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
    """While this lasts, Ctrl-C waits; who is started meanwhile lets it wait until he is ready."""
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
    """What became of a process, in words.

    >>> _end(-9), _end(3)
    ('the run ended its process: Killed', 'the run ended its process: exit code 3')
    """
    how = f"exit code {code}"
    if code is not None and code < 0:
        how = signal.strsignal(-code) or f"signal {-code}"
    return f"the run ended its process: {how}"
