"""Basis of the page's main results: a design, and its runs as a sample."""

from __future__ import annotations

from uqpen.core.labels import MISSING
from uqpen.report.sections.view_statistics import sample_account
from uqpen.results.archive_view import ArchiveView

__all__ = ["leading_design", "missing_runs_note"]


def leading_design(view: ArchiveView) -> str | None:
    """Return the design of the main results; None where no run of a sample completed.

    It is the first design of the study whose runs are a sample. So its place decides, not its
    results. A design that is made for another purpose is chosen only where there is no other.
    """
    found = [name for name in view.sample_designs if view.design(name).has_completed_runs]
    plain = [name for name in found if view.is_sample_design(name)]
    return next(iter((*plain, *found)), None)


def missing_runs_note(view: ArchiveView, design: str) -> list[str]:
    """Return a note on the runs that a distribution function leaves out, if any."""
    missing = sample_account(view, design).get(MISSING)
    if not missing:
        return []
    return [
        f"The curve uses the completed runs; {missing} failed. A band includes every result that "
        "they could have had."
    ]
