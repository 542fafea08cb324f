"""Mean and standard deviation of an output, by its surrogate and corrected by real runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.sample_shape import (
    DOUBTFUL_KURTOSIS,
    ENOUGH_RUNS_FOR_TAILS,
    FEWEST_EFFECTIVE_RUNS,
    FEWEST_RUNS_FOR_TAILS,
)
from uqpen.statistics.surrogate.correction.corrected_mean import (
    CorrectedMean,
    corrected_mean,
    spacing,
    tail_allowance,
    upper_allowance,
)
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = ["CorrectedMoments"]

# A surrogate that explains less says little of a tail that the runs have not met.
_LEAST_Q2 = 0.5

# Of the exponential function: a larger one is beyond all numbers.
_LARGEST_EXPONENT = 709.0


@dataclass(frozen=True)
class CorrectedMoments:
    """Corrected moments of one output.

    Parameters
    ----------
    runs : CorrectionRuns
    """

    runs: CorrectionRuns

    @cached_property
    def _mean(self) -> CorrectedMean:
        runs = self.runs
        exact = None if runs.exact_moments is None else runs.exact_moments[:, 0]
        return corrected_mean(runs, runs.values, runs.predictions, runs.draws, exact)

    @cached_property
    def variance(self) -> CorrectedMean:
        """The mean of squares about the corrected mean; too small by the variance of that."""
        runs, centre, exact = self.runs, self._mean.value, None
        if runs.exact_moments is not None:
            means, stds = runs.exact_moments.T
            exact = stds**2 + (means - centre) ** 2
        values, predictions, draws = (
            (each - centre) ** 2 for each in (runs.values, runs.predictions, runs.draws)
        )
        return corrected_mean(runs, values, predictions, draws, exact)

    def mean(self) -> Estimate:
        """Estimate the mean: Student's t over the runs, moved out for rare values beyond them."""
        found, runs = self._mean, self.runs
        half = found.half_width(runs.level) + found.missing_margin(runs)
        allowance = tail_allowance(runs)
        lower, upper = found.value - half - allowance.below, found.value + half + allowance.above
        method = texts.CORRECTED_STUDENT
        return Estimate(found.value, float(lower), float(upper), method, "conservative")

    def std(self) -> Estimate:
        """Estimate the standard deviation, by the delta method on its logarithm."""
        found, runs = self.variance, self.runs
        total = found.value + self._mean.error**2
        if not total > 0:
            return Estimate.without_bounds(math.nan, texts.NO_VARIANCE_LEFT)
        value = math.sqrt(total)
        if reason := self.heavy_tail or self.hidden_tail:
            return Estimate.without_bounds(value, reason, texts.SEE_QUANTILES)
        squares, of_draws = ((each - self._mean.value) ** 2 for each in (runs.values, runs.draws))
        allowance = spacing(squares, runs.weights) + upper_allowance(runs, squares, of_draws)
        margin = found.half_width(runs.level) + allowance + found.missing_margin(runs)
        exponent = margin / (2 * total)
        factor = math.exp(exponent) if exponent < _LARGEST_EXPONENT else math.inf
        method = texts.CORRECTED_DELTA_ON_LOGARITHM
        note = texts.DOUBTFUL_TAIL if runs.size < ENOUGH_RUNS_FOR_TAILS else ""
        return Estimate(value, value / factor, value * factor, method, "conservative", note)

    @cached_property
    def kurtosis(self) -> float:
        """The largest kurtosis of the runs and of the fits."""
        runs = self.runs
        return max(_kurtosis(runs.values, runs.weights), *map(_kurtosis, runs.draws))

    @cached_property
    def heavy_tail(self) -> str:
        """Reason why no interval of a spread is reliable for its tail; empty where one is.

        Such intervals covered in 20 to 83 % where the runs or the surrogate show a heavy tail.
        """
        runs, kurtosis = self.runs, self.kurtosis
        if kurtosis <= DOUBTFUL_KURTOSIS or runs.size >= FEWEST_EFFECTIVE_RUNS * kurtosis:
            return ""
        tail = texts.HEAVY_TAIL_OF_SURROGATE.format(kurtosis=kurtosis)
        return texts.NO_INTERVAL_AS.format(reason=tail)

    @property
    def hidden_tail(self) -> str:
        """Reason why neither the runs nor the surrogate can show a heavy tail; empty if one can."""
        if self.runs.size >= FEWEST_RUNS_FOR_TAILS or self.runs.q2 >= _LEAST_Q2:
            return ""
        explained = texts.EXPLAINS_TOO_LITTLE.format(share=100 * max(self.runs.q2, 0.0))
        return "; ".join([texts.HIDDEN_TAIL.format(runs=FEWEST_RUNS_FOR_TAILS), explained])


def _kurtosis(values: FloatArray, weights: FloatArray | None = None) -> float:
    """Return the fourth standardized moment: 3 for a normal distribution, 0 for a constant."""
    if weights is not None:
        return _weighted_kurtosis(values, weights)
    deviations = values - values.mean()
    scale = float(np.abs(deviations).max())
    if not scale > 0:
        return 0.0
    squares = (deviations / scale) ** 2
    return float((squares**2).mean() / squares.mean() ** 2)


def _weighted_kurtosis(values: FloatArray, weights: FloatArray) -> float:
    """Return the fourth standardized moment of weighted values; 0 for a constant."""
    squares = (values - np.average(values, weights=weights)) ** 2
    if not (scale := float(squares.max())) > 0:
        return 0.0
    second, fourth = (np.average((squares / scale) ** power, weights=weights) for power in (1, 2))
    return float(fourth / second**2)
