"""Posterior of a dear model: rounds of runs at draws of a surrogate's posterior, then weights."""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import ndtri

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import PREDICTED_LOG_LIKELIHOOD, SEARCH_ROUND, VARIANCE_SCALE
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.core.streams import Stream
from uqpen.designs.at_experiments import MeasuredDesign
from uqpen.designs.design import NO_STEP_BETWEEN_LABELS, Rounds
from uqpen.designs.posterior import (
    PARTICLES_OF_EACH,
    PosteriorPoints,
    PriorCoordinates,
    Replicate,
    sample_posterior,
)
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.measurements.errors import EXACTLY
from uqpen.measurements.experiments import Experiments
from uqpen.surrogates.gaussian_process_fit import (
    SMOOTHNESS,
    ConditionedProcess,
    GaussianProcessFit,
    Parameters,
    ProcessData,
    improve_parameters,
    likeliest_parameters,
    trend_terms,
)
from uqpen.surrogates.principal_components import PrincipalComponents

# Surrogate of the results at the rows of the measurements.

# Variance that the components leave, over all rows, in units of that of an error.
_TRUNCATED = 0.01
_SMOOTHNESS = SMOOTHNESS["matern-5/2"]
# Completed runs of each unknown, and of their mean, that a fit takes at least.
_RUNS_OF_EACH = 4
# Steps of a search that starts from the parameters of the round before.
_STEPS = 30
# Largest number of entries of covariances that are in memory at once.
_MOST_ENTRIES = 2**22


