"""Conditional sampling: moves of Markov chains in standard normal space."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["ConditionalSampling"]

# Share of moves to accept. The variance of an estimate hardly depends on it from 0.4 to 0.5.
_TARGET = 0.5

# Limits of the standard deviation, and of the factor by which it changes between levels.
_SMALLEST, _LARGEST = 1e-3, 1.0
_SMALLEST_FACTOR = 0.05


@dataclass(frozen=True)
class ConditionalSampling:
    """Moves ``sqrt(1 - sigma²) u + sigma z`` with standard normal z.

    They keep the normal distribution. A move is accepted where it stays in the level, so no density
    is needed. All inputs have the same sigma, and a level keeps it: a scale that followed the
    states that it moves would not keep their distribution.

    Parameters
    ----------
    sigma : float
        Standard deviation of a move.
    """

    sigma: float = 0.6

    def candidates(self, states: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return a candidate for each state, shape (chain, random input)."""
        moved: FloatArray = rng.standard_normal(states.shape)
        moved *= self.sigma
        moved += math.sqrt(1 - self.sigma**2) * states
        return moved

    def following(self, accepted: float) -> ConditionalSampling:
        """Return the moves of the next level, given the share that was accepted at this one."""
        factor = max(accepted / _TARGET, _SMALLEST_FACTOR)
        return ConditionalSampling(min(max(factor * self.sigma, _SMALLEST), _LARGEST))
