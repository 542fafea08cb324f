"""Verdicts on probabilities: whether an interval lies within the acceptance limits of a study."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

import xarray as xr

from uqpen.core.labels import EVENT, LOWER_THRESHOLD, THRESHOLD
from uqpen.results.digits import percent_text
from uqpen.results.table import NOTHING, OutputTable

__all__ = ["Acceptance", "AcceptanceVerdict", "acceptance_json", "add_verdicts"]


# What has acceptance limits lies along one of these.
_DIMENSIONS = (THRESHOLD, LOWER_THRESHOLD, EVENT)


class AcceptanceVerdict(StrEnum):
    """Verdict on a requirement, by the interval of an estimate."""

    MET = "met"
    """The whole interval is accepted."""
    NOT_MET = "not met"
    """No value in the interval is accepted."""
    NOT_DECIDED = "not decided"
    """A part of the interval is accepted, or there is no interval."""


@dataclass(frozen=True)
class Acceptance:
    """Accepted probabilities, and the verdict on an estimate.

    Parameters
    ----------
    at_least, at_most : float
        The limits; 0 and 1 where the study states none.
    verdict : AcceptanceVerdict
        Whether the estimate meets them.
    """

    at_least: float
    at_most: float
    verdict: AcceptanceVerdict

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
