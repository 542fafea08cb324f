"""Results of the verification of an archive, part by part."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from uqpen.workflow.repetition import TOLERANCE, Difference

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

    @classmethod
    def of_differences(
        cls, name: str, what: str, found: Iterable[Difference], tolerance: float
    ) -> CheckResult:
        """Return the result of a repetition, the largest differences first.

        Parameters
        ----------
        name, what : str
            The part, and what of it was repeated.
        found : iterable of Difference
            The differences from the archive.
        tolerance : float
            Largest relative difference; 0 where every bit must be the same.
        """
        found = sorted(found, key=lambda each: -each.relative)
        if not found:
            return cls(name, CheckOutcome.EQUAL, f"{what}: bit-equal")
        details = first_lines([each.what for each in found])
        if found[0].relative <= tolerance:
            close = f"{what}: equal within {TOLERANCE:g} of the largest value"
            return cls(name, CheckOutcome.CLOSE, close, details)
        return cls(name, CheckOutcome.DIFFERENT, f"{what}: different", details)


def first_lines(
    lines: Sequence[str], most: int = _MOST_LISTED, more: str = "more"
) -> tuple[str, ...]:
    """Return the first lines, and how many more there are; whoever wants all has the archives."""
    left = len(lines) - most
    return (*lines[:most], *((f"and {left} {more}",) if left > 0 else ()))
