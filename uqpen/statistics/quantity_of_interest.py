"""Quantity of interest: statistics that a study requests beyond those always computed."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.model import Output
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import Context, probabilities, read_list, setting, validate
from uqpen.core.units import are_convertible

__all__ = ["DEFAULT_QUANTILES", "QuantityOfInterest", "Threshold"]

DEFAULT_QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Threshold:
    """Threshold: a value whose probability of exceedance is requested.

    Parameters
    ----------
    text : str
        Its text in the study, which names the estimate.
    value : float
        In the output's SI unit.
    """

    text: str
    value: float


def _read_thresholds(written: object, context: Context) -> tuple[Threshold, ...]:
    texts: set[str] = set()

    def read_one(value: str | float) -> Threshold:
        text = value.strip() if isinstance(value, str) else toml_text(value)
        if text in texts:
            raise QuantityError(f'"{text}" a second time', "each threshold once")
        threshold = Threshold(text, parse_quantity(value, context.like).value)
        texts.add(text)
        return threshold

    return tuple(read_list(written, read_one))


def _read_unit(written: object, context: Context) -> str:
    found, expected = toml_text(written), f'a unit such as "{context.like}"'
    try:
        if isinstance(written, str) and written.strip() and are_convertible(written, context.like):
            return written
    except QuantityError as error:
        found = error.found
    raise QuantityError(found, expected)


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
    quantiles : tuple of float
        Probabilities strictly between 0 and 1, ascending.
    tolerance_contents : tuple of float
        Contents of the upper tolerance limits: probabilities of lying at or below the limit.
    """

    output: Output
    display_unit: str = setting(
        "unit", "a unit", lambda unit: isinstance(unit, str), read=_read_unit, key="unit"
    )
    thresholds: tuple[Threshold, ...] = setting(
        "thresholds",
        "thresholds",
        lambda values: all(isinstance(value, Threshold) for value in values),
        read=_read_thresholds,
        default=(),
        key="exceeds",
    )
    quantiles: tuple[float, ...] = probabilities(always=DEFAULT_QUANTILES)
    tolerance_contents: tuple[float, ...] = probabilities(key="hold")

    def __post_init__(self) -> None:
        validate(self)
