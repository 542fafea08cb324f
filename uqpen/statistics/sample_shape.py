"""The shape of a sample's tail: whether a few runs decide its spread."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, singledispatch

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics import texts
from uqpen.statistics.sample import Sample
from uqpen.statistics.weights import effective_sizes

__all__ = [
    "DOUBTFUL_KURTOSIS",
    "ENOUGH_RUNS_FOR_MEANS",
    "ENOUGH_RUNS_FOR_TAILS",
    "FEWEST_EFFECTIVE_RUNS",
    "FEWEST_RUNS_FOR_TAILS",
    "SampleShape",
    "shape_of",
]


# Limits for the interval of the standard deviation, from its coverage in simulations. Beyond the
# first two, the tail is so heavy that only a few runs decide the variance. With few runs, a heavy
# tail can remain hidden: usually below the third limit, sometimes up to the fourth.
_HEAVY_KURTOSIS = 6.0
FEWEST_EFFECTIVE_RUNS = 1000.0
FEWEST_RUNS_FOR_TAILS = 200
ENOUGH_RUNS_FOR_TAILS = 1000
# With fewer runs, a tail that no run has met may be long enough to move any mean.
ENOUGH_RUNS_FOR_MEANS = 2000
# A distribution with a heavier tail may give a sample below the former limit, seldom below this.
DOUBTFUL_KURTOSIS = 4.5


@dataclass(frozen=True)
class SampleShape:
    """A sample's deviations from its mean, and the influence of few runs on them.

    Every number is an array of shape (...), as the sample has values of shape (..., run).
    """

    sample: Sample

    @cached_property
    def mean(self) -> FloatArray:
        """The mean, also of values near the end of the numbers."""
        return self.sample.once("mean", self._mean_of_values)

    def _mean_of_values(self) -> FloatArray:
        values = self.sample.values
        if not self.sample.size:
            return np.full(values.shape[:-1], np.nan)
        # The sum of values over their largest cannot overflow.
        largest = np.maximum(values.max(axis=-1), -values.min(axis=-1))
        largest = np.where(largest > 0, largest, 1.0)
        means = self.sample.mean(values / largest[..., np.newaxis]) * largest
        return np.where(self.sample.is_constant, values[..., 0], means)

    @cached_property
    def scale(self) -> FloatArray:
        """The largest deviation; powers of values divided by it neither overflow nor vanish."""
        return self.sample.once("largest deviation", self._largest_deviation)

    def _largest_deviation(self) -> FloatArray:
        if not self.sample.size:
            return np.full(self.mean.shape, np.nan)
        # Rounding is monotonic, so the largest deviation is that of an end.
        values = self.sample.values
        return np.maximum(values.max(axis=-1) - self.mean, self.mean - values.min(axis=-1))

    @cached_property
    def deviations(self) -> FloatArray:
        """Deviations from the mean over `scale`, shape (..., run)."""
        return self.sample.once("deviations", self._deviations)

    def _deviations(self) -> FloatArray:
        varies = self.scale > 0
        scale = np.where(varies, self.scale, 1.0)
        deviations: FloatArray = self.sample.values - self.mean[..., np.newaxis]
        deviations /= scale[..., np.newaxis]
        deviations[~varies] = 0.0
        return deviations

    def _mean(self, powers: FloatArray) -> FloatArray:
        """Return the mean of powers of the deviations; NaN where these are all 0."""
        if not self.sample.size:
            return self.scale
        return np.where(self.scale > 0, self.sample.mean(powers), np.nan)

    @property
    def std(self) -> FloatArray:
        """The standard deviation in the unit of the values, without weights; 0 of a constant."""
        return self.scale * self.deviations.std(axis=-1)

    @cached_property
    def _variance(self) -> FloatArray:
        return self._mean(self.deviations**2)

    @cached_property
    def skewness(self) -> FloatArray:
        """The third standardized moment."""
        # Products, as a power takes twenty times as long.
        cubes = self.deviations * self.deviations * self.deviations
        return self._mean(cubes) / _power(self._variance, 1.5)

    @cached_property
    def kurtosis(self) -> FloatArray:
        """Fourth standardized moment; 3 for a normal distribution."""
        return self.sample.once("kurtosis", self._kurtosis)

    def _kurtosis(self) -> FloatArray:
        return self._mean((self.deviations**2) ** 2) / _power(self._variance, 2)

    @cached_property
    def effective_runs(self) -> FloatArray:
        """(Σd²)²/Σd⁴ of the deviations d, times the weights: the runs that decide the variance."""
        if self.sample.run_weights is None:
            return self.sample.size / self.kurtosis
        return effective_sizes((self.sample.run_weights * self.deviations) ** 2)

    @property
    def has_few_effective_runs(self) -> BoolArray:
        """True if the effective runs are too few for a heavy tail."""
        return self.effective_runs < FEWEST_EFFECTIVE_RUNS

    @property
    def is_heavy(self) -> BoolArray:
        """True if a few runs dominate the variance, so that no interval of it is reliable."""
        return (self.kurtosis > _HEAVY_KURTOSIS) & self.has_few_effective_runs

    @property
    def may_be_heavy(self) -> BoolArray:
        """True if the runs are a heavy tail's, or may be: no interval of the spread is reliable."""
        return (self.kurtosis > DOUBTFUL_KURTOSIS) & self.has_few_effective_runs

    @cached_property
    def is_uncertain(self) -> BoolArray:
        """True where the scatter of the runs does not show the error of the variance."""
        return bool(self.hidden_tail) | self.is_heavy

    @property
    def is_small(self) -> bool:
        """True if there are so few runs that any of them may hide a heavy tail."""
        return self.sample.effective_size < ENOUGH_RUNS_FOR_TAILS

    @property
    def is_doubtful(self) -> BoolArray:
        """True if the distribution may have a heavier tail than these runs show."""
        return self.is_small | self.may_be_heavy

    @property
    def hidden_tail(self) -> str:
        """Reason why the runs cannot show a heavy tail; empty where there are enough."""
        if self.sample.effective_size >= FEWEST_RUNS_FOR_TAILS:
            return ""
        is_weighted = self.sample.weights is not None
        text = texts.HIDDEN_TAIL_OF_WEIGHTED if is_weighted else texts.HIDDEN_TAIL
        return text.format(runs=FEWEST_RUNS_FOR_TAILS)

    @property
    def tail_note(self) -> str:
        """Kurtosis and effective runs of a heavy tail, as text."""
        if self.sample.is_at_places:
            return texts.HEAVY_TAIL_AT_PLACES
        return texts.HEAVY_TAIL.format(kurtosis=self.kurtosis, runs=self.effective_runs)


@singledispatch
def shape_of(sample: Sample) -> SampleShape:
    """Return the shape of a sample; of one without its values, as it knows it itself."""
    return SampleShape(sample)


def _power(base: FloatArray, exponent: float) -> FloatArray:
    """Return powers by the C library, whose last digits do not depend on the shape of an array."""
    return np.asarray(np.frompyfunc(lambda each: each**exponent, 1, 1)(base), dtype=np.float64)
