"""Probabilities from the runs at which a surrogate is on the wrong side of a value.

A probability is that of the surrogate, plus the probability that the output alone is on the side,
minus the probability that the surrogate alone is. Bonett and Price give the interval of such a
difference, which keeps its coverage where the runs show no disagreement at all.

References
----------
Bonett, D. G. & Price, R. M. (2012). J. Educ. Behav. Stat. 37, 479-488.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics.intervals import clopper_pearson, ratio_error
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = [
    "CorrectedProbability",
    "Counts",
    "FoldCounts",
    "bonett_price",
    "corrected_probability",
    "with_bounds",
]

# The plain share is used where its variance is below this part of that with the surrogate. With no
# event at all the two are about equal, and the surrogate's bound is the lower one.
_CLEARLY_SMALLER = 0.9

# Numbers of runs, or sums of their weights, of one event or of several.
Counts = npt.NDArray[np.integer[Any]] | FloatArray


@dataclass(frozen=True, eq=False)
class CorrectedProbability:
    """Probabilities with their bounds, of any one shape."""

    value: FloatArray
    lower: FloatArray
    upper: FloatArray


def bonett_price(
    gained: npt.ArrayLike,
    dropped: npt.ArrayLike,
    runs: npt.ArrayLike,
    level: float,
    *,
    squares: npt.ArrayLike | None = None,
    heaviest: float = 1.0,
) -> tuple[FloatArray, FloatArray]:
    """Return centre and half-width of the interval of a difference of paired probabilities.

    Of weighted runs, the one run that is added to each kind of disagreement has the largest weight,
    as nobody knows where the next disagreement is.

    Parameters
    ----------
    gained, dropped : array_like
        Numbers of runs where the event happened by the model alone, and by the surrogate alone.
    runs : array_like
        Their total.
    level : float
        Two-sided.
    squares : array_like, optional
        Of weighted runs, the sum of the squares of the weights in both. The numbers are then sums
        of weights.
    heaviest : float
        The largest weight of a run.
    """
    size = np.asarray(runs, dtype=np.float64) + 2
    one, other = ((np.asarray(each, dtype=np.float64) + 1) / size for each in (gained, dropped))
    both = one + other if squares is None else (np.asarray(squares) + 2 * heaviest**2) / size
    variance = (both - (one - other) ** 2) / size
    return one - other, special.ndtri(0.5 + level / 2) * np.sqrt(variance)


def corrected_probability(
    runs: CorrectionRuns,
    events: BoolArray,
    predicted: BoolArray,
    drawn: BoolArray,
    missing: BoolArray,
) -> CorrectedProbability:
    """Estimate the probability of an event; missing runs may have had it or not.

    Parameters
    ----------
    runs : CorrectionRuns
    events, predicted : ndarray of bool, shape (run,)
        Whether it happened at each run, by the model and by the run's fit.
    drawn : ndarray of bool, shape (fold, draw)
        Whether it happened at each draw, by each fold's fit.
    missing : ndarray of bool, shape (missing,)
        Whether it happened at the missing runs, by their fits.
    """
    folds = len(runs.draws)

    def counts_of(weights: FloatArray | None, missing_weights: FloatArray | None) -> FoldCounts:
        by_model, by_fit, by_both = (
            _fold_counts(runs.fold, flags, weights, folds)
            for flags in (events, predicted, events & predicted)
        )
        by_missing = _fold_counts(runs.missing_fold, missing, missing_weights, folds)
        return FoldCounts(by_model, by_fit, by_both, by_missing)

    counts = FoldCounts.weighted(runs, counts_of)
    is_used = counts.uses_surrogate(runs)
    pooled = (runs.shares * is_used) @ drawn
    error, _ = ratio_error(pooled, runs.draw_replicate, runs.draw_replicates)
    return with_bounds(runs, np.asarray(pooled.mean()), counts, is_used, error)


def _fold_counts(
    fold: IntArray, flags: BoolArray, weights: FloatArray | None, folds: int
) -> Counts:
    """Return how many runs of each fold have a flag, or what these weigh."""
    of = None if weights is None else weights[flags]
    return np.bincount(fold[flags], of, minlength=folds)


@dataclass(frozen=True, eq=False)
class FoldCounts:
    """Numbers of runs of each fold at which an event happened, or each of several events.

    Parameters
    ----------
    by_model, by_fit, by_both, missing : ndarray of int, shape (fold, ...)
        By the model, by the fold's fit, by both, and by the fit at missing runs. Of weighted runs,
        sums of weights.
    squares : FoldCounts, optional
        The same sums of the squares of the weights.
    """

    by_model: Counts
    by_fit: Counts
    by_both: Counts
    missing: Counts
    squares: FoldCounts | None = None

    @classmethod
    def weighted(
        cls,
        runs: CorrectionRuns,
        counts: Callable[[FloatArray | None, FloatArray | None], FoldCounts],
    ) -> FoldCounts:
        """Return counts, or sums of weights and of their squares, of completed and missing runs."""
        if runs.weights is None or runs.missing_weights is None:
            return counts(None, None)
        squares = counts(runs.weights**2, runs.missing_weights**2)
        return replace(counts(runs.weights, runs.missing_weights), squares=squares)

    def disagreements(self, is_used: BoolArray) -> tuple[Counts, Counts, Counts]:
        """Return the sums over the folds: by the model alone, by the surrogate alone, missing."""
        gained = (self.by_model - is_used * self.by_both).sum(axis=0)
        dropped = (is_used * (self.by_fit - self.by_both)).sum(axis=0)
        return gained, dropped, (is_used * self.missing).sum(axis=0)

    def uses_surrogate(self, runs: CorrectionRuns) -> BoolArray:
        """Return whether each fold uses its fit, shape (fold, ...): the *other* folds decide.

        A fold does without where these have a clearly smaller variance for the plain share. A
        single fold has no other one, and uses its fit; so do weighted runs, which were placed where
        the fits are uncertain.
        """
        folds = len(runs.draws)
        if folds == 1 or self.squares is not None:
            return np.ones(self.by_model.shape, dtype=np.bool_)
        by_model, gained, dropped = (
            each.sum(axis=0) - each
            for each in (self.by_model, self.by_model - self.by_both, self.by_fit - self.by_both)
        )
        sizes = runs.size * (1 - runs.shares).reshape(-1, *[1] * (by_model.ndim - 1))
        _, half = bonett_price(gained, dropped, sizes, runs.level)
        plain = (by_model + 2) / (sizes + 4)
        variance = special.ndtri(0.5 + runs.level / 2) ** 2 * plain * (1 - plain) / (sizes + 4)
        return np.asarray(variance > _CLEARLY_SMALLER * half**2)


def with_bounds(
    runs: CorrectionRuns,
    share: FloatArray,
    counts: FoldCounts,
    is_used: BoolArray,
    error: FloatArray,
) -> CorrectedProbability:
    """Return probabilities with bounds: those of the surrogate, and the disagreements.

    Parameters
    ----------
    runs : CorrectionRuns
    share, error : ndarray
        The probabilities by the surrogate, 0 for each fold that does without, and their errors.
    counts : FoldCounts
    is_used : ndarray of bool, shape (fold, ...)
        Whether each fold uses its fit. If none does, the interval is the plain one.
    """
    gained, dropped, missing_events = counts.disagreements(is_used)
    value = np.clip(share + (gained - dropped) / runs.size, 0.0, 1.0)
    total = runs.size + runs.missing
    missing, least_options, most_options = _weights_of_bounds(runs, counts, is_used)
    noise = special.ndtri(0.5 + runs.level / 2) * error
    # The missing runs are against the surrogate, all one way and all the other.
    least, half_below = bonett_price(
        gained, dropped + missing_events, total, runs.level, **least_options
    )
    most, half_above = bonett_price(
        gained + (missing - missing_events), dropped, total, runs.level, **most_options
    )
    is_plain = ~is_used.any(axis=0)
    plain_lower, _ = clopper_pearson(gained, total, runs.level)
    _, plain_upper = clopper_pearson(gained + missing, total, runs.level)
    lower = np.where(is_plain, plain_lower, share + least - np.hypot(half_below, noise))
    upper = np.where(is_plain, plain_upper, share + most + np.hypot(half_above, noise))
    return CorrectedProbability(
        value,
        np.minimum(np.maximum(lower, 0.0), value),
        np.maximum(np.minimum(upper, 1.0), value),
    )


def _weights_of_bounds(
    runs: CorrectionRuns, counts: FoldCounts, is_used: BoolArray
) -> tuple[float, dict[str, Any], dict[str, Any]]:
    """Return the weight of all missing runs, and what weights say of the lower and upper bound."""
    if counts.squares is None or runs.weights is None or runs.missing_weights is None:
        return runs.missing, {}, {}
    gained, dropped, events = counts.squares.disagreements(is_used)
    known, missing = gained + dropped, float((runs.missing_weights**2).sum())
    heaviest = float(np.concatenate([runs.weights, runs.missing_weights]).max())
    below = {"squares": known + events, "heaviest": heaviest}
    above = {"squares": known + (missing - events), "heaviest": heaviest}
    return float(runs.missing_weights.sum()), below, above
