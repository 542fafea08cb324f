"""Least squares: the values of unknown inputs at which a model is nearest to measurements."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares, minimize
from scipy.special import ndtri, stdtrit

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem, StudyError
from uqpen.core.labels import (
    DRAW,
    EXPERIMENT,
    MEASURED,
    MOVED_AXIS,
    SEARCH_ORIGIN,
    SEARCH_START,
    SEARCH_STARTS,
    WEIGHTED_AT,
)
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, flag
from uqpen.core.streams import Stream
from uqpen.designs.at_experiments import LimitedMeasuredDesign
from uqpen.designs.design import NO_STEP_BETWEEN_LABELS, Rounds
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput, points_dataset
from uqpen.measurements.experiments import Experiments
from uqpen.measurements.likelihood import NormalLikelihood

# Numbers of the coordinate that says which input a run moves; 0 and above are inputs.
NO_AXIS = -1
NOISE_AXIS = -2

# Noise of a model: runs on a line, so close to each other that a smooth model is straight there.

NOISE_RUNS = 9
# Distances of these runs, in standard deviations of the priors: the next where the nearest runs
# are as if there were noise alone, or all alike.
_DISTANCES = (1e-6, 1e-4, 1e-2)
# Variance of a difference of third order, of independent errors with the variance 1.
_OF_THIRD_ORDER = 20.0
# The change over all of the runs has to be this many times the noise.
_CLEAR = 10.0

# Least and largest step of a difference quotient, in standard deviations of the prior; and that
# where the noise could not be measured.
SMALLEST_STEP, _LARGEST_STEP = 1e-4, 0.1
_UNKNOWN_STEP = 3e-3
# Least step near a minimum, in standard errors of an unknown.
_FINER_STEP = 1e-3
_MOST_REFINEMENTS = 4
# Noise beyond this part of the standard deviation of a residual is measured at each minimum.
_NOTICEABLE = 1e-7


def noise_line(dimension: int, distance: float) -> FloatArray:
    """Return steps along the diagonal of all unknowns, shape (run, unknown); one of them is 0."""
    along = distance * (np.arange(NOISE_RUNS) - NOISE_RUNS // 2)
    return np.repeat(along[:, np.newaxis], dimension, axis=1) / math.sqrt(dimension)


class ModelNoise(NamedTuple):
    """Noise of a model in whitened residuals, as nine runs close to each other show it."""

    size: float  # root mean square over the residuals; NaN where too few runs completed
    slope: float  # the same of the change along the line, for one standard deviation of the priors
    distance: float  # of the runs, in standard deviations of the priors

    @classmethod
    def of(cls, residuals: FloatArray, distance: float) -> ModelNoise:
        """Return the noise in the runs of a line, by their differences of third order.

        Parameters
        ----------
        residuals : ndarray, shape (run, residual)
            In the order of the line; NaN where a run failed.
        distance : float
            Distance of neighbours.

        References
        ----------
        Moré, J. J. & Wild, S. M. (2011). SIAM J. Sci. Comput. 33, 1292-1314.
        """
        third = np.diff(residuals, 3, axis=0)
        third = third[np.isfinite(third).all(axis=1)]
        completed = np.flatnonzero(np.isfinite(residuals).all(axis=1))
        if not len(third):
            return cls(math.nan, math.nan, distance)
        first, last = completed[0], completed[-1]
        change = (residuals[last] - residuals[first]) / ((last - first) * distance)
        size = math.sqrt(float((third**2).mean()) / _OF_THIRD_ORDER)
        return cls(size, math.sqrt(float((change**2).mean())), distance)

    @property
    def is_clear(self) -> bool:
        """False where the runs are so close that the noise hides what the inputs change."""
        change = self.slope * self.distance * (NOISE_RUNS - 1)
        return math.isnan(self.size) or change > _CLEAR * self.size

    @property
    def hidden(self) -> float:
        """Change of a residual that the noise may hide."""
        return 0.0 if math.isnan(self.size) else 3 * self.size

    def finer_steps(self, steps: FloatArray, at: LinearModel) -> FloatArray:
        """Return steps that are short beside standard errors, where the noise allows it."""
        part = max((self.hidden / at.scale) ** (1 / 3), _FINER_STEP)
        return np.minimum(steps, part * at.scale * at.standard_errors)

    @property
    def step(self) -> float:
        """Step of central difference quotients, in standard deviations of the priors.

        It makes the error by noise as large as that by the curvature of a model whose third
        derivative, for one standard deviation, is as large as its first.
        """
        if math.isnan(self.size):
            return _UNKNOWN_STEP
        relative = self.size / self.slope if self.slope > 0 else 0.0
        return min(max((3 * relative) ** (1 / 3), SMALLEST_STEP), _LARGEST_STEP)


# Difference quotients from the runs around a point.


def difference_quotient(
    at_point: FloatArray, moved: FloatArray, offsets: FloatArray
) -> FloatArray | None:
    """Return the derivative at a point from the two nearest runs that completed.

    It is of second order; of first order from one run.

    Parameters
    ----------
    at_point : ndarray, shape (residual,)
    moved : ndarray, shape (run, residual)
        NaN where the run failed.
    offsets : ndarray, shape (run,)

    Returns
    -------
    ndarray or None
        None where all runs failed.
    """
    # Far out, a step may be lost in rounding.
    completed = np.flatnonzero(np.isfinite(moved).all(axis=1) & (offsets != 0))
    if not len(completed):
        return None
    nearest = completed[np.argsort(np.abs(offsets[completed]), kind="stable")][:2]
    slopes = (moved[nearest] - at_point) / offsets[nearest, np.newaxis]
    if len(nearest) == 1:
        one_sided: FloatArray = slopes[0]
        return one_sided
    first, second = offsets[nearest]
    quotient: FloatArray = (second * slopes[0] - first * slopes[1]) / (second - first)
    return quotient


# Steps from a point by the linear model of the residuals there.


@dataclass(frozen=True)
class SearchSettings:
    """Settings of a search."""

    errors_are_known: bool = True  # whether the residuals have the variance 1
    at_most: int = 10_000  # runs
    level: float = 0.0  # confidence level of profile-likelihood intervals; 0 for none
    freedom: float = math.inf  # degrees of freedom of errors that are known from repeats
    # A search goes on until the next step is this part of a standard error.
    precision: float = 1e-6

    def quantile(self, level: float, freedom: int) -> float:
        """Half-width of an interval in standard errors: normal where errors are known, else t."""
        upper = 0.5 + level / 2
        if self.errors_are_known and math.isinf(self.freedom):
            return float(ndtri(upper))
        freedom = int(self.freedom) if self.errors_are_known else freedom
        return float(stdtrit(freedom, upper)) if freedom > 0 else math.nan


# A step that changes all unknowns by less, in standard errors, is too short to go on.
_TOO_SHORT = 1e-8
# Within this part of a standard error of a minimum, profiles are followed from it.
NEAR_MINIMUM = 0.05
# So near to the end of its support, in its standard errors, an unknown is held there.
_AT_END = 1e-3


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Residuals of a model and their derivatives at a point."""

    point: FloatArray  # (unknown,): in standard deviations of the priors, from their medians
    residuals: FloatArray  # (residual,): whitened, so that the variance of each is 1 or unknown
    jacobian: FloatArray  # (residual, unknown)
    lower: FloatArray  # (unknown,): ends of the supports of the priors
    upper: FloatArray
    settings: SearchSettings

    @property
    def sum_of_squares(self) -> float:
        """Sum of squares of the residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def freedom(self) -> int:
        """Number of residuals beyond that of the unknowns."""
        residuals, unknowns = self.jacobian.shape
        return residuals - unknowns

    @property
    def scale(self) -> float:
        """Standard deviation of a residual: 1 where errors are known."""
        if self.settings.errors_are_known or self.freedom < 1:
            return 1.0
        return math.sqrt(self.sum_of_squares / self.freedom)

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors where the variance of residuals is 1; infinite for what is not seen."""
        _, values, right = np.linalg.svd(self.jacobian, full_matrices=False)
        with np.errstate(divide="ignore"):
            found: FloatArray = np.sqrt(((right / values[:, np.newaxis]) ** 2).sum(axis=0))
        return found

    @property
    def end_distance(self) -> FloatArray:
        """Distance from an end at which an unknown is held there, shape (unknown,)."""
        with np.errstate(divide="ignore"):
            found: FloatArray = _AT_END / np.sqrt((self.jacobian**2).sum(axis=0))
        return found

    def is_at_end(self, axis: int) -> bool:
        """Return whether an unknown is held at an end of its range."""
        distance = min(self.point[axis] - self.lower[axis], self.upper[axis] - self.point[axis])
        return bool(distance < self.end_distance[axis])

    @property
    def is_minimum(self) -> bool:
        """True where the next step is short beside the standard errors."""
        return self.newton_step[1] <= NEAR_MINIMUM * self.scale

    @property
    def profile_level(self) -> float:
        """Sum of squares at the ends of profile-likelihood intervals about this minimum."""
        quantile = self.settings.quantile(self.settings.level, self.freedom)
        return self.sum_of_squares + (quantile * self.scale) ** 2

    @cached_property
    def newton_step(self) -> tuple[FloatArray, float]:
        """Step of Gauss and Newton's method, and how much it changes the residuals.

        An unknown that the step leads out of its support is held where it is at the end.
        """
        free = np.ones(len(self.point), dtype=np.bool_)
        while True:
            step = np.zeros(len(self.point))
            if free.any():
                step[free] = np.linalg.lstsq(self.jacobian[:, free], -self.residuals, rcond=None)[0]
            distance = np.where(step < 0, self.point - self.lower, self.upper - self.point)
            leaves = free & (np.abs(step) > distance) & (distance < self.end_distance)
            if not leaves.any():
                return step, float(np.linalg.norm(self.jacobian @ step))
            free &= ~leaves

    def profile_step(self, level: float, axis: int, side: int) -> FloatArray | None:
        """Return the step to where the sum of squares is at a level, and one unknown at its end.

        Parameters
        ----------
        level : float
            Sum of squares.
        axis, side : int
            Number of the unknown, and 1 for its upper end or -1 for its lower.

        Returns
        -------
        ndarray or None
            Shape (unknown,). None where the derivatives do not determine all unknowns.

        References
        ----------
        Venzon, D. J. & Moolgavkar, S. H. (1988). Applied Statistics 37, 87-94.
        """
        left, values, right = np.linalg.svd(self.jacobian, full_matrices=False)
        if len(values) < len(self.point) or values[-1] <= values[0] * np.finfo(float).eps:
            return None
        nearest = -right.T @ ((left.T @ self.residuals) / values)
        rest = self.residuals + self.jacobian @ nearest
        room = max(level - float(rest @ rest), 0.0)
        inverse = right.T @ (right[:, axis] / values**2)
        step: FloatArray = nearest + side * math.sqrt(room / inverse[axis]) * inverse
        return step


