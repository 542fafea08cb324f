"""Reasons of failed runs that differ in their numbers alone, under one text."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from uqpen.core.masked_numbers import mask_numbers

__all__ = ["common_reasons"]

# Reasons that differ in their numbers alone and stay apart, at the most: there are few exit codes.
_MOST_APART = 3


def common_reasons(reasons: Iterable[str]) -> dict[str, str]:
    """Return for each reason the text that it is counted under.

    Where many reasons differ in their numbers alone, these are masked. All others stay as they are.

    >>> common_reasons(["no root", *(f"residual {n}e-3 after {n} steps" for n in range(4))])[
    ...     "residual 2e-3 after 2 steps"
    ... ]
    'residual # after # steps'
    """
    alike: dict[str, list[str]] = defaultdict(list)
    for reason in dict.fromkeys(reasons):
        alike[mask_numbers(reason)].append(reason)
    return {
        reason: masked if len(found) > _MOST_APART else reason
        for masked, found in alike.items()
        for reason in found
    }
