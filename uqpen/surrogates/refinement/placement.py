"""Random placement of runs where errors are expected, with weights that keep estimates unbiased.

Each point is drawn from candidates of its own, which are draws of the inputs. So points are
independent, and the weight of a point is the mean of the placement's density over its candidates,
over that at the point: its expectation is exactly 1.

References
----------
Zrnic, T. & Candès, E. J. (2024). Proc. ICML 235, 62993-63010 (active statistical inference);
Hesterberg, T. (1995). Technometrics 37, 185-194 (defensive mixtures).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.surrogates.refinement.predicted_errors import PredictedError

__all__ = ["Placement", "place"]

# Shares of the points that are drawn as the inputs are; a weight is at most one over the share.
_SHARES = (0.8, 0.6, 0.4)

# A placement is used where the variance that it promises is at most this part of that of draws.
_CLEARLY_SMALLER = 0.9


@dataclass(frozen=True, eq=False)
class Placement:
    """Chosen candidates.

    Parameters
    ----------
    candidates : ndarray of int, shape (point,)
        Their numbers among all candidates.
    weights : ndarray, shape (point,)
        Density of the inputs over that of the placement.
    share : float
        Share of the points that were drawn as the inputs are.
    gain : float
        The promised variance of the evidence, over that of as many draws of the inputs.
    """

    candidates: IntArray
    weights: FloatArray
    share: float
    gain: float


def place(
    errors: Sequence[PredictedError],
    points: int,
    each: int,
    heaviest: float,
    rng: np.random.Generator,
) -> Placement:
    """Choose points among candidates, more of them where errors are expected.

    The share of plain draws is the one whose interval promises to be the narrowest.

    Parameters
    ----------
    errors : sequence of PredictedError
        At ``points * each`` candidates; without any, points are plain draws.
    points, each : int
        Number of points, and of the candidates of each.
    heaviest : float
        The largest weight of the runs so far.
    rng : Generator
        Source of the choice.
    """
    shape = (points, each)
    uniform = rng.random((points, 1))
    relative = _relative_density(errors, shape)
    gains = {
        share: np.mean([_gain(error, share + (1 - share) * relative, heaviest) for error in errors])
        for share in _SHARES
        if errors
    }
    share = min(gains, key=lambda each: gains[each], default=1.0)
    if not gains or gains[share] > _CLEARLY_SMALLER:
        return Placement(np.arange(points) * each, np.ones(points), 1.0, 1.0)
    density = share + (1 - share) * relative
    chosen = (density.cumsum(axis=1) > uniform * each).argmax(axis=1)
    rows = np.arange(points)
    return Placement(rows * each + chosen, 1 / density[rows, chosen], share, float(gains[share]))


def _relative_density(errors: Sequence[PredictedError], shape: tuple[int, int]) -> FloatArray:
    """Return the best density for the sum of all scaled errors, over that of the inputs."""
    found = np.zeros(shape)
    for error in errors:
        size = np.sqrt(error.squares).reshape(shape)
        found += size / (size.mean() or 1.0)
    mean = found.mean(axis=1, keepdims=True)
    # Where nothing is expected of any candidate, all are alike.
    return np.divide(found, mean, out=np.ones(shape), where=mean > 0)


def _gain(error: PredictedError, density: FloatArray, heaviest: float) -> float:
    """Return the promised variance of an estimate, over that with plain draws.

    The interval of a probability counts a disagreement of either kind that no run has shown, at
    the largest weight.
    """
    squares, points = error.squares.reshape(density.shape), len(density)
    unseen = [2 * max(heaviest, 1 / density.min()) ** 2, 2 * heaviest**2]
    with_it, without = points * (squares / density).mean(), points * squares.mean()
    if error.is_of_event:
        with_it, without = with_it + unseen[0], without + unseen[1]
    return float(with_it / without)
