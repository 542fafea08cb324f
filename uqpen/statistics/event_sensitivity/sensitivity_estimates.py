"""Sensitivities of an event's probability to one input, as estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from uqpen.statistics.estimate import Estimate
from uqpen.statistics.event_sensitivity.input_scores import InputScores

__all__ = ["PairOfEstimates", "SensitivityEstimates"]


class PairOfEstimates(NamedTuple):
    """Estimates for the mean of an input and for its standard deviation."""

    mean: Estimate
    std: Estimate


@dataclass(frozen=True)
class SensitivityEstimates:
    """Sensitivities of an event's probability to the mean and the standard deviation of an input.

    Parameters
    ----------
    changes : PairOfEstimates
        Derivatives of the probability times the standard deviation of the input.
    relative_changes : PairOfEstimates
        The same of the logarithm of the probability.
    effective_runs : float
        Effective number of the runs with the event, by their scores.
    """

    changes: PairOfEstimates
    relative_changes: PairOfEstimates
    effective_runs: float

    @classmethod
    def without_values(cls, reason: str) -> SensitivityEstimates:
        """Return no estimates, for a reason."""
        none = Estimate.without_bounds(float("nan"), reason)
        return cls(PairOfEstimates(none, none), PairOfEstimates(none, none), float("nan"))

    def elasticities(self, scores: InputScores | None, reason: str) -> PairOfEstimates:
        """Return the relative changes of the probability per relative change of each moment.

        Parameters
        ----------
        scores : InputScores or None
            Of the input.
        reason : str
            Why there is no elasticity to a mean of 0.
        """
        mean, std = self.relative_changes
        if scores is None:
            return self.relative_changes
        if abs(scores.mean) < 1e-12 * scores.std:
            return PairOfEstimates(Estimate.without_bounds(float("nan"), reason), std)
        return PairOfEstimates(_scaled(mean, scores.mean / scores.std), std)


def _scaled(estimate: Estimate, factor: float) -> Estimate:
    """Return an estimate times a number."""
    lower, upper = estimate.lower * factor, estimate.upper * factor
    if factor < 0:
        lower, upper = upper, lower
    return replace(estimate, value=estimate.value * factor, lower=lower, upper=upper)
