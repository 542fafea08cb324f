"""Corrected mean: a surrogate's mean over cheap draws plus what real runs say of its error.

The predictions are a control variate whose mean is known. Their weight is tuned, so that a useless
surrogate gives the plain mean of the runs.

References
----------
Angelopoulos, A. N. et al. (2023). Science 382, 669-674.
Zrnic, T. & Candès, E. J. (2024). Proc. Natl. Acad. Sci. 121, e2322083121 (cross-fitting).
Hosking, J. R. M. & Wallis, J. R. (1987). Technometrics 29, 339-349 (generalized Pareto).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics.intervals import ratio_error, student_quantile
from uqpen.statistics.skewness import Margins
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = ["CorrectedMean", "corrected_mean", "spacing", "tail_allowance", "upper_allowance"]

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
    """Mean of a function of the output, corrected by real runs.

    Parameters
    ----------
    influence : ndarray, shape (run,)
        Values whose mean is the estimate.
    weight : float
        Weight of the surrogate, from 0 to 1.
    draws_variance : float
        Variance of the estimate that comes from the draws of the surrogate.
    """

    influence: FloatArray
    weight: float
    draws_variance: float

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
        return student_quantile(len(self.influence) - 2, level) * self.error

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
    runs : CorrectionRuns
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
    return Margins(
        np.asarray(upper_allowance(runs, -runs.values, -runs.draws)),
        np.asarray(upper_allowance(runs, runs.values, runs.draws)),
    )


def upper_allowance(runs: CorrectionRuns, values: FloatArray, draws: FloatArray) -> float:
    """Return how far rare values above the runs may move the mean of a function of the output.

    Parameters
    ----------
    runs : CorrectionRuns
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
