"""Rounds of a design that makes independent runs until a claim is decided."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Iterator, Mapping
from typing import TYPE_CHECKING

from uqpen.core.labels import (
    STATUS,
    STOPPING_AT_MOST,
    STOPPING_CLAIM,
    STOPPING_NOTE,
    STOPPING_RULE,
    STOPPING_STATISTICS,
)
from uqpen.designs.drawn_points import Points
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.acceptance_claim import AcceptanceClaim
from uqpen.designs.stopping.likelihood_ratio import ClaimVerdict

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["deciding_looks", "deciding_rounds"]

# Runs of the first round, and the least of any: as many as workers may share. A round adds an
# eighth of the runs so far, so that few are made beyond the decision.
_FEWEST, _PART = 32, 8

_NOTE = (
    "the runs decided their own number by a test that may be looked at after every run: its answer "
    "is wrong in at most 5 % of studies; intervals for a fixed number of runs do not hold here"
)


def deciding_looks(at_most: int) -> Iterator[int]:
    """Yield the numbers of runs at which rounds end.

    >>> list(deciding_looks(100))
    [32, 64, 96, 100]
    """
    look = _FEWEST
    while look < at_most:
        yield look
        look += max(_FEWEST, look // _PART)
    yield at_most


def deciding_rounds(
    claim: AcceptanceClaim, at_most: int, draw: Callable[[int, int], Points]
) -> Generator[Points, Feedback, None]:
    """Yield rounds of points, as a design does, until a claim is decided for every model.

    The number of runs after which it is decided depends on their order alone, so it is the same for
    any workers. The round is completed, and all of its runs are kept.

    Parameters
    ----------
    claim : AcceptanceClaim
        The claim.
    at_most : int
        Number of runs at which the design ends in any case.
    draw : callable
        Returns the points from one number to another, the last excluded: independent draws.
    """
    attributes = {
        STOPPING_RULE: f"until {claim} is decided; at most {at_most} runs",
        STOPPING_NOTE: _NOTE,
        STOPPING_AT_MOST: at_most,
        STOPPING_STATISTICS: json.dumps([]),
        STOPPING_CLAIM: str(claim),
    }
    rounds: list[Mapping[str, xr.Dataset]] = []
    start = 0
    for look in deciding_looks(at_most):
        feedback = yield draw(start, look).assign_attrs(attributes)
        rounds.append(feedback.runs)
        if _is_decided(claim, rounds):
            return
        start = look


def _is_decided(claim: AcceptanceClaim, rounds: list[Mapping[str, xr.Dataset]]) -> bool:
    """Check that the claim is decided for each model that has the output."""
    from uqpen.execution import join_rounds

    for model in (name for name, runs in rounds[0].items() if claim.output in runs):
        made = join_rounds([each[model][[claim.output, STATUS]] for each in rounds])
        if claim.decide(made).verdict is ClaimVerdict.UNDECIDED:
            return False
    return True
