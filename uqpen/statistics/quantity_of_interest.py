"""What a study asks of an output, beyond what is always told."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.model import Output

__all__ = ["DEFAULT_QUANTILES", "QuantityOfInterest", "Threshold"]

DEFAULT_QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Threshold:
    """A value whose exceedance is asked for.

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
    """What is asked of one output.

    Parameters
    ----------
    output : Output
        Of which model output.
    display_unit : str
        The unit to show it in.
    quantiles : tuple of float
        Probabilities strictly between 0 and 1, ascending.
    thresholds : tuple of Threshold
        Values whose probability of being exceeded is asked.
    tolerance_contents : tuple of float
        Probabilities with which a value is not to be exceeded.
    """

    output: Output
    display_unit: str
    quantiles: tuple[float, ...] = DEFAULT_QUANTILES
    thresholds: tuple[Threshold, ...] = ()
    tolerance_contents: tuple[float, ...] = ()
