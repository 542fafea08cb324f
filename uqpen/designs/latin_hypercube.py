"""Latin hypercube sampling, replicated so that its error can be told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.designs.design import Design, Rounds
from uqpen.errors import Problem
from uqpen.inputs.law import InputLaw
from uqpen.labels import REPLICATE, Sampling
from uqpen.settings import count, validate
from uqpen.streams import Stream

__all__ = ["LatinHypercube"]


@dataclass(frozen=True)
class LatinHypercube(Design):
    """Latin hypercubes: in each, every input has one point in each of its equally likely strata.

    The points of one hypercube depend on each other, so nothing but independent replicates shows
    the error of what is estimated from them.

    Parameters
    ----------
    runs : int
        How many points in all, a multiple of `replicates`.
    replicates : int
        How many hypercubes; with one, error bars are wider than they need to be and say so.

    References
    ----------
    McKay, M. D., Beckman, R. J. & Conover, W. J. (1979). Technometrics 21, 239-245.
    """

    runs: int = count(minimum=2)
    replicates: int = count(default=10)

    def __post_init__(self) -> None:
        validate(self, self._uneven())

    def _uneven(self) -> Iterator[Problem]:
        lowest = 2 * self.replicates
        if self.runs % self.replicates or self.runs < lowest:
            below = self.runs // self.replicates * self.replicates
            nearest = [str(runs) for runs in (below, below + self.replicates) if runs >= lowest]
            expected = (
                f"a multiple of replicates ({self.replicates}), such as "
                f"{' or '.join(nearest or [str(lowest)])}, or other replicates"
            )
            yield Problem(("runs",), str(self.runs), expected)

    @property
    def sampling(self) -> Sampling:
        return Sampling.STRATIFIED

    def rounds(self, law: InputLaw, stream: Stream) -> Rounds:
        # Imported where it is used: this part of SciPy takes longer to load than the rest.
        from scipy.stats import qmc

        each = self.runs // self.replicates
        cubes = [
            qmc.LatinHypercube(len(law.random), rng=stream.generator("points", replicate)).random(
                each
            )
            for replicate in range(self.replicates)
        ]
        yield law.points(
            np.concatenate(cubes), {REPLICATE: np.repeat(np.arange(self.replicates), each)}
        )

    def size(self, law: InputLaw) -> int:
        return self.runs
