"""Mean and standard deviation of an output, by its surrogate and corrected by real runs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import PERCENT, PROBABILITY
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import mean_half_width, ratio_error
from uqpen.statistics.sample import (
    DOUBTFUL_KURTOSIS,
    ENOUGH_RUNS_FOR_MEANS,
    ENOUGH_RUNS_FOR_TAILS,
    FEWEST_EFFECTIVE_RUNS,
    FEWEST_RUNS_FOR_TAILS,
)
from uqpen.statistics.standard_errors import Margins
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns

# Corrected mean: a surrogate's mean over cheap draws plus what real runs say of its error.
#
# The predictions are a control variate whose mean is known. Their weight is tuned, so that a
# useless surrogate gives the plain mean of the runs.
#
# References
# ----------
# Angelopoulos, A. N. et al. (2023). Science 382, 669-674.
# Zrnic, T. & Candès, E. J. (2024). Proc. Natl. Acad. Sci. 121, e2322083121 (cross-fitting).
# Hosking, J. R. M. & Wallis, J. R. (1987). Technometrics 29, 339-349 (generalized Pareto).

# Share of the runs that a gap among the largest ones spans.
_SPACING_SHARE = 10
_FEWEST_SPACED = 2
# A tail is fitted to ten values or more. Its shape is 0 for exponential tails; from one half on,
# there is no variance, and so no mean with an interval.
_FEWEST_FITTED = 10
_LEAST_SHAPE, _LARGEST_SHAPE = -1.0, 0.5
# With the median of the largest value, means of a Pareto variable from 500 runs cover 90 %.
_LARGEST_AT = 0.84


@dataclass(frozen=True, eq=False)
class CorrectedMean:
    """Mean of a function of the output, corrected by real runs."""

    influence: FloatArray  # (run,): values whose mean is the estimate
    weight: float  # weight of the surrogate, from 0 to 1
    draws_variance: float  # variance of the estimate that comes from the draws of the surrogate

    @property
    def value(self) -> float:
        """The estimate."""
        return float(self.influence.mean())

    @property
    def error(self) -> float:
        """Standard error of the estimate."""
        scatter = self.influence.var(ddof=1) / len(self.influence)
        return math.sqrt(scatter + self.draws_variance)

    def half_width(self, level: float) -> float:
        """Half of the width of Student's t interval; the weight costs a degree of freedom."""
        return float(mean_half_width(self.error, len(self.influence) - 2, level))

    def missing_margin(self, runs: CorrectionRuns) -> float:
        """Distance that the missing runs may move the estimate, were each as far off as any run."""
        return runs.share_missing * float(np.abs(self.influence - self.value).max())


def corrected_mean(
    runs: CorrectionRuns,
    values: FloatArray,
    predictions: FloatArray,
    draws: FloatArray,
    exact: FloatArray | None = None,
) -> CorrectedMean:
    """Estimate the mean of a function of the output, with the weight of the least variance.

    Parameters
    ----------
    values, predictions : ndarray, shape (run,)
        The function of the output, by the model and by each run's fit.
    draws : ndarray, shape (fold, draw)
        The function of the predictions at the draws.
    exact : ndarray, shape (fold,), optional
        The mean of the function of each fit, where it is known without draws.
    """
    means, draws_variance = exact, 0.0
    if means is None:
        means = draws.mean(axis=1)
        error, _ = ratio_error(runs.pooled(draws), runs.draw_replicate, runs.draw_replicates)
        draws_variance = float(error) ** 2
    if runs.weights is not None:
        # Weights are on average 1: about the mean, they scale deviations only.
        centre = float(runs.shares @ means)
        values = centre + runs.weights * (values - centre)
        predictions = centre + runs.weights * (predictions - centre)
    centred = predictions - means[runs.fold]
    deviations = centred - centred.mean()
    scatter = float((deviations**2).mean()) + runs.size * draws_variance
    covariance = float((values * deviations).mean())
    weight = min(max(covariance / scatter, 0.0), 1.0) if scatter > 0 else 0.0
    return CorrectedMean(values - weight * centred, weight, weight**2 * draws_variance)


