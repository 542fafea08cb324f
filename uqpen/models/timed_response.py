"""HTTP responses that must be complete before a deadline, however slowly their bytes arrive."""

from __future__ import annotations

import http.client
import io
import math
import socket
import time
from dataclasses import dataclass
from typing import Any

__all__ = ["Deadline", "TooLongError", "timed_response"]


class TooLongError(Exception):
    """Error: a response with more bytes than expected, of whatever kind they are."""


@dataclass(frozen=True)
class Deadline:
    """Time at which an exchange must be over; infinite without a limit."""

    at: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> Deadline:
        """Return the deadline of an exchange that begins now."""
        return cls() if seconds is None else cls(time.monotonic() + seconds)

    def apply(self, connection: socket.socket) -> None:
        """Limit the next operation of a connection to the time left.

        Raises
        ------
        TimeoutError
            If no time is left.
        """
        left = self.at - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        connection.settimeout(None if left == math.inf else left)


def timed_response(deadline: Deadline, most: int) -> type[http.client.HTTPResponse]:
    """Return the class of a response with a deadline and a largest number of bytes.

    A time-out of a connection begins anew with every piece that it receives. A server that sends
    a byte now and then, or one header after another, or ``100 Continue`` for ever, would never
    exceed it.
    """

    class TimedResponse(http.client.HTTPResponse):
        def __init__(self, sock: socket.socket, *arguments: Any, **options: Any) -> None:
            super().__init__(sock, *arguments, **options)
            received = _TimedStream(self.fp.detach(), sock, deadline, most)
            self.fp = io.BufferedReader(received)

    return TimedResponse


class _TimedStream(io.RawIOBase):
    """Bytes received by a connection, until a deadline and up to a number."""

    def __init__(
        self, stream: io.RawIOBase, connection: socket.socket, deadline: Deadline, most: int
    ) -> None:
        super().__init__()
        self._stream = stream
        self._connection = connection
        self._deadline = deadline
        self._left = most

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int | None:
        self._deadline.apply(self._connection)
        count = self._stream.readinto(buffer)
        self._left -= count or 0
        if self._left < 0:
            raise TooLongError
        return count

    def close(self) -> None:
        self._stream.close()
        super().close()
