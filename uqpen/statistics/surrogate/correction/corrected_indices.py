"""Sobol' indices of a variable, by a surrogate and corrected by real runs.

What an input explains of a variable f is E(Pf)², where P is a projection: on the functions of the
input alone (first order), or on those with no part without it (total order). For a surrogate g

    E(Pf)² = 2 E(f Pg) − E(Pg)² + E(P(f − g))²,  and  0 ≤ E(P(f − g))² ≤ E(f − g)²

So the first two terms, which real runs estimate without bias, are a lower bound; with the square of
the errors they are an upper bound. Where the surrogate is good, the two are close. This holds for
inputs that depend on each other, too: the projections are conditional means.

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
from uqpen.statistics.intervals import ratio_error, student_quantile
from uqpen.statistics.surrogate.correction.corrected_mean import CorrectedMean
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = ["InputParts", "corrected_event_indices", "corrected_indices"]

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
    error : ndarray, shape (input,), optional
        Standard error that draws leave to the mean of the squares over all runs.
    """

    values: FloatArray
    squares: FloatArray
    error: FloatArray | float = 0.0

    def each(self) -> Iterator[tuple[FloatArray, FloatArray, float]]:
        """Yield values, mean squares and their error for each input."""
        error = np.broadcast_to(self.error, self.squares.shape[1:]).tolist()
        yield from zip(self.values.T, self.squares.T, error, strict=True)


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
    errors = errors - errors.mean()
    for values, squares, draws_error in parts.each():
        least = squares[runs.fold] + 2 * errors * values
        share = _Share(runs, variance, draws_error)
        value, lower, _ = share.interval(least)
        _, _, upper = share.interval(least + errors**2)
        yield _bracket(value, lower, upper)


def corrected_event_indices(runs: CorrectionRuns, parts: InputParts) -> Iterator[Estimate]:
    """Yield the index of each input for an event, a variable that is 0 or 1.

    Bonett and Price add a run in which the event happened by the model alone, and one in which it
    happened by the surrogate alone. So do both bounds, each with the runs that move it out: where
    the runs show few disagreements, their scatter is too small.

    Parameters
    ----------
    runs : CorrectionRuns
        Of the event.
    parts : InputParts
    """
    errors = runs.values - runs.predictions
    centre = float(runs.pooled(runs.draws).mean() + errors.mean())
    squares_of_fits = (runs.draws - centre) ** 2
    # (f − c)² − (g − c)² for the two values of f and of g.
    influence = squares_of_fits.mean(axis=1)[runs.fold] + errors * (1 - 2 * centre)
    noise, _ = ratio_error(runs.pooled(squares_of_fits), runs.draw_replicate, runs.draw_replicates)
    added = float(influence.mean()) + (1 - 2 * centre) * np.array([1.0, -1.0])
    variance = CorrectedMean(np.append(influence, added), 1.0, float(noise) ** 2)
    errors = errors - errors.mean()
    for values, squares, draws_error in parts.each():
        least = squares[runs.fold] + 2 * errors * values
        value = float(least.mean()) / float(influence.mean())
        share = _Share(runs, variance, draws_error)
        added = np.full(2, squares.mean()) - 2 * _at_the_border(values, runs.values)
        _, lower, _ = share.interval(np.append(least, added))
        added = np.full(2, squares.mean()) + 2 * _at_the_border(values, runs.values) + 1
        _, _, upper = share.interval(np.append(least + errors**2, added))
        yield _bracket(value, lower, upper)


def _at_the_border(values: FloatArray, events: FloatArray) -> float:
    """Return the size of a projection at the border of an event, where its runs meet the others."""
    sides = [float((values[events == side] ** 2).mean()) for side in (0.0, 1.0)]
    return math.sqrt(sum(sides) / 2)


def _bracket(value: float, lower: float, upper: float) -> Estimate:
    """Return an index between two bounds."""
    value = min(max(value, 0.0), 1.0)
    return Estimate(
        value,
        min(max(lower - _RESOLUTION, 0.0), value),
        max(min(upper + _RESOLUTION, 1.0), value),
        texts.CORRECTED_BRACKET,
        "conservative",
    )


@dataclass(frozen=True, eq=False)
class _Share:
    """Share of the variance of a variable, by the delta method.

    Parameters
    ----------
    runs : CorrectionRuns
    variance : CorrectedMean
        Of the variable.
    draws_error : float
        Standard error of the part that draws leave.
    """

    runs: CorrectionRuns
    variance: CorrectedMean
    draws_error: float

    def interval(self, terms: FloatArray) -> tuple[float, float, float]:
        """Return the mean of some terms as a share, with its bounds."""
        variance, whole = self.variance, self.variance.value
        share = float(terms.mean()) / whole
        influence = (terms - share * variance.influence) / whole
        noise = (share**2 * variance.draws_variance + self.draws_error**2) / whole**2
        found = CorrectedMean(influence, 1.0, noise)
        half = student_quantile(self.runs.size - 2, self.runs.level) * found.error
        if math.isnan(half):
            return share, -math.inf, math.inf
        half += found.missing_margin(self.runs)
        return share, share - half, share + half
