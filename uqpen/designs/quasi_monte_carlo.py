"""Scrambled low-discrepancy points, replicated so that their error can be estimated."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import Problem
from uqpen.core.limits import MOST_REPLICATES, MOST_RUNS
from uqpen.core.settings import count
from uqpen.core.streams import BLOCK
from uqpen.designs.design import Design, keep_setting
from uqpen.designs.replicated import ReplicatedDesign, split_replicates
from uqpen.designs.stopping.stopping_rule import StoppingRule, stopping_rule
from uqpen.distributions.joint_distribution import JointDistribution

if TYPE_CHECKING:
    from scipy.stats.qmc import QMCEngine, Sobol

# All bits of a double: with fewer, a scrambled point may be 0, where a quantile may be infinite.
_BITS = 53


@dataclass(frozen=True)
class _Sequence(ReplicatedDesign):
    """Scrambled points of a low-discrepancy sequence."""

    is_sequence = True

    runs: int | None = count(minimum=2, maximum=MOST_RUNS, default=None)
    replicates: int | None = count(minimum=2, maximum=MOST_REPLICATES, default=None)
    until: StoppingRule | None = stopping_rule("until")
    at_most: int | None = count(default=None)
    keep: str = keep_setting()

    @abstractmethod
    def engine(self, rng: np.random.Generator, dimension: int) -> QMCEngine:
        """Return what draws the points of a replicate one after the other."""

    def points_between(
        self, rng: np.random.Generator, points: int, dimension: int
    ) -> Callable[[int, int], FloatArray]:
        if points <= BLOCK:
            return super().points_between(rng, points, dimension)
        engine = self.engine(rng, dimension)

        def between(start: int, stop: int) -> FloatArray:
            if start < engine.num_generated:
                engine.reset()
            with warnings.catch_warnings():
                # All points of the replicate are balanced, its parts need not be.
                warnings.filterwarnings("ignore", "The balance properties", UserWarning)
                # SciPy's fast_forward refuses Sobol' points of more than 32 bits.
                while left := start - engine.num_generated:
                    engine.random(min(left, BLOCK))
                return np.asarray(engine.random(stop - start), dtype=np.float64)

        return between

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> Design | None:
        shape = split_replicates(runs, self.replicate_count, replicated=replicated)
        return _SequencePoints(self, *shape) if shape else None


@dataclass(frozen=True)
class SobolSequence(_Sequence):
    """Scrambled Sobol' points: every replicate is balanced over all its elementary intervals.

    Parameters
    ----------
    runs : int, optional
        Number of points in all: `replicates` times a power of two, as any other number of points
        breaks the balance.
        With `until`, at the first look: 512 or the next that is possible by default, and no fewer.
    replicates : int, optional
        Number of sets, each scrambled by itself; their scatter shows the error. By default 16; with
        `until` 32, and no fewer. At most 10 000.
    until : StoppingRule, optional
        The rule that decides whether the points are enough, whenever those of each set doubled.
    at_most : int, optional
        With `until`, the largest number of points in all.
    keep : str
        ``"statistics"`` leaves the runs out of the archive, which then has their statistics, their
        number by status and their hashes.

    References
    ----------
    Sobol', I. M. (1967). USSR Comput. Math. Math. Phys. 7, 86-112.
    Owen, A. B. (1998). ACM Trans. Model. Comput. Simul. 8, 71-102.
    """

    needs_powers_of_two = True

    def draw(self, rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
        return sobol_points(rng, points, dimension)

    def engine(self, rng: np.random.Generator, dimension: int) -> QMCEngine:
        return _sobol_engine(rng, dimension)


@dataclass(frozen=True)
class Halton(_Sequence):
    """Scrambled Halton points, of any number.

    Parameters
    ----------
    runs : int, optional
        Number of points in all, a multiple of `replicates`.
        With `until`, at the first look: 512 or the next that is possible by default, and no fewer.
    replicates : int, optional
        Number of sets, each scrambled by itself; their scatter shows the error. By default 16; with
        `until` 32, and no fewer. At most 10 000.
    until : StoppingRule, optional
        The rule that decides whether the points are enough, whenever those of each set doubled.
    at_most : int, optional
        With `until`, the largest number of points in all.
    keep : str
        ``"statistics"`` leaves the runs out of the archive, which then has their statistics, their
        number by status and their hashes.

    References
    ----------
    Halton, J. H. (1960). Numer. Math. 2, 84-90.
    Owen, A. B. (2017). arXiv:1706.02808.
    """

    def draw(self, rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
        return np.asarray(self.engine(rng, dimension).random(points))

    def engine(self, rng: np.random.Generator, dimension: int) -> QMCEngine:
        from scipy.stats import qmc

        return qmc.Halton(dimension, scramble=True, rng=rng)


@dataclass(frozen=True)
class _SequencePoints(ReplicatedDesign):
    """Any number of points of a sequence, balanced or not, for a comparison of methods.

    No study can use them: the error of a single set cannot be estimated, and a Sobol' sequence is
    balanced only where the number of its points is a power of two. A comparison shows both effects.
    """

    sequence: _Sequence
    runs: int
    replicates: int

    def check_settings(self) -> Iterator[Problem]:
        yield from ()

    def draw(self, rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
        return self.sequence.draw(rng, points, dimension)


def sobol_points(rng: np.random.Generator, points: int, dimension: int) -> FloatArray:
    """Draw scrambled Sobol' points of the unit cube; a power of two of them are balanced."""
    engine = _sobol_engine(rng, dimension)
    return np.asarray(engine.random_base2((points - 1).bit_length())[:points])


def _sobol_engine(rng: np.random.Generator, dimension: int) -> Sobol:
    # Imported here: this part of SciPy takes longer to load than the rest.
    from scipy.stats import qmc

    return qmc.Sobol(dimension, scramble=True, bits=_BITS, rng=rng)
