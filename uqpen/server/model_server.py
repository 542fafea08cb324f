"""Models as a UM-Bridge server, which any client of that protocol can run.

The protocol: https://um-bridge-benchmarks.readthedocs.io. Its own server is not used: it listens
on every network that the machine is part of, and answers a run that fails with what is no JSON.
"""

from __future__ import annotations

import ipaddress
import json
import re
import socket
import socketserver
import sys
import threading
from collections.abc import Sequence
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any, Protocol

from uqpen.models.umbridge import PROTOCOL
from uqpen.server.served_model import RefusedError, RunBudget, only_vector

# Connections of clients to a server: their number, and errors while it answers one.


class LimitsConnections(socketserver.ThreadingTCPServer):
    """Server with a limited number of connections, which a client may leave at any time.

    A connection beyond `most_connections` is closed at once, so that clients cannot use up the
    files and threads of this process.
    """

    most_connections: int
    daemon_threads = True

    def __init__(self, *arguments: Any) -> None:
        self._count_lock = threading.Lock()
        self.connections = 0
        """Number of open connections."""
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, if there are not too many."""
        with self._count_lock:
            self.connections += 1
            is_refused = self.connections > self.most_connections
        if is_refused:
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        with self._count_lock:
            self.connections -= 1
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report an error in uqpen with its traceback; ignore a client that disconnects."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


# A request holds a few numbers; whoever sends more has something else in mind.
_LARGEST = 1024 * 1024
# A client sends its whole request before it reads the answer, so a larger one is read and thrown
# away, up to this number of bytes.
_DISCARDED = 1024 * _LARGEST

# Most connections that are served at once. As many again are told that the server is busy; a
# connection beyond these is closed.
_MOST_CONNECTIONS = 128

_LOCAL_NAMES = ("localhost", "localhost.localdomain")

# UM-Bridge also has derivatives and runs by shared memory, which uqpen does not offer.
_DERIVATIVES = ("Gradient", "ApplyJacobian", "ApplyHessian")
_BY_SHARED_MEMORY = ("TestShMem", *(f"{name}ShMem" for name in ("Evaluate", *_DERIVATIVES)))
_SUPPORTED = ("ModelInfo", "InputSizes", "OutputSizes", "Evaluate")
_REQUESTS = (*_SUPPORTED, *_DERIVATIVES, *_BY_SHARED_MEMORY)


class Offer(Protocol):
    """Interface of a model that a server offers, such as `ServedModel`."""

    @property
    def name(self) -> str:
        """Name of the model for the clients."""

    @property
    def input_size(self) -> int:
        """Length of the input vector."""

    @property
    def output_sizes(self) -> list[int]:
        """Lengths of the output vectors."""

    def run(self, values: Sequence[float]) -> list[list[float | None]]:
        """Return the output vectors of one run; a `RefusedError` says that it failed."""


class ModelServer(LimitsConnections):
    """A UM-Bridge server.

    Parameters
    ----------
    offers : sequence of Offer
        Its models, each with a unique name.
    host : str
        Address to listen at; `OSError` if that fails. Only this machine reaches ``127.0.0.1``.
    port : int
        The port; 0 for any free one.
    budget : RunBudget, optional
        The runs that clients may ask for; without it there is no limit.
    """

    allow_reuse_address = True
    request_queue_size = 128

    def __init__(
        self,
        offers: Sequence[Offer],
        host: str = "127.0.0.1",
        port: int = 4242,
        budget: RunBudget | None = None,
    ) -> None:
        self.offers = {offer.name: offer for offer in offers}
        self.budget = budget
        # Models need not bear being run by several at once; a user's function rarely does.
        self.turn = threading.Lock()
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._name = _plain_name(host)
        self.most_connections = 2 * _MOST_CONNECTIONS
        super().__init__((host, port), _Handler)

    @property
    def url(self) -> str:
        """Address for the clients."""
        host, port = self.server_address[:2]
        host = str(host)
        return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"

    @property
    def is_busy(self) -> bool:
        """True if it has more connections than it serves."""
        return self.connections > _MOST_CONNECTIONS

    def is_named(self, name: str) -> bool:
        """Check that a request is meant for this server, by the host name that it is sent to.

        A page of any site can make its own name stand for 127.0.0.1, and then ask this server as if
        it were that site. An address cannot be made to stand for another. Where the server listens
        at all addresses, its names are not known.
        """
        listening = ipaddress.ip_address(self.server_address[0])  # type: ignore[arg-type]
        plain = _plain_name(name)
        return (
            listening.is_unspecified
            or plain in (self._name, *_LOCAL_NAMES)
            or plain.endswith(".localhost")
            or _is_address(plain)
        )

    def answer(self, what: str, request: dict[str, Any]) -> dict[str, Any]:
        """Return the response to a request; a `RefusedError` stands for an error."""
        name = request.get("name")
        if not isinstance(name, str) or name not in self.offers:
            message = f"no model {json.dumps(name)}; known: {', '.join(self.offers)}"
            raise RefusedError("ModelNotFound", message)
        offer = self.offers[name]
        if what == "ModelInfo":
            return {
                "support": {"Evaluate": True, **dict.fromkeys(_DERIVATIVES, False)},
                **self._account(name),
            }
        if what not in _SUPPORTED:
            raise RefusedError("UnsupportedFeature", f"{what} is not supported")
        if request.get("config"):
            raise RefusedError("InvalidInput", f"{offer.name} takes no config")
        if what == "InputSizes":
            return {"inputSizes": [offer.input_size]}
        if what == "OutputSizes":
            return {"outputSizes": offer.output_sizes}
        values = only_vector(request.get("input"), offer.input_size)
        with self.turn:
            if self.budget is not None:
                self.budget.grant(name, values)
            return {"output": offer.run(values)}

    def _account(self, name: str) -> dict[str, int]:
        """Return the budget of a model and what is left of it, if it has one."""
        if self.budget is None:
            return {}
        return {"budget": self.budget.runs, "runsLeft": self.budget.left(name)}


def _plain_name(host: str) -> str:
    """Return the name of a host in lower case, without brackets and a last dot."""
    return host.lower().removeprefix("[").removesuffix("]").removesuffix(".")


def _is_address(name: str) -> bool:
    """Check that a name of a host is an IP address."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class _Handler(BaseHTTPRequestHandler):
    """Handler of the requests of one client."""

    server: ModelServer
    protocol_version = "HTTP/1.1"
    server_version = "uqpen"
    sys_version = ""
    timeout = 300  # seconds without a word from the client
    # A short answer must not wait for the client to acknowledge what came before it.
    disable_nagle_algorithm = True

    def do_GET(self) -> None:
        """Respond to a request for the list of models."""
        try:
            self._check_sender()
        except RefusedError as refused:
            self._send_refusal(refused)
            return
        if self.path.strip("/") == "Info":
            models = list(self.server.offers)
            self._send(HTTPStatus.OK, {"protocolVersion": PROTOCOL, "models": models})
        else:
            self.send_error(HTTPStatus.NOT_FOUND, f"{self.path} is not known")

    def do_POST(self) -> None:
        """Respond to a request for information on a model, or for a run of it."""
        try:
            content = self._content()
            self._check_sender()
            if self.headers.get_content_type() != "application/json":
                message = "the content of a request is application/json"
                code = HTTPStatus.UNSUPPORTED_MEDIA_TYPE
                raise RefusedError("UnsupportedMediaType", message, code)
            what = self.path.strip("/")
            if what not in _REQUESTS:
                raise RefusedError("NotFound", f"{self.path} is not known", HTTPStatus.NOT_FOUND)
            try:
                request = json.loads(content.decode())
            except (ValueError, RecursionError):
                request = None
            if not isinstance(request, dict):
                raise RefusedError("InvalidInput", "the request is no JSON object")
            self._send(HTTPStatus.OK, self.server.answer(what, request))
        except RefusedError as refused:
            self._send_refusal(refused)

    def _send_refusal(self, refused: RefusedError) -> None:
        error = {"type": refused.kind, "message": str(refused)}
        self._send(refused.code, {"error": error})

    def _check_sender(self) -> None:
        """Refuse a request that a page in a browser sends, or that is meant for another server.

        Clients of UM-Bridge are programs. A page that its user only looks at must not have runs
        made: browsers state its origin with every request that could.
        """
        if self.server.is_busy:
            self.close_connection = True
            message = f"all {_MOST_CONNECTIONS} connections are in use"
            raise RefusedError("ServiceUnavailable", message, HTTPStatus.SERVICE_UNAVAILABLE)
        if "Origin" in self.headers:
            message = "pages in a browser are not served"
            raise RefusedError("Forbidden", message, HTTPStatus.FORBIDDEN)
        host = self.headers.get_all("Host", [])
        name = re.sub(r":[0-9]*\Z", "", host[0].strip()) if len(host) == 1 else ""
        if not name:
            raise RefusedError("BadRequest", "the request does not tell its one host")
        if not self.server.is_named(name):
            message = f"this server is not {name}; it is known by its address"
            code = HTTPStatus.MISDIRECTED_REQUEST
            raise RefusedError("MisdirectedRequest", message, code)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Respond to a request outside the protocol with an error in the form of the protocol."""
        status = HTTPStatus(code)
        self.close_connection = True
        error = {"type": status.phrase.title().replace(" ", ""), "message": message or "refused"}
        self._send(status, {"error": error})

    def log_message(self, format: str, *values: Any) -> None:
        """Say nothing: there may be thousands of runs."""

    def _content(self) -> bytes:
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdecimal()):
            self.close_connection = True
            message = "the length of the request is not told"
            raise RefusedError("LengthRequired", message, HTTPStatus.LENGTH_REQUIRED)
        if len(length) > 9 or int(length) > _LARGEST:
            self.close_connection = True
            self._discard(int(length[:12]))
            code = HTTPStatus.REQUEST_ENTITY_TOO_LARGE
            raise RefusedError("TooLarge", f"a request has at most {_LARGEST} bytes", code)
        return self.rfile.read(int(length))

    def _discard(self, length: int) -> None:
        """Read what a client is about to send, so that it gets to reading the answer."""
        left = min(length, _DISCARDED)
        while left > 0 and (part := self.rfile.read1(min(left, 65536))):
            left -= len(part)

    def _send(self, code: HTTPStatus, answer: dict[str, Any]) -> None:
        content = json.dumps(answer).encode()
        self.send_response(code)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)
