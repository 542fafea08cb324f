"""Ranked curves: how deep each run's curve lies among the others, and which ones are outlying."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import CURVE
from uqpen.core.variables import field_coordinates
from uqpen.statistics import texts
from uqpen.statistics.estimate import NamedArrays
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

# A curve is outlying beyond so many times the height of the central region (Sun & Genton 2011).
_FENCE = 1.5
# Differences below this share of the values are rounding.
_ROUNDING = 1e-12


def ranked_curves(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Rank the curves of the runs by their depth, as for a functional boxplot.

    Yields
    ------
    name : str
        ``central_region``, ``envelope``, ``band_depth``, ``outlying``.
    array : DataArray
        ``central_region`` is along the dimensions of the field and ``bound``: the deepest curve as
        the estimate, and the range of the deeper half of the curves as the bounds. ``envelope`` has
        the range of all curves that are not outlying. Where fewer than half of the deeper half are
        left, there is no region, and no curve is outlying. The other two are along ``curve``, the
        numbers of the runs; ``outlying`` is 1 or 0. Weighted runs have none of them.

    References
    ----------
    López-Pintado, S. & Romo, J. (2009). J. Am. Stat. Assoc. 104, 718-734.
    Sun, Y. & Genton, M. G. (2011). J. Comput. Graph. Stat. 20, 316-334.
    """
    if field.runs.weights is not None or field.runs.size < 2:
        return
    depth = band_depth(field)
    order = np.argsort(-depth, kind="stable")
    deepest = np.sort(order[: math.ceil(len(order) / 2)])
    low, high = _range(field.matrix[deepest])
    is_left = 2 * field.exists[deepest].sum(axis=0) >= len(deepest)
    low, high = (np.where(is_left, ends, np.nan) for ends in (low, high))
    outlying = _outlying(field, low, high)
    median = int(order[0])
    for name, what, ends in (
        ("central_region", "the deeper half of the curves", (low, high)),
        ("envelope", "the curves that are not outlying", _range(field.matrix[~outlying])),
    ):
        array = estimate_array(
            np.stack([field.matrix[median], *ends], axis=-1),
            field.output.sizes,
            dict(zip(INTERVAL_TEXTS, ("none", "none", texts.REGION_OF_RUNS), strict=True)),
            units=quantity.output.unit,
            long_name=f"median curve of {quantity.output.title} and range of {what}",
            coordinates=field_coordinates(field.dims),
        )
        yield name, array.assign_attrs(median_run=int(field.runs.used[median]))
    title = quantity.output.title
    yield "band_depth", _by_curve(field, depth, f"modified band depth of the curves of {title}")
    yield (
        "outlying",
        _by_curve(field, outlying.astype(np.int8), f"1 for outlying curves of {title}"),
    )


def band_depth(field: FieldSample) -> FloatArray:
    """Return the modified band depth of each curve: how often it lies between two of the curves.

    It is the share of the pairs of curves that enclose a place of the curve, in the mean over its
    places. A curve that ends is compared with those that reach its places, and each place has the
    share of the curves that reach it as its weight (Elías, A., Jiménez, R., Paganoni, A. M. &
    Sangalli, L. M. (2023). J. Comput. Graph. Stat. 32, 341-352). The curve itself is in some of the
    pairs.
    """
    total, weight = np.zeros(field.runs.size), np.zeros(field.runs.size)
    for places, runs in field.samples():
        exists = np.flatnonzero(field.exists[:, places[0]])
        if len(exists) < 2:
            continue
        share = len(exists) / field.runs.size
        total[exists] += share * _enclosing_share(runs.values).sum(axis=0)
        weight[exists] += share * len(places)
    with np.errstate(invalid="ignore"):
        return np.where(weight > 0, total / weight, 0.0)


def _enclosing_share(values: FloatArray) -> FloatArray:
    """Return for each value the share of the pairs of values that enclose it, ends included.

    Values are of shape (place, run), and compared with those of the same place.
    """
    runs = values.shape[-1]
    order = np.argsort(values, axis=-1)
    ascending = np.take_along_axis(values, order, axis=-1)
    below, up_to = _ranks_of_equals(ascending)
    # All pairs, but for those above the value and those below it.
    outside = _pairs(below) + _pairs(runs - up_to)
    share = np.empty(values.shape)
    np.put_along_axis(share, order, 1 - outside / _pairs(runs), axis=-1)
    return share


def _ranks_of_equals(ascending: FloatArray) -> tuple[IntArray, IntArray]:
    """Return how many of the values in a row lie below each, and how many do not lie above it."""
    runs = ascending.shape[-1]
    differs = ascending[:, 1:] != ascending[:, :-1]
    edge = np.ones((len(ascending), 1), dtype=np.bool_)
    first, last = np.hstack([edge, differs]), np.hstack([differs, edge])
    below = np.maximum.accumulate(np.where(first, np.arange(runs), 0), axis=-1)
    up_to = np.where(last, np.arange(1, runs + 1), runs)
    return below, np.minimum.accumulate(up_to[:, ::-1], axis=-1)[:, ::-1]


def _pairs(count: Any) -> Any:
    return count * (count - 1) / 2


def _range(curves: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest value of some curves at each place; NaN for none."""
    if not len(curves):
        nothing = np.full(curves.shape[1], np.nan)
        return nothing, nothing
    return np.fmin.reduce(curves, axis=0), np.fmax.reduce(curves, axis=0)


def _outlying(field: FieldSample, low: FloatArray, high: FloatArray) -> BoolArray:
    """Mask of the curves that leave the central region by far, at any place where there is one."""
    reach = _FENCE * (high - low) + _ROUNDING * np.maximum(np.abs(low), np.abs(high))
    below, above = low - reach, high + reach
    # Run after run, so that memory is bounded. A place without a region has no comparison.
    return np.array([((run < below) | (run > above)).any() for run in field.matrix])


def _by_curve(field: FieldSample, values: Any, long_name: str) -> xr.DataArray:
    """Return a value of each run, with the numbers of the runs."""
    described = {"long_name": "number of the run", "units": "1"}
    return xr.DataArray(
        values,
        {CURVE: (CURVE, field.runs.used, described)},
        (CURVE,),
        attrs={"units": "1", "long_name": long_name},
    )
