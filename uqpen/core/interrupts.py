"""Ctrl-C, as distinct from a KeyboardInterrupt that a model raises itself."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

__all__ = ["exit_at_interrupt", "is_user_interrupt", "record_interrupts"]

_EXIT_CODE = 130

_is_pressed = False


@contextlib.contextmanager
def record_interrupts() -> Iterator[None]:
    """Record Ctrl-C within this context, so that `is_user_interrupt` is certain.

    It has no effect outside the main thread, or where another handler is installed.
    """
    global _is_pressed
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    _is_pressed = False
    signal.signal(signal.SIGINT, _record)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def exit_at_interrupt() -> None:
    """End this process at once at Ctrl-C from now on, without an exception."""
    signal.signal(signal.SIGINT, _exit)


def is_user_interrupt(error: BaseException) -> bool:
    """Check that an exception is, or may be, Ctrl-C by the user."""
    if not isinstance(error, KeyboardInterrupt):
        return False
    handler = signal.getsignal(signal.SIGINT)
    if handler is _record:
        return _is_pressed
    return handler not in (_exit, signal.SIG_IGN, signal.SIG_DFL)


def _record(number: int, frame: FrameType | None) -> None:
    global _is_pressed
    _is_pressed = True
    signal.default_int_handler(number, frame)


def _exit(number: int, frame: FrameType | None) -> None:
    os._exit(_EXIT_CODE)
