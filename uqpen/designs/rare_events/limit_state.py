"""Limit state: the event whose probability is wanted, and how near a run comes to it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import OUTCOME_OUTPUT, STATUS
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import Context, read_list, setting
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS
from uqpen.designs.stopping.stopping_rule import RequestedOutput, output_value_problems
from uqpen.models.outcomes import undecided_outcome

if TYPE_CHECKING:
    import xarray as xr

_EVENT = (
    'an event such as "depth > 3 m", a list of limits that must all be met, or '
    '{ any = ["depth > 3 m", "speed < 1 m/s"] }'
)
_LIMIT = re.compile(r"\s*(\w+)\s*([<>])(?!=)\s*([^<>]+?)\s*\Z", re.ASCII)
_OUTCOME = re.compile(r"\s*(?:(not)\s+)?([^\W\d]\w*)\s*\Z", re.ASCII)
_OR, _AND = " or ", " and "


class EventOutcomes(NamedTuple):
    """Outcomes of an event in runs."""

    # (run,): whether a run counts: it is admissible, and if completed, it has all outputs of the
    # event, or an outcome that the event names decides.
    belongs: BoolArray
    occurs: BoolArray  # (run,): whether the event occurred
    missing: BoolArray  # (run,): whether that is unknown, as the run failed
    # (limit, run): by how much each output lies beyond its limit, infinitely far for an outcome;
    # NaN where the run did not complete or lacks the number.
    excess: FloatArray

    def of(self, part: Any) -> EventOutcomes:
        """Return the outcomes of some runs, given by an index."""
        return EventOutcomes(
            self.belongs[part], self.occurs[part], self.missing[part], self.excess[:, part]
        )


@dataclass(frozen=True)
class EventLimit:
    """Limit of an output, with its value as written."""

    output: str  # name of the output
    is_above: bool  # true if it is met above the value, False if below
    value: str  # A value of the output, with its unit

    def excess(self, runs: xr.Dataset) -> FloatArray:
        """Return by how much the output of each run lies beyond the limit, in SI units."""
        variable = runs[self.output]
        unit = str(variable.attrs.get("units", DIMENSIONLESS))
        beyond = variable.values - parse_quantity(self.value, unit).value
        return np.asarray(beyond if self.is_above else -beyond, dtype=np.float64)

    def __str__(self) -> str:
        return f"{self.output} {'<>'[self.is_above]} {self.value}"


@dataclass(frozen=True)
class NamedOutcome:
    """Outcome of a run that an event names: a run that ends so is infinitely far beyond a limit."""

    flag: str  # name of the outcome
    is_met_by_it: bool  # False after ``not``: such a run is as far on the other side
    output = OUTCOME_OUTPUT

    def excess(self, runs: xr.Dataset) -> FloatArray:
        """Return infinity for each run that meets it, and minus infinity for the others."""
        is_named = runs[self.output].values == _categories(runs)[self.flag]
        return np.where(is_named == self.is_met_by_it, np.inf, -np.inf)

    def __str__(self) -> str:
        return self.flag if self.is_met_by_it else f"not {self.flag}"


def _categories(runs: xr.Dataset) -> dict[str, int]:
    """Return the value that stands for each outcome in the runs of a model."""
    attributes = runs[OUTCOME_OUTPUT].attrs
    values = np.atleast_1d(attributes.get("flag_values", ())).tolist()
    return dict(zip(str(attributes.get("flag_meanings", "")).split(), values, strict=False))


@dataclass(frozen=True)
class LimitState:
    """Limit state: an event that occurs where all limits are met, or any of them.

    Examples
    --------
    >>> str(parse_limit_state("depth > 3 m or speed < 1 m/s"))
    'depth > 3 m or speed < 1 m/s'
    """

    limits: tuple[EventLimit | NamedOutcome, ...]  # at least one
    is_any: bool = False  # true if one of the limits suffices

    @property
    def outputs(self) -> set[str]:
        """Names of the outputs that it concerns."""
        return {limit.output for limit in self.limits}

    @property
    def named(self) -> tuple[NamedOutcome, ...]:
        """Outcomes of a run that it names."""
        return tuple(each for each in self.limits if isinstance(each, NamedOutcome))

    @property
    def of_numbers(self) -> tuple[EventLimit, ...]:
        """Limits of numbers; only these say how near a run comes to it."""
        return tuple(each for each in self.limits if isinstance(each, EventLimit))

    def is_of(self, runs: xr.Dataset) -> bool:
        """Check whether the runs of a model have its outputs and outcomes."""
        if not self.outputs <= set(map(str, runs.variables)):
            return False
        return not self.named or {each.flag for each in self.named} <= _categories(runs).keys()

    def outcomes(self, runs: xr.Dataset) -> EventOutcomes:
        """Return what became of the event in the runs of a model."""
        status = runs[STATUS].values
        is_ok = status == Status.OK
        excess = np.array([limit.excess(runs) for limit in self.limits])
        excess[:, ~is_ok] = np.nan
        missing = ~is_ok & (status != Status.INADMISSIBLE)
        met = excess > 0
        is_decided = np.isinf(excess) & (met == self.is_any)
        is_known = ~np.isnan(excess).any(axis=0) | is_decided.any(axis=0)
        belongs = missing | (is_ok & is_known)
        occurs = met.any(axis=0) if self.is_any else met.all(axis=0)
        return EventOutcomes(belongs, occurs & belongs, missing, excess)

    def scales(self, outcomes: EventOutcomes) -> FloatArray:
        """Return the distance of each limit from the median of its output in some runs.

        Limits of outputs with different units are compared in these distances.

        Returns
        -------
        ndarray, shape (limit,)
            Above 0; 1 where the median is at the limit, or no run has the number.
        """
        known = outcomes.excess[:, outcomes.belongs & ~outcomes.missing]
        finite = [row[np.isfinite(row)] for row in known]
        distances = np.array([np.abs(np.median(row)) if len(row) else 1.0 for row in finite])
        return np.where((distances > 0) & np.isfinite(distances), distances, 1.0)

    def performance(self, outcomes: EventOutcomes, scales: FloatArray) -> FloatArray:
        """Return how near runs come to the event: above 0 where it occurs.

        Returns
        -------
        ndarray, shape (run,)
            Infinite for a failed run, which may have been anything, and for an outcome that is the
            event; minus infinity for an outcome that is not, and for a run that does not count.
        """
        distances = outcomes.excess / scales[:, np.newaxis]
        # Beside an outcome that decides, a number that the run does not have is left out.
        nearest = (np.fmax if self.is_any else np.fmin).reduce(distances)
        known = np.where(outcomes.belongs, nearest, -np.inf)
        return np.where(outcomes.missing, np.inf, known)

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        """Yield the problems between the event and the outputs of a study."""
        flags = [
            category.flag
            for each in requested
            if each.output.name == OUTCOME_OUTPUT
            for category in each.output.categories
        ]
        for limit in self.limits:
            if isinstance(limit, EventLimit):
                yield from output_value_problems(limit.output, limit.value, requested)
            elif limit.flag not in flags:
                expected = f"{_EVENT}; or an outcome, {', '.join(flags[1:])}" if flags else _EVENT
                yield Problem((), toml_text(str(limit)), expected)
            elif self.of_numbers and (fault := undecided_outcome(str(limit), is_any=self.is_any)):
                yield Problem((), *fault)

    def __str__(self) -> str:
        return (_OR if self.is_any else _AND).join(map(str, self.limits))


def parse_limit_state(text: str) -> LimitState:
    """Read the text of an event: limits with ``and`` between them, or with ``or``.

    Raises
    ------
    QuantityError
        If the text is no event.
    """
    if _OR in text and _AND in text:
        raise QuantityError(toml_text(text), "limits joined by and, or by or, not by both")
    is_any = _OR in text
    parts = text.split(_OR if is_any else _AND)
    return LimitState(tuple(map(_parse_limit, parts)), is_any)


def limit_state() -> Any:
    """Declare the text of an event, which a study file may give as a list or a table of limits."""
    return setting("event", _EVENT, _is_event, _read)


def _is_event(value: object) -> bool:
    try:
        return isinstance(value, str) and parse_limit_state(value) is not None
    except QuantityError:
        return False


def _read(written: Any, _: Context) -> Any:
    """Return the event as one text; a mistake in it is met here, so that a message names it."""
    if isinstance(written, str):
        return str(parse_limit_state(written))
    if isinstance(written, list):
        return _joined(written, _AND)
    if isinstance(written, Mapping) and len(written) == 1 and set(written) <= {"all", "any"}:
        ((quantifier, limits),) = written.items()
        return _joined(limits, _OR if quantifier == "any" else _AND)
    return written


def _joined(written: Any, link: str) -> str:
    limits = read_list(written, _parse_limit)
    if not limits:
        raise QuantityError("an empty list", _EVENT)
    return link.join(map(str, limits))


def _parse_limit(written: Any) -> EventLimit | NamedOutcome:
    match = _LIMIT.match(written) if isinstance(written, str) else None
    if match is None and isinstance(written, str) and (outcome := _OUTCOME.match(written)):
        return NamedOutcome(outcome[2], is_met_by_it=not outcome[1])
    if match is None:
        raise QuantityError(toml_text(written), _EVENT)
    name, sign, value = match.groups()
    return EventLimit(name, sign == ">", value)
