"""Posterior: what measurements say of unknown inputs, by tempered sequential Monte Carlo."""

from __future__ import annotations

import math
from collections.abc import Collection, Generator, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import erfcinv, erfinv, ndtr, ndtri

from uqpen.core.arrays import BoolArray, FloatArray, IntArray, rows_by_weight
from uqpen.core.errors import Problem
from uqpen.core.labels import (
    DISCREPANCY,
    DRAW,
    ERROR_SHARE,
    ERROR_STD,
    EXPERIMENT,
    LEAST_LOG_LIKELIHOOD,
    LIKELIHOOD_EXPONENT,
    MEASURED,
    PARENT_DRAW,
    REPLICATE,
    RUN,
)
from uqpen.core.limits import MOST_REPLICATES
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, flag
from uqpen.core.streams import Stream
from uqpen.designs.at_experiments import LimitedMeasuredDesign
from uqpen.designs.design import NO_STEP_BETWEEN_LABELS, Rounds
from uqpen.designs.quasi_monte_carlo import sobol_points
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.measurements.errors import UnknownSize
from uqpen.measurements.experiments import Experiments

if TYPE_CHECKING:
    import xarray as xr

# Particles of a level: a sample of the prior, weighted by a power of the likelihood.

# The effective share of the particles that the weights of the next level leave.
_EFFECTIVE_SHARE = 0.5
# Halvings of the interval that an exponent is in, so that it is known to rounding.
_HALVINGS = 60


class Particles(NamedTuple):
    """States of a replicate at one level."""

    runs: IntArray  # (particle,): number of the run that each particle is
    log_likelihood: FloatArray  # (particle,): finite; of a candidate NaN where its run failed

    def at(self, part: Any) -> Particles:
        """Return some of the particles, given by an index."""
        return Particles(*(each[part] for each in self))

    def moved(self, candidates: Particles, least: FloatArray) -> Particles:
        """Return the particles after a move: candidates where they reach what they have to.

        Parameters
        ----------
        candidates : Particles
        least : ndarray, shape (particle,)
            The logarithm of the likelihood with which a candidate is accepted.
        """
        accepted = candidates.log_likelihood >= least
        both = zip(candidates, self, strict=True)
        return Particles(*(np.where(accepted, new, old) for new, old in both))

    def weights(self, step: float) -> FloatArray:
        """Return weights by a power of the likelihood; the largest is 1."""
        weights: FloatArray = np.exp(step * (self.log_likelihood - self.log_likelihood.max()))
        return weights

    def log_mean(self, step: float) -> float:
        """Return the logarithm of the mean of a power of the likelihood."""
        return step * float(self.log_likelihood.max()) + math.log(self.weights(step).mean())

    def next_exponent(self, exponent: float) -> float:
        """Return the power of the likelihood at the next level, 1 at most."""
        low, high = 0.0, 1 - exponent
        if self._effective_share(high) >= _EFFECTIVE_SHARE:
            return 1.0
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            is_near = self._effective_share(middle) >= _EFFECTIVE_SHARE
            low, high = (middle, high) if is_near else (low, middle)
        return exponent + high

    def _effective_share(self, step: float) -> float:
        weights = self.weights(step)
        return float(weights.sum() ** 2 / (weights**2).sum() / len(weights))


# Moves of particles, which keep the distribution of their level.

# Share of Crank-Nicolson's moves that forget where they start, and of differences of two particles
# in full length: both lead from one mode to another.
_WHOLE, _JUMP = 0.5, 1 / 3
# Of Crank-Nicolson's moves and of differences: shares of the others to accept, and longest lengths.
_TARGETS, _LONGEST = (0.4, 0.25), (1.0, 2.0)
# Logarithm of the factor by which a length follows the share that is accepted.
_FOLLOWING = 2.0


class Candidates(NamedTuple):
    """Candidates of a move."""

    points: FloatArray  # (particle, coordinate)
    # (particle,): logarithm of the ratio of acceptance where the likelihood stays the same.
    log_ratio: FloatArray
    is_adapted: BoolArray  # (particle,): whether its length is the one that is adapted


