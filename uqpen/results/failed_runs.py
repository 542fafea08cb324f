"""The failed runs of an archive, and their reasons."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.labels import RUNS
from uqpen.core.masked_numbers import divide_place
from uqpen.core.status import Status
from uqpen.execution import status_counts
from uqpen.results.failure_causes import common_texts, failure_causes

__all__ = ["FailedRuns", "failed_runs", "has_failed_design"]


class FailedRuns(NamedTuple):
    """Number of runs of one design that failed for one reason.

    Attributes
    ----------
    reason : str
        With ``#`` for each number, where many reasons differ in their numbers alone.
    example : str
        One of these reasons as it stands; empty for a single reason.
    """

    design: str
    status: Status
    reason: str
    runs: int
    example: str = ""

    @property
    def text(self) -> str:
        """The reason, with its example if it has one; both name the same line of code."""
        example, place = divide_place(self.example)
        told = self.reason.removesuffix(place)
        return f"{told}, such as: {example}{place}" if example else self.reason


def failed_runs(tree: xr.DataTree, design: str) -> Iterator[FailedRuns]:
    """Yield the failed runs of a design by reason, the most frequent first."""
    every = [read_group(tree, RUNS, name) for name in group_names(tree, RUNS)]
    # The text of a reason is the same for all designs of a model.
    causes = failure_causes([read_group(tree, RUNS, design)], common_texts(every))
    for status, text, example, runs in causes:
        yield FailedRuns(design, status, text, runs, example * (example != text))


def has_failed_design(tree: xr.DataTree) -> bool:
    """Return whether some design has no completed run."""
    designs = (
        read_group(model, RUNS, design)
        for model in model_trees(tree).values()
        for design in group_names(model, RUNS)
    )
    return any(not status_counts(runs)[Status.OK] for runs in designs)
