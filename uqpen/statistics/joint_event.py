"""Event of several outputs: all of its limits are met, or any of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.threshold import AcceptanceLimits

__all__ = ["JointEvent", "OutputLimit"]


@dataclass(frozen=True)
class OutputLimit:
    """Limit of an output: a comparison that is true or false in each run.

    Parameters
    ----------
    text : str
        As the study has it, such as ``"depth < 60 cm"``.
    output : str
        Name of the output.
    is_above : bool
        True if the output exceeds the value, False if it lies below.
    value : float
        In the output's SI unit.
    """

    text: str
    output: str
    is_above: bool
    value: float

    def is_met(self, values: FloatArray) -> BoolArray:
        """Return which values of the output meet it."""
        return np.asarray(values > self.value if self.is_above else values < self.value)


@dataclass(frozen=True)
class JointEvent:
    """Event that concerns several outputs.

    Parameters
    ----------
    name : str
        Its name in the study.
    limits : tuple of OutputLimit
        At least one.
    is_any : bool
        True if one of the limits suffices, False if all must hold.
    accepted : AcceptanceLimits
        The probabilities that the study accepts.
    """

    name: str
    limits: tuple[OutputLimit, ...]
    is_any: bool = False
    accepted: AcceptanceLimits = AcceptanceLimits()

    @property
    def outputs(self) -> set[str]:
        """Names of the outputs that it concerns."""
        return {limit.output for limit in self.limits}

    def occurs(self, columns: Mapping[str, FloatArray]) -> BoolArray:
        """Return in which runs it occurs, from the values of its outputs."""
        met = [limit.is_met(columns[limit.output]) for limit in self.limits]
        return reduce(np.logical_or if self.is_any else np.logical_and, met)

    @property
    def condition(self) -> str:
        """The event in words."""
        return (" or " if self.is_any else " and ").join(limit.text for limit in self.limits)
