"""Counts with their noun, in sentences."""

from __future__ import annotations

from uqpen.results.digits import grouped_number

__all__ = ["count_text"]


def count_text(number: int, noun: str) -> str:
    """Return a number and its noun, which is in the singular for one.

    >>> count_text(1, "run"), count_text(20, "run")
    ('1 run', '20 runs')
    """
    return f"{grouped_number(number)} {noun}{'s' * (number != 1)}"
