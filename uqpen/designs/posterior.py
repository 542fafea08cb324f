"""Posterior: what measurements say of unknown inputs, by tempered sequential Monte Carlo."""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.special import erfcinv, erfinv, ndtr, ndtri

from uqpen.core.arrays import BoolArray, FloatArray, IntArray, rows_by_weight
from uqpen.core.streams import Stream
from uqpen.designs.quasi_monte_carlo import sobol_points

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
    """Return the largest correlation of a coordinate with its start, over the particles."""
    start, now = start - start.mean(axis=0), now - now.mean(axis=0)
    products = (start * now).sum(axis=0)
    scale = np.sqrt((start**2).sum(axis=0) * (now**2).sum(axis=0))
    return float((products / scale).max())


def half_normal(points: FloatArray, scale: float) -> FloatArray:
    """Return half-normal numbers that stand at the same probabilities as standard normal ones."""
    upper = erfcinv(ndtr(-np.maximum(points, 0.0)))
    number: FloatArray = np.where(points > 0, upper, erfinv(ndtr(points)))
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
    dimension: int, particles: int, replicates: int, at_most: int, stream: Stream
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

    References
    ----------
    Del Moral, P., Doucet, A. & Jasra, A. (2006). J. R. Statist. Soc. B 68, 411-436; Chopin, N.
    (2002). Biometrika 89, 539-552.
    """
    going = {
        number: _replicate(dimension, particles, stream.child("replicate", number))
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


def _replicate(dimension: int, size: int, stream: Stream) -> Generator[_Wanted, Particles, None]:
    """Yield the points of a replicate; it is sent their runs."""
    points = ndtri(sobol_points(stream.generator("prior"), size, dimension))
    made = yield points, np.zeros(size), np.full(size, -1), np.full(size, -math.inf)
    completed = np.isfinite(made.log_likelihood)
    if not has_enough(int(completed.sum()), dimension):
        return
    particles, points = made.at(completed), points[completed]
    exponent, level, turn, lengths = 0.0, 0, 0, [1.0, 1.0]
    while exponent < 1:
        level += 1
        rng = stream.generator("level", level)
        higher = particles.next_exponent(exponent)
        weights = particles.weights(higher - exponent)
        cloud = Cloud.of(points, weights)
        chosen = rows_by_weight(weights, (np.arange(size) + rng.random()) / size)
        chosen = rng.permutation(chosen)
        particles, points = particles.at(chosen), points[chosen]
        exponent, start, is_related = higher, points, True
        limit = _UNRELATED if exponent < 1 else UNRELATED_AT_LAST
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
            is_related = largest_correlation(start, points) > limit
            turn = 1 - turn


def has_enough(completed: int, dimension: int) -> bool:
    """Return whether the completed runs of the prior suffice for a cloud with all directions."""
    return completed >= 4 * (dimension + 1)
