"""Code of the user's own, which may raise anything, or fork."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator

from uqpen.core.interrupts import is_user_interrupt
from uqpen.models.reasons import one_line

__all__ = ["end_forked_child", "error_text", "restore_streams"]


def end_forked_child(process: int, error: BaseException | None = None) -> None:
    """End this process if a function that was called in `process` forked it.

    A forked child that returns or raises would go on with the study beside its parent.

    Parameters
    ----------
    process : int
        The number of the process before the call.
    error : BaseException, optional
        The exception with which the call ended.
    """
    if os.getpid() == process:
        return
    code = getattr(error, "code", 1) if isinstance(error, SystemExit) else bool(error)
    os._exit(code if isinstance(code, int) else int(code is not None))


def error_text(error: BaseException) -> str:
    """Format an exception in one line, even if its own text raises an error."""
    # The class of an exception may have a name of its own making.
    name = type.__dict__["__name__"].__get__(type(error))
    try:
        return one_line(f"{name}: {error}").removesuffix(":")
    except BaseException as another:  # a foreign exception whose text raises another
        if is_user_interrupt(another):
            raise
        return str(name)


@contextlib.contextmanager
def restore_streams() -> Iterator[None]:
    """Restore the standard output and error afterwards, as a model may replace them."""
    streams = sys.stdout, sys.stderr
    try:
        yield
    finally:
        sys.stdout, sys.stderr = streams
