"""Calls of a model that writes them down, without those that are made for comparison."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from uqpen.core.progress import Progress

__all__ = ["StudyCalls"]


class StudyCalls(Progress):
    """Receiver that takes the calls for comparison out of the file with all calls.

    Some finished runs are made again before all of them are taken.
    """

    def __init__(self, calls: Path) -> None:
        self._calls = calls
        self._size: int | None = None

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        if "for comparison" in name and self._size is None:
            self._size = self._calls.stat().st_size if self._calls.exists() else 0

    def announce_designs(self, runs: Mapping[str, int]) -> None:
        if self._size is not None:
            os.truncate(self._calls, self._size)

    def warn(self, text: str) -> None:
        pass
