"""Event of several outputs: all of its limits are met, or any of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.statistics.quantity_of_interest import AcceptanceLimits


@dataclass(frozen=True)
class OutputLimit:
    """Limit of an output: a comparison that is true or false in each run."""

    text: str  # as the study has it, such as ``"depth < 60 cm"``
    output: str  # name of the output
    is_above: bool  # true if the output exceeds the value, False if it lies below
    value: float  # in the output's SI unit; of a category, its position
    # Whether it names a category, which `is_above` says to be that of the run, or not to be.
    is_category: bool = False

    def is_met(self, values: FloatArray) -> BoolArray:
        """Return which values of the output meet it."""
        if self.is_category:
            return np.asarray((values == self.value) == self.is_above)
        return np.asarray(values > self.value if self.is_above else values < self.value)


@dataclass(frozen=True)
class JointEvent:
    """Event that concerns several outputs."""

    name: str  # its name in the study
    limits: tuple[OutputLimit, ...]  # at least one
    is_any: bool = False  # true if one of the limits suffices, False if all must hold
    accepted: AcceptanceLimits = AcceptanceLimits()  # the probabilities that the study accepts
    given: JointEvent | None = None  # the event on whose occurrence the probability is conditional
    # Whether the sensitivities of the probability to the inputs are requested.
    sensitivities: bool = False

    @property
    def outputs(self) -> set[str]:
        """Names of the outputs that it concerns, with those of its condition."""
        own = {limit.output for limit in self.limits}
        return own | self.given.outputs if self.given else own

    @property
    def category_output(self) -> str:
        """The output with a category that it names; empty if it names none."""
        own = next((limit.output for limit in self.limits if limit.is_category), "")
        return own or (self.given.category_output if self.given else "")

    def is_known(self, columns: Mapping[str, FloatArray]) -> BoolArray:
        """Return in which completed runs it is known whether it occurs.

        It is known in all that have its outputs. Without a number, a category that it names may
        decide: a run with the category occurs where any limit suffices, and one without it does not
        where all must hold.
        """
        exists = [~np.isnan(columns[limit.output]) for limit in self.limits]
        known = reduce(np.logical_and, exists)
        for limit in self.limits:
            if limit.is_category:
                known = known | (limit.is_met(columns[limit.output]) == self.is_any)
        return known & self.given.is_known(columns) if self.given else known

    def counts(self, columns: Mapping[str, FloatArray]) -> BoolArray | None:
        """Return which runs count, those that meet the condition; None for all of them."""
        return self.given.occurs(columns) if self.given else None

    def occurs(self, columns: Mapping[str, FloatArray]) -> BoolArray:
        """Return in which runs it occurs, from the values of its outputs."""
        met = [limit.is_met(columns[limit.output]) for limit in self.limits]
        return reduce(np.logical_or if self.is_any else np.logical_and, met)

    @property
    def condition(self) -> str:
        """The event in words."""
        own = (" or " if self.is_any else " and ").join(limit.text for limit in self.limits)
        return f"{own}, given {self.given.condition}" if self.given else own
