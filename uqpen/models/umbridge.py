"""Model on a UM-Bridge server, with one request for each run."""

from __future__ import annotations

import contextlib
import http.client
import io
import itertools
import json
import math
import re
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, floats
from uqpen.core.errors import toml_text
from uqpen.core.files import FileSnapshot
from uqpen.core.limits import Limits
from uqpen.core.model import Input, Model, Output, Results, RunOutcome, joined_outcomes
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.models.run_grid import FieldSources
from uqpen.models.user_code import one_line

# HTTP responses that must be complete before a deadline, however slowly their bytes arrive.


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

        TimeoutError if no time is left.
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


# Requests to a UM-Bridge server; a request without an answer has a reason in words.
#
# The protocol: https://um-bridge-benchmarks.readthedocs.io. Its own client raises any exception and
# has no time limit. Here a missing answer is data: a run without an answer is a failed run.

PROTOCOL = 1.0

# Time limit for a server to accept a connection, in seconds: its host may have vanished.
_PATIENCE = 5.0
# Checks for a host that vanishes during a run: delay and interval in seconds, number of checks,
# and the time in milliseconds that it may take to accept a request.
_SILENCE = {"TCP_KEEPIDLE": 30, "TCP_KEEPINTVL": 10, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 60_000}

_LARGEST = 16 * 1024 * 1024
# Headers and what is between the chunks of an answer come on top of it.
_MOST_RECEIVED = 2 * _LARGEST

_TOO_LONG = f"the server's answer has more than {_LARGEST} bytes"
_DISCONNECTED = "the server cannot be reached, or has closed the connection"
# Addresses differ from one day to the next, and a reason must not.
_PLACES = re.compile(r"https?://[^\s\"'<>]+|\b0x[0-9a-fA-F]+")
# Numbers that JSON does not know, as UM-Bridge's own server writes them.
_PYTHON_NUMBER = re.compile(r"(?<=[\[,\s])(-?)(nan|inf)(?=[\],\s])")
_JSON_NUMBER = {"nan": "NaN", "inf": "Infinity"}


class NoAnswerError(Exception):
    """Request without an answer; the message gives the reason, `status` the status of the run."""

    def __init__(self, reason: str, status: Status = Status.FAILED) -> None:
        super().__init__(reason)
        self.status = status


@dataclass(frozen=True)
class Address:
    """Address of a server: HTTPS if it is secure; `path` stands before that of each request."""

    host: str
    port: int
    path: str = ""
    is_secure: bool = False

    @classmethod
    def parse(cls, text: str) -> Address:
        """Parse the address in a text such as ``"http://127.0.0.1:4242"``.

        ValueError if it is none, or has a part that a study should not contain: a password, say.
        """
        parts = urlsplit(text)
        host = (parts.hostname or "").encode("idna").decode("ascii")
        is_secure = parts.scheme == "https"
        plain = re.fullmatch(r"[!-~]+", text) and not (parts.query or parts.fragment)
        if parts.scheme not in ("http", "https") or not host or "@" in parts.netloc or not plain:
            raise ValueError(text)
        port = parts.port or (443 if is_secure else 80)
        return cls(host, port, parts.path.rstrip("/"), is_secure)