@dataclass(frozen=True, eq=False)
class Cloud:
    """Weighted particles of a level before it moves them, from which moves have their directions.

    A level keeps it: directions that followed the particles would not keep their distribution.
    """

    points: FloatArray  # (particle, coordinate): in standard normal space
    weights: FloatArray  # (particle,): their sum is 1
    mean: FloatArray  # (coordinate,)
    root: FloatArray  # (coordinate, coordinate): standard normal to the cloud's normal distribution
    inverse: FloatArray  # (coordinate, coordinate): back

    @classmethod
    def of(cls, points: FloatArray, weights: FloatArray) -> Cloud:
        """Return the cloud of points, with more effective ones than coordinates."""
        shares = weights / weights.sum()
        mean = shares @ points
        off = points - mean
        covariance = (off.T * shares) @ off / (1 - shares @ shares)
        variances, axes = np.linalg.eigh(covariance)
        std = np.sqrt(np.maximum(variances, np.finfo(float).eps * variances[-1]))
        return cls(points, shares, mean, (axes * std).T, axes / std)

    def crank_nicolson(
        self, points: FloatArray, length: float, rng: np.random.Generator
    ) -> Candidates:
        """Return moves that keep the cloud's normal distribution."""
        is_adapted = rng.random(len(points)) >= _WHOLE
        along = np.where(is_adapted, length, 1.0)[:, np.newaxis]
        standard = (points - self.mean) @ self.inverse
        moved = np.sqrt(1 - along**2) * standard + along * rng.standard_normal(points.shape)
        candidates = self.mean + moved @ self.root
        log_ratio = _log_normal(candidates) - _log_normal(points)
        log_ratio -= _log_normal(moved) - _log_normal(standard)
        return Candidates(candidates, log_ratio, is_adapted)

    def difference(self, points: FloatArray, length: float, rng: np.random.Generator) -> Candidates:
        """Return moves by the difference of two particles of the cloud.

        References
        ----------
        ter Braak, C. J. F. (2006). Statistics and Computing 16, 239-249.
        """
        is_adapted = rng.random(len(points)) >= _JUMP
        along = np.where(is_adapted, length * 2.38 / math.sqrt(2 * points.shape[1]), 1.0)
        first, second = (rows_by_weight(self.weights, rng.random(len(points))) for _ in range(2))
        steps = self.points[first] - self.points[second]
        candidates = points + along[:, np.newaxis] * steps
        return Candidates(candidates, _log_normal(candidates) - _log_normal(points), is_adapted)


def _log_normal(points: FloatArray) -> FloatArray:
    """Return the logarithm of the standard normal density, but for a constant."""
    density: FloatArray = -(points**2).sum(axis=-1) / 2
    return density


def largest_correlation(start: FloatArray, now: FloatArray) -> float:
    """Return the largest correlation of a coordinate with its start, over the particles.

    NaN where a coordinate has one value, as at the end of its prior.
    """
    start, now = start - start.mean(axis=0), now - now.mean(axis=0)
    products = (start * now).sum(axis=0)
    scale = np.sqrt((start**2).sum(axis=0) * (now**2).sum(axis=0))
    with np.errstate(invalid="ignore"):
        return float((products / scale).max())


_SMALLEST = -20.0


def half_normal(points: FloatArray, scale: float) -> FloatArray:
    """Return half-normal numbers that stand at the same probabilities as standard normal ones."""
    upper = erfcinv(ndtr(-np.maximum(points, 0.0)))
    # None is so small that its square is 0.
    lower = erfinv(ndtr(np.maximum(points, _SMALLEST)))
    number: FloatArray = np.where(points > 0, upper, lower)
    return math.sqrt(2) * scale * number


# The sampler: replicates that advance in common rounds.

# Moves go on until no coordinate correlates with its start of the level above this; at the last
# level, of which the error is that of the answer.
_UNRELATED, UNRELATED_AT_LAST = 0.5, 0.1


class PosteriorPoints(NamedTuple):
    """Points of a round, and of each what the analysis needs."""

    points: FloatArray  # (run, coordinate): in standard normal space
    replicate: IntArray  # (run,)
    # (run,): power of the likelihood in the distribution that its level moves particles in; 0 for
    # a draw of the prior.
    exponent: FloatArray
    parent: IntArray  # (run,): run of the particle that it was moved from; -1 for a draw
    least: FloatArray  # (run,): logarithm of the likelihood with which it takes that one's place


# It yields the points of a round, and is sent the logarithms of their likelihoods, shape (run,),
# with NaN where a run failed.
Sampler = Generator[PosteriorPoints, FloatArray, None]


