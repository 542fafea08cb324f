"""Designs of a study that disagree on the probability of the same event."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np
import xarray as xr

__all__ = ["Disagreement", "disagreements"]


class Disagreement(NamedTuple):
    """Two designs whose estimates of a probability are not compatible.

    Parameters
    ----------
    condition : str
        The event.
    first, second : str
        Names of the designs; the first has an interval.
    second_has_interval : bool
        True if two intervals are disjoint, False if a value lies outside an interval.
    """

    condition: str
    first: str
    second: str
    second_has_interval: bool

    def __str__(self) -> str:
        if self.second_has_interval:
            return (
                f"{self.first} and {self.second} disagree: their intervals do not overlap, which "
                "chance hardly explains. One of them may have missed a part of the event, "
                "and no mean of them is right"
            )
        return f"the value of {self.second} lies outside the interval of {self.first}"


def disagreements(arrays: Mapping[str, xr.DataArray]) -> Iterator[Disagreement]:
    """Yield the disagreements on each event between designs that have its probability.

    Parameters
    ----------
    arrays : mapping of str to DataArray
        The joint probabilities of each design, along ``event`` and ``bound``.
    """
    by_condition: dict[str, list[tuple[str, xr.DataArray]]] = {}
    for design, array in arrays.items():
        for entry in array:
            known = by_condition.setdefault(str(entry["event_condition"].values), [])
            known.append((design, entry))
    for condition, entries in by_condition.items():
        for pair in combinations(entries, 2):
            # One with an interval comes first.
            (first, one), (second, other) = sorted(pair, key=lambda each: not _is_known(each[1]))
            if _is_known(one) and _are_disjoint(one, other):
                yield Disagreement(condition, first, second, _is_known(other))


def _is_known(estimate: xr.DataArray) -> bool:
    """Return True if an estimate has an interval."""
    return bool(np.isfinite(estimate.values).all())


def _are_disjoint(one: xr.DataArray, other: xr.DataArray) -> bool:
    """Return True if an interval contains nothing of another, or not the value that has none."""
    _, lower, upper = one.values
    value, low, high = other.values
    if not _is_known(other):
        low = high = value
    return bool(high < lower or upper < low)
