"""Quantity of interest: statistics that a study requests beyond those always computed."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.model import Output

__all__ = ["DEFAULT_QUANTILES", "QuantityOfInterest", "Threshold"]

DEFAULT_QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Threshold:
    """Threshold: a value whose probability of exceedance is requested.

    Parameters
    ----------
    text : str
        As its author wrote it; what the answer is called by.
    value : float
        In the output's SI unit.
    """

    text: str
    value: float


@dataclass(frozen=True)
class QuantityOfInterest:
    """Quantity of interest: an output and the statistics requested of it.

    Parameters
    ----------
    output : Output
        The model output.
    display_unit : str
        The unit to show it in.
    quantiles : tuple of float
        Probabilities strictly between 0 and 1, ascending.
    thresholds : tuple of Threshold
        Values whose probability of exceedance is requested.
    tolerance_contents : tuple of float
        Contents of the upper tolerance limits: probabilities of lying at or below the limit.
    """

    output: Output
    display_unit: str
    quantiles: tuple[float, ...] = DEFAULT_QUANTILES
    thresholds: tuple[Threshold, ...] = ()
    tolerance_contents: tuple[float, ...] = ()
