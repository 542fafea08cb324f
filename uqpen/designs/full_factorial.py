"""Every combination of a few levels of each input."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.designs.design import Design, Rounds
from uqpen.designs.grids import crossed, overgrown
from uqpen.designs.quadrature import WEIGHT_ATTRIBUTES
from uqpen.errors import Problem
from uqpen.inputs.law import InputLaw
from uqpen.labels import QUADRATURE_WEIGHT, Sampling
from uqpen.settings import count
from uqpen.streams import Stream

__all__ = ["FullFactorial"]


@dataclass(frozen=True)
class FullFactorial(Design):
    """The medians of equally likely strata of each input, all with all.

    Every point has the same weight: as an integration rule, it is the midpoint rule over the unit
    cube of probabilities.

    Parameters
    ----------
    levels : int
        How many values of each random input.
    """

    levels: int = count(minimum=2)

    @property
    def sampling(self) -> Sampling:
        return Sampling.RULE

    def misfit(self, law: InputLaw) -> Iterator[Problem]:
        inputs = len(law.random)
        return overgrown("levels", self.levels, self.levels**inputs, inputs)

    def rounds(self, law: InputLaw, stream: Stream) -> Rounds:
        medians = (np.arange(self.levels) + 0.5) / self.levels
        unit = np.stack(crossed([medians] * len(law.random)), axis=1).astype(np.float64)
        weights = np.full(len(unit), 1 / len(unit))
        points = law.points(unit, {QUADRATURE_WEIGHT: weights})
        points[QUADRATURE_WEIGHT].attrs = WEIGHT_ATTRIBUTES
        yield points

    def size(self, law: InputLaw) -> int:
        return int(self.levels ** len(law.random))
