"""Unknown inputs of a model from measurements: what the runs of a search for least squares say."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

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
    difference_quotient,
    is_profile_end,
    usable_residuals,
    weighted_likelihood,
)
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays

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
        points, axes, residuals = self.searched.points, self.searched.axis, self.residuals
        completed = np.isfinite(residuals).all(axis=1)
        found = []
        for run in np.flatnonzero((self.searched.start == start) & (axes == NO_AXIS) & completed):
            quotients = []
            for axis in range(points.shape[1]):
                moved = (self.searched.origin == run) & (axes == axis)
                offsets = points[moved, axis] - points[run, axis]
                quotients.append(difference_quotient(residuals[run], residuals[moved], offsets))
            columns = [each for each in quotients if each is not None]
            if len(columns) == len(quotients):
                at = points[run], residuals[run], np.stack(columns, axis=1)
                found.append(LinearModel(*at, self.lower, self.upper, self.settings))
        return found

    def minimum(self, start: int) -> LinearModel | None:
        """Return the point where a search has ended: of those that are as low, the flattest."""
        models = self.models(start)
        if not models:
            return None
        least = min(models, key=lambda each: each.sum_of_squares)
        as_low = least.sum_of_squares + _AS_LOW * least.scale**2
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
    def scale(self) -> float:
        """Standard deviation of a residual; NaN where it is neither stated nor can be estimated."""
        if not self.runs.settings.errors_are_known and self.at.freedom < 1:
            return math.nan
        return self.at.scale

    @property
    def next_step(self) -> float:
        """Length of the next step in standard errors."""
        return self.at.newton_step[1] / self.scale

    @property
    def has_converged(self) -> bool:
        """True where the next step is short beside the standard errors."""
        return self.at.is_minimum

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
        return self.runs.settings.quantile(self.level, self.at.freedom)

    @cached_property
    def _singular(self) -> tuple[FloatArray, FloatArray]:
        _, values, right = np.linalg.svd(self.at.jacobian, full_matrices=False)
        return values, right

    @property
    def combinations(self) -> tuple[FloatArray, FloatArray]:
        """Combinations that are known independently of each other, the best known first.

        Returns
        -------
        weights : ndarray, shape (combination, unknown)
            Of the unknowns in standard deviations of their priors; their squares have the sum 1.
        errors : ndarray, shape (combination,)
            Standard errors in the same unit: 1 or more is no more than the prior says.
        """
        values, right = self._singular
        with np.errstate(divide="ignore"):
            return right, self.scale / values

    @property
    def p_value(self) -> float:
        """Probability of a larger sum of squares, if the model and the stated errors are right."""
        if not self.runs.settings.errors_are_known or self.at.freedom < 1:
            return math.nan
        return float(scipy.special.chdtrc(self.at.freedom, self.at.sum_of_squares))

    @property
    def lag_1_correlation(self) -> float:
        """Correlation of each residual with the next."""
        residuals = self.at.residuals
        return float(residuals[1:] @ residuals[:-1]) / self.at.sum_of_squares

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
        for side in (-1, 1):
            found = math.nan
            for model in self.runs.models(self.runs.starts + 2 * axis + (side > 0)):
                step = model.profile_step(self.at.profile_level, axis, side)
                if step is not None and is_profile_end(model, step, self.at, axis):
                    found = float(model.point[axis] + step[axis])
            ends.append(found)
        return ends[0], ends[1]

    def estimate(self, axis: int) -> Estimate:
        """Return an unknown with its interval by the linear model at the minimum."""
        value, half = float(self.at.point[axis]), self.quantile * float(self.standard_errors[axis])
        notes = (
            "" if self.has_converged else texts.NOT_CONVERGED.format(step=self.next_step),
            texts.AT_END_OF_PRIOR * self.at.is_at_end(axis),
            texts.OTHER_MINIMA * bool(self.other_minima),
        )
        if not math.isfinite(half):
            return Estimate.without_bounds(value, texts.NOT_TAUGHT).with_note(*notes)
        settings, method = self.runs.settings, texts.LINEAR_STUDENT
        if settings.errors_are_known:
            method = texts.LINEAR_NORMAL
            if math.isfinite(settings.freedom):
                method = texts.LINEAR_REPEATS.format(freedom=int(settings.freedom))
        ends = value - half, value + half
        is_bent = bool((np.abs(np.subtract(self.profile_bounds(axis), ends)) > _BENT * half).any())
        found = Estimate(value, *ends, method, "nominal", "")
        return found.with_note(*notes, texts.BENT * is_bent)

    def profile_estimate(self, axis: int) -> Estimate:
        """Return an unknown with its profile-likelihood interval, as far as it is known."""
        value, bounds = float(self.at.point[axis]), self.profile_bounds(axis)
        settings, unknowns = self.runs.settings, len(self.at.point)
        if not settings.level:
            return Estimate.without_bounds(value, texts.NO_PROFILE_ASKED)
        if np.isfinite(bounds).all():
            return Estimate(value, *bounds, texts.PROFILE_LIKELIHOOD, "nominal", "")
        least = len(self.runs.residuals) + 2 * unknowns * (1 + 2 * unknowns)  # a step to each end
        if least > settings.at_most:
            too_dear = texts.NO_PROFILE_BUDGET.format(runs=settings.at_most)
            return Estimate.without_bounds(value, too_dear)
        return Estimate.without_bounds(value, texts.NO_PROFILE_END)

    @cached_property
    def other_minima(self) -> list[LinearModel]:
        """Other minima whose sum of squares is nearly as low, one for each place."""
        highest, found = self.at.sum_of_squares + _COMPARABLE * self.scale**2, [self.at]
        for start in range(self.runs.starts):
            other = self.runs.minimum(start)
            if other is None or not other.is_minimum or other.sum_of_squares >= highest:
                continue
            # The change of the residuals by either linear model.
            changes = [
                max(
                    np.linalg.norm(each.jacobian @ (one.point - other.point))
                    for each in (one, other)
                )
                for one in found
            ]
            if min(changes) > _SAME * self.scale:
                found.append(other)
        return found[1:]


# The statistics of an archive.


def fit_statistics(
    design: LeastSquares, joint: JointDistribution, runs: xr.Dataset, level: float
) -> NamedArrays:
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
    measured, settings = design.experiments, design.settings
    unknowns = Unknowns.of(joint, measured.unknown)
    values = np.stack([measured.drawn(runs, name) for name in unknowns.names], axis=-1)
    of_points = runs.isel({RUN: slice(0, None, measured.count)})
    described = (of_points[name].values for name in (SEARCH_START, SEARCH_ORIGIN, MOVED_AXIS))
    points = LeastSquaresPoints(unknowns.working(values), *described)
    predicted = measured.predicted(runs)
    weighted_at = int(of_points[WEIGHTED_AT].values[-1])
    likelihood = weighted_likelihood(measured, points, predicted, weighted_at)
    residuals, starts = usable_residuals(likelihood, predicted), int(runs.attrs[SEARCH_STARTS])
    searched = SearchRuns(points, residuals, unknowns.lower, unknowns.upper, starts, settings)
    fitted = FittedUnknowns.of(searched, level)
    if fitted is None:
        return
    at_minimum = (points.points == fitted.at.point).all(axis=1) & (points.axis == NO_AXIS)
    yield from measured.measured_rows(
        measured_std=fitted.scale * np.sqrt(np.diag(likelihood.covariance)),
        fitted=predicted[int(np.argmax(at_minimum))],
    )
    diagnosis = {
        "sum_of_squares": fitted.at.sum_of_squares,
        "degrees_of_freedom": float(fitted.at.freedom),
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
    yield from _unknowns_found(fitted, unknowns, level, settings.level or level)


def _unknowns_found(
    fitted: FittedUnknowns, unknowns: Unknowns, level: float, profile_level: float
) -> NamedArrays:
    """Yield the unknowns with intervals, correlations and all minima, each in its SI unit."""
    for name, estimate, own_level in (
        ("unknown_value", fitted.estimate, level),
        ("profile_value", fitted.profile_estimate, profile_level),
    ):
        working = Estimate.stacked(map(estimate, range(len(unknowns.names))))
        bounds = {
            each: unknowns.in_si(getattr(working, each)) for each in ("value", "lower", "upper")
        }
        array = replace(working, **bounds).to_array(
            UNKNOWN,
            units=DIMENSIONLESS,
            long_name="unknowns, each in its SI unit",
            coordinates={UNKNOWN: [*unknowns.names]},
            level=own_level,
        )
        yield name, array
    weights, errors = fitted.combinations
    minima = [fitted.at, *fitted.other_minima]
    coordinates = {
        UNKNOWN: [*unknowns.names],
        OTHER_UNKNOWN: [*unknowns.names],
        COMBINATION: np.arange(1, len(errors) + 1),
        MINIMUM: np.arange(1, len(minima) + 1),
    }
    places = unknowns.in_si(np.array([each.point for each in minima]))
    for name, numbers, dims in (
        ("standard_error", unknowns.std * fitted.standard_errors, [UNKNOWN]),
        ("prior_std", unknowns.std, [UNKNOWN]),
        ("correlation", fitted.correlation, [UNKNOWN, OTHER_UNKNOWN]),
        ("combination_error", errors, [COMBINATION]),
        ("combination_weight", weights, [COMBINATION, UNKNOWN]),
        ("minimum_sum_of_squares", [each.sum_of_squares for each in minima], [MINIMUM]),
        ("minimum_value", places, [MINIMUM, UNKNOWN]),
    ):
        yield name, xr.DataArray(numbers, {each: coordinates[each] for each in dims}, dims)