# Search: SciPy's method started again from the runs so far, until it needs no other.


class LeastSquaresPoints(NamedTuple):
    """Points of a round of a search."""

    points: FloatArray  # (run, unknown): in standard deviations of the priors, from their medians
    start: IntArray  # (run,): number of the start or, behind these, of the end of a profile
    origin: IntArray  # (run,): run that it is a step from; -1 for a point of the search itself
    # (run,): unknown that is moved; `NO_AXIS`, or `NOISE_AXIS`. Behind the unknowns: two for each
    # input that is new in each experiment, moved downwards and upwards.
    axis: IntArray

    @classmethod
    def around(
        cls, point: FloatArray, run: int, moved: int, *, with_point: bool = False
    ) -> LeastSquaresPoints:
        """Return the points that move each input which is new in each experiment, by both sides.

        With the point itself, that is run number `run`.
        """
        axis = len(point) + np.arange(2 * moved)
        if with_point:
            axis = np.append(NO_AXIS, axis)
        origin = np.where(axis == NO_AXIS, -1, run)
        return cls(np.tile(point, (len(axis), 1)), np.zeros_like(axis), origin, axis)

    @classmethod
    def joined(cls, rounds: Iterable[LeastSquaresPoints], dimension: int) -> LeastSquaresPoints:
        """Return the points of several rounds, in their order."""
        none = np.empty(0, dtype=np.int64)
        nothing = cls(np.empty((0, dimension)), none, none, none)
        return cls(*map(np.concatenate, zip(nothing, *rounds, strict=True)))


