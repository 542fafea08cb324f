"""Probabilities from the runs at which a surrogate is on the wrong side of a value.

A probability is that of the surrogate, plus the probability that the output alone is on the side,
minus the probability that the surrogate alone is. Bonett and Price give the interval of such a
difference, which keeps its coverage where the runs show no disagreement at all.

References
----------
Bonett, D. G. & Price, R. M. (2012). J. Educ. Behav. Stat. 37, 479-488.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.intervals import clopper_pearson, ratio_error
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = [
    "CorrectedProbability",
    "FoldCounts",
    "bonett_price",
    "corrected_probability",
    "with_bounds",
]

# The plain share is used where its variance is below this part of that with the surrogate. With no
# event at all the two are about equal, and the surrogate's bound is the lower one.
_CLEARLY_SMALLER = 0.9

# Numbers of runs, of one event or of several.
Counts = npt.NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class CorrectedProbability:
    """Probabilities with their bounds, of any one shape."""

    value: FloatArray
    lower: FloatArray
    upper: FloatArray


def bonett_price(
    gained: npt.ArrayLike, dropped: npt.ArrayLike, runs: npt.ArrayLike, level: float
) -> tuple[FloatArray, FloatArray]:
    """Return centre and half-width of the interval of a difference of paired probabilities.

    Parameters
    ----------
    gained, dropped : array_like
        Numbers of runs where the event happened by the model alone, and by the surrogate alone.
    runs : array_like
        Their total.
    level : float
        Two-sided.
    """
    size = np.asarray(runs, dtype=np.float64) + 2
    one, other = ((np.asarray(each, dtype=np.float64) + 1) / size for each in (gained, dropped))
    variance = (one + other - (one - other) ** 2) / size
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
    by_model, by_fit, by_both = (
        np.bincount(runs.fold[flags], minlength=folds)
        for flags in (events, predicted, events & predicted)
    )
    by_missing = np.bincount(runs.missing_fold[missing], minlength=folds)
    counts = FoldCounts(by_model, by_fit, by_both, by_missing)
    is_used = counts.uses_surrogate(runs)
    pooled = (runs.shares * is_used) @ drawn
    error, _ = ratio_error(pooled, runs.draw_replicate, runs.draw_replicates)
    return with_bounds(runs, np.asarray(pooled.mean()), counts, is_used, error)


@dataclass(frozen=True, eq=False)
class FoldCounts:
    """Numbers of runs of each fold at which an event happened, or each of several events.

    Parameters
    ----------
    by_model, by_fit, by_both, missing : ndarray of int, shape (fold, ...)
        By the model, by the fold's fit, by both, and by the fit at missing runs.
    """

    by_model: Counts
    by_fit: Counts
    by_both: Counts
    missing: Counts

    def uses_surrogate(self, runs: CorrectionRuns) -> BoolArray:
        """Return whether each fold uses its fit, shape (fold, ...): the *other* folds decide.

        A fold does without where these have a clearly smaller variance for the plain share. A
        single fold has no other one, and uses its fit.
        """
        folds = len(runs.draws)
        if folds == 1:
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
    gained = (counts.by_model - is_used * counts.by_both).sum(axis=0)
    dropped = (is_used * (counts.by_fit - counts.by_both)).sum(axis=0)
    missing_events = (is_used * counts.missing).sum(axis=0)
    value = np.clip(share + (gained - dropped) / runs.size, 0.0, 1.0)
    total = runs.size + runs.missing
    noise = special.ndtri(0.5 + runs.level / 2) * error
    # The missing runs are against the surrogate, all one way and all the other.
    least, half_below = bonett_price(gained, dropped + missing_events, total, runs.level)
    most, half_above = bonett_price(
        gained + (runs.missing - missing_events), dropped, total, runs.level
    )
    is_plain = ~is_used.any(axis=0)
    plain_lower, _ = clopper_pearson(gained, total, runs.level)
    _, plain_upper = clopper_pearson(gained + runs.missing, total, runs.level)
    lower = np.where(is_plain, plain_lower, share + least - np.hypot(half_below, noise))
    upper = np.where(is_plain, plain_upper, share + most + np.hypot(half_above, noise))
    return CorrectedProbability(
        value,
        np.minimum(np.maximum(lower, 0.0), value),
        np.maximum(np.minimum(upper, 1.0), value),
    )
