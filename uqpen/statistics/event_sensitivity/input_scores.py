"""Scores of an input: what a run counts for where the input's mean or standard deviation moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray
from uqpen.distributions.distribution import Distribution

__all__ = ["InputScores"]

# Moments are integrals over a standard normal variable. Beyond its ends lies a probability of
# 2e-16; the trapezoidal rule is exact to rounding for a smooth distribution.
_END, _NODES = 8.2, 4001
# With a smaller determinant, relative to its products, two functions are one but for rounding.
_SMALLEST_DETERMINANT = 1e-9


@dataclass(frozen=True, eq=False)
class InputScores:
    """Scores of the mean and of the standard deviation of one input.

    Each is a combination of the scores of the distribution's two parameters: along it the mean
    moves and the standard deviation stays, or the other way round. They are times the standard
    deviation, so they are plain numbers.

    Parameters
    ----------
    distribution : Distribution
        Of the input.
    mean, std : float
        Its moments, in the input's SI unit.
    centre : ndarray, shape (2,)
        Means of the functions that span the scores.
    weights : ndarray, shape (2, 2)
        Of these functions in the score of the mean, and in that of the standard deviation.

    References
    ----------
    Rubinstein, R. Y. (1986). Math. Comput. Simul. 28, 381-392.
    """

    distribution: Distribution
    mean: float
    std: float
    centre: FloatArray
    weights: FloatArray

    @classmethod
    def of(cls, distribution: Distribution) -> InputScores | None:
        """Return the scores of an input.

        Returns
        -------
        InputScores or None
            None where the mean cannot move without the standard deviation, as of two values.
        """
        values, shares = _nodes(distribution)
        with np.errstate(all="ignore"):
            mean = float((shares * values).sum())
            deviation = values - mean
            std = float(np.sqrt((shares * deviation**2).sum()))
            standard = deviation / std
            moved = np.array([standard, (standard**2 - 1) / 2])
            spanning = np.array(distribution.scores(values))
            centre = (shares * spanning).sum(axis=1)
            centred = spanning - centre[:, np.newaxis]
            # How far each function moves the mean and the standard deviation.
            (a, b), (c, d) = (moved[:, np.newaxis] * centred * shares).sum(axis=-1)
            determinant = a * d - b * c
            is_small = not abs(determinant) > _SMALLEST_DETERMINANT * max(abs(a * d), abs(b * c))
            weights = np.array([[d, -c], [-b, a]]) / determinant
        if is_small or not np.isfinite(weights).all() or not np.isfinite([mean, std]).all():
            return None
        return cls(distribution, mean, std, centre, weights)

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the scores of the mean and of the standard deviation, shape (2, run)."""
        first, second = (
            function - mean
            for function, mean in zip(self.distribution.scores(values), self.centre, strict=True)
        )
        return np.array([one * first + other * second for one, other in self.weights.tolist()])


def _nodes(distribution: Distribution) -> tuple[FloatArray, FloatArray]:
    """Return values of a distribution with their shares of the probability, for integrals."""
    atoms = distribution.atoms()
    if atoms is not None:
        return atoms
    z = np.linspace(-_END, _END, _NODES)
    lower, upper = special.ndtr(z), special.ndtr(-z)
    values = np.where(z < 0, distribution.ppf(lower), distribution.isf(upper))
    shares = np.exp(-(z**2) / 2)
    return values, shares / shares.sum()
