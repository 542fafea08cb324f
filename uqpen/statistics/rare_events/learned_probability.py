"""Probability of a rare event from a learned surrogate that weighted runs correct."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.special import ndtri

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import (
    CORRECTION_WEIGHT,
    EQUIVALENT_RUNS,
    PREDICTED_EVENT,
    PREDICTION_ERROR,
    RUN,
    SEARCH_WEIGHT,
    SURROGATE_ESTIMATE,
    SURROGATE_PROBABILITY,
    SURROGATE_PROBABILITY_ERROR,
)
from uqpen.designs.rare_events.limit_state import LimitState
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.rare_events.rare_event_probability import RareEventProbability, WeightedCount


class _Correction(NamedTuple):
    """Runs that correct a surrogate."""

    weights: FloatArray  # (run,)
    predicted: BoolArray  # (run,): where the surrogate predicts the event
    surrogate: float  # its probability by the surrogate
    error: float  # the standard error of its sampling
    # Weight of a further wrong prediction, where the event is predicted and where it is not.
    next_weights: tuple[float, float]
    level: float

    @property
    def is_fitted(self) -> bool:
        """True if there is a surrogate."""
        return not math.isnan(self.surrogate)

    def probability(self, occurs: BoolArray) -> tuple[float, float, float]:
        """Return the probability of an event that the runs show, with both ends.

        Runs that contradict the surrogate are counted in both directions. Their intervals and the
        error of sampling the surrogate are joined by the squares of their distances (MOVER).
        """
        wrong = self.predicted & ~occurs
        missed = occurs & ~self.predicted
        too_many, too_few = (
            WeightedCount.of_runs(self.weights[each], heaviest, self.level)
            for each, heaviest in zip((wrong, missed), self.next_weights, strict=True)
        )
        surrogate, error = (self.surrogate, self.error) if self.is_fitted else (0.0, 0.0)
        value = surrogate - too_many.value + too_few.value
        sampled = float(ndtri(0.5 + self.level / 2)) * error
        lower = value - math.hypot(too_many.above, too_few.below, sampled)
        upper = value + math.hypot(too_many.below, too_few.above, sampled)
        # What the runs show without the surrogate is a lower bound as well.
        shown = WeightedCount.of_runs(self.weights[occurs], 0.0, self.level).lower
        return max(value, 0.0), max(lower, min(shown, value)), min(max(upper, 0.0), 1.0)


def learned_probability(runs: xr.Dataset, event: LimitState, level: float) -> RareEventProbability:
    """Estimate the probability of an event from the runs that correct a surrogate.

    It is what the surrogate predicts, less the weights of runs that show no event where it predicts
    one, and with those of runs that show one where it predicts none. So it is without bias for any
    surrogate. What the surrogate says alone, and how many plain runs would have an interval as
    narrow, stand beside it.

    References
    ----------
    Fay, M. P. & Feuer, E. J. (1997). Statist. Med. 16, 791-801 (weighted counts);
    Zou, G. Y., Huang, W. & Zhang, X. (2009). Comput. Statist. Data Anal. 53, 1080-1085 (MOVER).
    """
    used = np.flatnonzero(runs[CORRECTION_WEIGHT].values > 0)
    correction = _correction(runs.isel({RUN: used}), level)
    own = event.outcomes(runs).of(used)
    if not (own.occurs | own.missing).any():
        reason = texts.EVENT_NEVER_SEEN if own.belongs.any() else texts.NO_ADMISSIBLE_REPLICATE
        return _with_companions(Estimate.without_bounds(math.nan, reason), correction, math.nan)
    value, lower, upper = correction.probability(own.occurs)
    method = texts.CORRECTED_COUNTS
    missing = float(correction.weights[own.missing].sum())
    if own.missing.any():
        value = value / (1 - missing) if missing < 1 else math.nan
        upper = correction.probability(own.occurs | own.missing)[2]
        method = texts.FOR_ANY_OUTCOME.format(method=method)
    if not own.belongs.all():
        out = WeightedCount.of_runs(correction.weights[~own.belongs], 0.0, level)
        share = min(out.value, 1 - 1e-9)
        value, lower = value / (1 - share), lower / (1 - min(out.lower, share))
        upper = min(upper / max(1 - out.upper, 1e-9), 1.0)
    equivalent = _equivalent_runs(value, upper - lower, level)
    estimate = Estimate(value, lower, upper, method, "nominal")
    worth = ""
    if not math.isnan(equivalent):
        worth = texts.AS_NARROW_AS.format(runs=int(float(f"{equivalent:.2g}")))
    nearest = float(runs[SEARCH_WEIGHT].values[used][own.occurs | own.missing].max())
    notes = (
        texts.PART_NOT_MET.format(probability=min(3 * nearest, 1.0)),  # the rule of three
        texts.SURROGATE_ALONE.format(probability=correction.surrogate) * correction.is_fitted,
        worth,
    )
    return _with_companions(estimate.with_note(*notes), correction, equivalent)


def _with_companions(
    estimate: Estimate, correction: _Correction, equivalent: float
) -> RareEventProbability:
    companions = {SURROGATE_ESTIMATE: correction.surrogate, EQUIVALENT_RUNS: equivalent}
    return RareEventProbability(estimate, companions)


def _equivalent_runs(value: float, width: float, level: float) -> float:
    """Return how many plain runs have an interval of this width; NaN where none has."""
    if not (0 < value < 1 and width > 0):
        return math.nan
    return (2 * float(ndtri(0.5 + level / 2)) / width) ** 2 * value * (1 - value)


def _correction(runs: xr.Dataset, level: float) -> _Correction:
    weights = runs[CORRECTION_WEIGHT].values
    predicted = runs[PREDICTED_EVENT].values == 1
    surrogate = float(runs[SURROGATE_PROBABILITY].values[0])
    error = float(runs[SURROGATE_PROBABILITY_ERROR].values[0])
    # Where the event is predicted, an error may be anywhere: a surrogate may be sure and wrong.
    among = float(weights[predicted].max(initial=0.0))
    beyond = _next_weight(weights[~predicted], runs[PREDICTION_ERROR].values[~predicted])
    return _Correction(weights, predicted, surrogate, error, (among, beyond), level)


def _next_weight(weights: FloatArray, errors: FloatArray) -> float:
    """Return the expected weight of a further run that shows an event which is not predicted.

    It would be where the surrogate may err: with a probability in proportion to that of the inputs
    and of an error, which a run's weight stands for.
    """
    likely = weights * errors
    total = float(likely.sum())
    if not total > 0:
        return float(weights.max(initial=0.0))
    return float((likely * weights).sum()) / total