class SearchEnd(NamedTuple):
    """The end of a search."""

    flat: set[int]  # unknowns with which the residuals change at no start
    minima: Mapping[int, LinearModel | None]  # where the search from each start has ended


class _Missing(Exception):  # noqa: N818
    """The runs that a search lacks: those at a point, or some around it."""

    def __init__(self, points: list[tuple[FloatArray, int]], around: FloatArray) -> None:
        super().__init__()
        self.points = points  # each with the unknown that is moved, or `NO_AXIS`
        self.around = around.tobytes()


class _Ended(Exception):  # noqa: N818
    """The end of a search, at a point that has converged or has no derivatives."""


class KnownRuns:
    """Residuals at the points of a search so far.

    Parameters
    ----------
    lower, upper : ndarray, shape (unknown,)
        Ends of the supports of the priors.
    settings : SearchSettings
    """

    def __init__(self, lower: FloatArray, upper: FloatArray, settings: SearchSettings) -> None:
        self.lower, self.upper, self.settings = lower, upper, settings
        self.runs = 0
        # By the bytes of a point: the number of its run, and its residuals.
        self.numbers: dict[bytes, int] = {}
        self.residuals: dict[bytes, FloatArray] = {}
        self._models: dict[bytes, LinearModel] = {}  # by the bytes of a point and of its steps

    def add(self, asked: LeastSquaresPoints, residuals: FloatArray) -> None:
        """Add the runs of a round; those that move other inputs are counted alone."""
        for point, axis, found in zip(asked.points, asked.axis, residuals, strict=True):
            if axis < len(point):
                self.numbers.setdefault(point.tobytes(), self.runs)
                self.residuals.setdefault(point.tobytes(), found)
            self.runs += 1

    def at(self, point: FloatArray, steps: FloatArray) -> FloatArray:
        """Return the residuals at a point; they and those around it are missing together."""
        known = self.residuals.get(point.tobytes())
        if known is None:
            raise _Missing([(point, NO_AXIS), *self._around(point, steps)], point)
        return known

    def linear_model(self, point: FloatArray, steps: FloatArray) -> LinearModel:
        """Return the residuals at a point with their derivatives by steps, shape (unknown,)."""
        key = point.tobytes() + steps.tobytes()
        if key not in self._models:
            residuals = self.at(point, steps)
            jacobian = self._jacobian(point, residuals, steps)
            around = self.lower, self.upper, self.settings
            self._models[key] = LinearModel(point, residuals, jacobian, *around)
        return self._models[key]

    def _around(self, point: FloatArray, steps: FloatArray) -> list[tuple[FloatArray, int]]:
        """Return points with one unknown moved, and its number: to both sides, or both inwards."""
        factors = np.tile([-1.0, 1.0], (len(point), 1))
        factors[point - steps < self.lower] = 1.0, 2.0
        factors[point + steps > self.upper] = -1.0, -2.0
        offsets = factors * steps[:, np.newaxis]
        is_axis = np.eye(len(point), dtype=np.bool_)
        return [
            (np.where(is_axis[axis], point + by, point), axis)
            for axis, both in enumerate(offsets)
            for by in both
        ]

    def _jacobian(self, point: FloatArray, residuals: FloatArray, steps: FloatArray) -> FloatArray:
        columns: dict[int, FloatArray] = {}
        # Where both runs of a quotient fail, one with smaller steps stands for it.
        for own_steps in (steps, steps / 8):
            around = [each for each in self._around(point, own_steps) if each[1] not in columns]
            lacking = [each for each in around if each[0].tobytes() not in self.residuals]
            if lacking:
                raise _Missing(lacking, point)
            for axis in {axis for _, axis in around}:
                moved = [each for each, of in around if of == axis]
                offsets = np.array([each[axis] - point[axis] for each in moved])
                runs = np.array([self.residuals[each.tobytes()] for each in moved])
                if (quotient := difference_quotient(residuals, runs, offsets)) is not None:
                    columns[axis] = quotient
        if len(columns) < len(point):
            raise _Ended
        return np.stack([columns[axis] for axis in range(len(point))], axis=1)


