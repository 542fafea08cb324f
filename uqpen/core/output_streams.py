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


class _LastingText(io.TextIOWrapper):
    """Text of a file that stays open where a model closes it."""

    def close(self) -> None:
        self.flush()


@contextlib.contextmanager
def lasting_streams(errors: str | None = None) -> Iterator[None]:
    """Let standard output and error be files whose writes never fail, within this context.

    What a shell has closed goes nowhere. Streams that are no files, such as those of a notebook or
    a test, stay as they are. The handler of errors is for characters that a stream lacks; by
    default it is its own.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (_lasting(stream, errors) for stream in before)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(AttributeError, ValueError):  # a model's own, perhaps closed
                stream.flush()
        sys.stdout, sys.stderr = before


def stream_error() -> str:
    """Return the reason why standard output could not be written; empty where it could."""
    sys.stdout.flush()
    raw = _raw_file(sys.stdout)
    return raw.error if isinstance(raw, _LastingFile) else ""


def _lasting(stream: TextIO | None, errors: str | None) -> TextIO:
    if stream is None:
        # It takes the number that was closed, in which a library would print into our next file.
        nowhere = _LastingFile(os.open(os.devnull, os.O_WRONLY), "w", closefd=False)
        return _LastingText(io.BufferedWriter(nowhere), encoding="utf-8")
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    if errors is not None:
        stream.reconfigure(errors=errors)
    raw = _raw_file(stream)
    if not isinstance(raw, io.FileIO):
        return stream
    stream.flush()
    file = _LastingFile(raw.fileno(), "w", closefd=False)
    return _LastingText(
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
