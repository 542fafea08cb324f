"""Quantity of interest: statistics that a study requests beyond those always computed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

from uqpen.core.catalogue import CATALOGUE, REQUESTED
from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.labels import LOGARITHMIC
from uqpen.core.lookup import resolve
from uqpen.core.model import Output
from uqpen.core.settings import Context, choice, probabilities, setting, text, validate
from uqpen.core.statistic import Statistic
from uqpen.core.units import are_convertible
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.threshold import Threshold, threshold_list

__all__ = ["DEFAULT_QUANTILES", "QuantityOfInterest", "Threshold"]

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
