"""Accuracy of methods over the repeats of a benchmark, and verdicts on which is best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.results.digits import grouped_number, range_text
from uqpen.results.texts import join_names
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.intervals import student_quantile

__all__ = [
    "NO_VERDICT",
    "Accuracy",
    "ErrorRatio",
    "Verdict",
    "convergence_slope",
    "error_ratio",
    "find_verdict",
    "reference_remark",
    "root_mean_square_errors",
    "verdict_sentence",
]

# Accuracy of estimates, its convergence rate and its comparison: formulas over repeats.
#
# All formulas use logarithms of root mean square errors, because methods differ by factors. The
# errors of estimates are usually far from normal, so their squares do not follow a chi-square
# distribution. The standard error of a logarithm is estimated by the jackknife over repeats.

# With a kurtosis of the errors above this, too few repeats dominate their mean square for a
# reliable interval; for normally distributed errors the kurtosis is 3.
_HEAVY_KURTOSIS = 6.0


@dataclass(frozen=True)
class Accuracy:
    """Root mean square errors.

    Parameters
    ----------
    logarithm : ndarray
        Natural logarithm of each; minus infinity where no repeat has an error, NaN where some
        repeat has no estimate.
    error : ndarray
        Standard error of each logarithm; NaN where it cannot be estimated.
    is_heavy : ndarray of bool
        True where a few of the repeats dominate it, so that rarer ones may make it larger.
    repeats : int
        Number of repeats.
    """

    logarithm: FloatArray
    error: FloatArray
    is_heavy: BoolArray
    repeats: int

    def __getitem__(self, at: Any) -> Accuracy:
        return Accuracy(self.logarithm[at], self.error[at], self.is_heavy[at], self.repeats)

    @property
    def reliable_error(self) -> FloatArray:
        """Standard error of each logarithm; NaN where a few of the repeats decide."""
        return np.where(self.is_heavy, np.nan, self.error)

    @property
    def bounds(self) -> FloatArray:
        """Root mean squares and their `reliable_error` bounds, along a last axis."""
        half = student_quantile(self.repeats - 1, LEVEL) * self.reliable_error
        ends = [self.logarithm, self.logarithm - half, self.logarithm + half]
        return np.asarray(np.exp(np.stack(ends, axis=-1)))


@dataclass(frozen=True)
class ErrorRatio:
    """Factor by which one method's error is below another's, and its interval."""

    factor: float
    lower: float
    upper: float

    @property
    def is_significant(self) -> bool:
        """True if the interval lies above 1."""
        return self.lower > 1


def root_mean_square_errors(errors: FloatArray) -> Accuracy:
    """Return root mean squares over repeats, with the jackknife's errors of their logarithms.

    Parameters
    ----------
    errors : ndarray, shape (..., repeat)
        Estimates less the truth.

    References
    ----------
    Efron, B. & Stein, C. (1981). Ann. Stat. 9, 586-596.
    """
    repeats = errors.shape[-1]
    squares = errors**2
    total = squares.sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(total / repeats) / 2
        # The differences of large numbers may come out below zero by rounding.
        others = np.maximum(total[..., np.newaxis] - squares, 0.0)
        without = np.log(others / (repeats - 1)) / 2
        deviations = without - without.mean(axis=-1, keepdims=True)
        variance = (deviations**2).sum(axis=-1) * (repeats - 1) / repeats
        # Over the largest, as the squares of squares of what is small vanish.
        scaled = squares / squares.max(axis=-1, keepdims=True)
        kurtosis = repeats * (scaled**2).sum(axis=-1) / scaled.sum(axis=-1) ** 2
    error = np.sqrt(np.where(np.isfinite(variance), variance, np.nan))
    return Accuracy(logarithm, error, kurtosis > _HEAVY_KURTOSIS, repeats)


def convergence_slope(
    logarithm: FloatArray, error: FloatArray, runs: FloatArray, repeats: int
) -> FloatArray:
    """Return the slope of the straight line through logarithms of errors over those of runs.

    The line is fitted by least squares. The interval covers the noise of the errors only: it is the
    interval of the line through these budgets, even if the errors do not lie on a line.

    Parameters
    ----------
    logarithm, error : ndarray, shape (budget, ...)
        Of `Accuracy`.
    runs : ndarray, shape (budget,)
        Number of runs.
    repeats : int
        Number of repeats of each error.

    Returns
    -------
    ndarray, shape (..., 3)
        Estimate, lower and upper bound; NaN with fewer than two budgets.
    """
    distance = np.log(runs) - np.log(runs).mean()
    square = float((distance**2).sum())
    if not square > 0:
        return np.full((*logarithm.shape[1:], 3), np.nan)
    weights = distance / square
    with np.errstate(invalid="ignore"):
        estimate = np.einsum("b,b...", weights, logarithm)
    half = student_quantile(repeats - 1, LEVEL) * np.sqrt(np.einsum("b,b...", weights**2, error**2))
    estimate = np.where(np.isfinite(estimate), estimate, np.nan)
    return np.stack([estimate, estimate - half, estimate + half], axis=-1)


def error_ratio(
    ahead: tuple[float, float], behind: tuple[float, float], repeats: int
) -> ErrorRatio:
    """Estimate the factor between two errors whose repeats are independent of each other.

    Each is given by its logarithm and the standard error of that.

    References
    ----------
    Welch, B. L. (1947). Biometrika 34, 28-35.
    """
    if ahead[0] == behind[0]:  # both may be minus infinity
        return ErrorRatio(1.0, math.nan, math.nan)
    difference = behind[0] - ahead[0]
    if math.isinf(difference):
        return ErrorRatio(math.inf, math.inf, math.inf)
    variance = ahead[1] ** 2 + behind[1] ** 2
    if not variance > 0:
        certain = math.exp(difference) if variance == 0 else math.nan
        return ErrorRatio(math.exp(difference), certain, certain)
    freedom = (repeats - 1) * variance**2 / (ahead[1] ** 4 + behind[1] ** 4)
    half = student_quantile(freedom, LEVEL) * math.sqrt(variance)
    return ErrorRatio(
        math.exp(difference), math.exp(difference - half), math.exp(difference + half)
    )


# Verdicts: the best method at each budget, for each statistic, and its significance.

# Largest half-width of the reference's own 95 % interval, relative to an error, without a remark:
# the error is then wrong by a few per cent at most.
_COARSE = 0.5

_FEW_DECIDE = "few of the repeats decide that"
_UNRESOLVED = "its errors are no larger than the reference's own"

NO_VERDICT = "no two methods have figures to compare"


@dataclass(frozen=True)
class Verdict:
    """Verdict of one comparison of methods.

    Parameters
    ----------
    winner, runner_up : str
        The methods with the smallest errors.
    lead : ErrorRatio
        The lead of the winner over the runner-up.
    level : tuple of str
        The methods, the winner first, whose errors do not differ significantly from its own.
    doubt : str
        Reason why the lead may not be real; empty for none. A few bad scrambles dominate the mean
        square error of scrambled points on a smooth function. So where a few repeats dominate, or
        all errors are as small as the reference's own, rarer repeats may change the order.
    """

    winner: str
    runner_up: str
    lead: ErrorRatio
    level: tuple[str, ...]
    doubt: str = ""


def find_verdict(
    names: Sequence[str], accuracies: Accuracy, resolution: float = 0.0
) -> Verdict | None:
    """Return the verdict of one comparison; None with fewer than two methods with estimates.

    Parameters
    ----------
    names : sequence of str
        Of the methods.
    accuracies : Accuracy
        Of shape (method,).
    resolution : float
        Error of the reference itself; NaN for unknown.
    """
    logarithm, error = accuracies.logarithm.tolist(), accuracies.error.tolist()
    order = [i for i in np.argsort(logarithm, kind="stable") if not math.isnan(logarithm[i])]
    if len(order) < 2:
        return None
    best = order[0]
    leads = {
        i: error_ratio((logarithm[best], error[best]), (logarithm[i], error[i]), accuracies.repeats)
        for i in order[1:]
    }
    # A method whose error a few repeats dominate is not level: it is behind, or ahead in doubt.
    is_heavy = accuracies.is_heavy
    level = [best, *(i for i, over in leads.items() if not (over.is_significant or is_heavy[i]))]
    ahead = leads[order[1]]
    is_decided = ahead.is_significant or len(level) > 1
    doubt = "" if is_decided and not is_heavy[best] else _FEW_DECIDE
    if math.exp(logarithm[best]) < resolution:
        doubt = _UNRESOLVED
    return Verdict(
        winner=names[best],
        runner_up=names[order[1]],
        lead=ErrorRatio(ahead.factor, math.nan, math.nan) if doubt else ahead,
        level=tuple(names[i] for i in level),
        doubt=doubt,
    )


def verdict_sentence(verdict: Verdict | None, budget: int) -> str:
    """Return a verdict in words.

    >>> close = ErrorRatio(1.1, 0.8, 1.5)
    >>> verdict_sentence(Verdict("sobol", "halton", close, ("sobol", "halton")), 128)
    'at 128 runs sobol and halton are level'
    """
    where = f"at {grouped_number(budget)} runs"
    if verdict is None:
        return f"{where} {NO_VERDICT}"
    if len(verdict.level) > 1:
        return f"{where} {join_names(verdict.level)} are level"
    over = verdict.lead
    if math.isinf(over.factor):
        return f"{where} {verdict.winner} alone is exact"
    if verdict.doubt:
        seen = f"{verdict.winner} is ahead of {verdict.runner_up}"
        return f"{where} {seen} by a factor of {_factor_text(over.factor)}, but {verdict.doubt}"
    factor, lower, upper = map(_factor_text, (over.factor, over.lower, over.upper))
    lead = f"{verdict.winner} leads {verdict.runner_up} by a factor of {factor}"
    return f"{where} {lead} ({range_text(lower, upper)})"


def reference_remark(error: float, half_width: float) -> str:
    """Return a remark on the half-width of the reference's interval, which may be NaN.

    It is compared with the smallest error that was measured against the reference.
    """
    if math.isnan(error):
        return ""
    if math.isnan(half_width):
        return "the reference has no interval here, so how far it is off is not known"
    if half_width > error:
        return "the smallest error is no larger than the reference's own"
    if half_width > _COARSE * error:
        return "the reference's own error is a good part of the smallest: take a larger --reference"
    return ""


def _factor_text(value: float) -> str:
    """Return a factor in two or three digits."""
    if value < 10:
        return f"{value:.2g}" if value < 1 else f"{value:.1f}"
    return f"{value:.0f}" if value < 1e5 else f"{value:.1g}"