class UmbridgeClient:
    """Sequence of requests to a server, over one connection while it lasts.

    The time limit is that of a whole exchange, from the request to the end of its answer, in
    seconds. The time to reach the server is limited by itself.
    """

    def __init__(self, address: Address, time_limit: float | None = None) -> None:
        self._path = address.path
        self._limits = Limits(seconds=time_limit)
        kind = http.client.HTTPSConnection if address.is_secure else http.client.HTTPConnection
        self._connection = kind(address.host, address.port, timeout=_PATIENCE)
        self._is_gone = False

    def __enter__(self) -> UmbridgeClient:
        return self

    def __exit__(self, *error: object) -> None:
        self._connection.close()

    def request(self, what: str, body: dict[str, Any] | None = None) -> dict[str, Any]:
        """Send a request of the protocol, such as ``"Evaluate"``, and return the answer.

        The body must be convertible to JSON; without a body, a GET request is sent.

        NoAnswerError if there is no answer, or it is an error.
        """
        try:
            code, phrase, content = self._exchange(what, body)
        except NoAnswerError:
            self._connection.close()
            raise
        answer = _parse_object(content)
        if answer is None:
            suffix = "" if code == http.HTTPStatus.OK else f" (HTTP {code} {phrase}".rstrip() + ")"
            raise NoAnswerError(one_line(f"the server's answer is no JSON object{suffix}"))
        if "error" in answer:
            raise NoAnswerError(_error_reason(answer["error"]))
        return answer

    def _exchange(self, what: str, request: dict[str, Any] | None) -> tuple[int, str, bytes]:
        """Exchange a request for an answer over HTTP; return its code, phrase and content."""
        # A server may close an old connection instead of answering; a new one is then tried.
        tries = 2 if self._is_open else 1
        self._connect()
        deadline = Deadline.after(self._limits.seconds)
        self._connection.response_class = timed_response(deadline, _MOST_RECEIVED)
        for _ in range(tries):
            try:
                return self._try_request(what, request, deadline)
            except ConnectionError:
                self._connection.close()
        raise NoAnswerError(_DISCONNECTED)

    def _try_request(
        self, what: str, request: dict[str, Any] | None, deadline: Deadline
    ) -> tuple[int, str, bytes]:
        self._connect()
        body = None if request is None else json.dumps(request).encode()
        try:
            deadline.apply(self._connection.sock)
            self._connection.request(
                "GET" if body is None else "POST",
                f"{self._path}/{what}",
                body,
                {"Content-Type": "application/json", "Accept-Encoding": "identity"},
            )
            response = self._connection.getresponse()
            content = response.read(_LARGEST + 1)
        except TimeoutError as error:
            if error.errno is not None:  # the system's own patience, not ours
                raise NoAnswerError(_DISCONNECTED) from None
            raise NoAnswerError(self._limits.timeout_reason, Status.TIMED_OUT) from None
        except (ConnectionError, http.client.IncompleteRead):
            raise ConnectionResetError from None
        except OSError:
            raise NoAnswerError(_DISCONNECTED) from None
        except (http.client.HTTPException, ValueError):  # ValueError: a chunk of negative size
            raise NoAnswerError("the server's answer is not HTTP") from None
        except TooLongError:
            raise NoAnswerError(_TOO_LONG) from None
        if len(content) > _LARGEST:
            raise NoAnswerError(_TOO_LONG)
        if response.length:  # bytes that were announced and did not arrive
            raise ConnectionResetError
        return response.status, response.reason, content

    @property
    def _is_open(self) -> bool:
        return self._connection.sock is not None

    def _connect(self) -> None:
        if self._is_open:
            return
        if self._is_gone:
            raise NoAnswerError(_DISCONNECTED)
        begun = time.monotonic()
        try:
            self._connection.connect()
        except OSError:
            # A host that does not even refuse would keep every later run waiting as well.
            self._is_gone = time.monotonic() - begun > _PATIENCE / 2
            raise NoAnswerError(_DISCONNECTED) from None
        # So that it ends when its other end has vanished, without a limit on the run.
        connection = self._connection.sock
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _SILENCE.items():
            with contextlib.suppress(AttributeError, OSError):  # not every system has them all
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def _parse_object(content: bytes) -> dict[str, Any] | None:
    """Parse the JSON object of an answer; None if it is no object."""
    try:
        text = content.decode()
        try:
            answer = json.loads(text)
        except json.JSONDecodeError:
            numbers = _PYTHON_NUMBER.sub(lambda match: match[1] + _JSON_NUMBER[match[2]], text)
            answer = json.loads(numbers)
    except (ValueError, RecursionError):
        return None
    return answer if isinstance(answer, dict) else None


def _error_reason(error: object) -> str:
    """Return the reason in a server's error."""
    if not isinstance(error, dict):
        return one_line(f"the server answers with an error: {_PLACES.sub('…', str(error))}")
    kind, message = str(error.get("type", "error")), str(error.get("message", ""))
    return one_line(_PLACES.sub("…", f"{kind}: {message}" if message else kind))


