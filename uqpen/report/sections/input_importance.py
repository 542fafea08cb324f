"""Importance of the inputs, by the first of some statistics that an archive has."""

from __future__ import annotations

import numpy as np

from uqpen.core.labels import INPUT
from uqpen.results.archive_view import ArchiveView

__all__ = ["input_importance"]

_CHOICE_TEXTS = (
    ("spearman", "the strongest rank correlations"),
    ("first_order", "the largest first order"),
    ("category_first_order", "the largest first order"),
)


def input_importance(view: ArchiveView, design: str, output: str) -> tuple[dict[str, float], str]:
    """Return the importance of each input, and its name; empty without an estimate."""
    for statistic, why in _CHOICE_TEXTS:
        array = view.statistics.get(design, output, statistic)
        if array is not None:
            estimates = np.abs(np.nan_to_num(array.values[..., 0]))
            largest = estimates.max(axis=0) if estimates.ndim > 1 else estimates
            if largest.any():
                return dict(zip(array[INPUT].values.tolist(), largest.tolist(), strict=True)), why
    return {}, ""
