"""What came of verifying an archive, part by part."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["CheckOutcome", "CheckResult"]


class CheckOutcome(StrEnum):
    """What is to be said of a part of an archive."""

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
    """What was found of one part.

    Parameters
    ----------
    name : str
        What was checked.
    verdict : CheckOutcome
        What came of it.
    text : str
        The same in words.
    details : tuple of str
        What differs, thing by thing.
    """

    name: str
    verdict: CheckOutcome
    text: str
    details: tuple[str, ...] = ()
