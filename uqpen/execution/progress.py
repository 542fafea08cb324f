"""Who is told how far a study is."""

from __future__ import annotations

import warnings

__all__ = ["Progress"]


class Progress:
    """Who wants to know how far a study is; this one does not."""

    def start_preparation(self, model: str) -> None:
        """The model is being made ready; the first time, that may mean compiling it."""

    def start_design(self, name: str, runs: int) -> None:
        """A design begins, with about this many runs."""

    def count_restored(self, runs: int) -> None:
        """So many of its runs were made before, and are not made again."""

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        """So many runs more are done, of which some were lost; others have been begun."""

    def start_analysis(self) -> None:
        """All runs are done; what they tell is being worked out."""

    def warn(self, text: str) -> None:
        """Something was worth a warning, which changes no result."""
        warnings.warn(text, RuntimeWarning, stacklevel=2)
