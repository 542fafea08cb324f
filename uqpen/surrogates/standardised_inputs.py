"""Standardised inputs: the coordinates in which a Gaussian process is stationary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.distributions.distribution import Distribution

__all__ = ["StandardisedInputs"]


@dataclass(frozen=True, eq=False)
class StandardisedInputs:
    """Map from the inputs to coordinates of mean 0 and variance 1 in the training runs.

    Parameters
    ----------
    is_logarithm : ndarray of int, shape (input,)
        1 where the coordinate is of the input's logarithm.
    location, scale : ndarray, shape (input,)
        Of the input, or of its logarithm.
    """

    is_logarithm: IntArray
    location: FloatArray
    scale: FloatArray

    @classmethod
    def of_runs(cls, distributions: Sequence[Distribution], points: FloatArray) -> Self:
        """Standardise the inputs of the training runs, or their logarithms where these are simpler.

        Parameters
        ----------
        distributions : sequence of Distribution
            One for each input.
        points : ndarray, shape (run, input)
            In SI units.
        """
        simpler = [each.logarithm() is not None for each in distributions]
        count = len(simpler)
        found = cls(np.array(simpler, dtype=np.int64), np.zeros(count), np.ones(count))
        raw = found.coordinates(points)
        # An input that is the same in all runs tells nothing, at whatever scale.
        spread = np.where(np.ptp(raw, axis=0) > 0, raw.std(axis=0), 1.0)
        return cls(found.is_logarithm, raw.mean(axis=0), spread)

    def coordinates(self, points: FloatArray) -> FloatArray:
        """Return the coordinates of points, shape (run, input); NaN without a logarithm."""
        raw = np.array(points, dtype=np.float64)
        columns = self.is_logarithm.astype(bool)
        with np.errstate(divide="ignore", invalid="ignore"):
            raw[:, columns] = np.log(raw[:, columns])
        return (raw - self.location) / self.scale
