"""Threshold: a value of an output to which the study asks for a probability."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import Context, read_each, read_list, setting, share, validate

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

    # With at_least: the largest and the smallest accepted probability; None for no limit.
    at_most: float | None = share(expected=_PROBABILITY, default=None)
    at_least: float | None = share(expected=_PROBABILITY, default=None)

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
