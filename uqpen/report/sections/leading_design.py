"""What a distribution function leaves out."""

from __future__ import annotations

from uqpen.core.labels import MISSING
from uqpen.results.archive_view import ArchiveView

__all__ = ["missing_runs_note"]


def missing_runs_note(view: ArchiveView, design: str) -> list[str]:
    """Return a note on the runs that a distribution function leaves out, if any."""
    missing = view.statistics.run_accounts(design).get(MISSING)
    if not missing:
        return []
    return [
        f"The curve uses the completed runs; {missing} failed. A band includes every result that "
        "they could have had."
    ]
