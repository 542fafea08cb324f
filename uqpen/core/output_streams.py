"""Standard output and error that neither a closed pipe nor a full disk ends.

What has to be written goes on to the end, such as a study whose archive counts and not its screen.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

__all__ = ["lasting_streams", "stream_error"]


class _LastingFile(io.FileIO):
    """File that goes nowhere from the first write that fails."""

    error = ""

    def write(self, data: ReadableBuffer, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            # A reader who has seen enough is no error. Windows has a reason of its own for that.
            is_left = isinstance(error, BrokenPipeError) or sys.platform == "win32"
            self.error = "" if is_left else error.strerror or str(error)
            with Path(os.devnull).open("wb") as nowhere:
                os.dup2(nowhere.fileno(), self.fileno())
            return memoryview(data).nbytes


@contextlib.contextmanager
def lasting_streams(errors: str | None = None) -> Iterator[None]:
    """Let standard output and error be files whose writes never fail, within this context.

    One that was closed when the program started goes nowhere. Streams that are no files, such as
    those of a notebook or a test, stay as they are.

    Parameters
    ----------
    errors : str, optional
        Name of the error handler for characters that a stream lacks; by default its own.
    """
    before = sys.stdout, sys.stderr
    with contextlib.ExitStack() as opened:
        sys.stdout, sys.stderr = (
            opened.enter_context(_nowhere()) if stream is None else _lasting(stream, errors)
            for stream in before
        )
        try:
            yield
        finally:
            for stream in (sys.stdout, sys.stderr):
                with contextlib.suppress(ValueError):  # closed by a model
                    stream.flush()
            sys.stdout, sys.stderr = before


def stream_error() -> str:
    """Return the reason why standard output could not be written; empty where it could."""
    sys.stdout.flush()
    raw = _raw_file(sys.stdout)
    return raw.error if isinstance(raw, _LastingFile) else ""


def _nowhere() -> TextIO:
    """Open a file that keeps nothing; it takes the place of a closed standard stream."""
    return Path(os.devnull).open("w", encoding="utf-8")


def _lasting(stream: TextIO, errors: str | None) -> TextIO:
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    if errors is not None:
        stream.reconfigure(errors=errors)
    raw = _raw_file(stream)
    if not isinstance(raw, io.FileIO):
        return stream
    stream.flush()
    file = _LastingFile(raw.fileno(), "w", closefd=False)
    return io.TextIOWrapper(
        # An unbuffered stream has none below it.
        file if stream.buffer is raw else io.BufferedWriter(file),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _raw_file(stream: object) -> object:
    buffer = getattr(stream, "buffer", None)
    return getattr(buffer, "raw", buffer)