def sample_posterior(
    dimension: int,
    particles: int,
    replicates: int,
    at_most: int,
    stream: Stream,
    moves: float = math.inf,
) -> Sampler:
    """Sample a posterior by independent replicates of tempered sequential Monte Carlo.

    The particles of a replicate are first draws of the prior. From level to level the likelihood
    counts by a larger power. Each level takes particles by their weights and moves them until they
    have forgotten where they started. A candidate whose run failed is refused.

    Parameters
    ----------
    dimension : int
        Number of coordinates, which are independent and standard normal by the prior.
    particles, replicates : int
        Number of particles of a replicate, and of replicates.
    at_most : int
        Largest number of points.
    stream : Stream
        Source of the random numbers.
    moves : int, optional
        Largest number of moves of a level, where these alone may not end it.

    References
    ----------
    Del Moral, P., Doucet, A. & Jasra, A. (2006). J. R. Statist. Soc. B 68, 411-436; Chopin, N.
    (2002). Biometrika 89, 539-552.
    """
    going = {
        number: _replicate(dimension, particles, stream.child("replicate", number), moves)
        for number in range(replicates)
    }
    wanted = {number: next(replicate) for number, replicate in going.items()}
    first = 0
    while wanted and first + len(wanted) * particles <= at_most:
        numbers = np.repeat(list(wanted), particles)
        columns = zip(*wanted.values(), strict=True)
        points, *beside = (np.concatenate(column) for column in columns)
        found = yield PosteriorPoints(points, numbers, *beside)
        log_likelihood = np.where(np.isfinite(found), found, np.nan)
        made = Particles(first + np.arange(len(found)), log_likelihood)
        first += len(found)
        following = {}
        for place, number in enumerate(wanted):
            part = np.arange(place * particles, (place + 1) * particles)
            with suppress(StopIteration):  # it has its sample
                following[number] = going[number].send(made.at(part))
        wanted = following


# Points, exponents, parents and least logarithms of likelihoods of a replicate's next runs.
_Wanted = tuple[FloatArray, FloatArray, IntArray, FloatArray]


def _replicate(
    dimension: int, size: int, stream: Stream, moves: float
) -> Generator[_Wanted, Particles, None]:
    """Yield the points of a replicate; it is sent their runs."""
    points = ndtri(sobol_points(stream.generator("prior"), size, dimension))
    made = yield points, np.zeros(size), np.full(size, -1), np.full(size, -math.inf)
    completed = np.isfinite(made.log_likelihood)
    if completed.sum() < 4 * (dimension + 1):  # their cloud may lack a direction
        return
    particles, points = made.at(completed), points[completed]
    exponent, level, turn, lengths, is_last = 0.0, 0, 0, [1.0, 1.0], False
    while not is_last:
        level, is_last = level + 1, exponent == 1
        rng = stream.generator("level", level)
        higher = particles.next_exponent(exponent)
        weights = particles.weights(higher - exponent)
        cloud = Cloud.of(points, weights)
        if higher > exponent:
            chosen = rows_by_weight(weights, (np.arange(size) + rng.random()) / size)
            chosen = rng.permutation(chosen)
            particles, points = particles.at(chosen), points[chosen]
        exponent, start, is_related, made_moves = higher, points, True, 0
        limit = UNRELATED_AT_LAST if is_last else _UNRELATED
        while is_related:
            move = cloud.difference if turn else cloud.crank_nicolson
            moved = move(points, lengths[turn], rng)
            with np.errstate(over="ignore"):
                least = (np.log(rng.random(size)) - moved.log_ratio) / exponent
            least += particles.log_likelihood
            made = yield moved.points, np.full(size, exponent), particles.runs, least
            is_accepted = made.log_likelihood >= least
            particles = particles.moved(made, least)
            points = np.where(is_accepted[:, np.newaxis], moved.points, points)
            if moved.is_adapted.any():
                share = is_accepted[moved.is_adapted].mean()
                longer = lengths[turn] * math.exp(_FOLLOWING * (share - _TARGETS[turn]))
                lengths[turn] = min(longer, _LONGEST[turn])
            made_moves += 1
            is_related = made_moves < moves and largest_correlation(start, points) > limit
            turn = 1 - turn


