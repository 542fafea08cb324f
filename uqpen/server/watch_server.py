"""The page of a running study, on this machine alone."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from importlib.resources import files
from typing import Any

from uqpen.core.labels import RUN
from uqpen.core.status import STATUS_TEXT
from uqpen.results.digits import grouped_number
from uqpen.results.failed_runs import failure_causes
from uqpen.results.output_tables import statistics_tables
from uqpen.results.texts import duration_text, runs_text, step_text
from uqpen.server.model_server import LimitsConnections
from uqpen.workflow.running_results import RunningResults

_HOST = "127.0.0.1"
_ASSETS = files("uqpen.server") / "assets"
_FILES = {
    "/": ("watch.html", "text/html; charset=utf-8"),
    "/watch.css": ("watch.css", "text/css; charset=utf-8"),
    "/watch.js": ("watch.js", "text/javascript; charset=utf-8"),
}
_STATE = "/state.json"

# A page may load what this server sends, and nothing else; no other page may contain it.
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
        "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


class WatchServer(LimitsConnections):
    """A server of one page, which only this machine reaches, and which changes nothing.

    Parameters
    ----------
    state : callable
        Returns what the page shows, which JSON can hold. It is called in a thread of the server.
    port : int
        The port; 0 for any free one. `OSError` if it cannot be listened at.
    """

    allow_reuse_address = True
    most_connections = 32

    def __init__(self, state: Callable[[], Mapping[str, Any]], port: int = 0) -> None:
        self.state = state
        super().__init__((_HOST, port), _Handler)
        self.hosts = {f"{name}:{self.port}" for name in (_HOST, "localhost")}

    @property
    def port(self) -> int:
        """Port that it listens at."""
        return int(self.server_address[1])

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{_HOST}:{self.port}/"


@contextmanager
def serve_watch_page(
    state: Callable[[], Mapping[str, Any]], port: int = 0
) -> Iterator[WatchServer]:
    """Serve the page in a thread of its own, until the context is left."""
    with WatchServer(state, port) as server:
        # It looks every so many seconds whether it is to end.
        thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


class _Handler(BaseHTTPRequestHandler):
    """Handler of the requests of one browser."""

    server: WatchServer
    server_version = "uqpen"
    sys_version = ""
    timeout = 10  # seconds without a word from the client

    def do_GET(self) -> None:
        """Send the page, or the state of the study."""
        # A page of any site can make its own name stand for 127.0.0.1, and read what it is sent.
        # Its name is then in this header.
        if self.headers.get_all("Host", []) not in [[name] for name in self.server.hosts]:
            self._send(HTTPStatus.MISDIRECTED_REQUEST, "text/plain", b"this is another server\n")
        elif self.path == _STATE:
            content = json.dumps(self.server.state(), ensure_ascii=True).encode()
            self._send(HTTPStatus.OK, "application/json", content)
        elif self.path in _FILES:
            name, kind = _FILES[self.path]
            self._send(HTTPStatus.OK, kind, (_ASSETS / name).read_bytes())
        else:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", b"there is no such page\n")

    def do_HEAD(self) -> None:
        """Send the headers alone."""
        self.do_GET()

    def _send(self, code: HTTPStatus, kind: str, content: bytes) -> None:
        self.send_response(code)
        for name, value in {**_HEADERS, "Content-Type": kind}.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def log_message(self, format: str, *values: Any) -> None:
        """Say nothing: the page asks once a second."""


# Content of the page of a running study, as texts.

# Causes that are shown; the archive has them all.
_MOST_CAUSES = 20


def watch_state(running: RunningResults) -> dict[str, Any]:
    """Return the state of a running study, for its page.

    Returns
    -------
    dict
        Lists and dicts of texts and whole numbers, which JSON can hold: ``title``, ``step``,
        ``runs``, ``done`` of ``total``, ``designs``, ``tables``, ``causes``.
    """
    progress, results = running.state, running.results
    rate = progress.runs_per_second
    runs = runs_text(progress)
    if rate and not progress.step:
        runs += f"; {_rate_text(rate)}"
    causes = failure_causes([each for made in results.finished.values() for each in made])
    designs = []
    for name, made in results.finished.items():
        count = grouped_number(sum(each.sizes[RUN] for each in made))
        # Why it has no estimates yet, or where they are.
        why = f"none: {results.reasons[name]}" if name in results.reasons else "below"
        designs.append((name, count, why))
    return {
        "title": str(results.tree.attrs["title"]),
        "step": step_text(progress),
        "runs": runs,
        "done": max(progress.step_number - 1, 0) if progress.step else progress.done,
        "total": progress.steps if progress.step else progress.runs,
        "designs": designs,
        "tables": [
            {
                "title": table.title,
                "columns": table.columns,
                "rows": [[label, *cells] for label, cells in table.rows],
                "notes": table.notes,
            }
            for table in statistics_tables(results.tree)
        ],
        "causes": [
            {
                "text": cause.reason,
                "runs": grouped_number(cause.runs),
                "status": STATUS_TEXT[cause.status],
                "example": cause.example or cause.reason,
            }
            for cause in causes[:_MOST_CAUSES]
        ],
    }


def _rate_text(rate: float) -> str:
    """Return a rate of runs in words.

    >>> _rate_text(345.6), _rate_text(3.14159), _rate_text(0.01)
    ('346 runs a second', '3.1 runs a second', 'a run takes about 100 s')
    """
    if rate < 1:
        return f"a run takes about {duration_text(1 / rate)}"
    shown = grouped_number(round(rate)) if rate >= 10 else f"{rate:.1f}"
    return f"{shown} runs a second"
