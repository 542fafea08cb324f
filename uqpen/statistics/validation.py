"""A model compared with measurements: errors, a test of all together, and a verdict.

The uncertainties are those of ASME V&V 20. All follow from joint draws of the model at the measured
conditions, as the values have inputs and errors in common.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
import scipy
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.catalogue import VALIDATION_STATISTICS
from uqpen.core.labels import MEASURED_ROW
from uqpen.core.model import Output
from uqpen.core.statistic import AcceptanceVerdict, UnitRule
from uqpen.core.streams import Stream
from uqpen.core.units import DIMENSIONLESS
from uqpen.distributions.input_group import SampleDistribution
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.measurements.errors import AT_LEAST, AT_MOST, EXACTLY
from uqpen.measurements.experiments import Experiments, ValidationSettings
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.intervals import (
    clopper_pearson,
    order_statistic_ranks,
    student_interval,
)

# Errors of the model are called detectable where the joint test finds them with this probability.
_POWER = 0.8
_FEWEST = 20  # draws of a test
# Eigenvalues of a correlation matrix below this are 0 but for rounding.
_ROUNDING = 1e-12

_Statistics = Iterator[tuple[str, Any]]


@dataclass(frozen=True, eq=False, kw_only=True)
class Validation:
    """Measured values of one output, and joint draws of a model at their conditions, in SI units.

    Parameters
    ----------
    measured : ndarray, shape (row,)
    censoring : ndarray of int, shape (row,)
        What each is: `EXACTLY`, or a bound of the value, `AT_LEAST` or `AT_MOST`.
    predicted : ndarray, shape (draw, row)
        What the model predicts; NaN where a run failed.
    errors : ndarray, shape (draw, row)
        Simulated errors of measurement, for the values that each draw predicts.
    covariance : ndarray, shape (row, row)
        Of the errors of measurement.
    used_before : ndarray of bool, shape (row,)
        True where inputs of the model were fitted to the value.
    level : float
        Confidence level.
    stream : Stream
        For the order of equal draws, and for the numerical error.
    numerical_std : float or ndarray, shape (row,)
        Standard deviation of the numerical error of the model, which all values have in common.
    accept : float, optional
        The largest error of the model that is accepted.
    fitted_inputs : int
        Number of inputs that were fitted to the values used before.
    """

    measured: FloatArray
    censoring: IntArray
    predicted: FloatArray
    errors: FloatArray
    covariance: FloatArray
    used_before: BoolArray
    level: float
    stream: Stream
    numerical_std: float | FloatArray = 0.0
    accept: float | None = None
    fitted_inputs: int = 0

    @cached_property
    def completed(self) -> BoolArray:
        """True for draws with a completed run at each value."""
        return np.asarray(np.isfinite(self.predicted).all(axis=1))

    @cached_property
    def simulated(self) -> FloatArray:
        """Values that would be measured if a draw were true, shape (draw, row)."""
        numerical = self.stream.generator("numerical error").standard_normal(len(self.predicted))
        found: FloatArray = self.predicted + self.errors
        return found + numerical[:, np.newaxis] * self.numerical_std

    @property
    def draws(self) -> int:
        """Number of draws that are used."""
        return int(self.completed.sum())

    @cached_property
    def is_tested(self) -> BoolArray:
        """True for values that the joint test uses: no bounds, and none used before."""
        return (self.censoring == EXACTLY) & ~self.used_before

    @cached_property
    def comparison_error(self) -> FloatArray:
        """Mean of the model minus measured value; NaN of a bound."""
        found: FloatArray = self.predicted[self.completed].mean(axis=0) - self.measured
        return np.where(self.censoring == EXACTLY, found, np.nan)

    @cached_property
    def input_std(self) -> FloatArray:
        """Standard deviation of the model by its inputs."""
        return np.asarray(self.predicted[self.completed].std(axis=0, ddof=1))

    @property
    def measured_std(self) -> FloatArray:
        """Standard deviation of the errors of measurement."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def uncertainty(self) -> FloatArray:
        """Standard uncertainty of the comparison error, by inputs, numerics and measurement."""
        parts = np.broadcast_arrays(self.input_std, self.numerical_std, self.measured_std)
        return np.sqrt(np.square(parts).sum(axis=0))

    def half_width(self, level: float) -> FloatArray:
        """Return half the interval of the model's error at each value.

        Only the scatter of the draws is estimated, so the degrees of freedom are those of Welch and
        Satterthwaite.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            freedom = (self.draws - 1) * (self.uncertainty / self.input_std) ** 4
        k = scipy.special.stdtrit(np.fmin(freedom, 1e9), 0.5 + level / 2)
        return np.asarray(k * np.hypot(self.uncertainty, self.input_std / math.sqrt(self.draws)))

    def verdicts(self, level: float) -> list[AcceptanceVerdict]:
        """Return the verdict on each value: whether its interval is within what is accepted."""
        assert self.accept is not None
        size, half = np.abs(self.comparison_error), self.half_width(level)
        is_met = (size + half <= self.accept) & self.is_tested
        found = np.full(len(size), AcceptanceVerdict.NOT_DECIDED, dtype=object)
        found[is_met] = AcceptanceVerdict.MET
        found[size - half > self.accept] = AcceptanceVerdict.NOT_MET
        return found.tolist()

    @property
    def verdict(self) -> AcceptanceVerdict:
        """Verdict on all values that are no bounds and were not used before.

        It is met where each is met. One of many intervals misses its error more often than one
        alone, so it is not met by intervals that hold together (Bonferroni).
        """
        rows = int(self.is_tested.sum())
        at_once = 1 - (1 - self.level) / max(rows, 1)
        missed = np.array(self.verdicts(at_once), dtype=object)[self.is_tested]
        if AcceptanceVerdict.NOT_MET in missed:
            return AcceptanceVerdict.NOT_MET
        each = np.array(self.verdicts(self.level), dtype=object)[self.is_tested]
        is_met = rows > 0 and set(each) == {AcceptanceVerdict.MET}
        return AcceptanceVerdict.MET if is_met else AcceptanceVerdict.NOT_DECIDED

    @property
    def left_out(self) -> str:
        """Note on the values that tests leave out; empty for none."""
        rows = int(self.used_before.sum())
        return texts.ROWS_USED_BEFORE.format(rows=rows) if rows else ""

    def reason(self, rows: BoolArray) -> str:
        """Return why a test of some values cannot be made; empty where it can."""
        # So that p values can be below 1 - level, and the quantile at the power has an interval.
        needed = max(math.ceil(1 / (1 - self.level)) - 1, _FEWEST)
        if self.draws < needed:
            return texts.FEW_DRAWS.format(draws=self.draws, needed=needed)
        return "" if rows.any() else texts.NO_NEW_ROWS

    def rank(self, found: FloatArray) -> Estimate:
        """Return the share of the draws whose statistic is larger than that of the measurements.

        That is the last one. It lies between the ranks of its neighbours as it does between these,
        so that p values of a right model are uniform, also of few draws.
        """
        draws, (values, counts) = len(found) - 1, np.unique(found[:-1], return_counts=True)
        ranks = draws - np.cumsum(counts) + (counts + 1) / 2  # from the largest
        rank = float(np.interp(found[-1], values, ranks, left=draws + 0.5, right=0.5))
        lower, upper = map(float, clopper_pearson(rank - 0.5, draws, self.level))
        method, value = texts.RANK_AMONG_DRAWS, rank / (draws + 1)
        return Estimate(value, lower, upper, method, "discrete", self.left_out)


def crps_by_draw(measured: FloatArray, simulated: FloatArray) -> FloatArray:
    """Return numbers of each draw, whose mean is the continuous ranked probability score.

    That is E abs(Y - y) - E abs(Y - Y') / 2, without bias from the number of draws. Each draw's
    number has its influence, so their scatter gives the error.

    Parameters
    ----------
    measured : ndarray, shape (row,)
    simulated : ndarray, shape (draw, row)

    References
    ----------
    Gneiting, T. & Raftery, A. E. (2007). J. Am. Stat. Assoc. 102, 359-378.
    """
    draws = len(simulated)
    order = np.argsort(simulated, axis=0)
    ascending = np.take_along_axis(simulated, order, axis=0)
    sums = np.cumsum(ascending, axis=0)
    number = 2 * np.arange(1, draws + 1)[:, np.newaxis] - draws
    apart = (ascending * number + sums[-1] - 2 * sums) / (draws - 1)
    spread = np.empty_like(apart)
    np.put_along_axis(spread, order, apart, axis=0)
    return np.asarray(np.abs(simulated - measured) - spread + spread.mean(axis=0) / 2)


def score_difference(one: Validation, other: Validation) -> Estimate:
    """Return how much larger the mean score of the first model is than that of another.

    Both have the same measurements, draws of inputs and errors. The smaller score is the better.
    """
    common = one.completed & other.completed
    tested = one.is_tested
    scores = [
        crps_by_draw(each.measured[tested], each.simulated[common][:, tested]).mean(axis=1)
        for each in (one, other)
    ]
    return _mean_over_draws(scores[0] - scores[1], one.level)


def _mean_over_draws(values: FloatArray, level: float) -> Estimate:
    mean, error = float(values.mean()), values.std(ddof=1) / math.sqrt(len(values))
    lower, upper = student_interval(mean, error, len(values) - 1, level)
    return Estimate(mean, float(lower), float(upper), texts.STUDENT_OVER_DRAWS, "nominal")


def area_metric(pit: FloatArray) -> FloatArray:
    """Area between the empirical distribution of PIT values, along the last axis, and the uniform.

    >>> area_metric(np.array([0.5])).item()
    0.25
    """
    ends = np.zeros((*pit.shape[:-1], pit.shape[-1] + 2))
    ends[..., 1:-1], ends[..., -1] = np.sort(pit, axis=-1), 1.0
    steps = np.linspace(0.0, 1.0, pit.shape[-1] + 1)
    below, above = ends[..., :-1] - steps, ends[..., 1:] - steps
    found: FloatArray = (above * np.abs(above) - below * np.abs(below)).sum(axis=-1) / 2
    return found


def kolmogorov_distance(pit: FloatArray) -> FloatArray:
    """Largest difference of the empirical distribution of PIT values from the uniform one."""
    ascending = np.sort(pit, axis=-1)
    steps = np.linspace(0.0, 1.0, pit.shape[-1] + 1)
    found = np.maximum(steps[1:] - ascending, ascending - steps[:-1])
    return np.asarray(found.max(axis=-1))


# The validations of the runs of a design at experiments.


def validations_at_experiments(
    experiments: Experiments,
    settings: ValidationSettings,
    predicted: FloatArray,
    sizes: Sequence[float],
    joint: JointDistribution,
    stream: Stream,
    level: float,
) -> Iterator[Validation]:
    """Yield the validation of each measured output by draws of the model at experiments.

    Where the errors of measurement depend on the model, they are those at its mean. Values that
    have taught a posterior among the inputs were used before.

    Parameters
    ----------
    experiments : Experiments
        The model has no error of its own in them: it is what is looked for.
    settings : ValidationSettings
    predicted : ndarray, shape (draw, row)
        Results, NaN where a run failed.
    sizes : sequence of float
        Sizes of errors that are not known.
    joint : JointDistribution
    stream : Stream
    level : float
        Confidence level.
    """
    completed = np.isfinite(predicted).all(axis=1)
    at = predicted[completed].mean(axis=0) if completed.any() else experiments.values
    covariance = experiments.errors.covariance(at, sizes)
    normal = stream.generator("errors of measurement").standard_normal(predicted.shape)
    errors = normal @ np.linalg.cholesky(covariance).T
    used = {*settings.fitted.row_hashes} if settings.fitted else set[str]()
    posteriors = [each for each in joint.groups if isinstance(each, SampleDistribution)]
    used = used.union(*(each.taught_by for each in posteriors))
    taught = sum(len(each.inputs) for each in posteriors if each.taught_by)
    used_before = np.array([each in used for each in experiments.row_hashes])
    for each, own in experiments.rows:
        if own.start == own.stop:
            continue  # no value of it is held out
        yield Validation(
            measured=each.values,
            censoring=each.censoring,
            predicted=predicted[:, own],
            errors=errors[:, own],
            covariance=covariance[own, own],
            used_before=used_before[own],
            level=level,
            stream=stream.child(each.output.name),
            numerical_std=settings.numerical_std.get(each.output.name, 0.0),
            accept=settings.accept.get(each.output.name),
            fitted_inputs=settings.fitted_inputs + taught,
        )


# The statistics of an archive.


def validation_statistics(validation: Validation, output: Output) -> NamedArrays:
    """Yield what measurements say of a model, by the names of the catalogue.

    Parameters
    ----------
    validation : Validation
    output : Output
        What was measured.

    Yields
    ------
    name : str
    statistic : DataArray
        Along ``measured_row``, or of all rows. Where fewer than two draws have completed, there are
        only their numbers.
    """
    numbers = {MEASURED_ROW: np.arange(1, len(validation.measured) + 1)}
    for name, found in _found(validation):
        record = VALIDATION_STATISTICS[name]
        units = DIMENSIONLESS if record.unit is UnitRule.NONE else output.unit
        along = numbers if record.dims else {}
        if isinstance(found, Estimate):
            array = found.to_array(
                *record.dims,
                units=units,
                long_name=record.title,
                coordinates=along,
                level=validation.level,
            )
        else:
            described = {"units": units, "long_name": record.title}
            array = xr.DataArray(found, along, record.dims, attrs=described)
        yield name, array


def _found(of: Validation) -> _Statistics:
    yield "draws", of.draws
    yield "failed_draws", len(of.completed) - of.draws
    if of.draws > 1:
        yield from chain(_of_rows(of), _of_all(of), _of_pit(of), _of_residuals(of))


def _of_rows(of: Validation) -> _Statistics:
    simulated, is_value = of.simulated[of.completed], of.censoring == EXACTLY
    half = of.half_width(of.level)
    failed = len(of.completed) - of.draws
    notes = [
        "" if np.any(of.numerical_std) else texts.NO_NUMERICAL_STD,
        texts.FAILED_DRAWS.format(failed=failed, draws=len(of.completed)) if failed else "",
    ]
    error = of.comparison_error
    estimate = Estimate(error, error - half, error + half, texts.VALIDATION_INTERVAL, "nominal")
    estimate = estimate.remove_bounds_at(~is_value, texts.MEASURED_BOUND)
    yield "comparison_error", estimate.with_note(*notes)
    yield "validation_uncertainty", of.uncertainty
    with np.errstate(divide="ignore", invalid="ignore"):
        yield "z_score", of.comparison_error / of.uncertainty
    yield "measured", of.measured
    yield "measured_std", of.measured_std
    yield "predicted_mean", of.predicted[of.completed].mean(axis=0)
    yield "predicted_std", of.input_std
    yield "used_before", of.used_before.astype(np.int8)
    scores = crps_by_draw(of.measured, simulated)
    yield "crps", np.where(is_value, scores.mean(axis=0), np.nan)
    if of.is_tested.any():
        yield "mean_crps", _mean_over_draws(scores[:, of.is_tested].mean(axis=1), of.level)
    if of.accept is not None:
        verdicts = [str(each) for each in of.verdicts(of.level)]
        yield "row_verdict", np.array(verdicts, dtype=object)
        yield "verdict", str(of.verdict)


def _of_all(of: Validation) -> _Statistics:
    """Yield the joint test and what it could not see, each draw without itself in mean and V."""
    rows, draws = of.is_tested, of.draws
    if reason := of.reason(rows):
        yield from _without_test(of, reason)
        return
    predicted = of.predicted[of.completed][:, rows]
    centred = predicted - predicted.mean(axis=0)
    numerical = np.broadcast_to(of.numerical_std, of.measured.shape)[rows]
    stated = of.covariance[np.ix_(rows, rows)] + np.outer(numerical, numerical)
    scatter = centred.T @ centred
    # V without one draw is this one minus a multiple of its square (Sherman and Morrison).
    others = stated + scatter / (draws - 2)
    multiple = draws / ((draws - 1) * (draws - 2))
    std = np.sqrt(np.diag(others))
    if not std.all() or np.linalg.eigvalsh(others / np.outer(std, std))[0] < _ROUNDING:
        yield from _without_test(of, texts.SINGULAR_COVARIANCE)
        return
    whiten = np.linalg.inv(np.linalg.cholesky(others))
    own = centred @ whiten.T
    error = of.simulated[of.completed][:, rows] - predicted + centred * draws / (draws - 1)
    error = error @ whiten.T
    factor = multiple / (1 - multiple * np.square(own).sum(axis=1))
    own_error = (own * error).sum(axis=1)
    distance = np.square(error).sum(axis=1) + factor * own_error**2
    errors = of.comparison_error[rows]
    measured = float(errors @ np.linalg.solve(stated + scatter / (draws - 1), errors))
    yield "joint_statistic", measured
    yield "joint_p_value", of.rank(np.append(distance, measured))
    # The error at which each draw's distance, a quadratic function of it, is the least that is
    # found: at each value alone, and the same at all.
    directions = whiten @ np.column_stack([np.eye(len(std)), np.ones(len(std))])
    along = own @ directions
    square = np.square(directions).sum(axis=0) + factor[:, np.newaxis] * along**2
    slope = error @ directions + (factor * own_error)[:, np.newaxis] * along
    slope[::2] *= -1  # half of the draws see an error of the other sign
    ranks, descending = np.arange(1, draws + 1), np.sort(distance)[::-1]
    least = np.interp((1 - of.level) * (draws + 1), ranks, descending)
    lacking = (least - distance)[:, np.newaxis]
    sizes = (np.sqrt(slope**2 + square * np.maximum(lacking, 0.0)) - slope) / square
    sizes = np.sort(np.where(lacking < 0, 0.0, sizes), axis=0)
    lower, upper = (sizes[int(each) - 1] for each in order_statistic_ranks(draws, _POWER, of.level))
    size = np.quantile(sizes, _POWER, axis=0)
    estimate = Estimate(size, lower, upper, texts.ORDER_STATISTICS, "discrete", of.left_out)
    yield "detectable_common_error", estimate[-1]
    yield "detectable_error", _at_rows(estimate, rows)


def _at_rows(found: Estimate, rows: BoolArray) -> Estimate:
    at_all = Estimate.without_bounds(np.full(len(rows), np.nan), texts.NOT_TESTED)
    place = np.cumsum(rows) - 1
    value, lower, upper = (each[place] for each in (found.value, found.lower, found.upper))
    return at_all.replace_at(rows, Estimate(value, lower, upper, found.method, found.label))


def _without_test(of: Validation, reason: str) -> _Statistics:
    yield "joint_p_value", Estimate.without_bounds(math.nan, reason)
    yield "detectable_common_error", Estimate.without_bounds(math.nan, reason)
    missing = np.full(len(of.measured), np.nan)
    yield "detectable_error", Estimate.without_bounds(missing, reason)


def _of_pit(of: Validation) -> _Statistics:
    """Yield what follows from ranks of each value; draws have theirs among the same values."""
    pooled = np.vstack([of.simulated[of.completed], of.measured])
    # What is censored at a bound is a tie with it, so that its rank may be any beyond.
    pooled = np.where(of.censoring == AT_LEAST, np.minimum(pooled, of.measured), pooled)
    pooled = np.where(of.censoring == AT_MOST, np.maximum(pooled, of.measured), pooled)
    first, last = (scipy.stats.rankdata(pooled, method, axis=0) for method in ("min", "max"))
    place = of.stream.generator("pit").random(pooled.shape)
    pit = (first - 1 + place * (last - first + 1)) / len(pooled)
    inside = np.abs((first + last - 1) / 2 / len(pooled) - 0.5) <= of.level / 2
    yield "pit", pit[-1]
    yield "inside", inside[-1].astype(np.int8)
    new = ~of.used_before
    if reason := of.reason(new):
        for name in ("share_inside", "share_p_value", "ks_p_value", "area", "area_p_value"):
            yield name, Estimate.without_bounds(math.nan, reason)
        return
    count, rows = int(inside[-1, new].sum()), int(new.sum())
    lower, upper = map(float, clopper_pearson(count, rows, of.level))
    note = texts.AS_INDEPENDENT_ROWS.format(p=scipy.stats.binomtest(count, rows, of.level).pvalue)
    share = Estimate(count / rows, lower, upper, texts.CLOPPER_PEARSON, "discrete", note)
    yield "share_inside", share.with_note(of.left_out)
    yield "share_p_value", of.rank(np.abs(inside[:, new].mean(axis=1) - of.level))
    distances = kolmogorov_distance(pit[:, new])
    yield "ks_statistic", distances[-1]
    yield "ks_p_value", of.rank(distances)
    areas = area_metric(pit[:, new])
    area, reach = float(areas[-1]), float(np.quantile(areas[:-1], of.level, method="higher"))
    yield "area_null", areas[:-1].mean()
    yield "area_null_quantile", reach
    # The areas between distributions are a metric, so that this is their triangle inequality.
    lower, upper = max(area - reach, 0.0), min(area + reach, 0.5)
    yield "area", Estimate(area, lower, upper, texts.BEYOND_NULL, "conservative", of.left_out)
    yield "area_p_value", of.rank(areas)


def _of_residuals(of: Validation) -> _Statistics:
    """Yield the test of the values that inputs were fitted to, by the errors of measurement."""
    rows = of.used_before & (of.censoring == EXACTLY)
    freedom = int(rows.sum()) - of.fitted_inputs
    if freedom < 1:
        return
    errors = of.comparison_error[rows]
    found = float(errors @ np.linalg.solve(of.covariance[np.ix_(rows, rows)], errors))
    yield "residual_chi_squared", found
    yield "residual_p_value", float(scipy.special.chdtrc(freedom, found))
