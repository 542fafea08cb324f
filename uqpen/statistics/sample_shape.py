"""The shape of a sample's tail: whether a few runs decide its spread."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics import texts
from uqpen.statistics.sample import Sample
from uqpen.statistics.weights import effective_size

__all__ = ["SampleShape"]


# Limits for the interval of the standard deviation, from its coverage in simulations. Beyond the
# first two, the tail is so heavy that only a few runs decide the variance. With few runs, a heavy
# tail can remain hidden: usually below the third limit, sometimes up to the fourth.
_HEAVY_KURTOSIS = 6.0
_FEWEST_EFFECTIVE_RUNS = 1000.0
_FEWEST_RUNS_FOR_TAILS = 200
_ENOUGH_RUNS_FOR_TAILS = 1000
# A distribution with a heavier tail may give a sample below the former limit, seldom below this.
_DOUBTFUL_KURTOSIS = 4.5


@dataclass(frozen=True)
class SampleShape:
    """A sample's deviations from its mean, and the influence of few runs on them."""

    sample: Sample

    @cached_property
    def mean(self) -> float:
        """The mean, also of values near the end of the numbers."""
        values = self.sample.values
        if not self.sample.size or self.sample.is_constant:
            return float(values[0]) if self.sample.size else math.nan
        # The sum of values over their largest cannot overflow.
        largest = float(np.abs(values).max())
        return self.sample.mean(values / largest) * largest

    @cached_property
    def scale(self) -> float:
        """The largest deviation; powers of values divided by it neither overflow nor vanish."""
        if not self.sample.size:
            return math.nan
        return float(np.abs(self.sample.values - self.mean).max())

    @cached_property
    def deviations(self) -> FloatArray:
        """Deviations from the mean over `scale`."""
        if not self.scale > 0:
            return np.zeros(self.sample.size)
        return (self.sample.values - self.mean) / self.scale

    def _moment(self, power: int) -> float:
        return self.sample.mean(self.deviations**power) if self.scale > 0 else math.nan

    @cached_property
    def skewness(self) -> float:
        """The third standardized moment."""
        return float(self._moment(3) / self._moment(2) ** 1.5)

    @cached_property
    def kurtosis(self) -> float:
        """Fourth standardized moment; 3 for a normal distribution."""
        return self._moment(4) / self._moment(2) ** 2

    @property
    def effective_runs(self) -> float:
        """(Σd²)²/Σd⁴ of the deviations d, times the weights: the runs that decide the variance."""
        if self.sample.run_weights is None:
            return self.sample.size / self.kurtosis
        return effective_size((self.sample.run_weights * self.deviations) ** 2)

    @property
    def has_few_effective_runs(self) -> bool:
        """True if the effective runs are too few for a heavy tail."""
        return self.effective_runs < _FEWEST_EFFECTIVE_RUNS

    @property
    def is_heavy(self) -> bool:
        """True if a few runs dominate the variance, so that no interval of it is reliable."""
        return self.kurtosis > _HEAVY_KURTOSIS and self.has_few_effective_runs

    @property
    def may_be_heavy(self) -> bool:
        """True if the runs are a heavy tail's, or may be: no interval of the spread is reliable."""
        return self.kurtosis > _DOUBTFUL_KURTOSIS and self.has_few_effective_runs

    @property
    def is_small(self) -> bool:
        """True if there are so few runs that any of them may hide a heavy tail."""
        return self.sample.effective_size < _ENOUGH_RUNS_FOR_TAILS

    @property
    def is_doubtful(self) -> bool:
        """True if the distribution may have a heavier tail than these runs show."""
        return self.is_small or self.may_be_heavy

    @property
    def hidden_tail(self) -> str:
        """Reason why the runs cannot show a heavy tail; empty where there are enough."""
        if self.sample.effective_size >= _FEWEST_RUNS_FOR_TAILS:
            return ""
        is_weighted = self.sample.weights is not None
        text = texts.HIDDEN_TAIL_OF_WEIGHTED if is_weighted else texts.HIDDEN_TAIL
        return text.format(runs=_FEWEST_RUNS_FOR_TAILS)

    @property
    def tail_note(self) -> str:
        """Kurtosis and effective runs of a heavy tail, as text."""
        return texts.HEAVY_TAIL.format(kurtosis=self.kurtosis, runs=self.effective_runs)