@dataclass(frozen=True, eq=False)
class Replicate:
    """Sample of a replicate, from its runs."""

    runs: IntArray  # (draw,): numbers of the runs that its draws are
    start: IntArray  # (draw,): those of the draws that its last level moved from
    log_evidence: float  # logarithm of the mean of the likelihood over the prior
    exponent: float  # power of the likelihood that its last level has; 1 for the posterior

    @classmethod
    def of(
        cls, sampled: PosteriorPoints, log_likelihood: FloatArray, number: int
    ) -> Replicate | None:
        """Return the last level of a replicate; None where it has none behind the prior.

        Parameters
        ----------
        sampled : PosteriorPoints
            All runs of a design.
        log_likelihood : ndarray, shape (run,)
            Of each run, NaN where it failed.
        number : int
            Number of the replicate.
        """
        found = np.where(np.isfinite(log_likelihood), log_likelihood, np.nan)
        everything = Particles(np.arange(len(found)), found)
        members = np.flatnonzero(sampled.replicate == number)
        drawn = members[sampled.exponent[members] == 0]
        completed = drawn[np.isfinite(found[drawn])]
        if len(members) == len(drawn):
            return None
        particles = everything.at(completed)
        log_evidence, exponent = math.log(len(completed) / len(drawn)), 0.0
        for moved in members[len(drawn) :].reshape(-1, len(drawn)):
            states = sampled.parent[moved]
            if (higher := float(sampled.exponent[moved[0]])) > exponent:
                log_evidence += particles.log_mean(higher - exponent)
                exponent, start = higher, states
            particles = everything.at(states).moved(everything.at(moved), sampled.least[moved])
        return cls(particles.runs, start, log_evidence, exponent)


# The design: the unknowns of a study, and the particles of its sampler.

# So few particles of each coordinate have a covariance that is worth to follow.
PARTICLES_OF_EACH = 20


