"""Connections of clients to a server: their number, and errors while it answers one."""

from __future__ import annotations

import socketserver
import sys
import threading
from typing import Any

__all__ = ["LimitsConnections"]


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
