"""Ranks of runs by their cells."""

from __future__ import annotations

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray

__all__ = ["mean_shares", "unresolved_share"]


def mean_shares(counts: IntArray) -> FloatArray:
    """Share of the runs below each cell, where those in it count half; shape (..., cell).

    Runs of one cell have their mean rank in common. Between splitters that is less than a cell's
    share of the runs from the true rank.
    """
    runs = np.maximum(counts.sum(axis=-1, keepdims=True), 1)
    found: FloatArray = (np.cumsum(counts, axis=-1) - counts / 2) / runs
    return found


def unresolved_share(counts: IntArray) -> float:
    """Share of the variance of the ranks within cells that hold more than one value."""
    shares = counts[::2] / max(counts.sum(), 1)
    return float((shares**3).sum())
