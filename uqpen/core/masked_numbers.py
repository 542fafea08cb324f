"""Reasons of failed runs without their numbers: those of one cause become equal."""

from __future__ import annotations

import re

__all__ = ["mask_numbers"]

# A number by itself; that of a name, as in x1, belongs to the name.
_NUMBER = re.compile(r"(?<![\w.])(?:0x[0-9a-fA-F]+|[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)")


def mask_numbers(text: str) -> str:
    """Replace the numbers in a text.

    >>> mask_numbers("residual 2e-3 of x1 after 50 steps")
    'residual # of x1 after # steps'
    """
    return _NUMBER.sub("#", text)
