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
from uqpen.statistics.intervals import clopper_pearson
from uqpen.statistics.surrogate.correction.correction_runs import CorrectionRuns

__all__ = [
    "CorrectedProbability",
    "Counts",
    "FoldChoice",
    "FoldCounts",
    "bonett_price",
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


@dataclass(frozen=True, eq=False)
class FoldChoice:
    """Prediction of each fold for an event, or for each of several: by its fit, or a constant.

    Parameters
    ----------
    uses_fit : ndarray of bool, shape (fold, ...)
        Whether the fold uses its fit.
    otherwise : ndarray of bool, shape (fold, ...)
        Without it, whether the fold predicts that the event always happens, or never.
    """

    uses_fit: BoolArray
    otherwise: BoolArray

    def at(self, number: IntArray) -> FoldChoice:
        """Return the choices of some events, shape (fold, number)."""
        return FoldChoice(self.uses_fit[:, number], self.otherwise[:, number])


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

    def disagreements(self) -> tuple[Counts, Counts, Counts]:
        """Return the sums over the folds: by the model alone, by the surrogate alone, missing."""
        gained = (self.by_model - self.by_both).sum(axis=0)
        dropped = (self.by_fit - self.by_both).sum(axis=0)
        return gained, dropped, self.missing.sum(axis=0)

    def predicted_by(self, choice: FoldChoice, runs: CorrectionRuns) -> FoldCounts:
        """Return the counts with the predictions that each fold chooses."""
        if choice.uses_fit.all():
            return self
        sizes, missing = (
            np.bincount(fold, minlength=len(runs.draws)).reshape(
                -1, *[1] * (self.by_model.ndim - 1)
            )
            for fold in (runs.fold, runs.missing_fold)
        )
        return replace(
            self,
            by_fit=np.where(choice.uses_fit, self.by_fit, choice.otherwise * sizes),
            by_both=np.where(choice.uses_fit, self.by_both, choice.otherwise * self.by_model),
            missing=np.where(choice.uses_fit, self.missing, choice.otherwise * missing),
        )

    def choice(self, runs: CorrectionRuns) -> FoldChoice:
        """Return what each fold predicts: the *other* folds decide.

        A fold does without its fit where these have a clearly smaller variance for the plain share;
        it then predicts what most of their runs did, so that an event and its opposite have the
        same interval. A single fold has no other one, and uses its fit; so do weighted runs, which
        were placed where the fits are uncertain.
        """
        folds = len(runs.draws)
        if folds == 1 or self.squares is not None:
            everywhere = np.ones(self.by_model.shape, dtype=np.bool_)
            return FoldChoice(everywhere, ~everywhere)
        by_model, gained, dropped = (
            each.sum(axis=0) - each
            for each in (self.by_model, self.by_model - self.by_both, self.by_fit - self.by_both)
        )
        sizes = runs.size * (1 - runs.shares).reshape(-1, *[1] * (by_model.ndim - 1))
        _, half = bonett_price(gained, dropped, sizes, runs.level)
        plain = (by_model + 2) / (sizes + 4)
        variance = special.ndtri(0.5 + runs.level / 2) ** 2 * plain * (1 - plain) / (sizes + 4)
        return FoldChoice(variance > _CLEARLY_SMALLER * half**2, 2 * by_model > sizes)


def with_bounds(
    runs: CorrectionRuns,
    share: FloatArray,
    counts: FoldCounts,
    choice: FoldChoice,
    error: FloatArray,
) -> CorrectedProbability:
    """Return probabilities with bounds: those of the surrogate, and the disagreements.

    Parameters
    ----------
    runs : CorrectionRuns
    share, error : ndarray
        The probabilities by what the folds predict, and their errors.
    counts : FoldCounts
        Of the fits.
    choice : FoldChoice
        What the folds predict. If none uses its fit, the interval is the plain one.
    """
    events = counts.by_model.sum(axis=0)
    counts = counts.predicted_by(choice, runs)
    gained, dropped, missing_events = counts.disagreements()
    value = np.clip(share + (gained - dropped) / runs.size, 0.0, 1.0)
    total = runs.size + runs.missing
    missing, least_options, most_options = _weights_of_bounds(runs, counts)
    noise = special.ndtri(0.5 + runs.level / 2) * error
    # The missing runs are against the surrogate, all one way and all the other.
    least, half_below = bonett_price(
        gained, dropped + missing_events, total, runs.level, **least_options
    )
    most, half_above = bonett_price(
        gained + (missing - missing_events), dropped, total, runs.level, **most_options
    )
    is_plain = ~choice.uses_fit.any(axis=0)
    plain_lower, _ = clopper_pearson(events, total, runs.level)
    _, plain_upper = clopper_pearson(events + missing, total, runs.level)
    lower = np.where(is_plain, plain_lower, share + least - np.hypot(half_below, noise))
    upper = np.where(is_plain, plain_upper, share + most + np.hypot(half_above, noise))
    return CorrectedProbability(
        value,
        np.minimum(np.maximum(lower, 0.0), value),
        np.maximum(np.minimum(upper, 1.0), value),
    )


def _weights_of_bounds(
    runs: CorrectionRuns, counts: FoldCounts
) -> tuple[float, dict[str, Any], dict[str, Any]]:
    """Return the weight of all missing runs, and what weights say of the lower and upper bound."""
    if counts.squares is None or runs.weights is None or runs.missing_weights is None:
        return runs.missing, {}, {}
    gained, dropped, events = counts.squares.disagreements()
    known, missing = gained + dropped, float((runs.missing_weights**2).sum())
    heaviest = float(np.concatenate([runs.weights, runs.missing_weights]).max())
    below = {"squares": known + events, "heaviest": heaviest}
    above = {"squares": known + (missing - events), "heaviest": heaviest}
    return float(runs.missing_weights.sum()), below, above