# The end of a profile is found where the next step is this part of its distance.
PROFILE_FOUND = 0.01
_PROFILE_STEPS = 20
# Parts of a step that are tried: it may not lead higher than so many times the height of the end.
_PROFILE_PARTS = tuple(2.0**-halved for halved in range(8))
_PROFILE_ROOM = 100.0
# SciPy stops where steps are shorter, in standard deviations of the priors.
_SHORTEST_STEP = 1e-12
_MOST_STEPS = 600


def search_least_squares(
    starts: FloatArray, known: KnownRuns
) -> Generator[LeastSquaresPoints, FloatArray, SearchEnd]:
    """Search the least sum of squares from several starts at once, then the ends of its profiles.

    Each round has the next point of each search, with the runs of its difference quotients. Steps
    are those of SciPy's trust-region reflective method. A point whose run fails is a step too long.

    Parameters
    ----------
    starts : ndarray, shape (start, unknown)
        In standard deviations of the priors, from their medians.
    known : KnownRuns
        The runs so far, if any, and the settings; other runs are added.

    Yields
    ------
    LeastSquaresPoints
        It is sent the whitened residuals of their runs, shape (run, residual), with NaN where a run
        failed.

    References
    ----------
    Branch, M. A., Coleman, T. F. & Li, Y. (1999). SIAM J. Sci. Comput. 21, 1-23.
    """
    for distance in _DISTANCES:
        line = starts[0] + noise_line(starts.shape[1], distance)
        at = np.zeros(len(line), dtype=np.int64)
        # The run in the middle is that of the start itself.
        axis = np.where((line == starts[0]).all(axis=1), NO_AXIS, NOISE_AXIS)
        if not all(point.tobytes() in known.residuals for point in line):
            asked = LeastSquaresPoints(line, at, at - 1, axis)
            known.add(asked, (yield asked))
        residuals = np.array([known.residuals[point.tobytes()] for point in line])
        noise = ModelNoise.of(residuals, distance)
        if noise.is_clear:
            break
    steps = np.full(starts.shape[1], noise.step)

    def descend(start: FloatArray) -> LinearModel | None:
        return _Descent(known, steps, noise).minimum(start)

    searches = {number: partial(descend, start) for number, start in enumerate(starts)}
    ended = yield from _advance_together(known, searches)
    flat = [
        {*np.flatnonzero(~at.jacobian.any(axis=0)).tolist()}
        for number, at in ended.items()
        if at is not None and (at.point == starts[number]).all()
    ]
    if len(flat) == len(starts) and (everywhere := set.intersection(*flat)):
        return SearchEnd(everywhere, ended)
    found = [each for each in ended.values() if each is not None and each.is_minimum]
    if known.settings.level and found:
        least = min(found, key=lambda each: each.sum_of_squares)
        finer = noise.finer_steps(steps, least)
        chains = {
            len(starts) + 2 * axis + (side > 0): partial(
                _follow_profile, known, finer, least, axis, side
            )
            for axis in range(starts.shape[1])
            for side in (-1, 1)
        }
        yield from _advance_together(known, chains)
    return SearchEnd(set(), ended)


