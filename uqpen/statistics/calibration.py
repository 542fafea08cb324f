"""Unknown inputs of a model from measurements: what the runs of a search for least squares say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CALIBRATION_STATISTICS
from uqpen.core.labels import (
    COMBINATION,
    MINIMUM,
    MOVED_AXIS,
    OTHER_UNKNOWN,
    RUN,
    SEARCH_ORIGIN,
    SEARCH_START,
    SEARCH_STARTS,
    UNKNOWN,
    WEIGHTED_AT,
)
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.least_squares import (
    NO_AXIS,
    NOISE_AXIS,
    NOISE_RUNS,
    LeastSquares,
    LeastSquaresPoints,
    LinearModel,
    ModelNoise,
    SearchSettings,
    Unknowns,
    WeightedResiduals,
    difference_quotient,
    is_profile_end,
    profile_level,
)
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.measurements import Experiments
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate

# Minima whose sums of squares differ by less than this many variances are both named.
_COMPARABLE = 4.0
# Points are of one minimum where the linear model changes less between them, in standard errors.
_SAME = 1.0
# Points of a search whose sums of squares differ by less are as good as each other.
_AS_LOW = 0.01

# Ends of intervals by the linear model and by the profile that differ more, in half-widths, differ
# visibly: the coverage of the first is then some per cent below its level.
_BENT = 0.2


@dataclass(frozen=True, eq=False)
class SearchRuns:
    """Runs of a search, in the order in which they were made."""

    searched: LeastSquaresPoints
    residuals: FloatArray  # (run, residual): whitened; NaN where a run failed
    lower: FloatArray  # (unknown,): ends of the supports of the priors
    upper: FloatArray
    starts: int  # number of starts
    settings: SearchSettings

    def models(self, start: int) -> list[LinearModel]:
        """Return the points of a search at which all derivatives are known."""
        of_search = (self.searched.start == start) & (self.searched.axis == NO_AXIS)
        completed = np.isfinite(self.residuals).all(axis=1)
        found = map(self._model, np.flatnonzero(of_search & completed).tolist())
        return [each for each in found if each is not None]

    def minimum(self, start: int) -> LinearModel | None:
        """Return the point where a search has ended: of those that are as low, the flattest."""
        models = self.models(start)
        if not models:
            return None
        least = min(models, key=lambda each: each.sum_of_squares)
        as_low = least.sum_of_squares + _AS_LOW * self.variance(least)
        lowest = [each for each in models if each.sum_of_squares <= as_low]
        return min(lowest, key=lambda each: each.newton_step[1])

    @property
    def noise(self) -> ModelNoise:
        """Noise of the model, from the last of the lines of runs that measured it."""
        first = int(np.argmax(self.searched.axis == NOISE_AXIS))
        is_noise = self.searched.axis[first + NOISE_RUNS - 1 :: NOISE_RUNS] == NOISE_AXIS
        lines = int(np.argmin([*is_noise, False]))
        line = slice(first + NOISE_RUNS * (lines - 1), first + NOISE_RUNS * lines)
        first, second = self.searched.points[line][:2]
        return ModelNoise.of(self.residuals[line], float(np.linalg.norm(second - first)))

    def variance(self, at: LinearModel) -> float:
        """Return the variance of a residual: 1 where errors are known."""
        return at.scale(errors_are_known=self.settings.errors_are_known) ** 2

    def _model(self, run: int) -> LinearModel | None:
        points, columns = self.searched.points, list[FloatArray]()
        around = self.searched.origin == run
        for axis in range(points.shape[1]):
            moved = around & (self.searched.axis == axis)
            offsets = points[moved, axis] - points[run, axis]
            quotient = difference_quotient(self.residuals[run], self.residuals[moved], offsets)
            if quotient is None:
                return None
            columns.append(quotient)
        jacobian = np.stack(columns, axis=1)
        return LinearModel(points[run], self.residuals[run], jacobian, self.lower, self.upper)


class Combination(NamedTuple):
    """Combination of unknowns, each in standard deviations of its prior."""

    weights: FloatArray  # (unknown,): their squares have the sum 1
    standard_error: float  # in the same unit: 1 or more is no more than the prior says

    def text(self, names: Sequence[str]) -> str:
        """Return it as a formula, the largest part first.

        >>> Combination(np.array([-0.8, 0.6]), 0.1).text(["rate", "limit"])
        '0.80 rate - 0.60 limit'
        """
        order = np.argsort(-np.abs(self.weights), kind="stable")
        shown = [at for at in order.tolist() if abs(self.weights[at]) >= _SMALL_PART]
        sign = math.copysign(1.0, self.weights[shown[0]])
        text = ""
        for at in shown:
            weight = sign * self.weights[at]
            link = (" - " if weight < 0 else " + ") if text else ""
            text += f"{link}{abs(weight):.2f} {names[at]}"
        return text


_SMALL_PART = 0.05


@dataclass(frozen=True, eq=False)
class FittedUnknowns:
    """Least sum of squares among all minima that were found, and what follows from it.

    Values are in standard deviations of the priors, from their medians.
    """

    runs: SearchRuns
    at: LinearModel
    level: float  # confidence level

    @classmethod
    def of(cls, runs: SearchRuns, level: float) -> FittedUnknowns | None:
        """Return the best of all starts; None where none has a run with its derivatives."""
        minima = [each for start in range(runs.starts) if (each := runs.minimum(start))]
        if not minima:
            return None
        return cls(runs, min(minima, key=lambda each: each.sum_of_squares), level)

    @property
    def degrees_of_freedom(self) -> int:
        """Number of residuals beyond that of the unknowns."""
        residuals, unknowns = self.at.jacobian.shape
        return residuals - unknowns

    @property
    def scale(self) -> float:
        """Standard deviation of a residual; NaN where it is neither stated nor can be estimated."""
        if not self.runs.settings.errors_are_known and self.degrees_of_freedom < 1:
            return math.nan
        return math.sqrt(self.runs.variance(self.at))

    @property
    def next_step(self) -> float:
        """Length of the next step in standard errors."""
        return self.at.newton_step[1] / self.scale

    @property
    def has_converged(self) -> bool:
        """True where the next step is short beside the standard errors."""
        return self.at.is_minimum(self.runs.settings)

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance of the unknowns, variance × (J' J)^-1; infinite where that does not exist."""
        values, right = self._singular
        if len(values) < len(self.at.point) or not values[-1] > values[0] * np.finfo(float).eps:
            return np.full((len(self.at.point),) * 2, math.inf)
        scaled = right / values[:, np.newaxis]
        return np.asarray(scaled.T @ scaled * self.scale**2)

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors of the unknowns."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the estimates."""
        errors = self.standard_errors
        with np.errstate(invalid="ignore"):
            found: FloatArray = self.covariance / np.outer(errors, errors)
        return found

    @property
    def quantile(self) -> float:
        """Half-width of an interval in standard errors: normal where errors are known, else t."""
        return replace(self.runs.settings, level=self.level).quantile(self.degrees_of_freedom)

    @cached_property
    def _singular(self) -> tuple[FloatArray, FloatArray]:
        _, values, right = np.linalg.svd(self.at.jacobian, full_matrices=False)
        return values, right

    @property
    def combinations(self) -> list[Combination]:
        """Combinations that are known independently of each other, the best known first."""
        values, right = self._singular
        with np.errstate(divide="ignore"):
            errors = self.scale / values
        return [Combination(*each) for each in zip(right, errors.tolist(), strict=True)]

    @property
    def p_value(self) -> float:
        """Probability of a larger sum of squares, if the model and the stated errors are right."""
        if not self.runs.settings.errors_are_known or self.degrees_of_freedom < 1:
            return math.nan
        return float(scipy.special.chdtrc(self.degrees_of_freedom, self.at.sum_of_squares))

    @property
    def lag_1_correlation(self) -> float:
        """Correlation of each residual with the next."""
        residuals = self.at.residuals
        return float(residuals[1:] @ residuals[:-1]) / self.at.sum_of_squares

    @property
    def are_residuals_correlated(self) -> bool:
        """True where the lag-1 correlation is beyond 2 / sqrt(n): one in 20 is so by chance."""
        return abs(self.lag_1_correlation) > 2 / math.sqrt(len(self.at.residuals))

    @property
    def standardised_residuals(self) -> FloatArray:
        """Residuals by their standard deviations, which the fit makes smaller than 1."""
        left, _, _ = np.linalg.svd(self.at.jacobian, full_matrices=False)
        share = 1 - (left**2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found: FloatArray = self.at.residuals / (self.scale * np.sqrt(np.maximum(share, 0.0)))
        return found

    def profile_bounds(self, axis: int) -> tuple[float, float]:
        """Return the ends of the profile-likelihood interval of an unknown; NaN where not found."""
        ends = []
        level = profile_level(self.at, self.runs.settings)
        for side in (-1, 1):
            found = math.nan
            for model in self.runs.models(self.runs.starts + 2 * axis + (side > 0)):
                step = model.profile_step(level, axis, side)
                if step is not None and is_profile_end(model, step, self.at, axis):
                    found = float(model.point[axis] + step[axis])
            ends.append(found)
        return ends[0], ends[1]

    def estimate(self, axis: int) -> Estimate:
        """Return an unknown with its interval by the linear model at the minimum."""
        value, error = float(self.at.point[axis]), float(self.standard_errors[axis])
        note = "" if self.has_converged else texts.NOT_CONVERGED.format(step=self.next_step)
        if self.at.is_at_end(axis):
            note = "; ".join(filter(None, (note, texts.AT_END_OF_PRIOR)))
        if self.other_minima:
            note = "; ".join(filter(None, (note, texts.OTHER_MINIMA)))
        half = self.quantile * error
        if not math.isfinite(half):
            return Estimate.without_bounds(value, texts.NOT_TAUGHT).with_note(note)
        settings = self.runs.settings
        is_normal = settings.errors_are_known and math.isinf(settings.freedom)
        method = texts.LINEAR_NORMAL if is_normal else texts.LINEAR_STUDENT
        if settings.errors_are_known and not is_normal:
            method = texts.LINEAR_REPEATS.format(freedom=int(settings.freedom))
        found = Estimate(value, value - half, value + half, method, "nominal", note)
        apart = np.abs(np.subtract(self.profile_bounds(axis), (value - half, value + half)))
        return found.with_note(texts.BENT if (apart > _BENT * half).any() else "")

    def profile_estimate(self, axis: int) -> Estimate:
        """Return an unknown with its profile-likelihood interval, as far as it is known."""
        value, bounds = float(self.at.point[axis]), self.profile_bounds(axis)
        if not self.runs.settings.level:
            return Estimate.without_bounds(value, texts.NO_PROFILE_ASKED)
        if not np.isfinite(bounds).all():
            least = texts.NO_PROFILE_BUDGET.format(runs=self.runs.settings.at_most)
            dear = len(self.runs.residuals) + self._profile_runs > self.runs.settings.at_most
            return Estimate.without_bounds(value, least if dear else texts.NO_PROFILE_END)
        return Estimate(value, *bounds, texts.PROFILE_LIKELIHOOD, "nominal", "")

    @property
    def _profile_runs(self) -> int:
        unknowns = len(self.at.point)
        return 2 * unknowns * (1 + 2 * unknowns)

    @property
    def other_minima(self) -> list[LinearModel]:
        """Other minima whose sum of squares is nearly as low, one for each place."""
        variance, found = self.scale**2, [self.at]
        for start in range(self.runs.starts):
            other = self.runs.minimum(start)
            if other is None or not other.is_minimum(self.runs.settings):
                continue
            if other.sum_of_squares - self.at.sum_of_squares >= _COMPARABLE * variance:
                continue
            distances = [_distance(each, other) for each in found]
            if min(distances) > _SAME * self.scale:
                found.append(other)
        return found[1:]


def _distance(one: LinearModel, other: LinearModel) -> float:
    """Return how far two points are apart: the change of the residuals by either linear model."""
    step = one.point - other.point
    return float(max(np.linalg.norm(each.jacobian @ step) for each in (one, other)))


# The statistics of an archive.


def fit_statistics(
    design: LeastSquares, joint: JointDistribution, runs: xr.Dataset, level: float
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield what the runs of a search for least squares say, by the names of the catalogue.

    Parameters
    ----------
    design : LeastSquares
        The design that has made the runs.
    joint : JointDistribution
        The inputs.
    runs : Dataset
        Its runs.
    level : float
        Confidence level.
    """
    measured = design.experiments
    unknowns = Unknowns.of(joint, measured.unknown)
    values = np.stack([measured.drawn(runs, name) for name in unknowns.names], axis=-1)
    of_points = runs.isel({RUN: slice(0, None, measured.count)})
    coordinates = (of_points[name].values for name in (SEARCH_START, SEARCH_ORIGIN, MOVED_AXIS))
    points = LeastSquaresPoints(unknowns.working(values), *coordinates)
    predicted = measured.predicted(runs)
    weighted_at = int(of_points[WEIGHTED_AT].values[-1])
    weighted = WeightedResiduals.of(measured, points, predicted, weighted_at)
    searched = SearchRuns(
        points,
        weighted(predicted),
        unknowns.lower,
        unknowns.upper,
        int(runs.attrs[SEARCH_STARTS]),
        design.settings,
    )
    fitted = FittedUnknowns.of(searched, level)
    if fitted is None:
        return
    yield from _row_statistics(measured, predicted, weighted, searched, fitted)
    along = {UNKNOWN: [*unknowns.names]}
    diagnosis = {
        "sum_of_squares": fitted.at.sum_of_squares,
        "degrees_of_freedom": float(fitted.degrees_of_freedom),
        "fit_p_value": fitted.p_value,
        "residual_std": fitted.scale,
        "residual_correlation": fitted.lag_1_correlation,
        "largest_residual": float(np.nanmax(np.abs(fitted.standardised_residuals))),
        "next_step": fitted.next_step,
        "model_noise": searched.noise.size,
        "difference_step": searched.noise.step,
    }
    for name, value in diagnosis.items():
        title = CALIBRATION_STATISTICS[name].title
        yield name, xr.DataArray(value, attrs={"units": DIMENSIONLESS, "long_name": title})
    estimates = [fitted.estimate(axis) for axis in range(len(unknowns.names))]
    profiles = [fitted.profile_estimate(axis) for axis in range(len(unknowns.names))]
    for name, found in (("unknown_value", estimates), ("profile_value", profiles)):
        in_si = [
            replace(
                each,
                **{
                    bound: float(unknowns.median[axis] + unknowns.std[axis] * getattr(each, bound))
                    for bound in ("value", "lower", "upper")
                },
            )
            for axis, each in enumerate(found)
        ]
        own_level = level if name == "unknown_value" else design.settings.level
        yield (
            name,
            Estimate.stack(
                in_si,
                UNKNOWN,
                units=DIMENSIONLESS,
                long_name="unknowns, each in its SI unit",
                coordinates=along,
                level=own_level or level,
            ),
        )
    for name, numbers in (
        ("standard_error", unknowns.std * fitted.standard_errors),
        ("prior_std", unknowns.std),
    ):
        yield name, xr.DataArray(numbers, along, (UNKNOWN,))
    both = along | {OTHER_UNKNOWN: [*unknowns.names]}
    yield "correlation", xr.DataArray(fitted.correlation, both, (UNKNOWN, OTHER_UNKNOWN))
    combinations = fitted.combinations
    numbered = {COMBINATION: np.arange(1, len(combinations) + 1)}
    errors = np.array([each.standard_error for each in combinations])
    yield "combination_error", xr.DataArray(errors, numbered, (COMBINATION,))
    weights = np.array([each.weights for each in combinations])
    yield "combination_weight", xr.DataArray(weights, numbered | along, (COMBINATION, UNKNOWN))
    minima = [fitted.at, *fitted.other_minima]
    numbered = {MINIMUM: np.arange(1, len(minima) + 1)}
    sums = np.array([each.sum_of_squares for each in minima])
    yield "minimum_sum_of_squares", xr.DataArray(sums, numbered, (MINIMUM,))
    places = np.array([unknowns.median + unknowns.std * each.point for each in minima])
    yield "minimum_value", xr.DataArray(places, numbered | along, (MINIMUM, UNKNOWN))


def _row_statistics(
    measured: Experiments,
    predicted: FloatArray,
    weighted: WeightedResiduals,
    runs: SearchRuns,
    fitted: FittedUnknowns,
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the measured values, their errors about the model, and the model at the minimum."""
    at_minimum = (runs.searched.points == fitted.at.point).all(axis=1)
    run = int(np.flatnonzero(at_minimum & (runs.searched.axis == NO_AXIS))[0])
    std = fitted.scale * np.sqrt(np.diag(weighted.likelihood.covariance))
    yield from measured.measured_rows(measured_std=std, fitted=predicted[run])
