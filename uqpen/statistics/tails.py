"""Tails of an output: generalised Pareto distributions beyond a threshold, and return levels."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import RETURN_PERIOD
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import ErrorModel, Sample

# Generalised Pareto distribution of excesses over a threshold, by maximum likelihood.

# The search goes over the logarithm of 1 + ξ x/σ at the largest excess x.
_ENDS, _GRID, _REFINEMENTS = (-9.0, 14.0), 47, 26
_GOLDEN = (5**0.5 - 1) / 2
# Nearer to an exponential distribution, its formulas are used.
_EXPONENTIAL = 1e-8


class TailFit(NamedTuple):
    """Generalised Pareto distributions of samples of excesses, shape (...)."""

    # Above 0 for a tail like a power, 0 for an exponential one, below 0 for one that ends.
    shape: FloatArray
    scale: FloatArray  # in the unit of the excesses
    anderson_darling: FloatArray  # anderson and Darling's statistic of the fit


def fit_tails(excesses: FloatArray) -> TailFit:
    """Fit a generalised Pareto distribution to each sample of excesses.

    The likelihood is that of one parameter, the ratio of the shape to the scale (Grimshaw, S. D.
    (1993). Technometrics 35, 185-191): the shape is the mean logarithm of 1 + ratio · excess.

    Parameters
    ----------
    excesses : ndarray, shape (..., run)
        Above 0.
    """
    largest = excesses.max(axis=-1, keepdims=True)
    grid = np.linspace(*_ENDS, _GRID)
    found = np.stack([_profile(excesses, largest, np.array([at])) for at in grid])
    best = np.clip(found.argmax(axis=0), 1, _GRID - 2)
    low, high = grid[best - 1][..., np.newaxis], grid[best + 1][..., np.newaxis]
    for _ in range(_REFINEMENTS):
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        is_left = _profile(excesses, largest, left) > _profile(excesses, largest, right)
        is_left = is_left[..., np.newaxis]
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
    ratio = np.expm1((low + high) / 2) / largest
    logarithms = np.log1p(ratio * excesses)
    shape = logarithms.mean(axis=-1)
    is_exponential = np.abs(shape) < _EXPONENTIAL
    safe = np.where(is_exponential, 1.0, ratio[..., 0])
    scale = np.where(is_exponential, excesses.mean(axis=-1), shape / safe)
    return TailFit(shape, scale, _anderson_darling(np.sort(excesses, axis=-1), shape, scale))


def _anderson_darling(ordered: FloatArray, shape: FloatArray, scale: FloatArray) -> FloatArray:
    runs, tiny = ordered.shape[-1], np.finfo(np.float64).tiny
    standard, shape = ordered / scale[..., np.newaxis], shape[..., np.newaxis]
    is_exponential = np.abs(shape) < _EXPONENTIAL
    safe = np.where(is_exponential, 1.0, shape)
    inside = np.maximum(1 + safe * standard, tiny)
    survival = np.where(is_exponential, -standard, -np.log(inside) / safe)
    below = np.log(np.maximum(-np.expm1(survival), tiny))
    weights = (2 * np.arange(1, runs + 1) - 1) / runs
    return -runs - (weights * (below + survival[..., ::-1])).sum(axis=-1)


def _profile(excesses: FloatArray, largest: FloatArray, at: FloatArray) -> FloatArray:
    """Return the log-likelihood for a ratio of shape and scale, over the number of excesses."""
    ratio = np.expm1(at) / largest
    shape = np.log1p(ratio * excesses).mean(axis=-1)
    ratio = np.broadcast_to(ratio[..., 0], shape.shape)
    is_exponential = np.abs(shape) < _EXPONENTIAL
    scale = np.where(
        is_exponential, excesses.mean(axis=-1), shape / np.where(is_exponential, 1.0, ratio)
    )
    # The likelihood has no maximum where the shape is below -1.
    return np.where(shape > -1, -np.log(scale) - shape - 1, -np.inf)


def log_likelihood(excesses: FloatArray, shape: float, scale: npt.ArrayLike) -> float:
    """Return the log-likelihood of a sample; minus infinity outside of its support."""
    size = float(scale)  # type: ignore[arg-type]
    if not size > 0:
        return -np.inf
    standard = excesses / size
    if abs(shape) < _EXPONENTIAL:
        return float(-len(excesses) * np.log(size) - standard.sum())
    inside = 1 + shape * standard
    if not inside.min() > 0:
        return -np.inf
    return float(-len(excesses) * np.log(size) - (1 + 1 / shape) * np.log(inside).sum())


# p-value of the fit of a generalised Pareto distribution, from a simulated table.

P_VALUES = (0.5, 0.25, 0.1, 0.05, 0.025, 0.01, 0.001)
SHAPES = (-0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)

# Values that Anderson and Darling's statistic exceeds with the probabilities above, for each
# shape, by simulation (`benchmarks/tail_fit_table.py`). Choulakian, V. and Stephens, M. A. (2001).
# Technometrics 43, 478-484, have a table of such points.
_POINTS = (
    (0.456, 0.668, 0.961, 1.183, 1.421, 1.754, 2.685),  # -0.5
    (0.422, 0.614, 0.870, 1.075, 1.277, 1.569, 2.277),  # -0.25
    (0.395, 0.563, 0.793, 0.966, 1.155, 1.397, 2.031),  # 0
    (0.373, 0.526, 0.731, 0.889, 1.045, 1.268, 1.826),  # 0.25
    (0.354, 0.498, 0.682, 0.829, 0.983, 1.174, 1.753),  # 0.5
    (0.345, 0.481, 0.656, 0.798, 0.936, 1.127, 1.635),  # 0.75
    (0.337, 0.466, 0.632, 0.761, 0.897, 1.072, 1.537),  # 1
)


def p_value(statistic: float, shape: float) -> float:
    """Return the p-value of Anderson and Darling's statistic of a fit, from 0.001 to 0.5.

    Parameters
    ----------
    statistic : float
        Its value.
    shape : float
        Of the fitted distribution; outside of the table, that of its end is taken.
    """
    table = np.array(_POINTS)
    points = [float(np.interp(shape, SHAPES, column)) for column in table.T]
    logarithms = [math.log(each) for each in P_VALUES]
    return math.exp(float(np.interp(statistic, points, logarithms)))


# Profile likelihood of a return level: generalised Pareto excesses, and how many there are.

# Steps of the search for an end of an interval, each further than the one before.
_STEPS = 60
# Of an end, relative to its excess or to the scale of all excesses.
_TOLERANCE = 1e-6
# Of parameters that the runs exclude: differences of it are numbers.
_IMPOSSIBLE = -1e300


@dataclass(frozen=True, eq=False)
class FittedTail:
    """Tail of a sample: runs beyond a threshold, and the distribution of their excesses."""

    ordered: FloatArray  # (run,): all runs, ascending, in the output's SI unit
    threshold: float  # in the same unit
    excesses: FloatArray  # (run,): of the runs beyond it
    shape: float  # of the fitted generalised Pareto distribution
    scale: float  # of the same
    p_value: float  # of the fit

    @property
    def share(self) -> float:
        """Share of the runs that lie beyond the threshold."""
        return len(self.excesses) / len(self.ordered)

    def return_level(self, period: float) -> float:
        """Return the value that is exceeded once in a number of cases."""
        return self.threshold + self.scale * _growth(math.log(period * self.share), self.shape)

    def interval(self, period: float, level: float) -> tuple[float, float]:
        """Return the values that twice the logarithm of the likelihood ratio does not exclude.

        Parameters
        ----------
        period : float
            Number of cases.
        level : float
            Two-sided. The quantile is that of Student's t, squared, as the excesses are few.
        """
        found = self.return_level(period) - self.threshold
        profile = _Profile(self, period)
        limit = student_quantile(len(self.excesses) - 2, level) ** 2 / 2
        best = profile(found)

        def excluded(at: float) -> float:
            return best - profile(at) - limit

        highest = self.threshold + self._end(excluded, found, 1.1)
        if excluded(0.0) > 0:
            return self.threshold + self._end(excluded, found, 0.9), highest
        return self._end_below(period, limit), highest

    def _end(self, excluded: Callable[[float], float], start: float, factor: float) -> float:
        """Return where a likelihood is as small as the limit; infinite, or 0, without an end."""
        inner, step = start, factor
        for _ in range(_STEPS):
            outer = inner * step
            if excluded(outer) > 0:
                found = scipy.optimize.brentq(
                    excluded, inner, outer, xtol=_TOLERANCE * self.scale, rtol=_TOLERANCE
                )
                return float(found)
            inner, step = outer, step**1.1
        return math.inf if factor > 1 else 0.0

    def _end_below(self, period: float, limit: float) -> float:
        """Return the lower end where the threshold is not excluded as the level.

        The tail says nothing below its threshold. There the number of runs beyond a value decides,
        whose likelihood at the threshold is that of the tail.
        """
        runs = len(self.ordered)

        def is_excluded(beyond: int) -> bool:
            largest = _counted(beyond, runs, beyond / runs)
            return largest - _counted(beyond, runs, 1 / period) > limit

        counts = range(len(self.excesses), runs)
        return float(self.ordered[-counts[bisect_left(counts, True, key=is_excluded)]])


@dataclass(eq=False)
class _Profile:
    """The largest log-likelihood of a return level, over the shape and the share beyond."""

    tail: FittedTail
    period: float
    # A search for an end asks for a level again, and has to be told the same.
    _found: dict[float, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # The second parameter is log(log(period · share)). A level close to the threshold has a
        # share close to 1/period, which the share itself does not resolve.
        at_fit = math.log(math.log(self.period * self.tail.share))
        self._start = np.array([self.tail.shape, at_fit])

    def __call__(self, excess: float) -> float:
        """Return it for a return level, given its excess over the threshold."""
        if excess not in self._found:
            self._found[excess] = self._largest(excess)
        return self._found[excess]

    def _largest(self, excess: float) -> float:
        if not excess > 0:  # its limit as the level comes down to the threshold
            tail = self.tail
            counted = _counted(len(tail.excesses), len(tail.ordered), 1 / self.period)
            return log_likelihood(tail.excesses, tail.shape, tail.scale) + counted
        simplex = self._start + np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])
        found = scipy.optimize.minimize(
            lambda at: -self._likelihood(excess, *at),
            self._start,
            method="Nelder-Mead",
            options={"xatol": 1e-5, "fatol": 1e-6, "initial_simplex": simplex},
        )
        if found.fun < -_IMPOSSIBLE:
            self._start = found.x  # the next level is near
        return -float(found.fun)

    def _likelihood(self, excess: float, shape: float, logarithm: float) -> float:
        # A shape below -1 has no largest likelihood, and a share is below 1.
        most = math.log(self.period)
        if not -1 < shape < 5 or not logarithm < math.log(most):
            return _IMPOSSIBLE
        growth = math.exp(logarithm)
        share = math.exp(growth - most)
        if not (growth > 0 and share < 1):
            return _IMPOSSIBLE
        counted = _counted(len(self.tail.excesses), len(self.tail.ordered), share)
        scale = excess / _growth(growth, shape)
        return max(log_likelihood(self.tail.excesses, shape, scale) + counted, _IMPOSSIBLE)


def _counted(beyond: int, runs: int, share: float) -> float:
    """Return the log-likelihood of a share, given how many of the runs lie beyond."""
    return beyond * math.log(share) + (runs - beyond) * math.log1p(-share)


def _growth(logarithm: float, shape: float) -> float:
    """Return the quantile of the standard distribution that one in a number exceeds.

    Parameters
    ----------
    logarithm : float
        Of the number.
    shape : float
        Of the distribution.
    """
    if abs(shape) <= 1e-8:
        return logarithm
    power = shape * logarithm
    return math.expm1(power) / shape if power < 700 else math.inf


# Choice of the threshold beyond which a tail is fitted.

FEWEST_BEYOND = 50
"""Number of runs beyond a threshold that a fit needs."""

FEWEST_RUNS = 500
"""Number of runs that a fit needs: a tail has a tenth of them at the most."""

# The error of a fit falls with the runs beyond, and its bias rises: the number grows slowly.
_FACTOR, _POWER = 10.0, 1 / 3
_STEP = 2**0.5
# A fit with a smaller p-value is rejected.
_SMALLEST_P_VALUE = 0.1


def fitting_tails(ordered: FloatArray) -> Iterator[FittedTail]:
    """Yield the tails that a generalised Pareto distribution fits, from the lowest threshold.

    The thresholds leave min(n/10, 10 n^(1/3)) of n runs beyond them, then 1/√2 of the runs before,
    down to 50. A fit is rejected where Anderson and Darling's p-value is below 0.1.

    Parameters
    ----------
    ordered : ndarray, shape (run,)
        The values, ascending.
    """
    runs = len(ordered)
    beyond = min(runs / 10, _FACTOR * runs**_POWER)
    while round(beyond) >= FEWEST_BEYOND:
        number = round(beyond)
        threshold = float(ordered[runs - number - 1])
        excesses = ordered[runs - number :] - threshold
        excesses = excesses[excesses > 0]  # a value may stand in several runs
        if len(excesses) >= FEWEST_BEYOND and excesses[0] < excesses[-1]:
            fit = fit_tails(excesses)
            shape, scale = float(fit.shape), float(fit.scale)
            found = p_value(float(fit.anderson_darling), shape)
            if found >= _SMALLEST_P_VALUE:
                yield FittedTail(ordered, threshold, excesses, shape, scale, found)
        beyond /= _STEP


# Return levels: values that an output exceeds once in a number of cases, from a fitted tail.

# The likelihood of a tail that ends more abruptly is not regular.
_SMALLEST_SHAPE = -0.5


def return_levels(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate return levels of an output, by a generalised Pareto distribution of its tail.

    Yields
    ------
    name : str
        ``return_level``; of the tail ``tail_threshold``, ``tail_shape``, ``tail_scale``,
        ``tail_runs`` and ``tail_p_value``.
    estimate : DataArray
        ``return_level`` along ``return_period``, a number of cases, and ``bound``; the others along
        ``bound``.

    References
    ----------
    Coles, S. (2001). An Introduction to Statistical Modeling of Extreme Values. Springer.
    """
    asked = quantity.requested(CATALOGUE["return_level"])
    if quantity.output.categories or not asked:
        return
    reason = sample.reason_without_intervals
    if not reason and sample.weights is not None:
        reason = texts.NOT_WEIGHTED
    if not reason and bool(sample.is_constant):
        reason = texts.CONSTANT_OUTPUT
    if not reason and sample.size < FEWEST_RUNS:
        reason = texts.FEW_RUNS_FOR_A_TAIL.format(runs=FEWEST_RUNS)
    tails = [] if reason else list(fitting_tails(sample.sorted_values))
    if not reason and not tails:
        reason = texts.NO_TAIL_FITS.format(runs=FEWEST_BEYOND)
    if tails and tails[0].shape < _SMALLEST_SHAPE:
        reason = texts.TAIL_ENDS.format(shape=tails[0].shape)
    unit, title = quantity.output.unit, quantity.output.title
    described = {"units": "1", "long_name": "number of cases"}
    periods = np.array(asked)
    yield (
        "return_level",
        Estimate.stack(
            [_return_level(sample, tails, reason, each) for each in asked],
            RETURN_PERIOD,
            units=unit,
            long_name=f"value that {title} exceeds once in a number of cases",
            coordinates={RETURN_PERIOD: (RETURN_PERIOD, periods, described)},
            level=sample.level,
        ),
    )
    of_tail = [math.nan] * 5
    if tails:
        first = tails[0]
        count = float(len(first.excesses))
        of_tail = [first.threshold, first.shape, first.scale, count, first.p_value]
    names, units = ("threshold", "shape", "scale", "runs", "p_value"), (unit, "1", unit, "1", "1")
    for name, own_unit, value in zip(names, units, of_tail, strict=True):
        estimate = Estimate.without_bounds(value, reason or texts.PART_OF_FIT)
        long_name = f"tail {name.replace('_', ' ')} of {title}"
        yield f"tail_{name}", estimate.to_array(units=own_unit, long_name=long_name)


