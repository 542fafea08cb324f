"""Base of the readers of outputs, and what they share: settings, texts and printed numbers."""

from __future__ import annotations

import contextlib
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import toml_text
from uqpen.core.settings import count, text, validate
from uqpen.models.command.written import RunFiles, UnreadableError

__all__ = [
    "OutputReader",
    "after_setting",
    "parse_number",
    "row_setting",
    "text_after",
]


def row_setting(default: int | None) -> Any:
    """Declare the position of a row."""
    expected = "a whole number: rows count from 0, and back from -1"
    return count(minimum=-math.inf, maximum=math.inf, default=default, expected=expected)


def after_setting() -> Any:
    """Declare a text behind which an output stands."""
    return text(expected="a text; what stands after its last occurrence is read", default=None)


@dataclass(frozen=True)
class OutputReader(ABC):
    """Reader of an output in a file of the run's folder, ``stdout`` and ``stderr`` among them."""

    file: str

    def __post_init__(self) -> None:
        validate(self)

    @property
    @abstractmethod
    def place(self) -> str:
        """Place of the output, for a reason."""

    @abstractmethod
    def value(self, written: RunFiles) -> float:
        """Return the output in the program's unit; UnreadableError gives the reason for none."""

    @abstractmethod
    def values(self, written: RunFiles) -> FloatArray:
        """Return all numbers there, in their order; UnreadableError names one that is none."""


def text_after(written: RunFiles, file: str, after: str | None) -> str:
    """Return the text of a file, or what stands in it after the last occurrence of another."""
    content = written.text(file)
    if after is None:
        return content
    _, found, rest = content.rpartition(after)
    if not found:
        raise UnreadableError(f"{file} does not contain {toml_text(after)}")
    return rest


def parse_number(text: str, place: str, row: int | None = None) -> float:
    """Parse a printed number, which may have a Fortran exponent.

    Raises
    ------
    UnreadableError
        If it is none, with its place and, in a list, its row.
    """
    written = text.strip().lower()
    for number in (written, written.replace("d", "e")):
        with contextlib.suppress(ValueError):
            return float(number)
    raise UnreadableError(f"{place} is no number", row)
