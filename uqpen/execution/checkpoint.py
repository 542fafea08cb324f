"""Who keeps what is done, should the program end before all is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from uqpen.execution.batch import BatchResult

__all__ = ["Checkpoint"]


class Checkpoint:
    """Who keeps the runs of a model over points; this one keeps none."""

    def restore(self, inputs: Mapping[str, npt.NDArray[np.float64]]) -> Iterator[BatchResult]:
        """The runs at these points that were kept before.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            All points, in SI units.
        """
        yield from ()

    def save(
        self, inputs: Mapping[str, npt.NDArray[np.float64]], batch_result: BatchResult
    ) -> None:
        """Keep a piece of the runs at these points."""