def _advance_together(
    known: KnownRuns, searches: Mapping[int, Callable[[], LinearModel | None]]
) -> Generator[LeastSquaresPoints, FloatArray, dict[int, LinearModel | None]]:
    """Yield the points that searches lack, all in one round; return where those that ended did."""
    ended: dict[int, LinearModel | None] = {}
    going = [*searches]
    while going:
        wanted: dict[bytes, tuple[FloatArray, int, int, bytes]] = {}
        for number in [*going]:
            try:
                ended[number] = searches[number]()
                going.remove(number)
            except _Missing as missing:
                for point, axis in missing.points:
                    row = point, number, axis, missing.around
                    wanted.setdefault(point.tobytes(), row)
        if not wanted or known.runs + len(wanted) > known.settings.at_most:
            break
        numbers = known.numbers | {key: known.runs + place for place, key in enumerate(wanted)}
        rows = [*wanted.values()]
        asked = LeastSquaresPoints(
            np.array([point for point, *_ in rows]),
            np.array([number for _, number, *_ in rows]),
            np.array([-1 if axis == NO_AXIS else numbers[key] for *_, axis, key in rows]),
            np.array([axis for _, _, axis, _ in rows]),
        )
        known.add(asked, (yield asked))
    return ended


class _Descent:
    """Search from a start, made from the runs so far: where they do not suffice, it is missing."""

    def __init__(self, known: KnownRuns, steps: FloatArray, noise: ModelNoise) -> None:
        self._known, self._steps, self._noise = known, steps, noise
        self._last: LinearModel | None = None

    def minimum(self, start: FloatArray) -> LinearModel | None:
        """Return the last point, as far as the search comes; None where the start has no runs.

        Where the residuals do not change with an unknown, the start is the last point.
        """
        if not np.isfinite(self._known.at(start, self._steps)).all():
            return None
        with suppress(_Ended):  # the derivatives at the start, or by finer steps, are not known
            last = self._move_to(start)
            if not last.jacobian.any(axis=0).all():
                return last
            for _ in range(_MOST_REFINEMENTS):
                last, is_at_end = self._descended(last)
                self._noise = self._noise_near(last)
                finer = self._noise.finer_steps(self._steps, last)
                if not is_at_end or (finer >= self._steps / 2).all():
                    break
                self._steps = finer
                last = self._move_to(last.point)
        return self._last

    def _descended(self, at: LinearModel) -> tuple[LinearModel, bool]:
        """Return where SciPy's method comes by the present steps, and if it ends by itself."""
        is_at_end = True
        with suppress(_Ended), np.errstate(all="ignore"):
            found = least_squares(
                self._residuals,
                at.point,
                self._derivatives,
                (self._known.lower, self._known.upper),
                x_scale=1.0,
                ftol=None,
                xtol=_SHORTEST_STEP,
                gtol=None,
                max_nfev=_MOST_STEPS,
            )
            is_at_end = found.status > 0
        return self._last or at, is_at_end

    def _noise_near(self, at: LinearModel) -> ModelNoise:
        """Return the noise at a point, measured there where it is large enough to matter."""
        found = self._noise
        if not found.size > _NOTICEABLE * at.scale:
            return found
        errors = np.minimum(at.scale * at.standard_errors, 1.0)
        for distance in _DISTANCES:
            line = at.point + errors * noise_line(len(at.point), distance)
            inside = np.clip(line, self._known.lower, self._known.upper)
            known = [self._known.residuals.get(each.tobytes()) for each in inside]
            if any(each is None for each in known):
                pairs = zip(inside, known, strict=True)
                raise _Missing([(each, NOISE_AXIS) for each, run in pairs if run is None], at.point)
            found = ModelNoise.of(np.array(known), distance)
            if found.is_clear:
                break
        return self._noise if math.isnan(found.size) else found

    def _move_to(self, point: FloatArray) -> LinearModel:
        self._last = self._known.linear_model(point, self._steps)
        return self._last

    def _residuals(self, point: FloatArray) -> FloatArray:
        last = self._last
        if last is not None and (step := point - last.point).any():
            length = float(np.linalg.norm(last.jacobian @ step))
            self._end_within(last, length, _TOO_SHORT)
        return self._known.at(point, self._steps)

    def _derivatives(self, point: FloatArray) -> FloatArray:
        last = self._move_to(point)
        self._end_within(last, last.newton_step[1], self._known.settings.precision)
        return last.jacobian

    def _end_within(self, at: LinearModel, length: float, part: float) -> None:
        """End the search where a step is this part of standard errors, or the noise hides it."""
        if length <= max(part * at.scale, self._noise.hidden * math.sqrt(len(at.point))):
            raise _Ended


