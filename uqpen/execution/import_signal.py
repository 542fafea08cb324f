"""Signal of a worker that its run imports a module, which takes time that is not the run's."""

from __future__ import annotations

import contextlib
import importlib.abc
import threading
from collections.abc import Callable, Iterator
from typing import Any

__all__ = ["ImportSignal"]


class ImportSignal(importlib.abc.MetaPathFinder):
    """Finder that finds nothing, but sends a signal when a run first looks for a module.

    Python asks it for modules that are not loaded yet, and for no others.
    """

    def __init__(self, send: Callable[[], None]) -> None:
        self._send = send
        self._is_armed = False

    @contextlib.contextmanager
    def armed(self, *, armed: bool) -> Iterator[None]:
        """Within this context, send the signal once, if it is armed."""
        self._is_armed = armed
        try:
            yield
        finally:
            self._is_armed = False

    def find_spec(self, *arguments: Any, **options: Any) -> None:
        """Return None, as other finders are to find the module."""
        # Another thread could send while this one does.
        if self._is_armed and threading.current_thread() is threading.main_thread():
            self._is_armed = False
            self._send()
