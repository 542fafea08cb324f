"""Errors that uqpen raises on purpose, each with a message for its user.

::

    UqpenError
    ├── StudyError (ValueError)          a study file with mistakes, all of them listed
    ├── SettingsError (ValueError)       a setting that its owner does not accept
    ├── QuantityError (ValueError)       text that is not a number with a unit
    │   └── ConstraintError              a constraint that cannot be read or has mixed units
    ├── UnknownNameError (LookupError)   a name that is not among the known ones
    ├── ModelError (ValueError)          a model that cannot be built or called as requested
    ├── TableError (ValueError)          a table of points that cannot be read
    ├── TrajectoryError (ArithmeticError)  a requested trajectory of a run that has failed
    ├── WorkerError (RuntimeError)       processes that cannot be started
    ├── ClusterError (RuntimeError)      a cluster that cannot be reached, or is no more
    ├── TooManyFailedError (RuntimeError)  more runs failed than a study allows
    │   └── FirstRunsFailedError         the first runs of a model all failed alike
    ├── FigureError (ValueError)         a figure that cannot be drawn or written
    ├── ExportError (ValueError)         a table that cannot be written in a format
    ├── ReportError (ValueError)         a report that cannot be written
    ├── CheckpointError (ValueError)     checkpointed runs that a study would not make
    └── ArchiveError (OSError)           a file that cannot be written, or is not an archive

Anything else that escapes is a fault of uqpen itself and keeps its traceback.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, time

# Python converts integers of up to 4 300 digits to decimal ones, as that takes the square of their
# number in time; these bits are some 4 200 digits. TOML's hexadecimal integers have no limit.
_HUGE = 14_000
# A list of more characters is named, not written.
_LONGEST_LIST = 60


@dataclass(frozen=True)
class Problem:
    """A mistake: its place, the text found there, and the text expected.

    Parameters
    ----------
    path : tuple of str or int
        Keys that lead to it, outermost first; empty for a whole file.
    found : str
        The text there, as its author wrote it where that is possible.
    expected : str
        A description of the texts that uqpen accepts there.
    """

    path: tuple[str | int, ...]
    found: str
    expected: str

    @property
    def key(self) -> str:
        """Dotted path, with positions in a list in brackets."""
        parts = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in self.path]
        return "".join(parts).removeprefix(".")

    def within(self, *prefix: str | int) -> Problem:
        """Return the problem with its path extended by that of an enclosing table."""
        return Problem((*prefix, *self.path), self.found, self.expected)

    def __str__(self) -> str:
        where = f"{self.key}: " if self.path else ""
        return f"{where}found {self.found}; expected {self.expected}"


class UqpenError(Exception):
    """Base of every error that uqpen raises on purpose.

    A notebook shows its message alone. ``traceback.print_exception(sys.last_value)`` in the next
    cell prints where it was raised.
    """

    def _render_traceback_(self) -> list[str]:
        """Return the lines that IPython shows in place of a traceback."""
        return [f"{type(self).__name__}: {self}"]


class StudyError(UqpenError, ValueError):
    """A study that cannot be run: the message reports all its `problems`, as a user reads it."""

    def __init__(self, message: str, problems: Iterable[Problem] = ()) -> None:
        super().__init__(message)
        self.problems = tuple(problems)


class SettingsError(UqpenError, ValueError):
    """Settings that their owner (a design, a distribution, a model) does not accept."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("; ".join(str(problem) for problem in self.problems))


class QuantityError(UqpenError, ValueError):
    """Text that is not a number with a unit of the right dimension."""

    def __init__(self, found: str, expected: str) -> None:
        super().__init__(f"found {found}; expected {expected}")
        self.found = found
        self.expected = expected
        self.problems = (Problem((), found, expected),)


class ConstraintError(QuantityError):
    """A constraint that cannot be read, or that compares quantities without a common unit."""


class UnknownNameError(UqpenError, LookupError):
    """A name that is not among the known ones; the message lists them."""


class ModelError(UqpenError, ValueError):
    """A model that cannot be built or called as requested.

    Attributes
    ----------
    expected : str
        What would be right, where that is known; else empty.
    """

    def __init__(self, found: str, expected: str = "") -> None:
        super().__init__(found)
        self.expected = expected


class TrajectoryError(UqpenError, ArithmeticError):
    """A requested trajectory of a run that has failed."""


class TableError(UqpenError, ValueError):
    """A table of points that cannot be read or does not fit the model."""


class WorkerError(UqpenError, RuntimeError):
    """Worker processes that cannot be started."""


class ClusterError(UqpenError, RuntimeError):
    """A cluster that cannot be reached, or has been shut down."""


class TooManyFailedError(UqpenError, RuntimeError):
    """Too many failed runs: more than a study allows."""

    # What follows a message that runs are kept: how a study goes on from them.
    remedy = (
        "With a larger share, the same command continues from them;\n"
        "with --lost-again, it repeats the failed ones"
    )


class FirstRunsFailedError(TooManyFailedError):
    """First runs of a model that all failed alike."""

    remedy = (
        "After a correction of the model, start over with --fresh.\n"
        "Of the same model, with stop_after = 0 in [failures], the same\n"
        "command continues from them; with --lost-again, it repeats them"
    )


class FigureError(UqpenError, ValueError):
    """A figure that cannot be drawn from an archive, or cannot be written."""


class ExportError(UqpenError, ValueError):
    """A table that cannot be written in a format."""


class ReportError(UqpenError, ValueError):
    """A report that cannot be written."""


class CheckpointError(UqpenError, ValueError):
    """Checkpointed runs that a study would not make."""


class ArchiveError(UqpenError, OSError):
    """A file that cannot be written, or that is not an archive of uqpen's."""


def is_huge(value: object) -> bool:
    """Check that a value is an integer with too many digits to be written or converted."""
    return isinstance(value, int) and value.bit_length() > _HUGE


def plural(noun: str, number: int) -> str:
    """Return a noun as it stands behind a number: in the singular for one."""
    return noun if number == 1 else f"{noun}s"


def counted(number: int, noun: str) -> str:
    """Return a number and its noun, in plain text; pages have `count_text`."""
    return f"{number} {plural(noun, number)}"


def toml_text(value: object) -> str:
    """Return a TOML value approximately as its author wrote it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        written = f"[{', '.join(map(toml_text, value))}]"
        is_short = len(written) <= _LONGEST_LIST
        is_flat = not any(isinstance(each, dict | list) for each in value)
        return "an empty list" if not value else written if is_short and is_flat else "a list"
    return "a whole number of over 4000 digits" if is_huge(value) else repr(value)