def _follow_profile(
    known: KnownRuns, steps: FloatArray, least: LinearModel, axis: int, side: int
) -> LinearModel | None:
    """Return the end of a profile; None where it is not found."""
    at, level = least, least.profile_level
    highest = least.sum_of_squares + _PROFILE_ROOM * (level - least.sum_of_squares)
    for _ in range(_PROFILE_STEPS):
        step = at.profile_step(level, axis, side)
        if step is None or is_profile_end(at, step, least, axis):
            return at
        for part in _PROFILE_PARTS:
            point = np.clip(at.point + part * step, known.lower, known.upper)
            # NaN of a failed run is not below.
            if (known.at(point, steps) ** 2).sum() <= highest:
                break
        else:
            return None
        try:
            at = known.linear_model(point, steps)
        except _Ended:
            return None
    return at


def is_profile_end(at: LinearModel, step: FloatArray, least: LinearModel, axis: int) -> bool:
    """Return whether the end of a profile is where the next step leads, which is a short one."""
    distance = abs(at.point[axis] + step[axis] - least.point[axis])
    return at is not least and abs(step[axis]) <= PROFILE_FOUND * distance


# Weights of the residuals, where their covariance depends on results of the model.

# Weights are good where another step of them moves the unknowns by less, in standard errors.
_WEIGHED = 0.01
_MOST_WEIGHTS = 10
# Number of the run by whose results residuals are weighted at first: none.
NO_RUN = -1
# The square of a residual has to be a number.
_LARGEST_RESIDUAL = 1e100


def weighted_likelihood(
    measured: Experiments, searched: LeastSquaresPoints, predicted: FloatArray, run: int
) -> NormalLikelihood:
    """Return the likelihood of results whose errors have the covariance at those of one run.

    Parameters
    ----------
    measured : Experiments
    searched : LeastSquaresPoints
        The runs so far.
    predicted : ndarray, shape (run, row)
        Their results.
    run : int
        Its number; `NO_RUN` for the measured values in place of results.
    """
    errors, sizes = measured.errors, np.array(measured.errors.scales)
    if run == NO_RUN:
        return measured.likelihood.at(errors.covariance(measured.values, sizes))
    at, (rows, dimension) = predicted[run], (predicted.shape[1], searched.points.shape[1])
    of_run = (searched.origin == run) & (searched.axis >= dimension)
    ends = predicted[of_run][: 2 * len(measured.moved)].reshape(-1, 2, rows)
    completed = np.isfinite(ends)
    # Of a failed run, the other one stands for both.
    low, high = np.moveaxis(np.where(completed, ends, at), 1, 0)
    slopes = (high - low) / np.where(completed.all(axis=1), 2, 1)
    if errors.sizes and not errors.has_one_unknown_size:
        # The sizes under which results are the likeliest, for the unknowns fitted.
        def deviance(logarithms: FloatArray) -> float:
            covariance = errors.covariance(at, np.exp(logarithms), slopes)
            return -float(measured.likelihood.at(covariance).log_density(at[np.newaxis])[0])

        tolerances = {"xatol": 1e-6, "fatol": 1e-9}
        with np.errstate(over="ignore"):
            found = minimize(deviance, np.log(sizes), method="Nelder-Mead", options=tolerances)
        sizes = np.exp(found.x) * math.sqrt(rows / max(rows - dimension, 1))
    return measured.likelihood.at(errors.covariance(at, sizes, slopes))


def usable_residuals(likelihood: NormalLikelihood, predicted: FloatArray) -> FloatArray:
    """Return whitened residuals, shape (run, residual); NaN where there is none to square."""
    found = likelihood.residuals(predicted)
    is_usable = (np.abs(found) < _LARGEST_RESIDUAL).all(axis=1, keepdims=True)
    return np.where(is_usable, found, np.nan)


