"""Formulas of confidence intervals, independent of designs and datasets.

The coverage of each formula on each design was measured, and `uqpen.statistics` makes the choice.
Levels are two-sided unless stated otherwise. A bound that does not exist at the given number of
runs is NaN.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy

from uqpen.core.arrays import FloatArray, IntArray


def student_quantile(freedom: float, level: float) -> float:
    """Half-width of Student's t interval in standard errors; NaN below one degree of freedom."""
    return math.nan if freedom < 1 else float(scipy.special.stdtrit(freedom, 0.5 + level / 2))


def mean_half_width(error: npt.ArrayLike, freedom: float, level: float) -> FloatArray:
    """Half-width of a mean's interval, from its standard error, for every kind of source."""
    return np.asarray(student_quantile(freedom, level) * np.asarray(error))


def student_interval(
    value: float | FloatArray,
    error: npt.ArrayLike,
    freedom: float,
    level: float,
    *,
    lowest: float = -math.inf,
    highest: float = math.inf,
) -> tuple[FloatArray, FloatArray]:
    """Student's t interval of estimates with a standard error, within a range."""
    half = student_quantile(freedom, level) * np.asarray(error)
    return np.maximum(value - half, lowest), np.minimum(value + half, highest)


def group_sums(values: FloatArray, group: IntArray, groups: int) -> FloatArray:
    """Return the sums of values over the groups of their last axis.

    Parameters
    ----------
    values : ndarray, shape (..., run)
    group : ndarray of int, shape (run,)
        The group of each run, from 0.
    groups : int
        Number of groups.

    Returns
    -------
    ndarray, shape (..., group)
    """
    rows = math.prod(values.shape[:-1])
    own = group if rows == 1 else np.arange(rows)[:, None] * groups + group
    sums = np.bincount(own.ravel(), values.ravel(), rows * groups).astype(np.float64, copy=False)
    return sums.reshape(*values.shape[:-1], groups)


def ratio_error(
    influence: FloatArray, replicate: IntArray, replicates: int
) -> tuple[FloatArray, float]:
    """Standard error of a mean from the scatter of its replicates.

    Failed runs leave replicates of unequal size, so the mean is a ratio of sums. Its error follows
    from the scatter of the replicates' sums of deviations.

    Parameters
    ----------
    influence : ndarray, shape (..., run)
        Values whose mean is estimated, at any places.
    replicate : ndarray of int, shape (run,)
        The replicate of each run, from 0.
    replicates : int
        Number of replicates.

    Returns
    -------
    error : ndarray, shape (...)
    freedom : float
        Its degrees of freedom.
    """
    deviation = influence - influence.mean(axis=-1, keepdims=True)
    sums = group_sums(deviation, replicate, replicates)
    return error_of_sums(sums, len(replicate)), replicates - 1


def error_of_sums(sums: FloatArray, runs: int) -> FloatArray:
    """Return the error of `ratio_error` from each replicate's sum of deviations."""
    replicates = sums.shape[-1]
    scale = replicates / runs
    return np.sqrt(scale**2 * (sums**2).sum(axis=-1) / (replicates * (replicates - 1)))


def ratio_jackknife_error(
    numerator: FloatArray, denominator: FloatArray, group: IntArray, groups: int
) -> tuple[FloatArray, float]:
    """Standard error of a ratio of sums, by leaving out one group after the other.

    The groups may be of unequal size (Busing, F. M. T. A., Meijer, E. & van der Leeden, R. (1999).
    Stat. Comput. 9, 3-8).

    Parameters
    ----------
    numerator, denominator : ndarray, shape (..., row)
        The terms of the sums.
    group : ndarray of int, shape (row,)
        The group of each row, from 0. No group is empty or contains all of the denominator.
    groups : int
        Number of groups.

    Returns
    -------
    error : ndarray, shape (...)
        Standard error of the ratio.
    freedom : float
        Its degrees of freedom.
    """
    above, below = (group_sums(column, group, groups) for column in (numerator, denominator))
    sum_above, sum_below = (sums.sum(axis=-1, keepdims=True) for sums in (above, below))
    without = (sum_above - above) / (sum_below - below)
    fold = len(group) / np.bincount(group, minlength=groups)
    whole = sum_above / sum_below
    pseudo_values = fold * whole - (fold - 1) * without
    centre = groups * whole - ((1 - 1 / fold) * without).sum(axis=-1, keepdims=True)
    variance = ((pseudo_values - centre) ** 2 / (fold - 1)).mean(axis=-1)
    return np.sqrt(variance), groups - 1