def _return_level(
    sample: Sample, tails: Sequence[FittedTail], reason: str, period: float
) -> Estimate:
    """Estimate the level of a period; the interval is that of all tails that fit."""
    if reason:
        return Estimate.without_bounds(math.nan, reason)
    first = tails[0]
    if period * first.share <= 1:
        return Estimate.without_bounds(math.nan, texts.BELOW_THE_TAIL)
    regular = [
        each for each in tails if each.shape >= _SMALLEST_SHAPE and period * each.share > 1 + 1e-9
    ]
    ends = np.array([each.interval(period, sample.level) for each in regular])
    notes = [texts.TAIL_OF_RUNS.format(runs=len(first.excesses), p_value=first.p_value)]
    if period > sample.size:
        notes.append(texts.BEYOND_ALL_RUNS)
    if sample.missing.size:
        notes.append(texts.MISSING_FROM_TAIL.format(runs=sample.missing.size))
    is_independent = sample.error_model is ErrorModel.INDEPENDENT
    label = "nominal" if is_independent else "conservative"
    lower, upper = float(ends[:, 0].min()), float(ends[:, 1].max())
    method = texts.PROFILE_LIKELIHOOD_OF_TAILS
    found = Estimate(first.return_level(period), lower, upper, method, label)
    if not math.isfinite(upper):
        return Estimate.without_bounds(found.value, texts.TAIL_WITHOUT_BOUND)
    return found.with_note(*notes)
