"""Distribution function of an output, by its surrogate and corrected by real runs; its inverse.

The function and its bounds ascend, and all that is said of a distribution follows from them:
probabilities of lying beyond a value, quantiles and their intervals.

Folds may use their fits or not, and the best choice is another one at other probabilities. Each
piece of the probabilities from 0 to 1 has a choice, and by each choice there is a function. The
quantiles by the choices of all pieces may step back from one piece to the next. Their rearrangement
in ascending order is no farther from the true quantiles, and rearranged bounds hold the whole
function at least as often (Chernozhukov, Fernández-Val and Galichon). The distribution function of
the rearranged quantiles is a sum over the pieces: each function, as far as it lies in its piece.

By one choice, too, the function falls where only a prediction lies below a value. Of all ascending
functions, the middle between its largest value up to a point and its least from there on is the
nearest to it in the largest distance (Ubhaya).

References
----------
Chernozhukov, V., Fernández-Val, I. & Galichon, A. (2009). Biometrika 96, 559-575.
Chernozhukov, V., Fernández-Val, I. & Galichon, A. (2010). Econometrica 78, 1093-1125.
Ubhaya, V. A. (1974). J. Approx. Theory 12, 146-159.
Woodruff, R. S. (1952). J. Am. Stat. Assoc. 47, 635-646 (the inverse).
Zou, G. Y. (2007). Psychol. Methods 12, 399-413 (the interval of a difference).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import special

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.intervals import (
    ascending,
    bonett_price,
    clopper_pearson,
    largest_up_to,
    least_from,
)
from uqpen.statistics.surrogate.correction_runs import CorrectionRuns

# Predictions that folds use for quantiles: one choice for all values of an interval.


@dataclass(frozen=True, eq=False)
class QuantileChoices:
    """Choices of all folds, each for the probabilities of a piece of 0 to 1."""

    # (piece,): the last probability of each piece, ascending; that of the last piece is 1. A piece
    # has its end, and not that of the one before.
    ends: FloatArray
    choice: FoldChoice  # of shape (fold, piece)

    @classmethod
    def of(cls, runs: CorrectionRuns, grid: FloatArray, choice: FoldChoice) -> QuantileChoices:
        """Return the choices at the quantiles of the other folds, which are order statistics.

        Parameters
        ----------
        grid : ndarray, shape (value,)
            Values, ascending, with those of all runs.
        choice : FoldChoice
            At these values, shape (fold, value).
        """
        folds = range(len(runs.draws))
        if len(folds) == 1:
            return cls(np.ones(1), choice.at(np.zeros(1, dtype=np.int64)))
        others = [np.sort(runs.values[runs.fold != number]) for number in folds]
        steps = [np.arange(1, each.size + 1) / each.size for each in others]
        ends = np.unique(np.concatenate(steps))
        places = [
            np.searchsorted(grid, values[np.searchsorted(step, ends)])
            for values, step in zip(others, steps, strict=True)
        ]
        uses_fit, otherwise = (
            np.array([row[place] for row, place in zip(rows, places, strict=True)])
            for rows in (choice.uses_fit, choice.otherwise)
        )
        # Neighbours with the same choice are one piece.
        table = np.concatenate([uses_fit, otherwise])
        kept = np.append(np.flatnonzero((table[:, 1:] != table[:, :-1]).any(axis=0)), len(ends) - 1)
        return cls(ends[kept], FoldChoice(uses_fit[:, kept], otherwise[:, kept]))

    def parts(self) -> Iterator[tuple[FoldChoice, Callable[[FloatArray], FloatArray]]]:
        """Yield each different choice, shape (fold, 1), with a function of probabilities.

        It returns how much of the pieces with this choice lies at or below a probability.
        """
        table = np.concatenate([self.choice.uses_fit, self.choice.otherwise])
        _, first, number_of = np.unique(table, axis=1, return_index=True, return_inverse=True)
        widths = np.diff(self.ends, prepend=0.0)
        for number, piece in enumerate(first):
            widths_of_choice = np.where(number_of.ravel() == number, widths, 0.0)
            below = np.concatenate([[0.0], np.cumsum(widths_of_choice)])
            yield self.choice.at(np.array([piece])), partial(self._part, below)

    def _part(self, below: FloatArray, probability: FloatArray) -> FloatArray:
        """Return what lies below probabilities, from what lies below the ends of all pieces."""
        ends = np.concatenate([[0.0], self.ends])
        return np.asarray(np.interp(probability, ends, below), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class CorrectedCdf:
    """The corrected distribution function with pointwise bounds, and its inverse."""

    runs: CorrectionRuns

    def at(self, values: FloatArray) -> Estimate:
        """Return the distribution function with its bounds at some values."""
        grid, known = self._grid, self._at_grid
        place = np.searchsorted(grid, values, side="right") - 1
        is_between = grid[place] != values
        after = np.minimum(place + is_between, len(grid) - 1)
        found = known.value[place]
        if is_between.any():
            between, number = np.unique(values[is_between], return_inverse=True)
            exact = self._between(between)[number]
            found[is_between] = np.clip(exact, found[is_between], known.value[after[is_between]])
        return _probability(found, known.lower[place], known.upper[after])

    def above(self, values: FloatArray) -> Estimate:
        """Return the probabilities of exceeding some values."""
        found = self.at(values)
        return _probability(1 - found.value, 1 - found.upper, 1 - found.lower)

    def below(self, values: FloatArray) -> Estimate:
        """Return the probabilities of lying below some values."""
        return self.at(np.nextafter(values, -np.inf))

    def surrogate_share(self, values: FloatArray) -> FloatArray:
        """Return the distribution function of the surrogate at quantiles."""
        shares = self._pooled(np.einsum("k,ksv->sv", self.runs.shares, self._drawn))
        return shares[np.searchsorted(self._grid, values)]

    def quantile(self, probability: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return quantiles with bounds: all values whose interval has the probability.

        Parameters
        ----------
        probability : ndarray, shape (probability,)

        Returns
        -------
        value, lower, upper : ndarray, shape (probability,)
            A bound is NaN where the interval has the probability beyond all values.
        """
        return self._inverted(self._at_grid, probability)

    def half_spread(self) -> tuple[float, float, float]:
        """Return half the 16 % to 84 % range with bounds; NaN where one of the ends has none.

        The errors of both ends add up as those of independent ends do (Zou). They are no further
        apart: a run that is on the wrong side of both ends is so in the same direction, and as
        each end is off in few runs, their correlation is next to nothing or positive. What the
        missing runs may do to both ends is one thing, and adds up as it is.
        """
        value, lower, upper = self._inverted(self._at_grid, np.array([0.16, 0.84]))
        combined = np.add if self.runs.missing else np.hypot
        spread = value[1] - value[0]
        least = spread - combined(upper[0] - value[0], value[1] - lower[1])
        most = spread + combined(value[0] - lower[0], upper[1] - value[1])
        return float(spread) / 2, float(np.maximum(least, 0.0)) / 2, float(most) / 2

    @cached_property
    def choices(self) -> QuantileChoices:
        """Predictions of the folds by probability; the other folds decide, at their quantile."""
        return QuantileChoices.of(self.runs, self._grid, self._counted.choice(self.runs))

    @cached_property
    def _grid(self) -> FloatArray:
        """Ascending values: of runs, predictions, and as many draws as a fit has.

        Minus infinity comes first: there, no run is below.
        """
        runs, folds = self.runs, len(self.runs.draws)
        drawn = np.sort(runs.draws, axis=None)[folds - 1 :: folds]
        found = (runs.values, runs.predictions, runs.missing_predictions, drawn)
        return np.concatenate([[-np.inf], np.unique(np.concatenate(found))])

    @cached_property
    def _drawn(self) -> FloatArray:
        return self._drawn_shares(self._grid)

    @cached_property
    def _counted(self) -> FoldCounts:
        return self._counts(self._grid)

    @cached_property
    def _at_grid(self) -> Estimate:
        return self._function(self.runs.level)

    @cached_property
    def _values_by_choice(self) -> list[FloatArray]:
        """The function at the grid by each choice alone, in the order of `choices.parts`."""
        return [
            self._bounded(self._drawn, self._counted, choice, self.runs.level).value
            for choice, _ in self.choices.parts()
        ]

    def _function(self, level: float) -> Estimate:
        """Return the function with its bounds at the grid."""
        value, lower, upper = np.zeros((3, len(self._grid)))
        for choice, part in self.choices.parts():
            found = self._bounded(self._drawn, self._counted, choice, level)
            value += part(ascending(found.value))
            lower += part(ascending(found.lower))
            upper += part(ascending(found.upper))
        # Rounding may be against both, and against the sum of all shares.
        value = np.where(value > 1 - 1e-12, 1.0, largest_up_to(value))
        return _probability(
            value, np.minimum(largest_up_to(lower), value), np.maximum(largest_up_to(upper), value)
        )

    def _between(self, values: FloatArray) -> FloatArray:
        """Return the function at ascending values between those of the grid."""
        after = np.searchsorted(self._grid, values).clip(0, len(self._grid) - 1)
        counts, drawn = self._counts(values), self._drawn_shares(values)
        result = np.zeros(len(values))
        for known, (choice, part) in zip(self._values_by_choice, self.choices.parts(), strict=True):
            found = self._bounded(drawn, counts, choice, self.runs.level).value
            highest = np.maximum(largest_up_to(known)[after - 1], found)
            result += part((highest + np.minimum(least_from(known)[after], found)) / 2)
        return result

    def _inverted(
        self, found: Estimate, probability: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return quantiles with bounds, of a distribution function at the grid."""
        values, last = self._grid[1:], len(self._grid) - 2
        value = values[np.searchsorted(found.value[1:], probability).clip(0, last)]
        # The first value with an upper bound of at least the probability.
        first = np.searchsorted(found.upper[1:], probability).clip(0, last)
        lower = np.where(probability > found.upper[0], values[first], np.nan)
        # The first value with a lower bound above the probability.
        beyond = np.searchsorted(found.lower[1:], probability, side="right")
        upper = np.where(beyond <= last, values[beyond.clip(0, last)], np.nan)
        return value, np.minimum(lower, value), np.maximum(upper, value)

    def _bounded(
        self, drawn: FloatArray, counts: FoldCounts, choice: FoldChoice, level: float
    ) -> Estimate:
        """Return bounds from shares of draws and counts of runs, by one choice for all values."""
        runs = replace(self.runs, level=level)
        by_set = np.einsum("k,ksv->sv", runs.shares * choice.uses_fit[:, 0], drawn)
        by_set += runs.shares @ (~choice.uses_fit & choice.otherwise)
        error = by_set.std(axis=0, ddof=1) / np.sqrt(len(by_set))
        return with_bounds(runs, self._pooled(by_set), counts, choice, error)

    def _pooled(self, by_set: FloatArray) -> FloatArray:
        """Return the mean over all draws of what is known by set."""
        draws = self.runs.draw_replicate
        return np.asarray(np.bincount(draws) @ by_set / len(draws))

    def _counts(self, values: FloatArray) -> FoldCounts:
        runs, folds = self.runs, len(self.runs.draws)
        both = np.maximum(runs.values, runs.predictions)

        def counts(weights: FloatArray | None, missing_weights: FloatArray | None) -> FoldCounts:
            by_model, by_fit, by_both = (
                _counts(outputs, runs.fold, weights, folds, values)
                for outputs in (runs.values, runs.predictions, both)
            )
            missing = runs.missing_predictions, runs.missing_fold, missing_weights
            return FoldCounts(by_model, by_fit, by_both, _counts(*missing, folds, values))

        return FoldCounts.weighted(runs, counts)

    def _drawn_shares(self, values: FloatArray) -> FloatArray:
        """Return the distribution function of each fit in each set of draws, at ascending values.

        Its shape is (fold, set, value).
        """
        runs, sets = self.runs, self.runs.draw_replicates
        shares = np.empty((len(runs.draws), sets, len(values)))
        for share, row in zip(shares, runs.draws, strict=True):
            # A draw counts from the first value on that is not below it.
            first = np.searchsorted(values, row)
            at = np.bincount(
                runs.draw_replicate * (len(values) + 1) + first,
                minlength=sets * (len(values) + 1),
            )
            np.cumsum(at.reshape(sets, -1)[:, :-1], axis=1, out=share)
        return shares / np.bincount(runs.draw_replicate)[:, None]


def _counts(
    outputs: FloatArray,
    fold: IntArray,
    weights: FloatArray | None,
    folds: int,
    values: FloatArray,
) -> Counts:
    """Return how many outputs of each fold are at most each value, or what these weigh.

    The shape is (fold, value).
    """
    found = []
    for number in range(folds):
        own = fold == number
        order = np.argsort(outputs[own])
        below = np.searchsorted(outputs[own][order], values, side="right")
        if weights is not None:
            below = np.concatenate([[0.0], np.cumsum(weights[own][order])])[below]
        found.append(below)
    return np.array(found)


# Probabilities from the runs at which a surrogate is on the wrong side of a value.
#
# A probability is that of the surrogate, plus the probability that the output alone is on the side,
# minus the probability that the surrogate alone is. Bonett and Price give the interval of such a
# difference, which keeps its coverage where the runs show no disagreement at all.

# The plain share is used where its variance is below this part of that with the surrogate. With no
# event at all the two are about equal, and the surrogate's bound is the lower one.
_CLEARLY_SMALLER = 0.9

# Numbers of runs, or sums of their weights, of one event or of several.
Counts = npt.NDArray[np.integer[Any]] | FloatArray


@dataclass(frozen=True, eq=False)
class FoldChoice:
    """Prediction of each fold for an event, or for each of several: by its fit, or a constant."""

    uses_fit: BoolArray  # (fold, ...): whether the fold uses its fit
    # (fold, ...): without it, whether the fold predicts that the event always happens, or never.
    otherwise: BoolArray

    def at(self, number: IntArray) -> FoldChoice:
        """Return the choices of some events, shape (fold, number)."""
        return FoldChoice(self.uses_fit[:, number], self.otherwise[:, number])


@dataclass(frozen=True, eq=False)
class FoldCounts:
    """Numbers of runs of each fold at which an event happened, or each of several events."""

    by_model: Counts  # (fold, ...): by the model; sums of weights if runs are weighted
    by_fit: Counts  # (fold, ...): by the fold's fit
    by_both: Counts  # (fold, ...): by both
    missing: Counts  # (fold, ...): by the fit at missing runs
    squares: FoldCounts | None = None  # the same sums of the squares of the weights

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


def _probability(value: FloatArray, lower: FloatArray, upper: FloatArray) -> Estimate:
    return Estimate(value, lower, upper, texts.CORRECTED_BONETT_PRICE, "discrete")


def with_bounds(
    runs: CorrectionRuns,
    share: FloatArray,
    counts: FoldCounts,
    choice: FoldChoice,
    error: FloatArray,
) -> Estimate:
    """Return probabilities with bounds: those of the surrogate, and the disagreements.

    Parameters
    ----------
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
    return _probability(
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
