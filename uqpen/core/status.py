"""Statuses of a run: how it ended."""

from __future__ import annotations

from enum import IntEnum
from types import MappingProxyType

__all__ = ["STATUS_TEXT", "Status"]


class Status(IntEnum):
    """Status of a run. Any other than `OK` marks a failed run, which is kept as data."""

    OK = 0
    INADMISSIBLE = 1
    FAILED = 2
    NOT_FINITE = 3
    TIMED_OUT = 4
    CRASHED = 5

    @property
    def meaning(self) -> str:
        """The status in one word, as in ``flag_meanings`` and in JSON."""
        return self.name.lower()


STATUS_TEXT = MappingProxyType({status: status.meaning.replace("_", " ") for status in Status})
