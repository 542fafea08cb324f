"""EstimateVerdict on an estimate of a surrogate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from uqpen.core.labels import NOT_COMPARABLE, UNCHECKED
from uqpen.trust import verdict_texts as texts

__all__ = ["EstimateVerdict", "designs_text", "undecided"]


class EstimateVerdict(NamedTuple):
    """One of `uqpen.core.labels.VERDICTS`, and the note on its reason."""

    label: str
    note: str

    def with_note(self, note: str) -> EstimateVerdict:
        """Return it with a further note; the same for an empty one."""
        return self._replace(note="; ".join(filter(None, (self.note, note))))


def undecided(of_completed_runs: Sequence[str], *, has_runs: bool) -> EstimateVerdict:
    """Return the verdict where no interval can decide.

    Parameters
    ----------
    of_completed_runs : sequence of str
        Designs with an interval that leaves out failed runs.
    has_runs : bool
        Whether there are validation runs.
    """
    if of_completed_runs:
        note = texts.FAILED_RUNS_MISSING.format(designs=designs_text(of_completed_runs))
        return EstimateVerdict(NOT_COMPARABLE, note)
    return EstimateVerdict(
        UNCHECKED, texts.NO_VALIDATION_INTERVAL if has_runs else texts.NO_VALIDATION_RUNS
    )


def designs_text(names: Sequence[str]) -> str:
    """Return the names of designs in a note."""
    return ", ".join(names)
