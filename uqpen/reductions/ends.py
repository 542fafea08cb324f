"""First and last value of a curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.derived import Reduction
from uqpen.core.model import Output
from uqpen.reductions.places import along

__all__ = ["First", "Last"]


@dataclass(frozen=True)
class First(Reduction):
    """Value at the first coordinate."""

    takes_curves_only = True

    def title(self, field: Output) -> str:
        return f"first {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        return values[:, 0]


@dataclass(frozen=True)
class Last(Reduction):
    """Value at the last coordinate; of a curve that ends, its last value."""

    takes_curves_only = True

    def title(self, field: Output) -> str:
        return f"last {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        last = np.isfinite(values).sum(axis=1) - 1
        return np.take_along_axis(values, last[:, None], axis=1)[:, 0]
