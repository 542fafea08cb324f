"""Setting ``keep``: whether the archive of a study has the runs of a design."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from uqpen.core.errors import Problem
from uqpen.core.settings import choice

__all__ = ["RUNS", "STATISTICS", "keep_problems", "keep_setting"]

# The runs with their statistics, or these alone.
RUNS, STATISTICS = "runs", "statistics"


def keep_setting() -> Any:
    """Declare the setting ``keep`` of a design whose points do not depend on its runs."""
    return choice(RUNS, STATISTICS, default=RUNS)


def keep_problems(keep: str, rule: str) -> Iterator[Problem]:
    """Yield the problem of keeping no runs that decide their own number.

    Parameters
    ----------
    keep : str
        The setting.
    rule : str
        The key of the rule that ends the design; empty where the number of its runs is fixed.
    """
    if keep == STATISTICS and rule:
        expected = f'"{RUNS}" beside {rule}, as the end of such a design is verified by its runs'
        yield Problem(("keep",), f'"{keep}"', expected)
