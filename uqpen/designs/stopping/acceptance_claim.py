"""Claim on a probability that a design decides: ``P(depth > 60 cm) < 0.2``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, IntArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import STATUS
from uqpen.core.quantities import parse_quantity
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.stopping.likelihood_ratio import ClaimVerdict, Decision, decide
from uqpen.designs.stopping.stopping_rule import RequestedOutput, output_value_problems

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CLAIM", "AcceptanceClaim", "Outcomes", "is_claim", "parse_claim"]

CLAIM = 'a claim such as "P(depth > 60 cm) < 0.2"'
_LIMIT = "a probability above 0 and below 1"

_PATTERN = re.compile(
    r"\s*P\s*\(\s*(?P<output>\w+)\s*(?P<event>[<>])(?!=)\s*(?P<value>[^<>]+?)\s*\)"
    r"\s*(?P<sign>[<>])(?!=)\s*(?P<limit>[^<>]+?)\s*\Z",
    re.ASCII,
)


class Outcomes(NamedTuple):
    """Outcomes of the admissible runs, in their order.

    Parameters
    ----------
    events, missing : ndarray of bool, shape (run,)
        Whether the event occurred, and whether that is unknown as the run failed.
    numbers : ndarray of int, shape (run,)
        Number of each run among all runs of the design, from 1.
    """

    events: BoolArray
    missing: BoolArray
    numbers: IntArray


@dataclass(frozen=True)
class AcceptanceClaim:
    """Claim that the probability of an event is below a limit, or above it.

    Parameters
    ----------
    output : str
        Name of the output.
    is_above : bool
        True for the event that the output exceeds the value, False for that it lies below.
    value : str
        A value of the output, with its unit.
    is_less : bool
        True for the claim that the probability is less than the limit, False for more.
    limit : float
        Between 0 and 1.
    """

    output: str
    is_above: bool
    value: str
    is_less: bool
    limit: float

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