def fieller_margins(
    error: npt.ArrayLike,
    covariance: npt.ArrayLike,
    denominator_error: npt.ArrayLike,
    quantile: float,
) -> tuple[FloatArray, FloatArray]:
    """Return the distances from a ratio to the ends of its set, which is Fieller's.

    The set has all ratios θ for which numerator - θ · denominator does not differ from 0. It is no
    interval where the denominator does not differ from 0 itself; its ends are then infinite.

    Parameters
    ----------
    error : array_like, shape (...)
        Standard error of the ratio by the delta method.
    covariance : array_like, shape (...)
        Of the errors of the ratio and of the denominator, the latter over the denominator.
    denominator_error : array_like, shape (...)
        Standard error of the denominator, over the denominator.
    quantile : float
        Half-width of an interval in standard errors.

    Returns
    -------
    below, above : ndarray, shape (...)

    References
    ----------
    Fieller, E. C. (1954). J. R. Statist. Soc. B 16, 175-185.
    """
    squared = quantile**2
    left = 1 - squared * np.square(denominator_error)
    shift = squared * np.asarray(covariance)
    half = np.sqrt(shift**2 + squared * np.square(error) * np.maximum(left, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = [np.where(left > 0, each / left, math.inf) for each in (half + shift, half - shift)]
    return ends[0], ends[1]


def additive_residual_error(influence: FloatArray, inputs: FloatArray) -> tuple[FloatArray, float]:
    """Standard error of a mean over one Latin hypercube.

    Stratification removes the part that is additive in the inputs from the mean's variance. The
    rest is the variance about an additive fit (Stein 1987, Technometrics 29, 143-151; Owen 1992, J.
    R. Statist. Soc. B 54, 541-551). The fit is piecewise constant over √n bins of each input's
    ranks, by backfitting.

    Parameters
    ----------
    influence : ndarray, shape (..., run)
        Values whose mean is estimated, at any places.
    inputs : ndarray, shape (run, input)
        The random inputs; only their order counts.

    Returns
    -------
    error : ndarray, shape (...)
        Standard error of the mean.
    freedom : float
        Degrees of freedom of the residuals.
    """
    runs, dimension = inputs.shape
    # At least half of the runs are left to the residuals.
    bins = min(math.isqrt(runs), runs // (2 * dimension)) if dimension else 1
    if runs < 2 or bins < 2:
        freedom = runs - 1
        if not freedom:
            return np.full(influence.shape[:-1], np.nan), freedom
        return influence.std(axis=-1, ddof=1) / math.sqrt(runs), freedom
    order = np.argsort(inputs, axis=0, kind="stable")
    label = np.empty((dimension, runs), dtype=np.int64)
    for column in range(dimension):
        label[column, order[:, column]] = np.arange(runs) * bins // runs
    residual = _additive_residual(influence - influence.mean(axis=-1, keepdims=True), label, bins)
    freedom = runs - 1 - dimension * (bins - 1)
    return np.sqrt((residual**2).sum(axis=-1) / freedom / runs), freedom


def _additive_residual(residual: FloatArray, label: IntArray, bins: int) -> FloatArray:
    """Residual of an additive, piecewise constant fit."""
    sizes = [np.bincount(column, minlength=bins) for column in label]
    # Ranks of a Latin hypercube are all but orthogonal between inputs: each sweep shrinks what
    # is left of the fit by about bins / runs, so a few reach rounding.
    for _ in range(6):
        for column, size in zip(label, sizes, strict=True):
            residual = residual - (group_sums(residual, column, bins) / size)[..., column]
    return residual


def clopper_pearson(
    events: npt.ArrayLike, runs: npt.ArrayLike, level: float
) -> tuple[FloatArray, FloatArray]:
    """Exact binomial interval of a probability (Clopper & Pearson 1934, Biometrika 26, 404-413).

    `events` of the `runs` had the event; the probability inside the interval is at least `level`.
    Effective numbers of runs need not be whole.
    """
    k, n = np.asarray(events, dtype=np.float64), np.asarray(runs, dtype=np.float64)
    if n.ndim == 0:
        # Few numbers of events stand at many places, and the inverse takes its time.
        distinct, place = np.unique(k, return_inverse=True)
        lower, upper = _exact_intervals(distinct.tobytes(), float(n), level)
        return lower[place].reshape(k.shape), upper[place].reshape(k.shape)
    return _binomial_ends(k, n, level)


@lru_cache(64)
def _exact_intervals(events: bytes, runs: float, level: float) -> tuple[FloatArray, FloatArray]:
    """Return the intervals of some numbers of events, which hundreds of outputs have in common."""
    return _binomial_ends(np.frombuffer(events), np.asarray(runs), level)


def _binomial_ends(k: FloatArray, n: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    tail, quantile = (1 - level) / 2, scipy.special.betaincinv
    with np.errstate(invalid="ignore"):
        lower = np.where(k > 0, quantile(np.where(k > 0, k, 1), n - k + 1, tail), 0.0)
        upper = np.where(k < n, quantile(k + 1, np.where(k < n, n - k, 1), 1 - tail), 1.0)
    return lower, upper


def order_statistic_ranks(
    runs: int, probability: npt.ArrayLike, level: float
) -> tuple[FloatArray, FloatArray]:
    """Ranks (from 1) whose values enclose a quantile; NaN where the runs do not suffice.

    The number of runs below the quantile is binomial, so the interval needs no assumption about
    the distribution. Ranks are discrete, so its coverage is at least `level`.
    """
    if np.ndim(probability) == 0:
        low, high = _enclosing_ranks(runs, float(np.asarray(probability)), level)
        return np.asarray(low), np.asarray(high)
    return _ranks(runs, np.asarray(probability, dtype=np.float64), level)


@lru_cache(1024)
def _enclosing_ranks(runs: int, probability: float, level: float) -> tuple[float, float]:
    """Return the ranks of one quantile, which hundreds of outputs have in common."""
    low, high = _ranks(runs, np.asarray(probability), level)
    return float(low), float(high)


def _ranks(runs: int, probability: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    tail = (1 - level) / 2
    upper = upper_rank(runs, probability, 1 - tail)
    mirrored = upper_rank(runs, 1 - probability, 1 - tail)
    return runs + 1 - mirrored, upper


def upper_rank(runs: int, probability: npt.ArrayLike, confidence: float) -> FloatArray:
    """Rank (from 1) of a one-sided upper bound of a quantile; NaN where the runs do not suffice.

    The smallest u with P(Binomial(runs, p) <= u - 1) >= confidence (Wilks 1941, Ann. Math.
    Statist. 12, 91-96).
    """
    p = np.asarray(probability, dtype=np.float64)
    # The continuous inverse is right to within one, which the two comparisons mend.
    guess = np.floor(scipy.special.bdtrik(confidence, runs, p)).clip(0, runs)
    guess = np.where(scipy.special.bdtr(guess, runs, p) < confidence, guess + 1, guess)
    before = (guess >= 1) & (scipy.special.bdtr(np.maximum(guess - 1, 0), runs, p) >= confidence)
    rank = np.where(before, guess - 1, guess) + 1
    return np.where(rank <= runs, rank, np.nan)


def runs_needed(probability: float, confidence: float) -> int:
    """Fewest independent runs whose largest value bounds a quantile from above.

    >>> runs_needed(0.95, 0.95)
    59
    """
    return math.ceil(math.log1p(-confidence) / math.log(probability))


def runs_needed_for_both(content: float, confidence: float) -> int:
    """Fewest independent runs whose smallest and largest value enclose a share of all cases.

    >>> runs_needed_for_both(0.95, 0.95)
    93
    """
    # Two runs at least: the smallest is not the largest. The probability rises with the runs.
    lowest, highest = 1, 2
    while scipy.special.bdtr(highest - 2, highest, content) < confidence:
        lowest, highest = highest, 2 * highest
    while highest - lowest > 1:
        middle = (lowest + highest) // 2
        if scipy.special.bdtr(middle - 2, middle, content) < confidence:
            lowest = middle
        else:
            highest = middle
    return highest


def dkw_half_width(runs: int, level: float) -> float:
    """Half-width of a simultaneous band about an empirical distribution function.

    The inequality of Dvoretzky, Kiefer and Wolfowitz with Massart's constant (1990, Ann. Probab.
    18, 1269-1283).
    """
    return math.sqrt(math.log(2 / (1 - level)) / (2 * runs)) if runs else math.nan


def bonett_price(
    gained: npt.ArrayLike,
    dropped: npt.ArrayLike,
    runs: npt.ArrayLike,
    level: float,
    *,
    squares: npt.ArrayLike | None = None,
    heaviest: float = 1.0,
) -> tuple[FloatArray, FloatArray]:
    """Return centre and half-width of the interval of a difference of paired probabilities.

    Of weighted runs, the one run that is added to each kind of disagreement has the largest weight,
    as nobody knows where the next disagreement is.

    Parameters
    ----------
    gained, dropped : array_like
        Numbers of runs where the event happened by the model alone, and by the surrogate alone.
    runs : array_like
        Their total.
    level : float
        Two-sided.
    squares : array_like, optional
        Of weighted runs, the sum of the squares of the weights in both. The numbers are then sums
        of weights.
    heaviest : float
        The largest weight of a run.

    References
    ----------
    Bonett, D. G. & Price, R. M. (2012). J. Educ. Behav. Stat. 37, 479-488.
    """
    size = np.asarray(runs, dtype=np.float64) + 2
    one, other = ((np.asarray(each, dtype=np.float64) + 1) / size for each in (gained, dropped))
    both = one + other if squares is None else (np.asarray(squares) + 2 * heaviest**2) / size
    variance = (both - (one - other) ** 2) / size
    return one - other, scipy.special.ndtri(0.5 + level / 2) * np.sqrt(variance)


def equivalent_runs(width: FloatArray, plain_width: FloatArray, runs: int) -> FloatArray:
    """Return how many plain runs would have intervals of some widths; NaN where that is unknown.

    The width of a plain interval falls with the root of the number of runs.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        found = runs * (plain_width / width) ** 2
    return np.where(np.isfinite(found), found, math.nan)


# Functions that ought to ascend, such as distribution functions and their bounds.


def largest_up_to(found: FloatArray) -> FloatArray:
    """Return the largest of all values up to each."""
    return np.maximum.accumulate(found)


def least_from(found: FloatArray) -> FloatArray:
    """Return the least of all values from each on."""
    return np.minimum.accumulate(found[::-1])[::-1]


def ascending(found: FloatArray) -> FloatArray:
    """Return the ascending function that is nearest in the largest distance.

    If the true function ascends, it is no farther from that. A function that is nowhere above
    another one stays so, and bounds contain their estimate.

    >>> ascending(np.array([0.0, 0.5, 0.25, 1.0])).tolist()
    [0.0, 0.375, 0.375, 1.0]
    """
    return (largest_up_to(found) + least_from(found)) / 2