@dataclass(frozen=True)
class VectorSizes:
    """Lengths of each input vector and each output vector of a model."""

    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


@dataclass(frozen=True)
class UmbridgeModel(Model):
    """Model on a UM-Bridge server; its inputs and outputs fill the server's vectors in order."""

    name: str  # its name on the server
    address: Address  # address of the server; results do not depend on it
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: Mapping[str, str]  # the unit that the server takes each input and gives each output in
    # Division of inputs and outputs into vectors; None if no request is to be made.
    sizes: VectorSizes | None
    config: str = "{}"  # content of every request in addition to the inputs, as a JSON object
    time_limit: float | None = None  # time limit of a run, in seconds
    fields: FieldSources = field(default=FieldSources(), repr=False)  # the files with coordinates

    vectorized = False

    @property
    def may_be_noisy(self) -> bool:
        return True

    @property
    def run_limits(self) -> Limits:
        return Limits(self.time_limit)

    def evaluate(self, inputs: Arrays) -> Results:
        columns = [scale(self.units[v.name]).from_si(inputs[v.name]) for v in self.inputs]
        points = np.stack(columns, axis=1).tolist()
        with UmbridgeClient(self.address, self.time_limit) as server:
            outcomes = (
                (slice(run, run + 1), self._request_outcome(server, point))
                for run, point in enumerate(points)
            )
            return joined_outcomes(outcomes, self.outputs, self.units, len(points))

    def files(self) -> tuple[FileSnapshot, ...]:
        return self.fields.files

    @property
    def uncompared(self) -> tuple[str, ...]:
        return (f"the server {self.address}",)

    def identity(self) -> dict[str, str]:
        config = {"config": self.config} if self.config != "{}" else {}
        return {"name": self.name, "kind": "UM-Bridge", **config}

    def _request_outcome(self, server: UmbridgeClient, point: list[float]) -> RunOutcome:
        try:
            values = self._request_outputs(server, point)
        except NoAnswerError as error:
            return RunOutcome.failed(str(error), error.status)
        sizes = [math.prod(output.shape) for output in self.outputs]
        parts = zip(self.outputs, np.split(values, np.cumsum(sizes)[:-1]), strict=True)
        return RunOutcome({each.name: part.reshape(each.shape) for each, part in parts})

    def _request_outputs(self, server: UmbridgeClient, point: list[float]) -> FloatArray:
        """Request the outputs of one run, in the server's units."""
        if self.sizes is None:
            raise NoAnswerError(f"{self.name}: the server is not asked without --trust")
        values = iter(point)
        vectors = [list(itertools.islice(values, size)) for size in self.sizes.inputs]
        request = {"name": self.name, "input": vectors, "config": json.loads(self.config)}
        found = server.request("Evaluate", request).get("output")
        lists = found if isinstance(found, list) else []
        if [len(v) if isinstance(v, list) else -1 for v in lists] != list(self.sizes.outputs):
            expected = ", ".join(map(str, self.sizes.outputs))
            raise NoAnswerError(f"the server's output is not made of vectors of length {expected}")
        # JSON knows no NaN, and some servers write null instead.
        flat = [np.nan if value is None else value for vector in lists for value in vector]
        for value in flat:
            if type(value) not in (int, float):
                raise NoAnswerError(f"the server's output has {toml_text(value)}, not a number")
        return floats(flat)


def request_sizes(server: UmbridgeClient, name: str, config: str) -> VectorSizes:
    """Request the lengths of a model's vectors; NoAnswerError if the server does not give them."""
    request = {"name": name, "config": json.loads(config)}
    found = []
    for what in ("InputSizes", "OutputSizes"):
        answer = server.request(what, request)
        sizes = answer.get(what[0].lower() + what[1:])
        if not isinstance(sizes, list) or not all(type(n) is int and n >= 0 for n in sizes):
            raise NoAnswerError(f"the server's answer to {what} is no list of whole numbers")
        found.append(tuple(sizes))
    return VectorSizes(*found)
