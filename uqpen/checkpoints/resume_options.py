"""Use of finished runs when an archive is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["ResumeOptions"]


@dataclass(frozen=True)
class ResumeOptions:
    """Use of the runs that earlier calls have finished.

    Parameters
    ----------
    fresh : bool
        Whether all checkpointed runs are removed, and all runs made.
    repeat_failed : bool
        Whether the missing ones among the finished runs are made again.
    read_again : bool
        Whether the outputs of runs whose folders are kept are read from these, without a run. If
        finished runs have no folder, this needs `fresh`.
    recheck : bool or None
        Whether some of the finished runs are made again before all are taken; None for all but
        costly ones.
    reuse : sequence of str or Path, or None
        Further archives whose runs may be taken; None for no archive, not even the one that is
        replaced.
    """

    fresh: bool = False
    repeat_failed: bool = False
    read_again: bool = False
    recheck: bool | None = None
    reuse: Sequence[str | Path] | None = ()

    @property
    def takes_archived_runs(self) -> bool:
        """True if runs may be taken from archives."""
        return self.reuse is not None and not self.fresh
