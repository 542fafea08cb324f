"""Basis of the page's main results: a design."""

from __future__ import annotations

from uqpen.results.archive_view import ArchiveView

__all__ = ["leading_design"]


def leading_design(view: ArchiveView) -> str | None:
    """Return the design of the main results; None where no run of a sample completed.

    It is the first design of the study whose runs are a sample. So its place decides, not its
    results. A design that is made for another purpose is chosen only where there is no other.
    """
    found = [name for name in view.sample_designs if view.design(name).has_completed_runs]
    plain = [name for name in found if view.is_sample_design(name)]
    return next(iter((*plain, *found)), None)
