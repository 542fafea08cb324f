"""Readers of outputs in JSON, NetCDF and any text."""

from __future__ import annotations

import re
import signal
import threading
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from types import FrameType
from typing import Any, Literal

import numpy as np

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.errors import toml_text
from uqpen.core.model import RunWarning
from uqpen.core.netcdf.opening import RefusedContentError, read_variable
from uqpen.core.settings import choice, text
from uqpen.core.status import Status
from uqpen.models.command.output_reader import (
    OutputReader,
    after_setting,
    parse_number,
    row_setting,
    text_after,
)
from uqpen.models.command.written import RunFiles, UnreadableError

__all__ = ["JsonReader", "NetcdfReader", "TextReader"]


@dataclass(frozen=True)
class JsonReader(OutputReader):
    """Reader of a number in a JSON document.

    Parameters
    ----------
    key : str
        Names and positions that lead to it, with dots between: ``result.depth``, ``depths.0``.
    """

    key: str = text(expected="the names that lead to it, with dots between")

    @property
    def place(self) -> str:
        return f'"{self.key}" in {self.file}'

    def value(self, written: RunFiles) -> float:
        found = self._find(written)
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise UnreadableError(f"{self.place} is no number")
        return _to_float(found)

    def values(self, written: RunFiles) -> FloatArray:
        try:
            return floats(self._find(written))
        except ValueError as error:
            raise UnreadableError(f"{self.place} holds {error}") from None

    def _find(self, written: RunFiles) -> Any:
        found = written.document(self.file)
        for part in [self.key] if _has_part(found, self.key) else self.key.split("."):
            if not _has_part(found, part):
                raise UnreadableError(f'{self.file} has no "{self.key}"')
            found = found[part if isinstance(found, dict) else int(part)]
        return found


@dataclass(frozen=True)
class NetcdfReader(OutputReader):
    """Reader of a number in a NetCDF file.

    Parameters
    ----------
    variable : str
        Its name, groups before it with slashes between.
    row : int, optional
        Position of the value in a one-dimensional variable, from 0; the last is -1.
    """

    variable: str = text(expected="the name of a variable")
    row: int | None = row_setting(None)

    @property
    def place(self) -> str:
        return f'"{self.variable}" in {self.file}'

    def value(self, written: RunFiles) -> float:
        values, place = self.values(written), self.place
        if self.row is None and values.size == 1:
            return float(values.reshape(()))
        if self.row is None or values.ndim != 1:
            wanted = "a single number" if self.row is None else "numbers along one dimension"
            raise UnreadableError(f"{place} is of shape {values.shape}, not {wanted}")
        if not -values.size <= self.row < values.size:
            raise UnreadableError(f"there is no row {self.row} of {place}")
        return float(values[self.row])

    def values(self, written: RunFiles) -> FloatArray:
        try:
            return floats(read_variable(written.content(self.file), self.variable))
        except KeyError:
            raise UnreadableError(f'{self.file} has no "{self.variable}"') from None
        except RefusedContentError as error:
            raise UnreadableError(f"{self.file} cannot be read as NetCDF: {error}") from None
        except ValueError as error:
            raise UnreadableError(f"{self.place} holds {error}") from None


@dataclass(frozen=True)
class TextReader(OutputReader):
    """Reader of a number in any text.

    Parameters
    ----------
    pattern : str
        A regular expression.
    group : int
        Number of the group that contains the number.
    match : str, optional
        Which match counts: the ``"first"``, the ``"last"`` (as without it, but then several matches
        are warned of), or the one with the smallest (``"min"``) or largest (``"max"``) number.
    after : str, optional
        A text; only what stands after its last occurrence is searched.
    """

    pattern: str
    group: int = 1
    match: Literal["first", "last", "min", "max"] | None = choice(
        "first",
        "last",
        "min",
        "max",
        default=None,
        expected='which match counts: "first", "last", "min" or "max"',
    )
    after: str | None = after_setting()

    @property
    def place(self) -> str:
        return f"what {toml_text(self.pattern)} matches in {self.file}"

    def value(self, written: RunFiles) -> float:
        numbers, place, pattern = self._matches(written), self.place, toml_text(self.pattern)
        if self.match in ("min", "max"):
            found = [parse_number(number, place) for number in numbers]
            return min(found) if self.match == "min" else max(found)
        if len(numbers) > 1 and self.match is None:
            message = (
                f'matches for {pattern} in {self.file}; the last is taken ("match" can say which)'
            )
            warning = RunWarning(f"several {message}", f"{len(numbers)} {message}")
            warnings.warn(warning, stacklevel=2)
        return parse_number(numbers[0 if self.match == "first" else -1], place)

    def values(self, written: RunFiles) -> FloatArray:
        matches = enumerate(self._matches(written))
        numbers = [parse_number(text, f"match {n} of {self.place}", n) for n, text in matches]
        return np.array(numbers, dtype=np.float64)

    def _matches(self, written: RunFiles) -> list[str]:
        """Return the texts of the group in all matches, one at least."""
        content = text_after(written, self.file, self.after)

        def search() -> list[str]:
            matches = re.finditer(self.pattern, content, re.MULTILINE)
            return [match[self.group] or "" for match in matches]

        try:
            numbers = _within(written.limits.seconds, search)
        except TimeoutError:
            reason = f"reading {self.place} {written.limits.timeout_reason}"
            raise UnreadableError(reason, status=Status.TIMED_OUT) from None
        if not numbers:
            raise UnreadableError(f"no match for {toml_text(self.pattern)} in {self.file}")
        return numbers


def _within(seconds: float | None, search: Callable[[], list[str]]) -> list[str]:
    """Search within a limit of processor time, in seconds, and return the result.

    Some patterns have a cost that is exponential in the length of the text. A search lets no other
    thread run. But it looks for signals, which reach the main thread. In other threads there is no
    limit.

    Raises
    ------
    TimeoutError
        If it takes longer.
    """
    if seconds is None or threading.current_thread() is not threading.main_thread():
        return search()
    before = signal.signal(signal.SIGVTALRM, _end_search)
    try:
        signal.setitimer(signal.ITIMER_VIRTUAL, seconds)
        return search()
    finally:
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        finally:  # should it end just now
            signal.signal(signal.SIGVTALRM, before or signal.SIG_DFL)


def _end_search(number: int, frame: FrameType | None) -> None:
    raise TimeoutError


def _has_part(found: Any, part: str) -> bool:
    if isinstance(found, dict):
        return part in found
    is_position = isinstance(found, list) and part.isascii() and part.isdecimal() and len(part) < 10
    return is_position and int(part) < len(found)


def _to_float(value: float) -> float:
    """Convert a number of JSON to a float; an integer may be too large for one."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")
