"""Lists and tables of a study file, read value by value with all mistakes at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

from uqpen.core.errors import QuantityError, SettingsError, toml_text

__all__ = ["as_float", "read_each", "read_list"]

T = TypeVar("T")


def read_list(written: Any, read_one: Callable[[Any], T]) -> list[T]:
    """Read each entry of a list in a study file; see `read_each`."""
    if not isinstance(written, list):
        raise QuantityError(toml_text(written), "a list in square brackets")
    return read_each(written, read_one)


def read_each(written: list[Any] | dict[str, Any], read_one: Callable[[Any], T]) -> list[T]:
    """Read each value of a list or a table; raise one SettingsError for all that are wrong."""
    found, problems = [], []
    for place, value in written.items() if isinstance(written, dict) else enumerate(written):
        try:
            found.append(read_one(value))
        except (SettingsError, QuantityError) as error:
            problems += [problem.within(place) for problem in error.problems]
    if problems:
        raise SettingsError(problems)
    return found


def as_float(written: Any) -> Any:
    """Convert an integer to a float; one too large becomes infinite, which nothing accepts."""
    if not isinstance(written, int) or isinstance(written, bool):
        return written
    return float(written) if abs(written) < 1e300 else math.inf
