"""Probability of a rare event from one replicate."""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["ReplicateProbability"]


class ReplicateProbability(NamedTuple):
    """Probabilities from one replicate, of admissible inputs.

    Parameters
    ----------
    event : float
        Of a completed run that shows the event.
    missing : float
        Of a failed run, whose outcome is unknown.
    """

    event: float
    missing: float

    @property
    def of_completed(self) -> float:
        """Probability of the event, given that a run completes; NaN if none does."""
        return self.event / (1 - self.missing) if self.missing < 1 else math.nan

    @property
    def largest(self) -> float:
        """Probability of the event if all failed runs have it."""
        return self.event + self.missing
