"""Moments by an integration rule: sums over its nodes with their weights."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import CONDITIONAL, QUADRATURE_WEIGHT, STATUS
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

# Rounding error of a sum of weighted terms, relative to their size.
_ROUNDING = 1e-12


def quadrature_moments(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Moments of an output by the weights of its runs.

    Yields
    ------
    name : str
        ``mean``, ``std``, ``skewness``, ``kurtosis``.
    estimate : DataArray
        Along ``bound``, without bounds: a quadrature rule gives no estimate of its error.
    """
    if quantity.output.categories:
        return
    title, unit = quantity.output.title, quantity.output.unit
    weights, used = runs[QUADRATURE_WEIGHT].values, runs[STATUS].values == Status.OK
    note = ""
    if not used.all():
        share = float(np.abs(weights[~used]).sum() / np.abs(weights).sum())
        note = (texts.ABSENT_NODES if CONDITIONAL in runs.attrs else texts.MISSING_NODES).format(
            failed=np.count_nonzero(~used), nodes=len(used), share=100 * share
        )
    values = runs[quantity.output.name].values[used].astype(np.float64)
    found = _integrals(values, weights[used])
    for statistic, (value, reason) in zip(
        ("mean", "std", "skewness", "kurtosis"), found, strict=True
    ):
        long_name = "standard deviation" if statistic == "std" else statistic
        estimate = Estimate.without_bounds(value, reason, note)
        units = unit if statistic in ("mean", "std") else "1"
        yield statistic, estimate.to_array(units=units, long_name=f"{long_name} of {title}")


def _integrals(values: FloatArray, weights: FloatArray) -> Iterator[tuple[float, str]]:
    """Yield the moments, each with the reason why it has no interval, or is NaN."""
    total = float(weights.sum())
    if not values.size or not total > _ROUNDING:
        yield from [(math.nan, texts.NO_WEIGHT if values.size else texts.NO_RUN)] * 4
        return
    weights = weights / total
    # About a value of its own a constant comes out exactly; over the largest no sum overflows.
    first, largest = float(values[0]), float(np.abs(values).max()) or 1.0
    mean = first + float(((values / largest - first / largest) * weights).sum()) * largest
    yield mean, texts.NO_SCATTER_OF_RULE
    scale = float(np.abs(values - mean).max())
    if not scale > 0:
        yield 0.0, texts.CONSTANT_OUTPUT
        yield from [(math.nan, texts.CONSTANT_OUTPUT)] * 2
        return
    # Powers of the deviations over the largest of them neither overflow nor vanish.
    deviations = (values - mean) / scale
    second, third, fourth = (float((deviations**power * weights).sum()) for power in (2, 3, 4))
    if not second > _ROUNDING:
        yield from [(math.nan, texts.IMPOSSIBLE_MOMENT.format(moment="variance"))] * 3
        return
    skewness, kurtosis = float(third / second**1.5), fourth / second**2
    yield math.sqrt(second) * scale, texts.NO_SCATTER_OF_RULE
    yield skewness, texts.NO_SCATTER_OF_RULE
    # No distribution has less (Pearson 1916, Phil. Trans. R. Soc. A 216, 429-457).
    if kurtosis < (1 + skewness**2) * (1 - _ROUNDING):
        yield math.nan, texts.IMPOSSIBLE_MOMENT.format(moment="kurtosis")
    else:
        yield kurtosis, texts.NO_SCATTER_OF_RULE
