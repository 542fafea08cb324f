"""First place of a curve above or below a value, such as the time of a failure."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.model import Output
from uqpen.core.settings import quantity, validate
from uqpen.reductions.places import CoordinateReduction, along

__all__ = ["FirstAbove", "FirstBelow"]


@dataclass(frozen=True)
class _FirstCrossing(CoordinateReduction):
    """Base of coordinates at which a curve first lies beyond a threshold."""

    threshold: float = quantity()

    def __post_init__(self) -> None:
        validate(self)

    # The side of the threshold, and the verb of a curve that never lies there.
    _words: ClassVar[tuple[str, str]]

    @abstractmethod
    def _is_beyond(self, values: FloatArray) -> BoolArray:
        """Return a mask of the values beyond the threshold."""

    def title(self, field: Output) -> str:
        side, _ = self._words
        limit = field.value_text(self.threshold)
        return f"first {along(field)} of {field.title} {side} {limit}"

    def absence(self, field: Output) -> str:
        _, verb = self._words
        return f"{field.title} never {verb} {field.value_text(self.threshold)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return _first_crossing(values, self._is_beyond(values), self.threshold, field)


@dataclass(frozen=True)
class FirstAbove(_FirstCrossing):
    """Coordinate at which a curve first exceeds a threshold, linear between coordinates.

    Parameters
    ----------
    threshold : float
        In the unit of the output.
    """

    _words = ("above", "exceeds")

    def _is_beyond(self, values: FloatArray) -> BoolArray:
        return values > self.threshold


@dataclass(frozen=True)
class FirstBelow(_FirstCrossing):
    """Coordinate at which a curve first lies below a threshold, linear between coordinates.

    Parameters
    ----------
    threshold : float
        In the unit of the output.
    """

    _words = ("below", "lies below")

    def _is_beyond(self, values: FloatArray) -> BoolArray:
        return values < self.threshold


def _first_crossing(
    values: FloatArray, is_beyond: BoolArray, threshold: float, field: Output
) -> FloatArray:
    """Return the coordinate where each curve passes a threshold; NaN where it never does.

    Parameters
    ----------
    values, is_beyond : ndarray, shape (run, place)
        The curves, and whether each value lies beyond the threshold.
    threshold, field
        See `FirstAbove`.
    """
    coordinates = np.array(field.dims[0].values)
    after = is_beyond.argmax(axis=1)
    before = np.maximum(after - 1, 0)
    runs = np.arange(len(values))
    start, end = values[runs, before], values[runs, after]
    # In halves, as a difference of large numbers may overflow.
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (threshold / 2 - start / 2) / (end / 2 - start / 2)
    share = np.where(after > before, np.clip(share, 0.0, 1.0), 0.0)
    found = coordinates[before] + share * (coordinates[after] - coordinates[before])
    return np.where(is_beyond.any(axis=1), found, np.nan)
