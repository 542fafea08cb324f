"""The shape of the distances of runs from the mean of a field."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.statistics.sample_shape import SampleShape

__all__ = ["DistanceShape"]


class DistanceShape(SampleShape):
    """The shape of distances, which are deviations from a mean as they are."""

    @cached_property
    def mean(self) -> FloatArray:
        """Zero."""
        return np.zeros(self.sample.values.shape[:-1])
