"""Settings of a rehearsal: the number of repeats, and of runs to compare designs at."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uqpen.core.errors import Problem, SettingsError, toml_text

__all__ = ["FEWEST_REPEATS", "MOST_REPEATS", "SECONDS", "RehearsalSettings"]

# With 1 000 repeats, a coverage of 95 % has a standard error of 0.7 points; with 200, of 1.5.
MOST_REPEATS, FEWEST_REPEATS = 1000, 200

# How long a rehearsal may take where nobody states a number of repeats.
SECONDS = 300.0

# Fewer repeats tell nothing, as the interval of a coverage of 100 % then begins below 69 %.
_FEWEST_STATED = 10

_FEWEST_RUNS = 8


@dataclass(frozen=True)
class RehearsalSettings:
    """Settings of a rehearsal.

    Parameters
    ----------
    repeats : int, optional
        Number of repeats; by default as many as take about `SECONDS`, from `FEWEST_REPEATS` to
        `MOST_REPEATS`.
    runs : int, optional
        Largest number of runs of the designs that are compared at equal runs.
    draws : int
        Number of draws of the surrogate for its true statistics, a power of two.
    """

    repeats: int | None = None
    runs: int | None = None
    draws: int = 2**18

    def __post_init__(self) -> None:
        fewest = {"repeats": _FEWEST_STATED, "runs": _FEWEST_RUNS}
        problems = [
            Problem((name,), toml_text(value), f"a whole number, at least {least}")
            for name, least in fewest.items()
            if (value := getattr(self, name)) is not None and value < least
        ]
        if problems:
            raise SettingsError(problems)

    def affordable_repeats(self, seconds: float) -> int:
        """Return the number of repeats, given the seconds that each takes."""
        if self.repeats is not None:
            return self.repeats
        affordable = math.floor(SECONDS / seconds) if seconds > 0 else MOST_REPEATS
        return min(max(affordable, FEWEST_REPEATS), MOST_REPEATS)
