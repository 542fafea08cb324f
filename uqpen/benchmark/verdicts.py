"""Verdicts: the best method at each budget, for each statistic, and its significance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqpen.benchmark.accuracy import Accuracy, ErrorRatio, error_ratio
from uqpen.results.digits import grouped_number, range_text
from uqpen.results.texts import join_names

__all__ = ["NO_VERDICT", "Verdict", "find_verdict", "reference_remark", "verdict_sentence"]


# Largest half-width of the reference's own 95 % interval, relative to an error, without a remark:
# the error is then wrong by a few per cent at most.
_COARSE = 0.5

_FEW_DECIDE = "few of the repeats decide that"
_UNRESOLVED = "its errors are no larger than the reference's own"

NO_VERDICT = "no two methods have figures to compare"


@dataclass(frozen=True)
class Verdict:
    """Verdict of one comparison of methods.

    Parameters
    ----------
    winner, runner_up : str
        The methods with the smallest errors.
    lead : ErrorRatio
        The lead of the winner over the runner-up.
    level : tuple of str
        The methods, the winner first, whose errors do not differ significantly from its own.
    doubt : str
        Reason why the lead may not be real; empty for none. A few bad scrambles dominate the mean
        square error of scrambled points on a smooth function. So where a few repeats dominate, or
        all errors are as small as the reference's own, rarer repeats may change the order.
    """

    winner: str
    runner_up: str
    lead: ErrorRatio
    level: tuple[str, ...]
    doubt: str = ""


def find_verdict(
    names: Sequence[str], accuracies: Accuracy, resolution: float = 0.0
) -> Verdict | None:
    """Return the verdict of one comparison; None with fewer than two methods with estimates.

    Parameters
    ----------
    names : sequence of str
        Of the methods.
    accuracies : Accuracy
        Of shape (method,).
    resolution : float
        Error of the reference itself; NaN for unknown.
    """
    logarithm, error = accuracies.logarithm.tolist(), accuracies.error.tolist()
    order = [i for i in np.argsort(logarithm, kind="stable") if not math.isnan(logarithm[i])]
    if len(order) < 2:
        return None
    best = order[0]
    leads = {
        i: error_ratio((logarithm[best], error[best]), (logarithm[i], error[i]), accuracies.repeats)
        for i in order[1:]
    }
    # A method whose error a few repeats dominate is not level: it is behind, or ahead in doubt.
    is_heavy = accuracies.is_heavy
    level = [best, *(i for i, over in leads.items() if not (over.is_significant or is_heavy[i]))]
    ahead = leads[order[1]]
    is_decided = ahead.is_significant or len(level) > 1
    doubt = "" if is_decided and not is_heavy[best] else _FEW_DECIDE
    if math.exp(logarithm[best]) < resolution:
        doubt = _UNRESOLVED
    return Verdict(
        winner=names[best],
        runner_up=names[order[1]],
        lead=ErrorRatio(ahead.factor, math.nan, math.nan) if doubt else ahead,
        level=tuple(names[i] for i in level),
        doubt=doubt,
    )


def verdict_sentence(verdict: Verdict | None, budget: int) -> str:
    """Return a verdict in words.

    >>> close = ErrorRatio(1.1, 0.8, 1.5)
    >>> verdict_sentence(Verdict("sobol", "halton", close, ("sobol", "halton")), 128)
    'at 128 runs sobol and halton are level'
    """
    where = f"at {grouped_number(budget)} runs"
    if verdict is None:
        return f"{where} {NO_VERDICT}"
    if len(verdict.level) > 1:
        return f"{where} {join_names(verdict.level)} are level"
    over = verdict.lead
    if math.isinf(over.factor):
        return f"{where} {verdict.winner} alone is exact"
    if verdict.doubt:
        seen = f"{verdict.winner} is ahead of {verdict.runner_up}"
        return f"{where} {seen} by a factor of {_factor_text(over.factor)}, but {verdict.doubt}"
    factor, lower, upper = map(_factor_text, (over.factor, over.lower, over.upper))
    lead = f"{verdict.winner} leads {verdict.runner_up} by a factor of {factor}"
    return f"{where} {lead} ({range_text(lower, upper)})"


def reference_remark(error: float, half_width: float) -> str:
    """Return a remark on the half-width of the reference's interval, which may be NaN.

    It is compared with the smallest error that was measured against the reference.
    """
    if math.isnan(error):
        return ""
    if math.isnan(half_width):
        return "the reference has no interval here, so how far it is off is not known"
    if half_width > error:
        return "the smallest error is no larger than the reference's own"
    if half_width > _COARSE * error:
        return "the reference's own error is a good part of the smallest: take a larger --reference"
    return ""


def _factor_text(value: float) -> str:
    """Return a factor in two or three digits."""
    if value < 10:
        return f"{value:.2g}" if value < 1 else f"{value:.1f}"
    return f"{value:.0f}" if value < 1e5 else f"{value:.1g}"