class PartSurrogate(NamedTuple):
    """Gaussian processes of the principal components of results at rows with the same inputs.

    Results are whitened: in units, and along the axes, of the errors of measurement.
    """

    rows: IntArray  # of the measurements
    coordinates: IntArray  # of a draw, on which their results depend
    values: FloatArray  # (row,): what was measured
    root: FloatArray  # (row, row): Cholesky factor of the covariance of the errors
    components: PrincipalComponents
    fits: tuple[GaussianProcessFit, ...]  # one for each component

    def predict(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return whitened results, shape (draw, row), and the variances of their scores.

        The variances, of shape (draw, component), are without the factor.
        """
        predicted = [each.predict(points[:, self.coordinates]) for each in self.fits]
        means = np.column_stack([each.mean for each in predicted])
        stds = np.column_stack([each.std for each in predicted if each.std is not None])
        return self.components.sums(means), stds**2

    def results(self, whitened: FloatArray) -> FloatArray:
        """Return results from whitened ones, shape (draw, row)."""
        return self.values + whitened @ self.root.T


@dataclass(frozen=True, eq=False)
class RowsSurrogate:
    """Surrogate of the results at all rows: parts whose errors are independent of each other."""

    measured: Experiments
    parts: tuple[PartSurrogate, ...]
    # Factor of all variances, so that errors of runs that were predicted before have the variance 1
    variance_scale: float = 1.0

    @classmethod
    @one_blas_thread()
    def fit(
        cls,
        prior: PriorCoordinates,
        points: FloatArray,
        results: FloatArray,
        stream: Stream,
        before: RowsSurrogate | None = None,
        variance_scale: float = 1.0,
    ) -> RowsSurrogate | None:
        """Fit the completed runs; None where they are too few or all alike.

        Parameters
        ----------
        prior : PriorCoordinates
        points : ndarray, shape (draw, coordinate)
            In standard normal space.
        results : ndarray, shape (draw, row)
            NaN where a run failed.
        before : RowsSurrogate, optional
            The fit to fewer runs, from whose parameters the search starts.
        """
        measured = prior.measured
        # An error that is a share of 0 has no size.
        is_known = np.isfinite(results)
        sizes = np.where(is_known, np.abs(results), 0.0).sum(axis=0)
        sizes /= np.maximum(is_known.sum(axis=0), 1)
        at = np.where(measured.values == 0, sizes, measured.values)
        covariance = measured.errors.covariance(at, np.array(measured.errors.scales))
        rngs = (stream.generator("component", number) for number in itertools.count())
        parts: list[PartSurrogate] = []
        for number, (rows, coordinates) in enumerate(prior.parts()):
            known = before.parts[number].fits if before else ()
            own, errors = results[:, rows], covariance[np.ix_(rows, rows)]
            completed = np.isfinite(own).all(axis=1)
            inputs, own = points[np.ix_(completed, coordinates)], own[completed]
            is_few = len(inputs) < _RUNS_OF_EACH * (len(coordinates) + 1)
            if is_few or not np.ptp(own, axis=0).any() or not np.diag(errors).all():
                return None
            root = np.asarray(np.linalg.cholesky(errors), dtype=np.float64)
            whitened = solve_triangular(root, (own - measured.values[rows]).T, lower=True).T
            whole = float(whitened.var(axis=0).sum())
            kept = 1 - min(_TRUNCATED / whole, 0.5)
            components = PrincipalComponents.of_runs(whitened, np.ones(len(rows)), kept)
            fits = [
                _fitted_process(inputs, scores, next(rngs), start)
                for scores, start in itertools.zip_longest(
                    components.scores(whitened).T, known[: components.count]
                )
            ]
            found = tuple(each for each in fits if each is not None)
            if len(found) < len(fits):
                return None
            values = measured.values[rows]
            parts.append(PartSurrogate(rows, coordinates, values, root, components, found))
        return cls(measured, tuple(parts), variance_scale)

    @one_blas_thread()
    def log_likelihood(self, points: FloatArray, sizes: FloatArray) -> FloatArray:
        """Return the logarithm of the likelihood, with the variance of the surrogate.

        It is added to the covariance of the errors with the covariance between places.

        Parameters
        ----------
        points : ndarray, shape (draw, coordinate)
        sizes : ndarray, shape (draw, size)
            Standard deviations of measurements that are not known.
        """
        measured, rows = self.measured, len(self.measured.values)
        is_fixed = measured.errors.is_fixed and not measured.errors.sizes
        if is_fixed and (measured.censoring == EXACTLY).all():
            (part,) = self.parts
            whitened, variances = part.predict(points)
            return self._log_density(part, whitened, self.variance_scale * variances)
        found = np.empty(len(points))
        at_once = max(1, _MOST_ENTRIES // rows**2)
        for first in range(0, len(points), at_once):
            some = slice(first, first + at_once)
            results = np.empty((len(points[some]), rows))
            added = np.zeros((*results.shape, rows))
            for part in self.parts:
                whitened, variances = part.predict(points[some])
                shapes = part.components.components
                covariance = (variances[:, np.newaxis] * shapes.T) @ shapes
                covariance += np.diag(part.components.truncated)
                results[:, part.rows] = part.results(whitened)
                added[:, part.rows[:, np.newaxis], part.rows] = (
                    part.root @ (self.variance_scale * covariance) @ part.root.T
                )
            found[some] = measured.likelihood.log_density(results, sizes[some], added=added)
        return found

    def z_scores(self, points: FloatArray, results: FloatArray) -> FloatArray:
        """Return the root mean squares of what results were off, in standard deviations.

        They are of the surrogate without its factor; of completed runs alone, shape (run,).
        """
        completed = np.isfinite(results).all(axis=1)
        squares, expected = np.zeros((2, int(completed.sum())))
        for part in self.parts:
            whitened, variances = part.predict(points[completed])
            off = results[np.ix_(completed, part.rows)] - part.results(whitened)
            errors = solve_triangular(part.root, off.T, lower=True)
            squares += (errors**2).sum(axis=0)
            # The components are orthonormal.
            expected += variances.sum(axis=1) + part.components.truncated.sum()
        found: FloatArray = np.sqrt(squares / expected)
        return found

    def _log_density(
        self, part: PartSurrogate, whitened: FloatArray, variances: FloatArray
    ) -> FloatArray:
        """Return the same where errors are known, by matrices of components alone.

        By Woodbury's identity and the matrix determinant lemma.
        """
        shapes = part.components.components
        own = 1 + self.variance_scale * part.components.truncated
        std = np.sqrt(variances)
        within = (shapes / own) @ shapes.T
        matrix = np.eye(len(shapes)) + std[:, :, np.newaxis] * within * std[:, np.newaxis]
        lower = np.linalg.cholesky(matrix)
        along = ((whitened / own) @ shapes.T * std)[..., np.newaxis]
        squares = (whitened**2 / own).sum(axis=1)
        squares -= (np.linalg.solve(lower, along) ** 2).sum(axis=(1, 2))
        diagonal = np.diagonal(lower, axis1=1, axis2=2)
        constant = np.log(own).sum() + 2 * np.log(np.diag(part.root)).sum()
        constant += len(own) * math.log(2 * math.pi)
        found: FloatArray = -0.5 * (squares + constant) - np.log(diagonal).sum(axis=1)
        return found


def _fitted_process(
    points: FloatArray,
    values: FloatArray,
    rng: np.random.Generator,
    start: GaussianProcessFit | None,
) -> GaussianProcessFit | None:
    """Return the process of a score; None where its correlations are singular to rounding."""
    location, scales = points.mean(axis=0), points.std(axis=0)
    centre, scale = float(values.mean()), float(values.std())
    coordinates = (points - location) / scales
    trend = trend_terms(coordinates, is_linear=False)
    data = ProcessData(coordinates, (values - centre) / scale, trend, _SMOOTHNESS)
    if start is None:
        parameters = likeliest_parameters(data, rng)
    else:
        lengths = start.lengths * start.input_scale / scales
        parameters = improve_parameters(data, Parameters(lengths, start.nugget), _STEPS)
    process = ConditionedProcess.of_runs(data, parameters)
    if process is None:
        return None
    none = np.zeros(len(scales), dtype=np.int64)
    return GaussianProcessFit(
        input_is_logarithm=none,
        input_location=location,
        input_scale=scales,
        points=coordinates / parameters.lengths,
        lengths=parameters.lengths,
        nugget=parameters.nugget,
        weights=process.weights,
        trend=process.coefficients,
        std=math.sqrt(process.variance),
        std_factor=1.0,
        centre=centre,
        scale=scale,
        smoothness=_SMOOTHNESS,
        q2=math.nan,
        of_logarithm=0,
        input_labels=none,
    )


# Weighted draws: real over surrogate likelihood.


def importance_weights(log_likelihood: FloatArray, predicted: FloatArray) -> FloatArray:
    """Return weights of draws of a surrogate's posterior; their sum is 1, of failed runs 0.

    Parameters
    ----------
    log_likelihood, predicted : ndarray, shape (draw,)
        Logarithms of the likelihood, NaN where a run failed, and of that by the surrogate.
    """
    ratio = np.where(np.isfinite(log_likelihood), log_likelihood - predicted, -np.inf)
    if not np.isfinite(ratio).any():
        return np.zeros(len(ratio))
    weights = np.exp(ratio - ratio.max())
    shares: FloatArray = weights / weights.sum()
    return shares


# The search: rounds of draws of the posterior so far.

# Particles that sample a surrogate's posterior, and most moves of a level and of all.
_PARTICLES, _MOVES, _ALL_MOVES = 1000, 25, 1000
# Replicates of the sampler for the draws of the result, as particles may find a narrow peak late.
_REPLICATES = 4
# Batches end early where this share of the draws of one is effective: few draws overstate it.
_ENOUGH = 0.75
# Batches of which z scores widen the variance.
_SCORED = 2
# Number of the round of the draws that are the result.
RESULT = -1


class SearchedDraws(NamedTuple):
    """Draws of a round, and of each what the analysis needs."""

    points: FloatArray  # (draw, coordinate): in standard normal space
    search_round: IntArray  # (draw,): 0 of the prior; `RESULT` of the last round
    # (draw,): logarithm of the likelihood by the surrogate that they were drawn by; NaN at first
    predicted: FloatArray
    variance_scale: FloatArray  # (draw,): factor that z scores gave its variance; NaN at first


def search_posterior(
    prior: PriorCoordinates, settings: SurrogatePosterior, stream: Stream
) -> Generator[SearchedDraws, FloatArray, None]:
    """Search a posterior by rounds of draws of the posterior so far, by a surrogate of all runs.

    The draws of the last round are independent of each other. Their runs, with weights, are the
    posterior.

    Yields
    ------
    SearchedDraws
        It is sent the results at the rows of the measurements, shape (draw, row), with NaN where a
        run failed.
    """
    points = ndtri(sobol_points(stream.generator("prior"), settings.runs, prior.dimension))
    nothing = np.full(len(points), np.nan)
    of_prior = np.zeros(len(points), dtype=np.int64)
    results = yield SearchedDraws(points, of_prior, nothing, nothing)
    surrogate: RowsSurrogate | None = None
    scores: list[FloatArray] = []
    left = [*range(1, settings.batches + 1), RESULT]
    while left:
        number = left.pop(0)
        own = stream.child("round", number)
        last = np.concatenate(scores[-_SCORED:]) if scores else np.empty(0)
        # Scores of the middle are small where a posterior has long ridges, so none narrows it.
        scale = max(1.0, float((last**2).mean())) if len(last) else 1.0
        surrogate = RowsSurrogate.fit(prior, points, results, own, surrogate, scale)
        if surrogate is None:
            return
        size = settings.confirm if number == RESULT else settings.batch
        found = draw_posterior(surrogate, prior, number, size, own)
        if found is None:
            return
        drawn, predicted = found
        made = yield SearchedDraws(drawn, np.full(size, number), predicted, np.full(size, scale))
        real = prior.measured.likelihood.log_density(made, prior.error_stds(drawn))
        weights = importance_weights(real, predicted)
        if weights.any() and _ENOUGH * size * (weights**2).sum() <= 1:
            left = left[-1:]
        scores.append(surrogate.z_scores(drawn, made))
        points, results = np.concatenate([points, drawn]), np.concatenate([results, made])


@one_blas_thread()
def draw_posterior(
    surrogate: RowsSurrogate, prior: PriorCoordinates, number: int, size: int, stream: Stream
) -> tuple[FloatArray, FloatArray] | None:
    """Return draws of a surrogate's posterior, and their log likelihood; None without an end."""
    replicates = _REPLICATES if number == RESULT else 1
    most = replicates * _ALL_MOVES * _PARTICLES
    sampler = sample_posterior(prior.dimension, _PARTICLES, replicates, most, stream, _MOVES)
    asked, found = [next(sampler)], list[FloatArray]()
    with suppress(StopIteration):
        while True:
            points = asked[-1].points
            found.append(surrogate.log_likelihood(points, prior.error_stds(points)))
            asked.append(sampler.send(found[-1]))
    sampled = PosteriorPoints(*(np.concatenate(each) for each in zip(*asked, strict=True)))
    predicted = np.concatenate(found)
    samples = [Replicate.of(sampled, predicted, replicate) for replicate in range(replicates)]
    ended = [each for each in samples if each is not None and each.exponent == 1]
    if not ended:
        return None
    # A replicate that found a narrow peak late has few particles there, and little evidence.
    evidence = np.repeat([each.log_evidence for each in ended], _PARTICLES)
    weights = np.exp(evidence - evidence.max())
    states = np.concatenate([each.runs for each in ended])
    rng = stream.generator("draws")
    chosen = rng.choice(states, size, replace=False, p=weights / weights.sum())
    return sampled.points[chosen], predicted[chosen]


# The design.

# Least draws of the prior for each unknown, so that a process knows its lengths.
_DRAWS_OF_EACH = 8
# Most coordinates of a draw, so that the particles have a covariance that is worth to follow.
_MOST_COORDINATES = _PARTICLES // PARTICLES_OF_EACH


@dataclass(frozen=True)
class SurrogatePosterior(MeasuredDesign):
    """Posterior of the unknown inputs of a dear model, by a surrogate and weighted runs.

    Gaussian processes learn the outputs at the measurements from draws of the prior, then of the
    posterior so far. At last, independent draws of that posterior are run. Their weights, real over
    surrogate likelihood, make them draws of the posterior of the model itself.

    Parameters
    ----------
    runs : int
        Number of draws of the prior. All draws have a run in every experiment.
    batches : int
        Largest number of batches of draws of the posterior so far. They end where three
        quarters of the draws of one are effective.
    batch : int
        Number of draws of a batch.
    confirm : int
        Number of draws of the result. Where fewer than a third are effective, it is the posterior
        by the surrogate, not confirmed by the model.

    References
    ----------
    Higdon, D., Gattiker, J., Williams, B. & Rightley, M. (2008). J. Am. Statist. Assoc. 103,
    570-583 (principal components); Li, J. & Marzouk, Y. M. (2014). SIAM J. Sci. Comput. 36,
    A1163-A1186 (rounds at draws of the posterior so far).
    """

    sampling = Sampling.WEIGHTED_POSTERIOR

    unordered_reason = NO_STEP_BETWEEN_LABELS

    needs_numbers = True

    runs: int = count(minimum=10, maximum=1000, default=40)
    batches: int = count(maximum=100, default=4)
    batch: int = count(minimum=5, maximum=_PARTICLES // 2, default=20)
    confirm: int = count(minimum=30, maximum=_PARTICLES // 2, default=60)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        measured = self.experiments
        if measured.errors.has_discrepancy:
            found = "a discrepancy, which no surrogate is certified beside"
            yield Problem(("measured",), found, 'kind = "posterior", where it has a prior')
        yield from self.check_continuous(joint, {*measured.unknown, *measured.moved})
        if not measured.count:
            return  # the mistake of its measurements is noted
        if not measured.unknown:
            expected = "measurements with an unknown input"
            yield Problem(("measured",), "no input that is unknown", expected)
        prior = PriorCoordinates(joint, measured)
        inputs = max(len(coordinates) for _, coordinates in prior.parts())
        if self.runs < (least := _DRAWS_OF_EACH * inputs):
            expected = f"at least {least}, {_DRAWS_OF_EACH} for each of {inputs} inputs that are "
            expected += "unknown or vary"
            yield Problem(("runs",), str(self.runs), expected)
        if (found_dimension := prior.dimension) > _MOST_COORDINATES:
            found = f"{found_dimension} unknowns: inputs, and each value of what varies"
            yield Problem(
                ("measured",), found, f"at most {_MOST_COORDINATES}; or fewer experiments"
            )

    def run_count(self, joint: JointDistribution) -> int:
        draws = self.runs + self.batches * self.batch + self.confirm
        return draws * self.experiments.count

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        measured, prior = self.experiments, PriorCoordinates(joint, self.experiments)
        search = search_posterior(prior, self, stream)
        asked, made = next(search), 0
        while True:
            of_draws = {
                SEARCH_ROUND: asked.search_round,
                PREDICTED_LOG_LIKELIHOOD: asked.predicted,
                VARIANCE_SCALE: asked.variance_scale,
            }
            feedback = yield prior.runs(asked.points, made, of_draws)
            made += len(asked.points)
            (runs,) = feedback.runs.values()
            try:
                asked = search.send(measured.predicted(runs))
            except StopIteration:
                return
