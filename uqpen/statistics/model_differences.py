"""Differences between models at common points, where the random draw affects all alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.core.labels import MOMENTS, QUANTILES, SAMPLING, STATUS
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.execution import common_runs, worst_status_runs
from uqpen.statistics.analyze import OutputStatistics, analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["model_differences"]

_GROUPS = (MOMENTS, QUANTILES)


def model_differences(
    first: xr.Dataset, other: xr.Dataset, quantities: Sequence[QuantityOfInterest]
) -> dict[str, OutputStatistics]:
    """Statistics of the differences between another model's outputs and those of the first.

    Two models at the same points differ far less than their runs scatter, so the difference has a
    smaller error than either.

    Parameters
    ----------
    first, other : Dataset
        Runs of the two models in one design. Those of the rounds that both have run are compared.
    quantities : sequence of QuantityOfInterest
        One for each output of the other model.

    Returns
    -------
    dict of str to dict of str to DataArray
        By output, moments and quantiles of other minus first over the runs that both models
        completed. Empty where the design is no sample of the inputs.
    """
    if not Sampling(first.attrs[SAMPLING]).is_sample:
        return {}
    requested = [
        replace(quantity, thresholds=(), lower_thresholds=(), tolerance_contents=())
        for quantity in quantities
        if quantity.output.name in first and not quantity.output.categories
    ]
    first, other = common_runs([first, other])
    runs = worst_status_runs([first, other])
    came_back = runs[STATUS].values == Status.OK
    for quantity in requested:
        name = quantity.output.name
        difference = other[name].values - first[name].values
        difference[~came_back] = np.nan
        runs[name] = other[name].copy(data=difference)
    return analyze(runs, requested, only=_GROUPS)
