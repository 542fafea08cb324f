"""Posterior of unknown inputs from the runs of a sampler, with what its replicates say of it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
import scipy.stats
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.catalogue import CALIBRATION_STATISTICS
from uqpen.core.labels import (
    BLANK_ROW,
    EXPERIMENT,
    LEAST_LOG_LIKELIHOOD,
    LIKELIHOOD_EXPONENT,
    MEASURED_CONDITION,
    MEASURED_ROW,
    PARENT_DRAW,
    PROBABILITY,
    REPLICATE,
    STATUS,
    UNKNOWN,
)
from uqpen.core.status import MANY_FAILED, Status
from uqpen.core.streams import Stream
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.posterior import (
    PosteriorPoints,
    Replicate,
    error_stds,
    largest_correlation,
    log_likelihoods,
    split_runs,
)
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.measurements.errors import EXACTLY, MeasuredOutput
from uqpen.measurements.experiments import Experiments
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL, Estimate, NamedArrays
from uqpen.statistics.intervals import student_interval

# A posterior is sampled well where the rank-normalised R-hat of each unknown is below this, the
# standard error of its mean is below this part of its standard deviation, and where its draws
# correlate less with those that the last level moved from.
_LARGEST_RHAT, _LARGEST_ERROR, _RELATED = 1.01, 0.05, 0.2


@dataclass(frozen=True, eq=False)
class PosteriorSample:
    """Draws of the posterior, from whole replicates whose scatter gives all errors."""

    names: tuple[str, ...]  # of the unknowns
    values: FloatArray  # (run, unknown): of all runs
    sampled: PosteriorPoints
    log_likelihood: FloatArray  # (run,): NaN where a run failed
    replicates: tuple[Replicate, ...]
    level: float = LEVEL  # confidence level
    prior_values: FloatArray | None = None  # (run, unknown): those of draws of the prior, if others

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        values: FloatArray,
        sampled: PosteriorPoints,
        log_likelihood: FloatArray,
        level: float = LEVEL,
        prior_values: FloatArray | None = None,
    ) -> PosteriorSample | str:
        """Return the sample in the runs of a design, or the reason why it has none."""
        numbers = np.unique(sampled.replicate).tolist()
        found = [Replicate.of(sampled, log_likelihood, number) for number in numbers]
        replicates = tuple(each for each in found if each is not None)
        is_moved = len(replicates) == len(found)
        if is_moved and min(each.exponent for each in replicates) == 1:
            beside = (replicates, level, prior_values)
            return cls(tuple(names), values, sampled, log_likelihood, *beside)
        completed = float(np.isfinite(log_likelihood[sampled.exponent == 0]).mean())
        if not is_moved:
            return texts.FEW_PRIOR_RUNS.format(share=completed)
        reached = min(each.exponent for each in replicates)
        return texts.UNFINISHED_POSTERIOR.format(runs=len(log_likelihood), exponent=reached)

    @cached_property
    def runs(self) -> IntArray:
        """Numbers of the runs that the draws are, shape (replicate, draw)."""
        return np.array([each.runs for each in self.replicates])

    @cached_property
    def draws(self) -> FloatArray:
        """Draws of the posterior, shape (replicate, draw, unknown)."""
        return self.values[self.runs]

    @property
    def prior_std(self) -> FloatArray:
        """Standard deviations of the unknowns over the draws of the prior."""
        values = self.values if self.prior_values is None else self.prior_values
        spread: FloatArray = values[self.sampled.exponent == 0].std(axis=0, ddof=1)
        return spread

    @property
    def mean(self) -> Estimate:
        """Means of the unknowns."""
        return self._estimate(self.draws.mean(axis=(0, 1)), self.draws.mean(axis=1))

    @property
    def std(self) -> Estimate:
        """Standard deviations of the unknowns."""
        each = self.draws.std(axis=1, ddof=1)
        return self._estimate(self._pooled.std(axis=0, ddof=1), each)

    def quantile(self, probability: float) -> Estimate:
        """Return the quantiles of the unknowns at a probability."""
        each = np.quantile(self.draws, probability, axis=1)
        return self._estimate(np.quantile(self._pooled, probability, axis=0), each)

    @property
    def log_evidence(self) -> Estimate:
        """Logarithm of the mean of the likelihood over the prior, 0 where a run fails."""
        each = np.array([replicate.log_evidence for replicate in self.replicates])
        most = each.max()
        value = most + math.log(np.exp(each - most).mean())
        return self._estimate(value, each).with_note(texts.EVIDENCE_OF_PRIORS)

    @property
    def standard_error(self) -> FloatArray:
        """Monte Carlo standard errors of the means, shape (unknown,)."""
        return _standard_error(self.draws.mean(axis=1))

    @property
    def effective_draws(self) -> FloatArray:
        """Number of independent draws whose means would scatter as the replicates', at most all."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = (self._pooled.std(axis=0, ddof=1) / self.standard_error) ** 2
        return np.minimum(found, len(self._pooled))

    @property
    def rhat(self) -> FloatArray:
        """Rank-normalised R-hat of each unknown; NaN for one that has a single value."""
        return np.array([rank_normalised_rhat(each) for each in np.moveaxis(self.draws, -1, 0)])

    @property
    def learnt(self) -> FloatArray:
        """Part of its prior's standard deviation that each unknown has lost."""
        return 1 - self._pooled.std(axis=0, ddof=1) / self.prior_std

    @property
    def related(self) -> float:
        """Largest rank correlation of an unknown with where the last level moved it from."""
        return max(
            largest_correlation(*(_ranks(self.values[each]) for each in (one.start, one.runs)))
            for one in self.replicates
        )

    def failed_share(self, *, prior: bool) -> float:
        """Return the share of failed runs over the prior, or among candidates at the posterior."""
        members = self.sampled.exponent == (0.0 if prior else 1.0)
        return float((~np.isfinite(self.log_likelihood[members])).mean())

    @property
    def failure_note(self) -> str:
        """Text on failed runs around the posterior; empty where they are few."""
        share = self.failed_share(prior=False)
        return texts.FAILED_AT_POSTERIOR.format(share=share) if share > MANY_FAILED else ""

    @property
    def faults(self) -> list[str]:
        """Reasons why each unknown is not sampled well, in words; empty where it is."""
        found = []
        part = self.standard_error / self._pooled.std(axis=0, ddof=1)
        related = self.related
        for rhat, error in zip(self.rhat.tolist(), part.tolist(), strict=True):
            reasons = (
                texts.NO_R_HAT if math.isnan(rhat) else "",
                texts.LARGE_R_HAT.format(rhat=rhat) if rhat >= _LARGEST_RHAT else "",
                texts.FEW_EFFECTIVE_DRAWS.format(error=error) if error >= _LARGEST_ERROR else "",
                texts.ENDED_TOO_EARLY.format(related=related) if related > _RELATED else "",
            )
            found.append("; ".join(filter(None, reasons)))
        return found

    @property
    def _pooled(self) -> FloatArray:
        return self.draws.reshape(-1, len(self.names))

    def _estimate(self, value: FloatArray | float, of_replicates: FloatArray) -> Estimate:
        error, freedom = _standard_error(of_replicates), len(of_replicates) - 1
        bounds = student_interval(value, error, freedom, self.level)
        return Estimate(value, *bounds, texts.STUDENT_OVER_REPLICATES, "nominal")


