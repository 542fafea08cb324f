"""Errors of a server while it answers a client."""

from __future__ import annotations

import socketserver
import sys
from typing import Any

__all__ = ["IgnoresDisconnections"]


class IgnoresDisconnections(socketserver.BaseServer):
    """Server that a client may leave at any time."""

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report an error in uqpen with its traceback; ignore a client that disconnects."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)
