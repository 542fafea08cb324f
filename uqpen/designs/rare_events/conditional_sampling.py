"""Adaptive conditional sampling: moves of Markov chains in standard normal space."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from uqpen.core.arrays import FloatArray

__all__ = ["ConditionalSampling"]

# Share of moves to accept; the optimum of Papaioannou et al. (2015).
_TARGET = 0.44


@dataclass(frozen=True, eq=False)
class ConditionalSampling:
    """Moves ``sqrt(1 - sigma²) u + sigma z`` with standard normal z.

    They keep the normal distribution. A move is accepted where it stays in the level, so no density
    is needed. The standard deviation of a move follows the scatter of the seeds in each direction,
    times a factor that is adapted after each step, so that 44 % of the moves are accepted.

    Parameters
    ----------
    factor : float
        Factor of the scatter.
    spread : float or ndarray, shape (random input,)
        Standard deviation of the seeds.
    steps : int
        Number of steps at this level so far.
    """

    factor: float = 0.6
    spread: float | FloatArray = 1.0
    steps: int = 0

    def start(self, seeds: FloatArray) -> ConditionalSampling:
        """Return the moves of the next level, from its seeds, shape (chain, random input)."""
        return replace(self, spread=seeds.std(axis=0), steps=0)

    def candidates(self, states: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return a candidate for each state, shape (chain, random input)."""
        sigma = np.clip(self.factor * self.spread, 1e-3, 1.0)
        moved: FloatArray = np.sqrt(1 - sigma**2) * states + sigma * rng.standard_normal(
            states.shape
        )
        return moved

    def adapted(self, accepted: float) -> ConditionalSampling:
        """Return the moves after a step, given the share that was accepted."""
        steps = self.steps + 1
        factor = self.factor * math.exp((accepted - _TARGET) / math.sqrt(steps))
        return replace(self, factor=factor, steps=steps)
