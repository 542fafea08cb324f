"""Sums of powers of deviations from the mean, by group of runs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.tally import Tally

__all__ = ["PowerSums"]


@dataclass(frozen=True, eq=False)
class PowerSums:
    """Number, mean, and sums of the powers of deviations of a column, by group of its runs.

    Parameters
    ----------
    sizes : ndarray of int, shape (group,)
        Number of runs.
    means : ndarray, shape (group,)
        0 for a group without runs.
    powers : ndarray, shape (3, group)
        Sums of the second, third and fourth powers of the deviations from the mean of the group.
    smallest, largest : ndarray, shape (group,)
        Infinite for a group without runs.

    References
    ----------
    Pebay, P. (2008). Formulas for robust, one-pass parallel computation of covariances and
    arbitrary-order statistical moments. Sandia report SAND2008-6212.
    """

    sizes: IntArray
    means: FloatArray
    powers: FloatArray
    smallest: FloatArray
    largest: FloatArray

    @classmethod
    def empty(cls, groups: int) -> PowerSums:
        """Return the sums of no runs."""
        ends = np.full(groups, np.inf)
        return cls(np.zeros(groups, np.int64), np.zeros(groups), np.zeros((3, groups)), ends, -ends)

    @classmethod
    def of_values(cls, values: FloatArray) -> PowerSums:
        """Return the sums of one group, of at least one run."""
        mean = values.mean()
        deviations = values - mean
        squares = deviations * deviations
        powers = [squares.sum(), (squares * deviations).sum(), (squares * squares).sum()]
        return cls(
            np.array([values.size]),
            np.array([mean]),
            np.array(powers)[:, np.newaxis],
            np.array([values.min()]),
            np.array([values.max()]),
        )

    @classmethod
    def of_events(cls, tally: Tally) -> PowerSums:
        """Return the sums of an indicator as one group, of at least one run."""
        runs, p = tally.size, float(tally.mean())
        powers = runs * p * (1 - p) * np.array([1, 1 - 2 * p, 1 - 3 * p * (1 - p)])
        ends = np.array([[tally.smallest], [tally.largest]])
        return cls(np.array([runs]), np.array([p]), powers[:, np.newaxis], *ends)

    def add(self, group: int, values: FloatArray) -> None:
        """Add runs to a group, in place."""
        if not values.size:
            return
        merged = self[group].merge(PowerSums.of_values(values))
        for mine, other in zip(self._columns, merged._columns, strict=True):
            mine[..., group : group + 1] = other

    def __getitem__(self, group: int) -> PowerSums:
        """Return one group."""
        return PowerSums(*(column[..., group : group + 1] for column in self._columns))

    def first(self, groups: int) -> PowerSums:
        """Return the first groups."""
        return PowerSums(*(column[..., :groups] for column in self._columns))

    def merge(self, other: PowerSums) -> PowerSums:
        """Return the sums of the runs of both, group by group."""
        one, two = self.sizes.astype(np.float64), other.sizes.astype(np.float64)
        runs = np.maximum(one + two, 1.0)
        a, b, step = one / runs, two / runs, other.means - self.means
        (squares, cubes, fourths), (more_squares, more_cubes, more_fourths) = (
            self.powers,
            other.powers,
        )
        powers = [
            squares + more_squares + step**2 * one * b,
            cubes
            + more_cubes
            + step**3 * one * b * (a - b)
            + 3 * step * (a * more_squares - b * squares),
            fourths
            + more_fourths
            + step**4 * one * b * (a**2 - a * b + b**2)
            + 6 * step**2 * (a**2 * more_squares + b**2 * squares)
            + 4 * step * (a * more_cubes - b * cubes),
        ]
        return PowerSums(
            self.sizes + other.sizes,
            np.where(one > 0, self.means + step * b, other.means),
            np.array(powers),
            np.minimum(self.smallest, other.smallest),
            np.maximum(self.largest, other.largest),
        )

    @cached_property
    def whole(self) -> PowerSums:
        """The sums of all groups together, merged in order."""
        merged = self[0]
        for group in range(1, self.sizes.size):
            merged = merged.merge(self[group])
        return merged

    def deviations(self) -> Tally:
        """Return the tally of the deviations from the mean of all runs."""
        whole = self.whole
        return Tally(
            self.sizes,
            self.sizes * (self.means - whole.means),
            float(whole.powers[0, 0]),
            float((whole.smallest - whole.means)[0]),
            float((whole.largest - whole.means)[0]),
        )

    def squared_deviations(self) -> Tally:
        """Return the tally of their squares; the smallest one is not known and 0."""
        squares, _, fourths = self.whole.powers[:, 0]
        runs, ends = int(self.sizes.sum()), self.deviations()
        sums = self.powers[0] + self.sizes * (self.means - self.whole.means) ** 2
        largest = max(ends.smallest**2, ends.largest**2)
        scatter = max(float(fourths - squares**2 / runs), 0.0)
        return Tally(self.sizes, sums, scatter, 0.0, largest)

    @property
    def _columns(self) -> tuple[Any, ...]:
        return self.sizes, self.means, self.powers, self.smallest, self.largest
