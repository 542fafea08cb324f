"""Samples and runs of given values, for the tests of statistics."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.labels import REPLICATE, ROLE, RUN, SAMPLING, STATUS, WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.sample import Sample

__all__ = ["runs_of_values", "sample_of_values"]


def sample_of_values(
    values: Any,
    points: Any = None,
    inputs: tuple[str, ...] = ("x1", "x2", "x3"),
    *,
    replicates: Any = 0,
    sampling: Sampling | None = None,
    weights: Any = None,
) -> Sample:
    """Return a sample without failed runs: independent draws, or replicates.

    There are a number of equal replicates, one after the other, or they are those of each run.
    """
    runs = np.arange(len(values))
    if np.ndim(replicates) == 0:
        replicates = runs * replicates // max(len(runs), 1)
    if points is None:
        columns = InputColumns.none(len(values))
    else:
        columns = InputColumns.from_matrix(inputs, points)
    if sampling is None:
        sampling = Sampling.STRATIFIED if np.any(replicates) else Sampling.INDEPENDENT
    return Sample(values, runs, runs[:0], columns, replicates, sampling, weights=weights)


def runs_of_values(
    values: Any, sampling: str = "independent", *, replicates: int = 0, weights: Any = None
) -> xr.Dataset:
    """Return runs with these values of y, NaN for a failed one, over an input x."""
    runs = np.arange(len(values))
    coordinates = {RUN: runs}
    if replicates:
        coordinates[REPLICATE] = (RUN, runs % replicates)
    if weights is not None:
        coordinates[WEIGHT] = (RUN, weights)
    status = np.where(np.isnan(values), Status.FAILED, Status.OK).astype(np.int8)
    variables = {
        "x": (RUN, runs / len(runs), {ROLE: "input"}),
        "y": (RUN, values, {ROLE: "output"}),
        STATUS: (RUN, status),
    }
    return xr.Dataset(variables, coordinates, {SAMPLING: sampling})
