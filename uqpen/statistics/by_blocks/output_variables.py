"""Functions of an output whose variance is explained: itself, its logarithm, its events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["OutputVariables"]


@dataclass(frozen=True)
class OutputVariables:
    """Functions of an output, as rows about fixed centres.

    Parameters
    ----------
    quantity : QuantityOfInterest
    centre, log_centre : float
        Taken from the output and from its logarithm, so that squares keep their digits.
    scale : float
        The output is divided by it.
    has_logarithm : bool
        Whether the logarithm is one of them.
    """

    quantity: QuantityOfInterest
    centre: float
    scale: float
    log_centre: float
    has_logarithm: bool

    @classmethod
    def from_values(cls, quantity: QuantityOfInterest, values: FloatArray) -> OutputVariables:
        """Return the functions of an output, from some of its values."""
        if quantity.output.categories or not values.size:
            return cls(quantity, 0.0, 1.0, 0.0, False)
        scale = float(values.std())
        scale = scale if np.isfinite(scale) and scale > 0 else 1.0
        is_positive = bool(values.min() > 0)
        log_centre = float(np.log(values).mean()) if is_positive else 0.0
        return cls(quantity, float(values.mean()), scale, log_centre, is_positive)

    @property
    def output(self) -> str:
        """Name of the output."""
        return self.quantity.output.name

    @property
    def log_name(self) -> str:
        """Key of the logarithm's sums; no name of an output."""
        return f"log {self.output}"

    @property
    def count(self) -> int:
        """Number of the functions."""
        if kinds := self.quantity.output.categories:
            return len(kinds)
        return 1 + self.has_logarithm + len(self.quantity.thresholds)

    def logarithm(self, values: FloatArray) -> FloatArray:
        """Logarithm of values of the output, about its centre; 0 where there is none."""
        known = np.where(values > 0, values, 1.0)
        found: FloatArray = np.where(values > 0, np.log(known) - self.log_centre, 0.0)
        return found

    def rows(self, values: FloatArray) -> FloatArray:
        """Return all functions of values, shape (function, run)."""
        found = np.empty((self.count, len(values)))
        if kinds := self.quantity.output.categories:
            for kind in range(len(kinds)):
                found[kind] = values == kind
            return found
        found[0] = (values - self.centre) / self.scale
        if self.has_logarithm:
            found[1] = self.logarithm(values)
        thresholds = self.quantity.thresholds
        for row, each in enumerate(thresholds, self.count - len(thresholds)):
            found[row] = values > each.value
        return found
