"""Empirical distribution of an input: its measurements without a named family."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.distributions.distribution import Distribution

__all__ = ["Empirical"]


@dataclass(frozen=True)
class Empirical(Distribution):
    """Empirical distribution: quantiles are interpolated linearly between measurements.

    The measurement of rank ``i`` of ``n`` is the quantile of ``(i - 1/2) / n``; beyond the first
    and the last the quantile is constant. So no draw lies outside the measured range, and the mean
    is exactly that of the measurements.

    Parameters
    ----------
    measurements : tuple of float
        In SI units, in any order; at least two of them differ.

    References
    ----------
    Hazen, A. (1914). Trans. Am. Soc. Civ. Eng. 77, 1539-1640.
    """

    measurements: tuple[float, ...]

    def check_settings(self) -> Iterator[Problem]:
        if not np.isfinite(self.measurements).all():
            yield Problem((), "a measurement that is no number", "finite numbers")
        elif len(set(self.measurements)) < 2:
            yield Problem((), "measurements that do not differ", "at least two that do")

    def ppf(self, probability: FloatArray) -> FloatArray:
        return np.interp(probability, self._positions, self._ordered)

    def isf(self, probability: FloatArray) -> FloatArray:
        return np.interp(probability, self._positions, self._ordered[::-1])

    def cdf(self, value: FloatArray) -> FloatArray:
        distinct, first, last = self._steps
        rank = np.searchsorted(distinct, value, side="right") - 1
        lower = np.clip(rank, 0, len(distinct) - 2)
        share = (value - distinct[lower]) / (distinct[lower + 1] - distinct[lower])
        inside = last[lower] + np.clip(share, 0.0, 1.0) * (first[lower + 1] - last[lower])
        return np.where(rank < 0, 0.0, np.where(rank > lower, 1.0, inside))

    def sf(self, value: FloatArray) -> FloatArray:
        return 1 - self.cdf(value)

    @cached_property
    def _ordered(self) -> FloatArray:
        return np.sort(np.array(self.measurements))

    @cached_property
    def _positions(self) -> FloatArray:
        return (np.arange(len(self.measurements)) + 0.5) / len(self.measurements)

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distinct measurements, and the first and last position of each.

        A value measured several times has a probability of its own.
        """
        distinct, first, counts = np.unique(self._ordered, return_index=True, return_counts=True)
        return distinct, self._positions[first], self._positions[first + counts - 1]
