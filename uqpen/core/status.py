"""Statuses of a run: how it ended; and reasons of failed ones, those of one cause made equal."""

from __future__ import annotations

import re
from enum import IntEnum
from types import MappingProxyType


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


# Whether a run ends so may depend on the machine.
BY_MACHINE = (Status.TIMED_OUT, Status.CRASHED)

# A share of failed runs around the posterior that a reader has to know of.
MANY_FAILED = 0.05

STATUS_TEXT = MappingProxyType({status: status.meaning.replace("_", " ") for status in Status})


# A number by itself; that of a name, as in x1, belongs to the name.
_NUMBER = re.compile(r"(?<![\w.])(?:0x[0-9a-fA-F]+|[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)")

# The line of the user's code at the end of a reason, as `uqpen.models.user_module` writes it.
_PLACE = re.compile(r" \([^(),]+, line \d+(?:: .*)?\)$")


def mask_numbers(text: str) -> str:
    """Replace the numbers in a reason, but for those of the line of code that it names.

    >>> mask_numbers("residual 2e-3 of x1 after 50 steps")
    'residual # of x1 after # steps'
    >>> mask_numbers("no root at 2.5 (beam.py, line 7: y = root(2))")
    'no root at # (beam.py, line 7: y = root(2))'
    """
    told, place = divide_place(text)
    return _NUMBER.sub("#", told) + place


def divide_place(text: str) -> tuple[str, str]:
    """Divide a reason from the line of code that it names, which is empty where it names none."""
    place = _PLACE.search(text)
    return (text[: place.start()], place[0]) if place else (text, "")