@dataclass(frozen=True, eq=False)
class PriorCoordinates:
    """Standard normal coordinates of what a sampler draws.

    First are the unknown inputs, then the standard deviations of measurements that are not known.
    Behind them, each experiment has its own for each input that varies and for each condition with
    an error, so that no formula is needed for what these add.
    """

    joint: JointDistribution
    measured: Experiments
    integrated: Collection[int] = ()  # numbers of sizes that have no coordinate

    @property
    def sizes(self) -> dict[int, UnknownSize]:
        """Sizes that have a coordinate, by their numbers."""
        every = enumerate(self.measured.errors.sizes)
        return {number: size for number, size in every if number not in self.integrated}

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the unknown inputs and standard deviations, which have the first coordinates."""
        return (*self.measured.unknown, *(each.name for each in self.sizes.values()))

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        of_each = (
            section.experiments * (len(section.varies) + len(section.condition_std))
            for section in self.measured.sections
        )
        return len(self.unknowns) + sum(of_each)

    def parts(self) -> Iterator[tuple[IntArray, IntArray]]:
        """Yield rows whose results depend on the same coordinates, and the numbers of these.

        They are all rows. Where something has a value of its own in each experiment, they are those
        of each experiment.
        """
        measured, unknown = self.measured, np.arange(len(self.measured.unknown))
        if not measured.moved:
            yield np.arange(len(measured.values)), unknown
            return
        at = len(self.unknowns)
        for section, numbers in measured.numbered:
            size = section.experiments
            moved = np.arange(len(section.varies) + len(section.condition_std))
            for place in range(size):
                rows = np.flatnonzero(measured.experiment == numbers.start + place)
                if len(rows):
                    yield rows, np.concatenate([unknown, at + place + size * moved])
            at += size * len(moved)

    def error_stds(self, points: FloatArray) -> FloatArray:
        """Return the standard deviations of measurements that have a coordinate.

        Their shape is (draw, size), with NaN for those that have none.
        """
        found = np.full((len(points), len(self.measured.errors.sizes)), np.nan)
        for at, (number, size) in enumerate(self.sizes.items(), len(self.measured.unknown)):
            found[:, number] = half_normal(points[:, at], size.scale)
        return found

    def inputs(self, points: FloatArray) -> dict[str, FloatArray]:
        """Return the random inputs and conditions of all runs, shape (draw * experiment,)."""
        size, measured = len(points), self.measured
        names = [entry.variable.name for entry in self.joint.random]
        # What is neither unknown nor varies is at its median.
        standard = np.zeros((size, measured.count, len(names)))
        for place, name in enumerate(measured.unknown):
            standard[..., names.index(name)] = points[:, place, np.newaxis]
        offsets: dict[str, FloatArray] = {}
        at = len(self.unknowns)
        for section, own in measured.numbered:
            for name in (*section.varies, *section.condition_std):
                column = points[:, at : at + section.experiments]
                at += section.experiments
                if name in section.varies:
                    standard[:, own, names.index(name)] = column
                else:
                    offset = offsets.setdefault(name, np.zeros((size, measured.count)))
                    offset[:, own] = section.condition_std[name] * column
        unit = ndtr(standard.reshape(-1, len(names)))
        values = self.joint.ppf(self.joint.conditional_probabilities(unit, {}))
        nominal = self.joint.nominal()
        others = {name: nominal[name] for name in names}
        drawn = {name: values[name].reshape(size, -1) for name in names}
        draws = {name: drawn[name][:, 0] for name in measured.unknown}
        draws |= {name: drawn[name] for each in measured.sections for name in each.varies}
        for name, offset in offsets.items():
            middle, _ = measured.moved_inputs(name, others, 0.0)
            draws[name] = middle + offset
        return measured.inputs(draws, others)

    def runs(
        self, points: FloatArray, first: int, of_draws: Mapping[str, npt.NDArray[Any]]
    ) -> xr.Dataset:
        """Return the inputs of all runs of some draws, with what is known of these.

        Parameters
        ----------
        points : ndarray, shape (draw, coordinate)
        first : int
            Number of the first draw.
        of_draws : mapping of str to ndarray, shape (draw,)
        """
        size, measured = len(points), self.measured
        stds = self.error_stds(points)
        columns = {
            DRAW: np.arange(first, first + size),
            **of_draws,
            **{ERROR_STD.format(number=k + 1): stds[:, k] for k in self.sizes},
        }
        coordinates = {
            **{name: np.repeat(column, measured.count) for name, column in columns.items()},
            EXPERIMENT: np.tile(np.arange(measured.count), size),
        }
        made = points_dataset(
            self.joint, self.inputs(points), coordinates, runs=size * measured.count
        )
        text = measured.errors.discrepancy_text
        return made.assign_attrs({MEASURED: measured.name} | ({DISCREPANCY: text} if text else {}))


@dataclass(frozen=True)
class Posterior(LimitedMeasuredDesign):
    """Posterior of the unknown inputs, by independent replicates of sequential Monte Carlo.

    Parameters
    ----------
    particles : int
        Number of draws that each replicate moves from the prior to the posterior.
    replicates : int
        Number of independent replicates. Their scatter gives all errors.
    at_most : int
        Largest number of runs.
    discrepancy : bool
        Whether the model may have an error of its own, where its measurements state one.
    """

    sampling = Sampling.POSTERIOR

    unordered_reason = NO_STEP_BETWEEN_LABELS

    needs_numbers = True

    particles: int = count(minimum=100, maximum=1_000_000, default=500)
    replicates: int = count(minimum=4, maximum=MOST_REPLICATES, default=4)
    at_most: int = count(minimum=20, default=200_000)
    discrepancy: bool = flag(default=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.discrepancy:
            object.__setattr__(self, "experiments", self.experiments.without_discrepancy())

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        if not self.experiments.count:
            return  # the mistake of its measurements is noted
        prior = self._coordinates(joint, self.experiments)
        dimension = prior.dimension
        if not prior.unknowns:
            expected = "measurements with an unknown input, or with errors of unknown size"
            yield Problem(("measured",), "nothing that is unknown", expected)
        if self.particles < (least := PARTICLES_OF_EACH * dimension):
            expected = f"at least {least}, {PARTICLES_OF_EACH} for each of {dimension} unknowns: "
            expected += "inputs, sizes of errors, and each value of what varies"
            yield Problem(("particles",), str(self.particles), expected)
        least = 2 * self.particles * self.replicates * self.experiments.count + self._of_blank_rows
        if self.at_most < least:
            expected = f"at least {least:_}: {self.replicates} replicates of {self.particles} "
            expected += f"particles, each at {self.experiments.count} experiments, and one move"
            if blank := self.experiments.blank.count:
                expected += f"; then at {blank} of blank rows"
            yield Problem(("at_most",), f"{self.at_most:_}", expected)

    @property
    def replicate_count(self) -> int:
        return self.replicates

    @property
    def _integrated(self) -> Collection[int]:
        """Numbers of the sizes without a coordinate; each has one where no input is unknown."""
        return self.experiments.likelihood.integrated if self.experiments.unknown else ()

    def _coordinates(self, joint: JointDistribution, measured: Experiments) -> PriorCoordinates:
        return PriorCoordinates(joint, measured, self._integrated)

    def _shares(self, draws: int, stream: Stream) -> dict[str, FloatArray]:
        """Return where in its conditional distribution each integrated size of a draw is."""
        return {
            ERROR_SHARE.format(number=number + 1): stream.generator(number).random(draws)
            for number in self._integrated
        }

    @property
    def _of_blank_rows(self) -> int:
        """Largest number of runs at blank rows."""
        return self.particles * self.replicates * self.experiments.blank.count

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        measured, prior = self.experiments, self._coordinates(joint, self.experiments)
        at_most = (self.at_most - self._of_blank_rows) // measured.count
        sampler = sample_posterior(
            prior.dimension, self.particles, self.replicates, at_most, stream
        )
        made, found, first = [next(sampler)], list[FloatArray](), 0
        while True:
            asked = made[-1]
            of_draws = {
                REPLICATE: asked.replicate,
                LIKELIHOOD_EXPONENT: asked.exponent,
                PARENT_DRAW: asked.parent,
                LEAST_LOG_LIKELIHOOD: asked.least,
                **self._shares(len(asked.points), stream.child("sizes", first)),
            }
            feedback = yield prior.runs(asked.points, first, of_draws)
            first += len(asked.points)
            (runs,) = feedback.runs.values()
            with one_blas_thread():
                found.append(log_likelihoods(measured, runs))
                try:
                    made.append(sampler.send(found[-1]))
                except StopIteration:
                    break
        if measured.blank.count:
            sampled = PosteriorPoints(*map(np.concatenate, zip(*made, strict=True)))
            yield from self._rounds_of_blank_rows(prior, sampled, np.concatenate(found), stream)

    def _rounds_of_blank_rows(
        self,
        prior: PriorCoordinates,
        sampled: PosteriorPoints,
        log_likelihood: FloatArray,
        stream: Stream,
    ) -> Rounds:
        """Yield the runs at blank rows: of the draws of the posterior, if it has any."""
        numbers = range(self.replicates)
        replicates = [Replicate.of(sampled, log_likelihood, number) for number in numbers]
        drawn = [each.runs for each in replicates if each is not None and each.exponent == 1]
        if len(drawn) < self.replicates:
            return
        draws, blank = np.unique(np.concatenate(drawn)), self.experiments.blank
        beyond, known = self._coordinates(prior.joint, blank), len(prior.unknowns)
        shape = len(draws), beyond.dimension - known
        normal = stream.generator("blank rows").standard_normal(shape)
        points = np.hstack([sampled.points[draws, :known], normal])
        of_draws = {
            REPLICATE: sampled.replicate[draws],
            LIKELIHOOD_EXPONENT: np.ones(len(draws)),
            PARENT_DRAW: draws,
            LEAST_LOG_LIKELIHOOD: np.full(len(draws), -math.inf),
            **self._shares(len(draws), stream.child("sizes", "blank rows")),
        }
        runs = beyond.runs(points, len(sampled.points), of_draws)
        # They are experiments behind those with measurements.
        number = runs[EXPERIMENT] + self.experiments.count
        yield runs.assign_coords({EXPERIMENT: number})


def split_runs(measured: Experiments, runs: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset]:
    """Return the runs that a posterior was sampled by, and those where nothing was measured."""
    sampled = int(np.count_nonzero(runs[EXPERIMENT].values < measured.count))
    return runs.isel({RUN: slice(sampled)}), runs.isel({RUN: slice(sampled, None)})


def log_likelihoods(measured: Experiments, runs: xr.Dataset) -> FloatArray:
    """Return the logarithm of the likelihood of each draw; NaN where a run failed."""
    stds = _of_sizes(measured, runs, ERROR_STD)
    return measured.likelihood.log_density(measured.predicted(runs), stds)


def error_stds(measured: Experiments, runs: xr.Dataset, *, of_prior: bool = False) -> FloatArray:
    """Return the standard deviations of measurements of each draw, shape (draw, size).

    Those that the likelihood is integrated over are draws of their distribution with the results
    of a run, NaN where it failed; or of their prior.
    """
    stds, shares = (_of_sizes(measured, runs, each) for each in (ERROR_STD, ERROR_SHARE))
    if of_prior:
        drawn = half_normal(ndtri(shares), 1.0) * np.array(measured.errors.scales)
        return np.where(np.isnan(stds), drawn, stds)
    return measured.likelihood.integrated_sizes(measured.predicted(runs), stds, shares)


def _of_sizes(measured: Experiments, runs: xr.Dataset, label: str) -> FloatArray:
    """Return a column for each size, shape (draw, size); NaN where there is none."""
    found = np.full((runs.sizes[RUN] // measured.count, len(measured.errors.sizes)), np.nan)
    for number in range(len(measured.errors.sizes)):
        if (name := label.format(number=number + 1)) in runs:
            found[:, number] = runs[name].values[:: measured.count]
    return found
