"""Check that a design which follows one model is not given several."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from uqpen.core.errors import Problem

__all__ = ["check_single_model"]


def check_single_model(models: Collection[str]) -> Iterator[Problem]:
    """Yield a problem where a study has several models: each would lead the runs elsewhere."""
    if len(models) > 1:
        found = f"a study of {len(models)} models"
        expected = "a study of one model: its results decide where the next runs are"
        yield Problem(("kind",), found, expected)
