"""Rounds of a design that doubles its runs until a stopping rule is satisfied."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Iterator

from uqpen.core.labels import (
    STOPPING_AT_MOST,
    STOPPING_NOTE,
    STOPPING_RULE,
    STOPPING_STATISTICS,
)
from uqpen.designs.drawn_points import Points
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.stopping_rule import StoppingRule

__all__ = ["FIRST_LOOK", "doubling_looks", "doubling_rounds"]

# Number of runs before the first look. In 4 000 trials of an exponential output, intervals of
# nominal 95 % covered in 94.5 % at the worst target, in 92.9 % from 64 runs and 85.5 % from 8
# (benchmarks/stopping_coverage.py).
FIRST_LOOK = 512

_NOTE = (
    "the runs decided their own number; as looks double from {first} runs, intervals {of} "
    "cover about as they do after a number that was fixed; no rule can know of a "
    "part of the output that none of the runs has met"
)


def doubling_looks(at_most: int, first: int = FIRST_LOOK) -> Iterator[int]:
    """Yield the numbers of runs at which a rule looks.

    >>> list(doubling_looks(3_000))
    [512, 1024, 2048, 3000]
    """
    look = first
    while look < at_most:
        yield look
        look *= 2
    yield at_most


def doubling_rounds(
    rule: StoppingRule,
    at_most: int,
    draw: Callable[[int, int], Points],
    *,
    first: int = FIRST_LOOK,
    intervals: str = "of independent draws",
) -> Generator[Points, Feedback, None]:
    """Yield rounds of points, as a design does, until a rule is satisfied.

    The rule looks at the first runs, then whenever their number has doubled. The points say so in
    attributes, which the archive keeps with the runs.

    Parameters
    ----------
    rule : StoppingRule
        The rule.
    at_most : int
        Number of runs at which the design ends in any case.
    draw : callable
        Returns the points from one number to another, the last excluded, as a design may yield
        them.
    first : int
        Number of runs at the first look.
    intervals : str
        Which intervals are certified, for a reader: those of independent draws, or over enough
        replicates. Of fewer replicates, the smallest standard errors end a design too soon.
    """
    attributes = {
        STOPPING_RULE: f"{rule}; at most {at_most} runs",
        STOPPING_NOTE: _NOTE.format(first=first, of=intervals),
        STOPPING_AT_MOST: at_most,
        STOPPING_STATISTICS: json.dumps(list(rule.statistics())),
    }
    start = 0
    for look in doubling_looks(at_most, first):
        feedback = yield draw(start, look).assign_attrs(attributes)
        if look < at_most and rule.is_satisfied(feedback):
            return
        start = look
