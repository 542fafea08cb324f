"""Reductions of a curve: where it crosses a value, its ends, its variation."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.model import Output
from uqpen.core.settings import quantity, validate
from uqpen.core.variables import Reduction
from uqpen.reductions.derived import CoordinateReduction, along

# First place of a curve above or below a value, such as the time of a failure.


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


# First and last value of a curve.


@dataclass(frozen=True)
class First(Reduction):
    """Value at the first coordinate."""

    takes_curves_only = True

    def title(self, field: Output) -> str:
        return f"first {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return values[:, 0]


@dataclass(frozen=True)
class Last(Reduction):
    """Value at the last coordinate; of a curve that ends, its last value."""

    takes_curves_only = True

    def title(self, field: Output) -> str:
        return f"last {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        last = np.isfinite(values).sum(axis=1) - 1
        return np.take_along_axis(values, last[:, None], axis=1)[:, 0]


# Total variation of a curve: all its ups and downs, added.


@dataclass(frozen=True)
class TotalVariation(Reduction):
    """Sum of the absolute changes between neighbouring coordinates, up to the end of a curve."""

    takes_curves_only = True
    is_difference = True

    def title(self, field: Output) -> str:
        return f"total variation of {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        # In memory run by run, so that the order of a sum depends on nothing but the run.
        changes = np.abs(np.diff(np.ascontiguousarray(values), axis=1))
        found: FloatArray = np.nansum(changes, axis=1)
        return found
