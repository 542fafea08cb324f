"""Threshold: a value of an output to which the study asks for a probability."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import Context, read_list, setting

__all__ = ["Threshold", "threshold_list"]


@dataclass(frozen=True)
class Threshold:
    """Threshold: a value whose probability of exceedance, or of lying below it, is requested.

    Parameters
    ----------
    text : str
        Its text in the study, which names the estimate.
    value : float
        In the output's SI unit.
    """

    text: str
    value: float


def threshold_list(*, key: str) -> Any:
    """Declare thresholds, which a study file gives as a list of quantities."""
    return setting(
        "thresholds",
        "thresholds",
        lambda values: all(isinstance(value, Threshold) for value in values),
        read=_read_thresholds,
        default=(),
        key=key,
    )


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
