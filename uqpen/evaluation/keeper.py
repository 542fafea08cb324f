"""Who keeps what is done, should the program end before all is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from uqpen.executors.work import Piece

__all__ = ["Keeper"]


class Keeper:
    """Who keeps the runs of a model over points; this one keeps none."""

    def found(self, inputs: Mapping[str, npt.NDArray[np.float64]]) -> Iterator[Piece]:
        """The runs at these points that were kept before.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            All points, in SI units.
        """
        yield from ()

    def keep(self, inputs: Mapping[str, npt.NDArray[np.float64]], piece: Piece) -> None:
        """Keep a piece of the runs at these points."""
