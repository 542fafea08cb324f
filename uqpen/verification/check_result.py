"""Results of the verification of an archive, part by part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

__all__ = ["CheckOutcome", "CheckResult", "first_lines"]

# Differences of one kind that are listed; a damaged archive may have thousands.
_MOST_LISTED = 8


class CheckOutcome(StrEnum):
    """Outcome of the check of a part of an archive."""

    EQUAL = "equal"
    """To the bit."""
    CLOSE = "close"
    """Within a tolerance, on another platform or with other versions."""
    UNCHECKED = "unchecked"
    """On purpose, or because there is nothing to check."""
    IMPOSSIBLE = "impossible"
    """Cannot be checked as things are here, which the user can mend."""
    DIFFERENT = "different"


@dataclass(frozen=True)
class CheckResult:
    """Result of the check of one part, in words; the details are its differences, one by one."""

    name: str
    verdict: CheckOutcome
    text: str
    details: tuple[str, ...] = ()


def first_lines(
    lines: Sequence[str], most: int = _MOST_LISTED, more: str = "more"
) -> tuple[str, ...]:
    """Return the first lines, and how many more there are; whoever wants all has the archives."""
    left = len(lines) - most
    return (*lines[:most], *((f"and {left} {more}",) if left > 0 else ()))
