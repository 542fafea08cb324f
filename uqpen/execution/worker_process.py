"""Loop of a worker process, which makes the runs that its parent process sends."""

from __future__ import annotations

import contextlib
import importlib.abc
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from queue import SimpleQueue
from typing import Any

import numpy as np

from uqpen.core.interrupts import exit_at_interrupt, ignore_termination
from uqpen.core.output_streams import lasting_streams
from uqpen.core.processors import use_one_thread
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.execution.batch import Batch, BatchResult, Work
from uqpen.execution.memory_limit import limit_memory

# Signal of a worker that its run imports a module, which takes time that is not the run's.


class ImportSignal(importlib.abc.MetaPathFinder):
    """Finder that finds nothing, but sends a signal when a run first looks for a module.

    Python asks it for modules that are not loaded yet, and for no others.
    """

    def __init__(self, send: Callable[[], None]) -> None:
        self._send = send
        self._is_armed = False

    @contextlib.contextmanager
    def armed(self, *, armed: bool) -> Iterator[None]:
        """Within this context, send the signal once, if it is armed."""
        self._is_armed = armed
        try:
            yield
        finally:
            self._is_armed = False

    def find_spec(self, *arguments: Any, **options: Any) -> None:
        """Return None, as other finders are to find the module."""
        # Another thread could send while this one does.
        if self._is_armed and threading.current_thread() is threading.main_thread():
            self._is_armed = False
            self._send()


# The role of this process: whether another process can end it.

_is_child_process = False


def is_child_process() -> bool:
    """Check that another process can end this one, should a run hang."""
    return _is_child_process


def mark_as_child_process() -> None:
    """Record that another process can end this one."""
    global _is_child_process
    _is_child_process = True


# Message of a worker: its run looks for a module that is not loaded yet.
IMPORTING = "importing"

# Number of models, each loaded once, that a worker keeps.
_KNOWN = 16

# Exit code; nobody is left to read it.
_ORPHANED = 1


def run_batches(connection: Connection[Any, Any]) -> None:
    """Run batches until asked to end, or until the parent process is gone."""
    exit_at_interrupt()
    ignore_termination()
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
    messages: SimpleQueue[Any] = SimpleQueue()
    threading.Thread(target=_receive, args=(connection, messages), daemon=True).start()
    with lasting_streams(), contextlib.suppress(BrokenPipeError, ConnectionResetError):
        connection.send(None)
        while (message := messages.get()) is not None:
            connection.send(_run_batch(connection, known, imports, *message))


def _receive(connection: Connection[Any, Any], messages: SimpleQueue[Any]) -> None:
    """Put messages into a queue as they come, and None behind the last.

    If they were received between runs only, both processes could wait forever: the parent to send
    a large batch, and this one to send a large result.
    """
    with contextlib.suppress(EOFError, ConnectionResetError):
        while (message := connection.recv()) is not None:
            messages.put(message)
    messages.put(None)


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
