"""Verdicts: on the requirements of a study, and of designs that decided a claim by themselves."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.errors import QuantityError
from uqpen.core.labels import (
    DECISION,
    DECISION_CLAIM,
    DECISION_LOWER,
    DECISION_PROBABILITY,
    DECISION_RUNS,
    DECISION_UPPER,
    EVENT,
    LOWER_THRESHOLD,
    RUN,
    STOPPING_AT_MOST,
    STOPPING_CLAIM,
    STOPPING_RULE,
    THRESHOLD,
)
from uqpen.core.quantities import parse_quantity
from uqpen.core.statistic import AcceptanceVerdict
from uqpen.core.status import Status
from uqpen.designs.stopping.acceptance_claim import ERROR, parse_claim
from uqpen.execution import status_counts
from uqpen.results.digits import estimate_text, grouped_number, percent_text
from uqpen.results.table import NOTHING, OutputTable

# Verdicts on probabilities: whether an interval lies within the acceptance limits of a study.


# What has acceptance limits lies along one of these.
_DIMENSIONS = (THRESHOLD, LOWER_THRESHOLD, EVENT)


@dataclass(frozen=True)
class Acceptance:
    """Accepted probabilities, and the verdict on an estimate."""

    at_least: float  # 0 where the study states none
    at_most: float  # 1 where the study states none
    verdict: AcceptanceVerdict  # whether the estimate meets them

    @classmethod
    def from_array(cls, array: xr.DataArray) -> Acceptance | None:
        """Return the acceptance of a single estimate along ``bound``; None without limits."""
        limits: dict[str, float] = {}
        for end in ("at_least", "at_most"):
            for dimension in _DIMENSIONS:
                # Coordinates of an array would each be made an array of their own.
                limit = array.coords.variables.get(f"{dimension}_{end}")
                if limit is not None and not math.isnan(limit.values):
                    limits[end] = float(limit.values)
        if not limits:
            return None
        least, most = limits.get("at_least", 0.0), limits.get("at_most", 1.0)
        _, lower, upper = array.values.tolist()
        verdict = AcceptanceVerdict.NOT_DECIDED
        if lower >= least and upper <= most:
            verdict = AcceptanceVerdict.MET
        elif lower > most or upper < least:
            verdict = AcceptanceVerdict.NOT_MET
        return cls(least, most, verdict)

    def __str__(self) -> str:
        parts = ["at least " + percent_text(self.at_least)] if self.at_least > 0 else []
        if self.at_most < 1 or not parts:
            parts.append("at most " + percent_text(self.at_most))
        return " and ".join(parts)


def add_verdicts(
    table: OutputTable, arrays: Mapping[str, xr.DataArray], *, without: Collection[str] = ()
) -> None:
    """Add a row of verdicts on a probability by source, if the study has acceptance limits.

    Sources in `without` have no verdict.
    """
    found = {source: Acceptance.from_array(array) for source, array in arrays.items()}
    if first := next(filter(None, found.values()), None):
        shown = (None if each in without else found.get(each) for each in table.columns)
        cells = [str(each.verdict) if each else NOTHING for each in shown]
        table.rows.append((f"accepted: {first}", cells))


def acceptance_json(array: xr.DataArray) -> dict[str, Any]:
    """Return the acceptance limits of a probability and the verdict; empty without limits."""
    found = Acceptance.from_array(array)
    return {**asdict(found), "verdict": str(found.verdict)} if found else {}


# Designs whose runs decided their own number: the rule, its limits, the decision.

# By the rule of three: what has this probability times 1/n is missed by n runs in 5 % of studies.
_UNSEEN = 3

# The attributes with the fields of a decision, in their order, and the types of these.
_FIELDS: dict[str, type] = {
    DECISION_CLAIM: str,
    DECISION: str,
    DECISION_RUNS: int,
    DECISION_PROBABILITY: float,
    DECISION_LOWER: float,
    DECISION_UPPER: float,
}


def stopping_text(runs: xr.Dataset) -> str:
    """Return by which rule a design has ended, and whether at its largest number of runs.

    Empty for a design whose number of runs was fixed.
    """
    if STOPPING_RULE not in runs.attrs:
        return ""
    text = str(runs.attrs[STOPPING_RULE])
    if STOPPING_CLAIM in runs.attrs:
        return text
    if runs.sizes[RUN] == runs.attrs.get(STOPPING_AT_MOST):
        text += "; that number ended it, so the precision may not be reached"
    return "; ".join(filter(None, (text, unseen_text(runs))))


def unseen_text(runs: xr.Dataset) -> str:
    """Return which part of an output a stopping rule cannot exclude; empty for a fixed number."""
    completed = status_counts(runs)[Status.OK]
    if STOPPING_RULE not in runs.attrs or STOPPING_CLAIM in runs.attrs or completed <= _UNSEEN:
        return ""
    share = percent_text(float(f"{_UNSEEN / completed:.2g}"))
    return (
        f"no rule can exclude a part of the output that fewer than {_UNSEEN} in "
        f"{grouped_number(completed)} runs ({share}) meet"
    )


@dataclass(frozen=True)
class StatedDecision:
    """Decision on a claim, as an archive states it."""

    claim: str
    verdict: str  # ``"held"``, ``"not held"`` or ``"undecided"``
    runs: int  # number of runs after which it was decided
    probability: float  # share of the completed runs with the event
    lower: float  # end of the interval of its probability
    upper: float  # the other end

    @classmethod
    def from_source(cls, attributes: Mapping[Any, Any]) -> StatedDecision | None:
        """Return the decision among the attributes of a source; None without one."""
        if not attributes.keys() >= _FIELDS.keys():
            return None
        return cls(*(kind(attributes[key]) for key, kind in _FIELDS.items()))

    @property
    def output(self) -> str:
        """Name of the output that the claim concerns; empty if the claim cannot be read."""
        try:
            return parse_claim(self.claim).output
        except QuantityError:
            return ""

    def concerns(self, output: str, statistic: str, value: float, unit: str) -> bool:
        """Check whether a probability is that of the claim's event.

        `value` is its threshold in `unit`, the output's SI unit.
        """
        try:
            claim = parse_claim(self.claim)
            limit = parse_quantity(claim.value, unit).value
        except QuantityError:  # an archive can claim anything
            return False
        event = CATALOGUE[statistic].shown.event if statistic in CATALOGUE else ""
        is_event = bool(event) and (event == "above") is claim.is_above
        return is_event and output == claim.output and math.isclose(value, limit, rel_tol=1e-12)

    @property
    def verdict_text(self) -> str:
        """The verdict, and after how many runs."""
        comma = "," if self.verdict == "not held" else ""
        return f"{self.verdict}{comma} after {grouped_number(self.runs)} runs"

    @property
    def guarantee(self) -> str:
        """The probability of a wrong answer, and what is known of the probability, in words."""
        estimate = estimate_text(self.probability, self.lower, self.upper)
        return (
            f"a wrong answer has a probability of at most {percent_text(ERROR)}, whenever one "
            f"looks; the probability is {estimate}, an interval that holds whenever one stops"
        )

    def to_json(self) -> dict[str, Any]:
        """Return its fields, and the largest probability of a wrong answer."""
        return {**asdict(self), "error": ERROR}
