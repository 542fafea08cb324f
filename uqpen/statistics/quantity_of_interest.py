"""Quantity of interest: statistics that a study requests beyond those always computed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar

from uqpen.core.catalogue import CATALOGUE, REQUESTED
from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.labels import LOGARITHMIC
from uqpen.core.lookup import resolve
from uqpen.core.model import Output
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import (
    Context,
    choice,
    probabilities,
    read_each,
    read_list,
    setting,
    share,
    text,
    validate,
)
from uqpen.core.statistic import Statistic
from uqpen.core.units import are_convertible
from uqpen.statistics.estimate import LEVEL

# Threshold: a value of an output to which the study asks for a probability.


_PROBABILITY = 'a probability from 0 to 1, such as 0.05 or "5 %"'
_LIMITS = "a table such as { at_most = 0.05 }"


@dataclass(frozen=True)
class AcceptanceLimits:
    """Acceptance limits: the probabilities that a study accepts.

    Raises
    ------
    SettingsError
        If a limit is no probability, or no probability lies within both.
    """

    # Largest accepted probability; None for no limit.
    at_most: float | None = share(expected=_PROBABILITY, default=None)
    at_least: float | None = share(expected=_PROBABILITY, default=None)  # smallest accepted one

    def __post_init__(self) -> None:
        validate(self)
        if self.at_most is not None and self.at_least is not None and self.at_most < self.at_least:
            found = f"{toml_text(self.at_most)}, less than at_least"
            raise SettingsError([Problem(("at_most",), found, "at least that of at_least")])


class Acceptable(Protocol):
    """Request for a probability, which may have acceptance limits."""

    @property
    def accepted(self) -> AcceptanceLimits:
        """The probabilities that the study accepts."""


@dataclass(frozen=True)
class Threshold:
    """Threshold: a value whose probability of exceedance, or of lying below it, is requested."""

    text: str  # its text in the study, which names the estimate
    value: float  # in the output's SI unit
    # The probabilities that the study accepts; all, unless it states limits.
    accepted: AcceptanceLimits = AcceptanceLimits()


def threshold_list(*, key: str) -> Any:
    """Declare thresholds, which a study file gives as a list of quantities.

    A table in place of the list has the thresholds as its keys, each with its acceptance limits.
    """
    return setting(
        "thresholds",
        "thresholds",
        lambda values: all(isinstance(value, Threshold) for value in values),
        read=_read_thresholds,
        default=(),
        key=key,
    )


def _read_thresholds(written: object, context: Context) -> tuple[Threshold, ...]:
    known: set[str] = set()

    def read_one(value: str | float, limits: object = None) -> Threshold:
        text = value.strip() if isinstance(value, str) else toml_text(value)
        if text in known:
            raise QuantityError(f'"{text}" a second time', "each threshold once")
        number = parse_quantity(value, context.like, allow_offset=context.allow_offset).value
        known.add(text)
        return Threshold(text, number, _read_limits({} if limits is None else limits))

    if isinstance(written, dict):
        entries = {text: (text, limits) for text, limits in written.items()}
        return tuple(read_each(entries, lambda entry: read_one(*entry)))
    return tuple(read_list(written, read_one))


def _read_limits(written: object) -> AcceptanceLimits:
    if not isinstance(written, dict):
        raise QuantityError(toml_text(written), _LIMITS)
    if unknown := [key for key in written if key not in ("at_most", "at_least")]:
        raise SettingsError([Problem((unknown[0],), "an unknown key", "at_most or at_least")])
    return AcceptanceLimits(**written)


DEFAULT_QUANTILES = CATALOGUE["quantile"].asked.always


def _read_unit(written: object, context: Context) -> str:
    found, expected = toml_text(written), f'a unit such as "{context.like}"'
    try:
        if isinstance(written, str) and written.strip() and are_convertible(written, context.like):
            return written
    except QuantityError as error:
        found = error.found
    raise QuantityError(found, expected)


_Class = TypeVar("_Class", bound=type)


def _declare_requests(declared: _Class) -> _Class:
    """Add a field for each statistic of the catalogue that names the declaration of its request."""
    for statistic in REQUESTED:
        asked = statistic.asked
        if asked.declared_by:
            declared.__annotations__[asked.attribute] = "tuple[float, ...]"
            setattr(declared, asked.attribute, resolve(asked.declared_by)(key=asked.key))
    return declared


@dataclass(frozen=True)
@_declare_requests
class QuantityOfInterest:
    """Quantity of interest: an output and the statistics requested of it.

    Statistics of the catalogue that declare their request have a field each, empty by default.
    """

    output: Output  # the model output
    display_unit: str = setting(
        "unit", "a unit", lambda unit: isinstance(unit, str), read=_read_unit, key="unit"
    )  # the unit to show it in
    # Values whose probability of exceedance is requested.
    thresholds: tuple[Threshold, ...] = threshold_list(key="exceeds")
    # Values; the probability that the output lies below each is requested.
    lower_thresholds: tuple[Threshold, ...] = threshold_list(key="below")
    # Probabilities strictly between 0 and 1, ascending.
    quantiles: tuple[float, ...] = probabilities(always=DEFAULT_QUANTILES)
    # Contents of the upper tolerance limits: probabilities of lying at or below the limit.
    tolerance_contents: tuple[float, ...] = probabilities(key="hold")
    # Contents of the lower tolerance limits: probabilities of lying at or above the limit.
    lower_tolerance_contents: tuple[float, ...] = probabilities(key="hold_above")
    # Contents of the tolerance intervals: probabilities of lying between their ends.
    tolerance_interval_contents: tuple[float, ...] = probabilities(key="hold_between")
    # Sentence on what a reader has to mind of all numbers of this output.
    caveat: str | None = text(expected="a sentence in quotes", default=None)
    # ``"log"`` for charts by the logarithm of the output, or ``"linear"``.
    axis_scale: str = choice("linear", LOGARITHMIC, default="linear", key="scale")
    confidence_level: float = LEVEL  # confidence level of the intervals of its statistics

    def __post_init__(self) -> None:
        validate(self)

    def requested(self, statistic: Statistic) -> tuple[Any, ...]:
        """Return the entries of a statistic that the study asks for."""
        return getattr(self, statistic.asked.attribute) if statistic.asked.key else ()

    def without(self, *statistics: Statistic) -> QuantityOfInterest:
        """Return the same without the requests for some statistics."""
        left_out: dict[str, Any] = {each.asked.attribute: () for each in statistics}
        return replace(self, **left_out)

    @property
    def is_logarithmic(self) -> bool:
        """True if it is shown by its logarithm."""
        return self.axis_scale == LOGARITHMIC
