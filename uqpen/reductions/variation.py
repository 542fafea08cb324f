"""Total variation of a curve: all its ups and downs, added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.derived import Reduction
from uqpen.core.model import Output
from uqpen.reductions.places import along

__all__ = ["TotalVariation"]


@dataclass(frozen=True)
class TotalVariation(Reduction):
    """Sum of the absolute changes between neighbouring coordinates, up to the end of a curve."""

    takes_curves_only = True
    is_difference = True

    def title(self, field: Output) -> str:
        return f"total variation of {field.title} along {along(field)}"

    def reduce(self, values: FloatArray, field: Output) -> FloatArray:
        # In memory run by run, so that the order of a sum depends on nothing but the run.
        changes = np.abs(np.diff(np.ascontiguousarray(values), axis=1))
        found: FloatArray = np.nansum(changes, axis=1)
        return found
