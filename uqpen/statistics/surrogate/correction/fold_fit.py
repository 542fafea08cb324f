"""Fit of a surrogate with the runs that it has not seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN, STATUS
from uqpen.core.status import Status
from uqpen.surrogates.field_surrogate import FieldSurrogate
from uqpen.surrogates.fitted_surrogate import FittedSurrogate

__all__ = ["FoldFit"]


@dataclass(frozen=True, eq=False)
class FoldFit:
    """Fit, and the completed and the missing runs that it has not seen.

    Parameters
    ----------
    model : FittedSurrogate
        Of scalar outputs.
    completed, missing : Dataset
        Inadmissible runs are neither.
    """

    model: FittedSurrogate
    completed: xr.Dataset
    missing: xr.Dataset

    @classmethod
    def of(cls, model: FittedSurrogate, runs: xr.Dataset) -> FoldFit:
        """Divide runs into completed and missing ones."""
        status = runs[STATUS].values
        is_missing = (status != Status.OK) & (status != Status.INADMISSIBLE)
        return cls(
            model.scalars if isinstance(model, FieldSurrogate) else model,
            runs.isel({RUN: np.flatnonzero(status == Status.OK)}),
            runs.isel({RUN: np.flatnonzero(is_missing)}),
        )

    @property
    def size(self) -> int:
        """Number of completed runs."""
        return int(self.completed.sizes[RUN])

    def inputs(self, runs: xr.Dataset) -> dict[str, FloatArray]:
        """Return the random inputs of some runs."""
        size, names = runs.sizes[RUN], self.model.random_inputs
        return {name: np.broadcast_to(runs[name].values, size) for name in names}

    def predictions(self, runs: xr.Dataset) -> Mapping[str, FloatArray]:
        """Return predictions at some runs, by output."""
        if not self.model.outputs:
            return {}
        found = self.model.evaluate(self.inputs(runs)).outputs
        return {name: np.asarray(each, dtype=np.float64) for name, each in found.items()}
