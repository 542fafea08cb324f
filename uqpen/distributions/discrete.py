"""Discrete distribution of an input: a few values, each with a probability."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.settings import numbers, quantity_list
from uqpen.distributions.distribution import Distribution

__all__ = ["Discrete"]


@dataclass(frozen=True)
class Discrete(Distribution):
    """Discrete distribution: its quantile at p is the smallest value with a cdf of p or more.

    Parameters
    ----------
    values : sequence of float or str
        At least two, in any order, each once.
    weights : sequence of float, optional
        Relative probabilities, which need not add up to 1; equal ones by default.

    Examples
    --------
    >>> bolts = Discrete(["8 mm", "10 mm", "12 mm"], [1, 2, 1])
    >>> bolts.ppf(np.array([0.2, 0.5, 0.9]))
    array([0.008, 0.01 , 0.012])
    """

    is_discrete = True
    unfitted_reason = "its values are given, and counting them needs no fit"

    values: tuple[float, ...] = quantity_list()
    weights: tuple[float, ...] = numbers(minimum=0, default=())

    def check_settings(self) -> Iterator[Problem]:
        if len(set(self.values)) < max(len(self.values), 2):
            yield Problem(("values",), f"{len(set(self.values))} of them", "two or more, each once")
        if self.weights and len(self.weights) != len(self.values):
            expected = f"one for each of the {len(self.values)} values"
            yield Problem(("weights",), f"{len(self.weights)} weights", expected)
        elif self.weights and sum(weight > 0 for weight in self.weights) < 2:
            yield Problem(("weights",), "fewer than two above 0", "at least two above 0")

    @classmethod
    def from_sample(cls, values: FloatArray, weights: FloatArray) -> Discrete:
        """Return the distribution of weighted values; equal ones are taken together."""
        distinct, place = np.unique(values, return_inverse=True)
        total = np.bincount(place, weights, len(distinct))
        return cls(tuple(distinct.tolist()), tuple(total.tolist()))

    def ppf(self, probability: FloatArray) -> FloatArray:
        support, below, _ = self._steps
        return support[np.minimum(np.searchsorted(below, probability), len(support) - 1)]

    def isf(self, probability: FloatArray) -> FloatArray:
        support, _, above = self._steps
        # The probabilities above descend; the first of at most the given one counts.
        place = len(above) - np.searchsorted(above[::-1], probability, side="right")
        return support[np.minimum(place, len(support) - 1)]

    def cdf(self, value: FloatArray) -> FloatArray:
        support, below, _ = self._steps
        return np.concatenate([[0.0], below])[np.searchsorted(support, value, side="right")]

    def sf(self, value: FloatArray) -> FloatArray:
        support, _, above = self._steps
        return np.concatenate([[1.0], above])[np.searchsorted(support, value, side="right")]

    def atoms(self) -> tuple[FloatArray, FloatArray]:
        """Return the values with a probability above 0, ascending, and their probabilities."""
        weights = np.array(self.weights or [1.0] * len(self.values), dtype=np.float64)
        values = np.array(self.values, dtype=np.float64)
        order = np.argsort(values)
        order = order[weights[order] > 0]
        shares = weights[order] / weights.max()
        return values[order], shares / shares.sum()

    @cached_property
    def _steps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The values, ascending, with the probability of at most and of more than each."""
        values, shares = self.atoms()
        above = np.concatenate([np.cumsum(shares[:0:-1])[::-1], [0.0]])
        below = np.where(above < 0.5, 1 - above, np.cumsum(shares))
        return values, below, above