def _standard_error(of_replicates: FloatArray) -> FloatArray:
    error: FloatArray = of_replicates.std(axis=0, ddof=1) / math.sqrt(len(of_replicates))
    return error


def _ranks(values: FloatArray) -> FloatArray:
    ranks: FloatArray = scipy.stats.rankdata(values, axis=0)
    return ranks


def rank_normalised_rhat(draws: FloatArray) -> float:
    """Return R-hat of the ranks of draws, or of their distances from the median if that is larger.

    Parameters
    ----------
    draws : ndarray, shape (replicate, draw)

    References
    ----------
    Vehtari, A., Gelman, A., Simpson, D., Carpenter, B. & Bürkner, P.-C. (2021). Bayesian Analysis
    16, 667-718.
    """
    half = draws.shape[1] // 2
    halves = np.concatenate([draws[:, :half], draws[:, -half:]])
    found = []
    for values in (halves, np.abs(halves - np.median(halves))):
        ranks = scipy.stats.rankdata(values, axis=None).reshape(values.shape)
        scores = scipy.special.ndtri((ranks - 0.375) / (values.size + 0.25))
        within = scores.var(axis=1, ddof=1).mean()
        between = scores.mean(axis=1).var(ddof=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            found.append(np.sqrt((between + within * (half - 1) / half) / within))
    return float(np.max(found))


# The statistics of an archive, and the groups that other programs read.

PROBABILITIES = (0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975)


def posterior_sample(
    measured: Experiments, runs: xr.Dataset, level: float
) -> PosteriorSample | str:
    """Return the posterior in the runs of a design, or the reason why it has none."""
    names, values = unknown_values(measured, runs)
    columns = (REPLICATE, LIKELIHOOD_EXPONENT, PARENT_DRAW, LEAST_LOG_LIKELIHOOD)
    coordinates = (runs[name].values[:: measured.count] for name in columns)
    sampled = PosteriorPoints(values, *coordinates)
    found = log_likelihoods(measured, runs)
    _, of_prior = unknown_values(measured, runs, of_prior=True)
    return PosteriorSample.of(names, values, sampled, found, level, of_prior)


def unknown_values(
    measured: Experiments, runs: xr.Dataset, *, of_prior: bool = False
) -> tuple[tuple[str, ...], FloatArray]:
    """Return names of the unknowns, and their values in all draws, shape (draw, unknown)."""
    names = (*measured.unknown, *(each.name for each in measured.errors.sizes))
    inputs = [measured.drawn(runs, name) for name in measured.unknown]
    return names, np.column_stack([*inputs, error_stds(measured, runs, of_prior=of_prior)])


def posterior_statistics(
    joint: JointDistribution, measured: Experiments, runs: xr.Dataset, stream: Stream, level: float
) -> Iterator[tuple[str, xr.DataArray | xr.Dataset]]:
    """Yield what the runs of a posterior say, by the names of the catalogue, and its groups.

    The groups are those of `arviz_groups`; there are none without a posterior.
    """
    runs, beyond = split_runs(measured, runs)
    sample = posterior_sample(measured, runs, level)
    if isinstance(sample, str):
        yield from no_posterior(measured, sample, level)
        return
    drawn = sample.runs.ravel()
    shares = np.full(len(drawn), 1 / len(drawn))
    predicted = measured.predicted(runs)[drawn]
    sizes = sample.values[drawn, len(measured.unknown) :]
    yield from predicted_rows(measured, predicted, sizes, shares)
    if measured.blank.count:
        at = np.searchsorted(beyond[PARENT_DRAW].values[:: measured.blank.count], drawn)
        results = measured.blank.predicted(beyond)[at]
        yield from blank_row_statistics(measured, predicted, sizes, results, level)
    notes = np.array(sample.faults, dtype=object)
    estimates = {
        "posterior_mean": replace(sample.mean, note=notes).with_note(sample.failure_note),
        "posterior_std": sample.std,
        "posterior_quantile": Estimate.stacked(map(sample.quantile, PROBABILITIES)),
        "log_evidence": sample.log_evidence,
    }
    numbers: dict[str, FloatArray | float] = {
        "prior_std": sample.prior_std,
        "learnt": sample.learnt,
        "rhat": sample.rhat,
        "effective_draws": sample.effective_draws,
        "sampled_well": float(not any(sample.faults)),
        "prior_failed_share": sample.failed_share(prior=True),
        "posterior_failed_share": sample.failed_share(prior=False),
        "start_correlation": sample.related,
    }
    yield from described_statistics(measured, estimates, numbers, level)
    yield failed_shares(measured, runs, sample.sampled.exponent == 1)
    prior = np.flatnonzero(sample.sampled.exponent == 0).reshape(len(sample.runs), -1)
    groups = {
        "posterior": (sample.runs, sample.values),
        "prior": (prior, sample.values if sample.prior_values is None else sample.prior_values),
    }
    yield from arviz_groups(joint, measured, runs, groups, sample.log_likelihood, stream)


def predicted_rows(
    measured: Experiments, predicted: FloatArray, sizes: FloatArray, shares: FloatArray
) -> NamedArrays:
    """Yield what was measured and what draws of a posterior say of it.

    Parameters
    ----------
    measured : Experiments
    predicted : ndarray, shape (draw, row)
        Results of draws whose runs completed.
    sizes : ndarray, shape (draw, size)
        Their standard deviations of measurements.
    shares : ndarray, shape (draw,)
        Their weights, of sum 1.
    """
    middle = shares @ predicted
    # The covariance of the errors is that at the mean.
    covariance = measured.errors.covariance(middle, np.sqrt(shares @ sizes**2))
    variance = shares @ (predicted - middle) ** 2 / (1 - shares @ shares)
    yield from measured.measured_rows(
        measured_std=np.sqrt(np.diag(covariance)),
        predicted_mean=middle,
        predicted_std=np.sqrt(variance),
    )


# Draws of a normal distribution that stand for it among those of others.
_NORMAL = scipy.special.ndtri((np.arange(49) + 0.5) / 49)


def blank_row_statistics(
    measured: Experiments,
    predicted: FloatArray,
    sizes: FloatArray,
    results: FloatArray,
    level: float,
) -> NamedArrays:
    """Yield what a posterior predicts where nothing was measured: the model with its own error.

    Parameters
    ----------
    measured : Experiments
    predicted : ndarray, shape (draw, row)
        Results of the draws of a posterior.
    sizes : ndarray, shape (draw, size)
        Their numbers of the errors that are not known.
    results : ndarray, shape (draw, blank row)
        Results at the blank rows; NaN where a run failed.
    level : float
        Probability of the truth to be inside of an interval.
    """
    blank, errors = measured.blank, measured.errors
    means, variances = results.copy(), np.zeros(results.shape)
    for draw in range(len(means) if errors.has_discrepancy else 0):
        covariance = errors.covariance(predicted[draw], sizes[draw])
        off = measured.values - predicted[draw]
        mean, variances[draw] = errors.discrepancies(blank.errors, off, covariance, sizes[draw])
        means[draw] += mean
    estimates, stds = [], []
    for mean, variance in zip(means.T, variances.T, strict=True):
        kept = np.isfinite(mean)
        mean, variance = mean[kept], variance[kept]
        if not len(mean):
            estimates.append(Estimate.without_bounds(math.nan, texts.NO_RUN))
            stds.append(math.nan)
            continue
        drawn = mean[:, np.newaxis] + np.sqrt(variance)[:, np.newaxis] * _NORMAL
        lower, upper = np.quantile(drawn, (0.5 - level / 2, 0.5 + level / 2)).tolist()
        failed = len(kept) - len(mean)
        note = texts.FAILED_DRAWS.format(failed=failed, draws=len(kept)) if failed else ""
        method = texts.POSTERIOR_PREDICTIVE
        estimates.append(Estimate(float(mean.mean()), lower, upper, method, "nominal", note))
        stds.append(math.sqrt(mean.var() + variance.mean()))
    whole, at = (dict(each.measured_rows()) for each in (measured, blank))
    found = Estimate.stacked(estimates)
    for (each, own), (_, there) in zip(measured.rows, blank.rows, strict=True):
        of = each.errors.discrepancy
        names = [] if of is None else whole["condition"][MEASURED_CONDITION].values.tolist()
        for place, name in enumerate(names):
            if of is not None and name == of.along and of.zero_at is not None:
                continue
            known, values = (array["condition"].values[:, place] for array in (whole, at))
            is_beyond = np.zeros(len(values), dtype=np.bool_)
            lowest, highest = known[own].min(), known[own].max()
            is_beyond[there] = (values[there] < lowest) | (values[there] > highest)
            reason = texts.BEYOND_MEASURED.format(name=name)
            found = found.remove_bounds_at(is_beyond, reason)
    along = {BLANK_ROW: np.arange(1, len(stds) + 1)}
    described = {"units": DIMENSIONLESS, "long_name": "predictions, each in its SI unit"}
    yield "prediction", found.to_array(BLANK_ROW, coordinates=along, level=level, **described)
    spread = np.where(found.has_bounds, stds, np.nan)
    yield "prediction_std", xr.DataArray(spread, along, (BLANK_ROW,))
    for name, own_name in (
        ("measured_output", "prediction_output"),
        ("file_row", "prediction_row"),
        ("condition", "prediction_condition"),
    ):
        if name in at:
            yield own_name, at[name].rename({MEASURED_ROW: BLANK_ROW})


# Groups of a posterior with its draws, and with their numbers.
POSTERIOR_DRAWS = ("posterior", "sample_stats")


def left_out_predictions(
    measured: Experiments, runs: xr.Dataset, draws: xr.Dataset | None, numbers: xr.Dataset | None
) -> tuple[FloatArray, list[float]]:
    """Return what a posterior predicts of the rows held out, and sizes of their errors.

    Parameters
    ----------
    measured : Experiments
    runs : Dataset
        All runs of the design.
    draws, numbers : Dataset or None
        The groups `POSTERIOR_DRAWS`; None without a posterior.

    Returns
    -------
    predicted : ndarray, shape (draw, row)
        Results of the model alone; there is no draw without a posterior.
    sizes : list of float
        The root mean square over the posterior of each size that is not known.
    """
    left_out = measured.left_out
    if draws is None or numbers is None:
        return np.empty((0, len(left_out.values))), left_out.errors.scales
    _, beyond = split_runs(measured, runs)
    drawn = numbers["draw_number"].values.ravel()
    at = np.searchsorted(beyond[PARENT_DRAW].values[:: measured.blank.count], drawn)
    own = [size is each.errors.size for each, _ in measured.rows for size in each.errors.sizes]
    values = np.column_stack([each.values.ravel() for each in draws.values()])
    squares = values[:, len(measured.unknown) :][:, own] ** 2
    return left_out.predicted(beyond)[at], np.sqrt(squares.mean(axis=0)).tolist()


def failed_shares(
    measured: Experiments, runs: xr.Dataset, draws: BoolArray | IntArray
) -> tuple[str, xr.DataArray]:
    """Return the share of failed runs of each experiment among some draws, with its name."""
    failed = (runs[STATUS].values != Status.OK).reshape(-1, measured.count)
    numbered = {EXPERIMENT: np.arange(1, measured.count + 1)}
    shares = xr.DataArray(failed[draws].mean(axis=0), numbered, (EXPERIMENT,))
    return "experiment_failed_share", shares


def no_posterior(measured: Experiments, reason: str, level: float) -> NamedArrays:
    """Yield the reason in the place of a mean, where runs give no posterior of the unknowns."""
    unknowns = len(measured.unknown) + len(measured.errors.sizes)
    nothing = Estimate.without_bounds(np.full(unknowns, np.nan), reason)
    yield from described_statistics(measured, {"posterior_mean": nothing}, {}, level)


def described_statistics(
    measured: Experiments,
    estimates: Mapping[str, Estimate],
    numbers: Mapping[str, FloatArray | float],
    level: float,
) -> NamedArrays:
    """Yield statistics of a posterior as arrays, along the unknowns where they are of each.

    Parameters
    ----------
    measured : Experiments
    estimates : mapping of str to Estimate
        By the names of the catalogue: of shape (unknown,), (unknown, probability) or ().
    numbers : mapping of str to ndarray or float
        The same without intervals.
    level : float
        Confidence level of the intervals.
    """
    names = [*measured.unknown, *(each.name for each in measured.errors.sizes)]
    shown = [*measured.unknown, *(each.like for each in measured.errors.sizes)]
    unit_like = np.array(shown, dtype=object)
    yield "unit_like", xr.DataArray(unit_like, {UNKNOWN: names}, (UNKNOWN,))
    sizes = {UNKNOWN: names, PROBABILITY: np.array(PROBABILITIES)}
    for name, estimate in estimates.items():
        dims = [*sizes][: np.ndim(estimate.value)]
        title = "unknowns, each in its SI unit" if dims else CALIBRATION_STATISTICS[name].title
        described: dict[str, Any] = {"units": DIMENSIONLESS, "long_name": title, "level": level}
        along = {each: sizes[each] for each in dims}
        yield name, estimate.to_array(*dims, coordinates=along, **described)
    for name, values in numbers.items():
        if np.ndim(values):
            yield name, xr.DataArray(values, {UNKNOWN: names}, (UNKNOWN,))
            continue
        title = CALIBRATION_STATISTICS[name].title
        yield name, xr.DataArray(values, attrs={"units": DIMENSIONLESS, "long_name": title})


def arviz_groups(
    joint: JointDistribution,
    measured: Experiments,
    runs: xr.Dataset,
    draws: Mapping[str, tuple[IntArray, FloatArray]],
    log_likelihood: FloatArray,
    stream: Stream,
) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield groups of a posterior by the names and dimensions of ArviZ, in SI units.

    A size of errors that follows from repeats is drawn for each draw: for one of the posterior with
    its results; for one of the prior by what repeats say alone. So predictions are Student's t.

    Parameters
    ----------
    joint : JointDistribution
    measured : Experiments
    runs : Dataset
        Runs of a design for its posterior.
    draws : mapping of str to tuple of ndarray
        Of the groups ``posterior`` and ``prior``: the numbers of their draws, of shape
        (chain, draw), and the unknowns in all draws, of shape (draw, unknown).
    log_likelihood : ndarray, shape (draw,)
        Of all draws.
    stream : Stream
        Source of the errors that predictions have.
    """
    predicted = measured.predicted(runs)
    for group, (numbers, values) in draws.items():
        stds = values[:, len(measured.unknown) :]
        yield group, unknowns_dataset(measured, runs, values[numbers])
        rng = stream.generator(group)
        drawn = predicted[numbers]
        left_out = np.full(drawn.shape, np.nan)
        rng_of_sizes = stream.generator(group, "sizes by repeats")
        added = [*_added_by_repeats(measured, predicted, stds, rng_of_sizes, group)]
        for at, number in np.ndenumerate(numbers):
            normal = rng.standard_normal(drawn.shape[-1])
            if np.isfinite(predicted[number]).all():
                whole = measured.errors.covariance(predicted[number], stds[number])
                for rows, correlation, variance in added:
                    whole[rows, rows] += variance[number] * correlation
                covariance = whole
                off = measured.values - predicted[number]
                if group == "posterior" and measured.errors.has_discrepancy:
                    # The model's own error is the one that the measurements teach.
                    own = measured.errors.model_covariance(stds[number])
                    weights = np.linalg.solve(covariance, own)
                    drawn[at] += off @ weights
                    covariance = covariance - own @ weights
                variances, axes = np.linalg.eigh(covariance)
                drawn[at] += axes @ (np.sqrt(np.maximum(variances, 0)) * normal)
                if group == "posterior":
                    left_out[at] = conditional_log_densities(off, whole)
        yield f"{group}_predictive", _rows_dataset(measured, drawn, CHAINS)
        if group == "posterior" and (measured.censoring == EXACTLY).all():
            yield "log_likelihood", _rows_dataset(measured, left_out, CHAINS)
    numbers, values = draws["posterior"]
    densities = _log_prior(joint, measured, values[numbers])
    if densities is not None:
        yield "log_prior", unknowns_dataset(measured, runs, densities, unit=DIMENSIONLESS)
    yield "observed_data", _rows_dataset(measured, measured.values, ())
    yield "constant_data", _conditions_dataset(measured, runs)
    found = {"log_likelihood": (CHAINS, log_likelihood[numbers]), "draw_number": (CHAINS, numbers)}
    yield "sample_stats", xr.Dataset(found, _along_chains(numbers.shape))


def _added_by_repeats(
    measured: Experiments,
    predicted: FloatArray,
    sizes: FloatArray,
    rng: np.random.Generator,
    group: str,
) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
    """Yield rows whose size of errors follows from repeats, their correlation, and a variance.

    That is how much more each draw has than repeats have, shape (draw,).
    """
    completed = np.flatnonzero(np.isfinite(predicted).all(axis=1))
    drawn = measured.likelihood.sizes_by_repeats(predicted[completed], sizes[completed], rng)
    for each, own, size in drawn:
        freedom, square = each.errors.freedom, each.errors.std[0] ** 2
        squares = size**2
        if group == "prior":
            squares = square * freedom / rng.chisquare(freedom, len(completed))
        variance = np.zeros(len(predicted))
        variance[completed] = squares - square
        yield own, each.correlation, variance


def _log_prior(
    joint: JointDistribution, measured: Experiments, values: FloatArray
) -> FloatArray | None:
    """Return the logarithm of the prior density of each unknown, shape (..., unknown).

    None where they depend on each other, or one has no density.
    """
    joined = () if joint.dependence is None else joint.dependence.inputs
    is_joined = len({*joined} & {*measured.unknown}) > 1
    if is_joined or joint.reason_without_density(measured.unknown):
        return None
    found: list[FloatArray | None] = []
    known = {each.variable.name: each.distribution for each in joint.random}
    for place, name in enumerate(measured.unknown):
        found.append(known[name].log_density(values[..., place]))
    for place, size in enumerate(measured.errors.sizes, len(found)):
        found.append(scipy.stats.halfnorm.logpdf(values[..., place], scale=size.scale))
    return np.stack([each for each in found if each is not None], axis=-1)


def conditional_log_densities(errors: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the logarithm of the density of each normal error given all others, shape (row,).

    References
    ----------
    Bürkner, P.-C., Gabry, J. & Vehtari, A. (2021). Computational Statistics 36, 1243-1261.
    """
    inverse = np.linalg.inv(covariance)
    variance = 1 / np.diag(inverse)
    off = variance * (inverse @ errors)
    density: FloatArray = -0.5 * (off**2 / variance + np.log(2 * math.pi * variance))
    return density


CHAINS = ("chain", "draw")


def _along_chains(shape: tuple[int, ...]) -> dict[str, IntArray]:
    """Return the numbers of chains and of draws."""
    return {name: np.arange(size) for name, size in zip(CHAINS, shape, strict=False)}


def unknowns_dataset(
    measured: Experiments, runs: xr.Dataset, values: FloatArray, unit: str = ""
) -> xr.Dataset:
    """Return numbers of shape (chain, draw, unknown) by unknown, in its SI unit or another."""
    units = {name: str(runs[name].attrs["units"]) for name in measured.unknown}
    units |= {each.name: each.unit for each in measured.errors.sizes}
    columns = zip(units.items(), np.moveaxis(values, -1, 0), strict=True)
    found = {name: (CHAINS, each, {"units": unit or own}) for (name, own), each in columns}
    return xr.Dataset(found, _along_chains(values.shape))


def _rows_dataset(measured: Experiments, values: FloatArray, dims: tuple[str, ...]) -> xr.Dataset:
    """Return values at the rows of the measurements, by their outputs."""
    found: dict[str, Any] = {
        name: ((*dims, f"{name}_row"), values[..., rows], {"units": each.output.unit})
        for name, each, rows in _named_rows(measured)
    }
    return xr.Dataset(found, _along_chains(values.shape) if dims else {})


def _conditions_dataset(measured: Experiments, runs: xr.Dataset) -> xr.Dataset:
    """Return the experiments, conditions and places of the rows, by their outputs."""
    found: dict[str, Any] = {}
    for name, each, rows in _named_rows(measured):
        row, known = (f"{name}_row",), dict(measured.described_rows(rows))
        units = {of.name: of.unit for of in each.output.dims}
        found[f"{name}_experiment"] = (row, known["experiment_number"].values)
        if (conditions := known.get("condition")) is None:
            continue
        for key, column in zip(
            conditions[MEASURED_CONDITION].values.tolist(), conditions.values.T, strict=True
        ):
            if np.isfinite(column).all():
                unit = units.get(key) or str(runs[key].attrs["units"])
                found[f"{name}_{key}"] = (row, column, {"units": unit})
    return xr.Dataset(found)


def _named_rows(measured: Experiments) -> Iterator[tuple[str, MeasuredOutput, slice]]:
    """Yield a name for each measured output, which is that of its output once, and its rows."""
    taken: set[str] = set()
    for number, (each, rows) in enumerate(measured.rows):
        name = each.output.name
        name = f"{name}_{number + 1}" if name in taken else name
        taken.add(name)
        yield name, each, rows
