"""Ctrl-C, as distinct from a KeyboardInterrupt that a model raises itself, and its like."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

_EXIT_CODE = 130

# Signals by which a scheduler, a service or a closed terminal ends a program.
_TERMINATIONS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]

_pressed: int | None = None  # the signal of the last interrupt
_process = 0  # the process that records interrupts


@contextlib.contextmanager
def record_interrupts() -> Iterator[None]:
    """Record Ctrl-C within this context, so that `is_user_interrupt` is certain.

    A request to terminate (SIGTERM, SIGHUP) is an interrupt as well, unless it is ignored. The
    context has no effect outside the main thread, or where another handler of Ctrl-C is installed.
    """
    global _pressed, _process
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    _pressed, _process = None, os.getpid()
    signal.signal(signal.SIGINT, _record)
    requests = [each for each in _TERMINATIONS if signal.getsignal(each) == signal.SIG_DFL]
    for each in requests:
        signal.signal(each, _record)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        for each in requests:
            signal.signal(each, signal.SIG_DFL)


def interrupt_exit_code() -> int:
    """Return the exit code of a program after the last interrupt: 128 and the signal's number."""
    return 128 + (_pressed or signal.SIGINT)


def ignore_termination() -> None:
    """Leave it to the parent process to end this one when both are asked to terminate.

    A service or a scheduler may ask all processes at once. A child of this process, such as that
    of a pool that a model makes, still ends.
    """
    global _process
    _process = os.getpid()
    for each in _TERMINATIONS:
        if signal.getsignal(each) == signal.SIG_DFL:
            signal.signal(each, _ignore)


def exit_at_interrupt() -> None:
    """End this process at once at Ctrl-C from now on, without an exception."""
    signal.signal(signal.SIGINT, _exit)


def is_user_interrupt(error: BaseException) -> bool:
    """Check that an exception is, or may be, Ctrl-C by the user."""
    if not isinstance(error, KeyboardInterrupt):
        return False
    handler = signal.getsignal(signal.SIGINT)
    if handler is _record:
        return _pressed is not None
    return handler not in (_exit, signal.SIG_IGN, signal.SIG_DFL)


def _record(number: int, frame: FrameType | None) -> None:
    global _pressed
    if number != signal.SIGINT and os.getpid() != _process:
        _end_by(number)
    _pressed = number
    signal.default_int_handler(number, frame)


def _ignore(number: int, frame: FrameType | None) -> None:
    if os.getpid() != _process:
        _end_by(number)


def _end_by(number: int) -> None:
    """End this process, a fork of another, as it would end without a handler."""
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)


def _exit(number: int, frame: FrameType | None) -> None:
    os._exit(_EXIT_CODE)