def search_experiments(
    starts: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    settings: SearchSettings,
    measured: Experiments,
) -> Generator[tuple[LeastSquaresPoints, int], FloatArray, set[int]]:
    """Search as `search_least_squares` does, with weights that are found together with the minimum.

    Where the covariance of the residuals depends on results of the model, it is that at the minimum
    so far. The search starts again from there, until the minimum stays.

    Yields
    ------
    points : LeastSquaresPoints
        It is sent the results of their runs at the rows of the measurements, shape (run, row).
    weighted_at : int
        Number of the run by whose results residuals are weighted.

    Returns
    -------
    set of int
        The unknowns with which the residuals change at no start.

    References
    ----------
    Seber, G. A. F. & Wild, C. J. (2003). Nonlinear Regression, section 2.8. Wiley.
    """
    rounds: list[tuple[LeastSquaresPoints, FloatArray]] = []  # with the results
    moved, run = len(measured.moved), NO_RUN
    reached: list[FloatArray] = []  # minima so far
    is_weighted = measured.errors.is_fixed
    if not is_weighted:
        asked = LeastSquaresPoints.around(starts[0], 0, moved, with_point=True)
        rounds.append((asked, (yield asked, NO_RUN)))
        run = NO_RUN if np.isnan(rounds[0][1][0]).any() else 0
    while True:
        whole = LeastSquaresPoints.joined((each for each, _ in rounds), starts.shape[1])
        predicted = np.concatenate([np.empty((0, len(measured.values))), *(y for _, y in rounds)])
        likelihood = weighted_likelihood(measured, whole, predicted, run)
        # Ends of profiles are looked for once, and weights are good to a part of a standard error.
        stage = settings
        if not measured.errors.is_fixed:
            level, part = (settings.level, 0.1) if is_weighted else (0.0, 1.0)
            stage = replace(settings, level=level, precision=part * _WEIGHED)
        known = KnownRuns(lower, upper, stage)
        known.add(whole, usable_residuals(likelihood, predicted))
        search = search_least_squares(starts, known)
        try:
            asked = next(search)
            while True:
                rounds.append((asked, (yield asked, run)))
                with one_blas_thread():
                    asked = search.send(usable_residuals(likelihood, rounds[-1][1]))
        except StopIteration as stopped:
            ended: SearchEnd = stopped.value
        found = [each for each in ended.minima.values() if each is not None]
        if is_weighted or ended.flat or not found:
            return ended.flat
        least = min(found, key=lambda each: each.sum_of_squares)
        near = _WEIGHED * least.standard_errors
        stays = any((np.abs(least.point - each) < near).all() for each in reached[-1:])
        if is_weighted := stays or len(reached) == _MOST_WEIGHTS:
            continue
        reached.append(least.point)
        run = known.numbers[least.point.tobytes()]
        # Searches go on where they have ended, or else begin again.
        lasts = [ended.minima.get(number) for number in range(len(starts))]
        pairs = zip(starts, lasts, strict=True)
        starts = np.array([start if at is None else at.point for start, at in pairs])
        if moved:
            if known.runs + 2 * moved > settings.at_most:
                return set()
            asked = LeastSquaresPoints.around(least.point, run, moved)
            rounds.append((asked, (yield asked, run)))


# The design: the unknowns of a study, and the points of its search.

# The other starts are within this share of each prior.
_BOX = 0.98
# A search leaves out this share of it: where the data teach next to nothing, it would go anywhere.
_OUTSIDE = 1e-3
# So far inside the end of a support a search stays, in standard deviations of the prior.
_INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Working coordinates of a search: unknowns from the medians of their priors, in their std."""

    names: tuple[str, ...]
    median: FloatArray  # (unknown,): in SI units
    std: FloatArray  # standard deviations of the priors, or half the 68 % of one that has none
    # Ends of the search in working coordinates: nearly all of the priors, and what the model takes.
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def of(cls, joint: JointDistribution, names: tuple[str, ...]) -> Unknowns:
        """Return the coordinates of some random inputs."""
        entries = {each.variable.name: each for each in joint.random}
        rows = []
        for entry in (entries[name] for name in names):
            prior, possible = entry.distribution, entry.variable.bounds
            lower = max(float(prior.ppf(np.array(_OUTSIDE / 2))), possible.lower)
            upper = min(float(prior.isf(np.array(_OUTSIDE / 2))), possible.upper)
            rows.append((entry.nominal, prior_scale(entry), lower, upper))
        median, std, lowest, highest = np.array(rows).T
        inside = (lowest - median) / std + _INSIDE, (highest - median) / std - _INSIDE
        return cls(names, median, std, *inside)

    def starts(self, joint: JointDistribution, number: int, stream: Stream) -> FloatArray:
        """Return the medians and, beside them, Sobol' points of the box of the priors."""
        found = np.zeros((number, len(self.names)))
        if number > 1:
            rng = stream.generator("starts")
            unit = sobol_points(rng, number - 1, len(self.names))
            entries = {each.variable.name: each.distribution for each in joint.random}
            at = 0.5 + _BOX * (unit - 0.5)
            values = np.array([entries[name].ppf(at[:, k]) for k, name in enumerate(self.names)])
            found[1:] = self.working(values.T)
        return np.clip(found, self.lower, self.upper)

    def working(self, values: FloatArray) -> FloatArray:
        """Return working coordinates of values in SI units, both along a last axis of unknowns."""
        working: FloatArray = (values - self.median) / self.std
        return working

    def in_si(self, working: FloatArray) -> FloatArray:
        """Return values in SI units, along a last axis of unknowns."""
        values: FloatArray = self.median + self.std * working
        return values


