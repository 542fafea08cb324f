"""Sequential test of a probability against a limit, which may be looked at after every run.

Two wealths are betted, one against each answer. A run multiplies the wealth against "P is at least
the limit" by the ratio of two likelihoods: that of an estimate from the runs before, no larger than
the limit, and that of the limit itself. If P is at least the limit, the wealth is expected to fall.
By Ville's inequality it ever reaches 1/error with a probability of at most `ERROR`. So the decision
is wrong at most that often, whenever it is looked at.

References
----------
Ville, J. (1939). Étude critique de la notion de collectif. Gauthier-Villars.
Ramdas, A., Grünwald, P., Vovk, V. & Shafer, G. (2023). Statist. Sci. 38, 576-601.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray

__all__ = ["ERROR", "ClaimVerdict", "Decision", "decide", "log_evidence_below"]

# Largest probability of a wrong decision.
ERROR = 0.05


class ClaimVerdict(StrEnum):
    """ClaimVerdict on a claim."""

    HELD = "held"
    """The claim is accepted."""
    NOT_HELD = "not held"
    """Its opposite is accepted."""
    UNDECIDED = "undecided"
    """The runs are too few for either."""


class Decision(NamedTuple):
    """Decision on a claim.

    Parameters
    ----------
    verdict : ClaimVerdict
        What the runs say.
    runs : int
        Number of runs after which it was decided; all of them if it was not.
    """

    verdict: ClaimVerdict
    runs: int


def decide(events: BoolArray, missing: BoolArray, limit: float, *, is_below: bool) -> Decision:
    """Decide whether the probability of an event lies below a limit, or above it.

    A missing run counts against either answer: as an event for "below", as none for "above".

    Parameters
    ----------
    events, missing : ndarray of bool, shape (run,)
        Whether the event occurred in each run, in their order, and whether that is unknown.
    limit : float
        Between 0 and 1.
    is_below : bool
        True for the claim that the probability is below the limit, False for above.
    """
    below = _first_crossing(log_evidence_below(events | missing, limit))
    above = _first_crossing(log_evidence_below(~(events & ~missing), 1 - limit))
    if below is None and above is None:
        return Decision(ClaimVerdict.UNDECIDED, len(events))
    is_first = above is None or (below is not None and below <= above)
    crossed = below if is_first else above
    assert crossed is not None  # as one of them is
    return Decision(ClaimVerdict.HELD if is_first == is_below else ClaimVerdict.NOT_HELD, crossed)


def log_evidence_below(events: BoolArray, limit: float) -> FloatArray:
    """Return the logarithm of the wealth against "P is at least the limit", after each run.

    >>> log_evidence_below(np.zeros(2, bool), 0.5).round(3).tolist()
    [0.0, 0.405]
    """
    runs_before = np.arange(len(events))
    events_before: IntArray = np.cumsum(events) - events
    guess = np.minimum((events_before + 0.5) / (runs_before + 1), limit)
    ratio = np.where(events, guess / limit, (1 - guess) / (1 - limit))
    logarithm: FloatArray = np.cumsum(np.log(ratio))
    return logarithm


def _first_crossing(logarithm: FloatArray) -> int | None:
    """Return the number of runs after which a wealth is large enough; None if it never is."""
    is_enough = logarithm >= -math.log(ERROR)
    return int(is_enough.argmax()) + 1 if is_enough.any() else None
