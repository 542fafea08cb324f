"""Claim on a probability that a design decides by a sequential test: ``P(depth > 60 cm) < 0.2``."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import (
    STATUS,
    STOPPING_AT_MOST,
    STOPPING_CLAIM,
    STOPPING_NOTE,
    STOPPING_RULE,
    STOPPING_STATISTICS,
)
from uqpen.core.quantities import parse_quantity
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.drawn_points import Points
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.stopping_rule import RequestedOutput, output_value_problems

if TYPE_CHECKING:
    import xarray as xr

# Sequential test of a probability against a limit, which may be looked at after every run.
#
# Two wealths are betted, one against each answer. A run multiplies the wealth against "P is at
# least the limit" by the ratio of two likelihoods: that of an estimate from the runs before, no
# larger than the limit, and that of the limit itself. If P is at least the limit, the wealth is
# expected to fall. By Ville's inequality it ever reaches 1/error with a probability of at most
# `ERROR`. So the decision is wrong at most that often, whenever it is looked at.
#
# References
# ----------
# Ville, J. (1939). Étude critique de la notion de collectif. Gauthier-Villars.
# Ramdas, A., Grünwald, P., Vovk, V. & Shafer, G. (2023). Statist. Sci. 38, 576-601.

# Largest probability of a wrong decision.
ERROR = 0.05


class ClaimVerdict(StrEnum):
    """Verdict on a claim."""

    HELD = "held"
    """The claim is accepted."""
    NOT_HELD = "not held"
    """The opposite of the claim is accepted."""
    UNDECIDED = "undecided"
    """The runs are too few for either."""


class Decision(NamedTuple):
    """Decision on a claim."""

    verdict: ClaimVerdict  # what the runs say
    runs: int  # number of runs after which it was decided; all of them if it was not


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


# Claim on a probability that a design decides: ``P(depth > 60 cm) < 0.2``.

CLAIM = 'a claim such as "P(depth > 60 cm) < 0.2"'
_LIMIT = "a probability above 0 and below 1"

_PATTERN = re.compile(
    r"\s*P\s*\(\s*(?P<output>\w+)\s*(?P<event>[<>])(?!=)\s*(?P<value>[^<>]+?)\s*\)"
    r"\s*(?P<sign>[<>])(?!=)\s*(?P<limit>[^<>]+?)\s*\Z",
    re.ASCII,
)


class Outcomes(NamedTuple):
    """Outcomes of the admissible runs, in their order."""

    events: BoolArray  # (run,): whether the event occurred
    missing: BoolArray  # (run,): whether that is unknown, as the run failed
    numbers: IntArray  # (run,): number of each run among all runs of the design, from 1


@dataclass(frozen=True)
class AcceptanceClaim:
    """Claim that the probability of an event is below a limit, or above it."""

    output: str  # name of the output
    is_above: bool  # whether the event is that the output exceeds the value, or lies below it
    value: str  # of the output, with its unit
    is_less: bool  # whether the probability is claimed to be less than the limit, and not more
    limit: float  # between 0 and 1

    def outcomes(self, runs: xr.Dataset | BlockedRuns) -> Outcomes:
        """Return the outcomes of a model's runs.

        Left out are inadmissible ones, and those without a value of a derived output.
        """
        handle = LoadedDataset.of(runs)
        status, values = handle.column(STATUS), handle.column(self.output)
        unit = str(handle.template[self.output].attrs.get("units", DIMENSIONLESS))
        value = parse_quantity(self.value, unit).value
        is_absent = (status == Status.OK) & np.isnan(values)
        positions = np.flatnonzero((status != Status.INADMISSIBLE) & ~is_absent)
        missing = status[positions] != Status.OK
        known = values[positions]
        events = known > value if self.is_above else known < value
        return Outcomes(events & ~missing, missing, positions + 1)

    def decide(self, runs: xr.Dataset | BlockedRuns) -> Decision:
        """Return what independent runs of a model say; a failed run counts against either answer.

        The number of runs counts the inadmissible ones, too.
        """
        events, missing, numbers = self.outcomes(runs)
        decision = decide(events, missing, self.limit, is_below=self.is_less)
        if decision.verdict is ClaimVerdict.UNDECIDED:
            return decision._replace(runs=LoadedDataset.of(runs).size)
        return decision._replace(runs=int(numbers[decision.runs - 1]))

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        """Yield the problems between the claim and the outputs of a study."""
        return output_value_problems(self.output, self.value, requested)

    def __str__(self) -> str:
        event, sign = "<>"[self.is_above], "><"[self.is_less]
        return f"P({self.output} {event} {self.value}) {sign} {self.limit:g}"


def parse_claim(text: str) -> AcceptanceClaim:
    """Read a claim.

    Raises
    ------
    QuantityError
        If the text is none, or its limit is no probability between 0 and 1.
    """
    match = _PATTERN.match(text)
    if match is None:
        raise QuantityError(toml_text(text), CLAIM)
    limit = parse_quantity(match["limit"], DIMENSIONLESS).value
    if not 0 < limit < 1:
        raise QuantityError(toml_text(match["limit"]), _LIMIT)
    return AcceptanceClaim(
        match["output"], match["event"] == ">", match["value"], match["sign"] == "<", limit
    )


def is_claim(value: object) -> bool:
    """Check that a value is the text of a claim."""
    try:
        return isinstance(value, str) and parse_claim(value) is not None
    except QuantityError:
        return False


# Rounds of a design that makes independent runs until a claim is decided.

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