# Probability below one standard deviation of a normal distribution.
_LOW = 0.15865525393145707


def prior_scale(entry: RandomInput) -> float:
    """Return half the width of the middle 68 % of an input, its standard deviation if normal."""
    prior = entry.distribution
    low, high = (float(prior.ppf(np.array(each))) for each in (_LOW, 1 - _LOW))
    return (high - low) / 2


# Confidence level of profile-likelihood intervals.
PROFILE_LEVEL = 0.95


@dataclass(frozen=True)
class LeastSquares(LimitedMeasuredDesign):
    """Search of the unknowns with the least sum of squares, from several starts.

    Steps of difference quotients follow from the noise of the model, which nine runs measure.

    Parameters
    ----------
    starts : int
        Number of starts: the medians of the priors, and Sobol' points between their 1 % and 99 %
        quantiles.
    profile : bool
        Whether to look for the ends of profile-likelihood intervals, too.

    References
    ----------
    Branch, M. A., Coleman, T. F. & Li, Y. (1999). SIAM J. Sci. Comput. 21, 1-23;
    Venzon, D. J. & Moolgavkar, S. H. (1988). Applied Statistics 37, 87-94.
    """

    sampling = Sampling.TOWARDS_MEASUREMENTS

    unordered_reason = NO_STEP_BETWEEN_LABELS

    needs_numbers = True

    starts: int = count(default=1, maximum=1000)
    profile: bool = flag(default=True)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        if self.experiments.errors.has_discrepancy:
            found = "a discrepancy, which takes up whatever the unknowns do not explain"
            yield Problem(("measured",), found, 'kind = "posterior", where it has a prior')
        yield from self.check_continuous(joint, self.experiments.unknown)

    @property
    def settings(self) -> SearchSettings:
        """Settings of its search, in points with a run of each experiment."""
        level = PROFILE_LEVEL if self.profile else 0.0
        errors_are_known = not self.experiments.errors.has_one_unknown_size
        at_most = self.at_most // self.experiments.count
        return SearchSettings(errors_are_known, at_most, level, self.experiments.errors.freedom)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        measured = self.experiments
        unknowns = Unknowns.of(joint, measured.unknown)
        entries = {each.variable.name: each for each in joint.random}
        others = {name: joint.nominal()[name] for name in entries}
        middles = {}
        for name in measured.moved:
            std_over_all = prior_scale(entries[name]) if name in entries else 0.0
            middles[name] = measured.moved_inputs(name, others, std_over_all)
        starts = unknowns.starts(joint, self.starts, stream)
        search = search_experiments(starts, unknowns.lower, unknowns.upper, self.settings, measured)
        described = {MEASURED: measured.name, SEARCH_STARTS: len(starts)}
        asked, weighted_at = next(search)
        made = 0
        while True:
            size = len(asked.points)
            draws = dict(zip(unknowns.names, unknowns.in_si(asked.points).T, strict=True))
            for place, (name, (middle, std)) in enumerate(middles.items()):
                lowered = len(unknowns.names) + 2 * place
                side = (asked.axis == lowered + 1).astype(float) - (asked.axis == lowered)
                draws[name] = middle + np.multiply.outer(side, std)
            of_points: dict[str, Any] = {
                SEARCH_START: asked.start,
                SEARCH_ORIGIN: asked.origin,
                MOVED_AXIS: asked.axis,
                WEIGHTED_AT: np.full(size, weighted_at),
                DRAW: np.arange(made, made + size),
            }
            coordinates = {
                **{name: np.repeat(values, measured.count) for name, values in of_points.items()},
                EXPERIMENT: np.tile(np.arange(measured.count), size),
            }
            made += size
            inputs = measured.inputs(draws, others)
            points = points_dataset(joint, inputs, coordinates, runs=size * measured.count)
            feedback = yield points.assign_attrs(described)
            results = measured.predicted(next(iter(feedback.runs.values())))
            try:
                asked, weighted_at = search.send(results)
            except StopIteration as ended:
                flat = sorted(ended.value)
                break
        if flat:
            named = ", ".join(unknowns.names[axis] for axis in flat)
            raise StudyError(
                f"no measured output changes with {named}, so that no measurement teaches it: "
                "declare it as fixed, or measure an output that it changes"
            )