def tail_allowance(runs: CorrectionRuns) -> Margins:
    """Return how far rare values beyond the runs may move the mean of the output.

    A surrogate leaves errors that are smaller than the output, but with a heavier tail: few runs
    meet them. The allowance is the gap that the furthest runs leave, and twice what the surrogate
    has beyond them.
    """
    values = runs.means()
    return Margins(
        np.asarray(upper_allowance(runs, -values, -runs.draws)),
        np.asarray(upper_allowance(runs, values, runs.draws)),
    )


def upper_allowance(runs: CorrectionRuns, values: FloatArray, draws: FloatArray) -> float:
    """Return how far rare values above the runs may move the mean of a function of the output.

    Parameters
    ----------
    values : ndarray, shape (run,)
        The function at the runs.
    draws : ndarray, shape (fold, draw)
        The function of the predictions at the draws.
    """
    beyond = runs.pooled(np.maximum(draws - values.max(), 0.0)).mean()
    return spacing(values, runs.weights) + 2 * float(beyond)


def spacing(values: FloatArray, weights: FloatArray | None = None) -> float:
    """Return the gap below the largest value to the one with a tenth of the runs above, over n.

    A sample whose largest value happens to be small leaves a small gap where a large one is needed.
    The gap is therefore at least that up to the largest value that its tail lets expect.

    With weights, a tenth of the weight is above, and each run there has its part of that.
    """
    if weights is not None:
        return _weighted_spacing(values, weights)
    size = len(values)
    ranks = min(max(_FEWEST_SPACED, size // _SPACING_SHARE), size - 1)
    highest = np.sort(values)[-1 - ranks :]
    gap = float(highest[-1] - highest[0])
    if ranks >= _FEWEST_FITTED:
        gap = max(gap, _largest_to_expect(highest[1:] - highest[0]))
    return gap / size


def _largest_to_expect(excesses: FloatArray) -> float:
    """Return the largest of as many excesses to expect, by a generalized Pareto distribution.

    Its parameters follow from the first two L-moments of the excesses.

    Parameters
    ----------
    excesses : ndarray, shape (excess,)
        Ascending.
    """
    size = len(excesses)
    mean = float(excesses.mean())
    second = 2 * float((np.arange(size) * excesses).sum()) / (size * (size - 1)) - mean
    if not second > 0:
        return mean
    shape = min(max(2 - mean / second, _LEAST_SHAPE), _LARGEST_SHAPE)
    # The largest of n has its p-quantile where one value has that at p ** (1 / n).
    log_return = -math.log(-math.expm1(math.log(_LARGEST_AT) / size))
    growth = math.expm1(shape * log_return) / shape if shape else log_return
    return mean * (1 - shape) * growth


def _weighted_spacing(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(-values)
    above = np.cumsum(weights[order]) / len(values)
    ranks = int(np.searchsorted(above, 1 / _SPACING_SHARE)) + 1
    ranks = min(max(_FEWEST_SPACED, ranks), len(values) - 1)
    return float((values[order[0]] - values[order[ranks]]) * above[ranks - 1] / ranks)


# A surrogate that explains less says little of a tail that the runs have not met.
_LEAST_Q2 = 0.5

# Of the exponential function: a larger one is beyond all numbers.
_LARGEST_EXPONENT = 709.0


@dataclass(frozen=True)
class CorrectedMoments:
    """Corrected moments of one output."""

    runs: CorrectionRuns

    @cached_property
    def _mean(self) -> CorrectedMean:
        runs = self.runs
        exact = None if runs.exact_moments is None else runs.exact_moments[:, 0]
        return corrected_mean(runs, runs.means(), runs.predictions, runs.draws, exact)

    @cached_property
    def variance(self) -> CorrectedMean:
        """The mean of squares about the corrected mean; too small by the variance of that."""
        runs, centre, exact = self.runs, self._mean.value, None
        if runs.exact_moments is not None:
            means, stds = runs.exact_moments.T
            exact = stds**2 + (means - centre) ** 2
        predictions, draws = ((each - centre) ** 2 for each in (runs.predictions, runs.draws))
        return corrected_mean(runs, self._squares, predictions, draws, exact)

    @property
    def _squares(self) -> FloatArray:
        """Mean squares of the runs at each point about the corrected mean, shape (run,)."""
        return self.runs.means(lambda values: (values - self._mean.value) ** 2)

    @cached_property
    def variance_of_mean(self) -> CorrectedMean:
        """Variance of the mean given the inputs, without the noise of repeated runs."""
        return replace(self.variance, influence=self.variance.influence - self.runs.noise)

    def mean(self) -> Estimate:
        """Estimate the mean: Student's t over the runs, moved out for rare values beyond them."""
        found, runs = self._mean, self.runs
        half = found.half_width(runs.level) + found.missing_margin(runs)
        allowance = tail_allowance(runs)
        lower, upper = found.value - half - allowance.below, found.value + half + allowance.above
        method = texts.CORRECTED_STUDENT
        note = texts.DOUBTFUL_TAIL if runs.size < ENOUGH_RUNS_FOR_MEANS else ""
        return Estimate(found.value, float(lower), float(upper), method, "conservative", note)

    def std(self) -> Estimate:
        """Estimate the standard deviation, by the delta method on its logarithm."""
        found, runs = self.variance, self.runs
        total = found.value + self._mean.error**2
        if not total > 0:
            return Estimate.without_bounds(math.nan, texts.NO_VARIANCE_LEFT)
        value = math.sqrt(total)
        if reason := self.heavy_tail or self.hidden_tail:
            return Estimate.without_bounds(value, reason, texts.SEE_QUANTILES)
        squares, of_draws = self._squares, (runs.draws - self._mean.value) ** 2
        allowance = spacing(squares, runs.weights) + upper_allowance(runs, squares, of_draws)
        margin = found.half_width(runs.level) + allowance + found.missing_margin(runs)
        if runs.repeats is not None:
            # Of two values that are equally frequent, no point has an influence on the variance.
            margin += self._mean.half_width(runs.level) ** 2
        exponent = margin / (2 * total)
        factor = math.exp(exponent) if exponent < _LARGEST_EXPONENT else math.inf
        method = texts.CORRECTED_DELTA_ON_LOGARITHM
        note = texts.DOUBTFUL_TAIL if runs.size < ENOUGH_RUNS_FOR_TAILS else ""
        return Estimate(value, value / factor, value * factor, method, "conservative", note)

    @cached_property
    def kurtosis(self) -> float:
        """The largest kurtosis of the runs and of the fits."""
        runs = self.runs
        return max(kurtosis(runs.values, runs.weights), *map(kurtosis, runs.draws))

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


def kurtosis(values: FloatArray, weights: FloatArray | None = None) -> float:
    """Return the fourth standardized moment: 3 for a normal distribution, 0 for a constant."""
    deviations = values - np.average(values, weights=weights)
    if not (scale := float(np.abs(deviations).max())) > 0:
        return 0.0
    squares = (deviations / scale) ** 2
    second, fourth = (np.average(squares**power, weights=weights) for power in (1, 2))
    return float(fourth / second**2)


# Quantiles with their bounds, of surrogates and of stand-ins.


def quantile_probabilities(array: xr.DataArray) -> FloatArray:
    """Return the probabilities that an estimate array of quantiles or of percentiles is at."""
    if PERCENT in array.dims:
        return np.asarray(array[PERCENT].values / 100)
    return np.asarray(array[PROBABILITY].values)


def quantile_estimates(
    value: FloatArray, lower: FloatArray, upper: FloatArray, method: str, runs: int
) -> Estimate:
    """Return quantiles with a note where a number of runs is too small for a bound."""
    too_few = texts.TOO_FEW_RUNS.format(runs=runs)
    found = Estimate(value, lower, upper, method, "discrete")
    for text, end in ((texts.NO_LOWER_BOUND, lower), (texts.NO_UPPER_BOUND, upper)):
        found = found.replace_at(np.isnan(end), found.with_note(text.format(too_few=too_few)))
    return found
