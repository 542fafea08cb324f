"""Sobol' indices by a surrogate whose terms are known, corrected by real runs.

What an input explains of the output f is E(Pf)², where P is a projection: on the functions of the
input alone (first order), or on those with no part without it (total order). For a surrogate g

    E(Pf)² = 2 E(f Pg) − E(Pg)² + E(P(f − g))²,  and  0 ≤ E(P(f − g))² ≤ E(f − g)²

So the first two terms, which real runs estimate without bias, are a lower bound; with the square of
the errors they are an upper bound. Where the surrogate is good, the two are close.

References
----------
Zhang, L. & Janson, L. (2020). arXiv:2007.01283 (floodgate: the lower bound).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import student_quantile
from uqpen.statistics.surrogate.correction.corrected_mean import CorrectedMean
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = ["IndexParts", "InputParts", "corrected_indices"]

# Both ends move out by this: errors below it are those of the true values of the simulations.
_RESOLUTION = 0.001


@dataclass(frozen=True, eq=False)
class InputParts:
    """Projections of the surrogate, by input.

    Parameters
    ----------
    values : ndarray, shape (run, input)
        The projection of the fit of each run's fold, at the run.
    squares : ndarray, shape (fold, input)
        The mean square of the projection of each fold's fit.
    """

    values: FloatArray
    squares: FloatArray


@dataclass(frozen=True, eq=False)
class IndexParts:
    """Projections for first-order and for total-order indices, or why they are not known."""

    first: InputParts | None
    total: InputParts | None
    reason: str = ""

    @classmethod
    def without(cls, reason: str) -> IndexParts:
        """Return no projections, for a reason."""
        return cls(None, None, reason)


def corrected_indices(
    runs: CorrectionRuns, parts: InputParts, variance: CorrectedMean
) -> Iterator[Estimate]:
    """Yield the index of each input, between the intervals of its two bounds.

    Parameters
    ----------
    runs : CorrectionRuns
    parts : InputParts
    variance : CorrectedMean
        Of the output.
    """
    errors = runs.values - runs.predictions
    errors = errors - np.average(errors, weights=runs.weights)
    weights = 1.0 if runs.weights is None else runs.weights
    for values, squares in zip(parts.values.T, parts.squares.T, strict=True):
        least = squares[runs.fold] + 2 * weights * errors * values
        value, lower, _ = _ratio_interval(runs, least, variance)
        _, _, upper = _ratio_interval(runs, least + weights * errors**2, variance)
        value = min(max(value, 0.0), 1.0)
        yield Estimate(
            value,
            min(max(lower - _RESOLUTION, 0.0), value),
            max(min(upper + _RESOLUTION, 1.0), value),
            texts.CORRECTED_BRACKET,
            "conservative",
        )


def _ratio_interval(
    runs: CorrectionRuns, terms: FloatArray, variance: CorrectedMean
) -> tuple[float, float, float]:
    """Return a share of the variance with its bounds, by the delta method."""
    whole = variance.value
    share = float(terms.mean()) / whole
    influence = (terms - share * variance.influence) / whole
    found = CorrectedMean(influence, 1.0, share**2 * variance.draws_variance / whole**2)
    half = student_quantile(runs.size - 2, runs.level) * found.error
    if math.isnan(half):
        return share, -math.inf, math.inf
    half += found.missing_margin(runs)
    return share, share - half, share + half
