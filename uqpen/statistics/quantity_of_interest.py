"""Quantity of interest: statistics that a study requests beyond those always computed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.labels import LOGARITHMIC
from uqpen.core.list_reading import read_list
from uqpen.core.model import Output
from uqpen.core.setting_fields import Context
from uqpen.core.settings import choice, probabilities, setting, text, validate
from uqpen.core.units import are_convertible
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.threshold import Threshold, threshold_list

__all__ = ["DEFAULT_QUANTILES", "QuantityOfInterest", "Threshold"]

DEFAULT_QUANTILES = (0.05, 0.5, 0.95)
_PERIODS = "numbers of cases above 1"


def _read_unit(written: object, context: Context) -> str:
    found, expected = toml_text(written), f'a unit such as "{context.like}"'
    try:
        if isinstance(written, str) and written.strip() and are_convertible(written, context.like):
            return written
    except QuantityError as error:
        found = error.found
    raise QuantityError(found, expected)


def _is_period(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return 1 < value < math.inf


def _read_periods(written: object, _: Context) -> tuple[float, ...]:
    def read_one(value: Any) -> float:
        if not _is_period(value):
            raise QuantityError(toml_text(value), "a number of cases above 1, such as 10_000")
        return float(value)

    return tuple(sorted(set(read_list(written, read_one))))


@dataclass(frozen=True)
class QuantityOfInterest:
    """Quantity of interest: an output and the statistics requested of it.

    Parameters
    ----------
    output : Output
        The model output.
    display_unit : str
        The unit to show it in.
    thresholds : tuple of Threshold
        Values whose probability of exceedance is requested.
    lower_thresholds : tuple of Threshold
        Values; the probability that the output lies below each is requested.
    quantiles : tuple of float
        Probabilities strictly between 0 and 1, ascending.
    tolerance_contents : tuple of float
        Contents of the upper tolerance limits: probabilities of lying at or below the limit.
    lower_tolerance_contents : tuple of float
        Contents of the lower tolerance limits: probabilities of lying at or above the limit.
    tolerance_interval_contents : tuple of float
        Contents of the tolerance intervals: probabilities of lying between their ends.
    shortfall_levels : tuple of float
        Probabilities below the quantiles beyond which the mean is requested.
    return_periods : tuple of float
        Numbers of cases, above 1; the value exceeded once in each on average is requested.
    caveat : str, optional
        Sentence on what a reader has to mind of all numbers of this output.
    axis_scale : str
        ``"log"`` for charts by the logarithm of the output, or ``"linear"``.
    confidence_level : float
        Confidence level of the intervals of its statistics.
    """

    output: Output
    display_unit: str = setting(
        "unit", "a unit", lambda unit: isinstance(unit, str), read=_read_unit, key="unit"
    )
    thresholds: tuple[Threshold, ...] = threshold_list(key="exceeds")
    lower_thresholds: tuple[Threshold, ...] = threshold_list(key="below")
    quantiles: tuple[float, ...] = probabilities(always=DEFAULT_QUANTILES)
    tolerance_contents: tuple[float, ...] = probabilities(key="hold")
    lower_tolerance_contents: tuple[float, ...] = probabilities(key="hold_above")
    tolerance_interval_contents: tuple[float, ...] = probabilities(key="hold_between")
    shortfall_levels: tuple[float, ...] = probabilities(key="expected_shortfall")
    return_periods: tuple[float, ...] = setting(
        "return periods",
        _PERIODS,
        lambda periods: all(_is_period(each) for each in periods),
        read=_read_periods,
        default=(),
        key="return_periods",
    )
    caveat: str | None = text(expected="a sentence in quotes", default=None)
    axis_scale: str = choice("linear", LOGARITHMIC, default="linear", key="scale")
    confidence_level: float = LEVEL

    def __post_init__(self) -> None:
        validate(self)

    @property
    def is_logarithmic(self) -> bool:
        """True if it is shown by its logarithm."""
        return self.axis_scale == LOGARITHMIC
