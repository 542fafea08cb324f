"""A field over runs as samples of its values at each place, and the statistics there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.labels import BOUND, CONDITIONAL, INTERVAL_LEVEL
from uqpen.core.model import Dimension, Output
from uqpen.core.variables import field_coordinates
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import (
    below_probabilities,
    event_probability,
    exceedance_probabilities,
)
from uqpen.statistics.distribution_function.quantiles import quantile_estimates
from uqpen.statistics.estimate import PLACE, NamedArrays
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

# A field over runs, as samples of its values at each place.

# Values of a field that are taken together, so that memory is bounded: 8 MB.
_MOST_VALUES = 2**20


class PlaceSamples(NamedTuple):
    """Samples of a field at places that exist in the same runs."""

    places: IntArray  # (place,): positions of the places in the field, flattened
    # The runs in which these places exist; its values are of shape (place, run), those of a place
    # next to each other.
    runs: Sample


@dataclass(frozen=True, eq=False)
class FieldSample:
    """A field over the completed runs of a design."""

    # The runs, with values of shape (run, *dims). They are NaN where a curve has ended.
    runs: Sample
    output: Output  # the field

    @property
    def dims(self) -> tuple[Dimension, ...]:
        """The dimensions of the field."""
        return self.output.dims

    @cached_property
    def weights(self) -> FloatArray:
        """Weight of each place in a mean over the field; their sum is 1."""
        return self.output.place_weights

    @property
    def matrix(self) -> FloatArray:
        """The values in shape (run, place)."""
        return self.runs.values.reshape(self.runs.size, math.prod(self.output.shape))

    @cached_property
    def exists(self) -> BoolArray:
        """Mask of the values that exist, shape (run, place)."""
        mask: BoolArray = ~np.isnan(self.matrix)
        return mask

    @cached_property
    def effective_runs(self) -> FloatArray:
        """Runs that decide the variance at each place, shape (place,); NaN without scatter."""
        found = np.full(self.matrix.shape[1], np.nan)
        for places, runs in self.samples():
            found[places] = runs.shape.effective_runs
        return found

    def samples(self) -> Iterator[PlaceSamples]:
        """Yield the samples at all places, together for places that exist in the same runs."""
        most = max(_MOST_VALUES // max(self.runs.size, 1), 1)
        for places in equal_columns(self.exists):
            chosen = np.flatnonzero(self.exists[:, places[0]])
            used = self.runs.used[chosen]
            for start in range(0, len(places), most):
                part = places[start : start + most]
                # Those of a place next to each other, as sums are then the same as of it alone.
                values = np.ascontiguousarray(self.matrix[:, part][chosen].T)
                yield PlaceSamples(part, replace(self.runs, values=values, used=used))


def equal_columns(mask: BoolArray) -> Iterator[IntArray]:
    """Yield the positions of equal columns of a mask, in the order of the first of each."""
    if mask.all():
        yield np.arange(mask.shape[1])
        return
    packed = np.packbits(mask, axis=0).T
    found: dict[bytes, list[int]] = {}
    for position, column in enumerate(packed):
        found.setdefault(column.tobytes(), []).append(position)
    yield from (np.array(positions) for positions in found.values())


# Statistics at each place of a field, by the analysis of a scalar output.


ScalarAnalysis = Callable[[Sample, QuantityOfInterest], Iterable[tuple[str, xr.DataArray]]]


def at_each_place(
    analysis: ScalarAnalysis,
    field: FieldSample,
    quantity: QuantityOfInterest,
    most: int | None = None,
) -> NamedArrays:
    """Apply the analysis of a scalar output to the values of a field at each place.

    Parameters
    ----------
    analysis : callable
        Takes samples of several places, too.
    field : FieldSample
        The runs of the field.
    quantity : QuantityOfInterest
        What is requested of it.
    most : int, optional
        Number of the statistics that are wanted, the first of the analysis.

    Yields
    ------
    name : str
        A statistic of the analysis.
    estimate : DataArray
        Along the dimensions of the field, then as of a scalar output.
    """
    scalar = replace(quantity, output=replace(quantity.output, dims=(), may_end=False))
    found: dict[str, list[tuple[IntArray, xr.DataArray]]] = {}
    for places, runs in field.samples():
        for name, array in islice(analysis(runs, scalar), most):
            found.setdefault(name, []).append((places, array))
    for name, parts in found.items():
        order = np.argsort(np.concatenate([places for places, _ in parts]))
        arrays = [array for _, array in parts]
        attributes = {**arrays[0].attrs, INTERVAL_LEVEL: field.runs.level}
        yield name, _joined(arrays, field.output, attributes, order)


def along_field(array: xr.DataArray, output: Output, level: float) -> xr.DataArray:
    """Return an estimate array along all places as one along the dimensions of the field."""
    return _joined(
        [array], output, {**array.attrs, INTERVAL_LEVEL: level}, np.arange(array.sizes[PLACE])
    )


def joined_places(arrays: Sequence[xr.DataArray], output: Output) -> xr.DataArray:
    """Return the estimate arrays at all places of a field as one, along its dimensions first."""
    attributes = {key: value for each in arrays for key, value in each.attrs.items()}
    return _joined(arrays, output, attributes, None)


def _joined(
    arrays: Sequence[xr.DataArray],
    output: Output,
    attributes: dict[str, Any],
    order: IntArray | None,
) -> xr.DataArray:
    """Return arrays as one along the dimensions of the field: of a place each, or along places."""

    def join(parts: list[Any]) -> Any:
        return np.stack(parts) if order is None else np.concatenate(parts)[order]

    own = {str(dim): size for dim, size in arrays[0].sizes.items() if dim not in (PLACE, BOUND)}
    coordinates = {
        str(name): each.variable
        for name, each in arrays[0].coords.items()
        if name not in (*INTERVAL_TEXTS, BOUND)
    }
    if output.may_end:
        attributes[CONDITIONAL] = texts.REACHED
    return estimate_array(
        join([array.values for array in arrays]),
        {**output.sizes, **own},
        {text: join([array.coords[text].values for array in arrays]) for text in INTERVAL_TEXTS},
        units=attributes.pop("units"),
        long_name=attributes.pop("long_name"),
        attributes=attributes,
        coordinates={**field_coordinates(output.dims), **coordinates},
    )


# Statistics at each place of a field: moments, quantiles, probabilities, shares of runs.


def moments_at_places(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Mean and standard deviation at each place of a field."""
    # The others are diagnostics of one distribution.
    yield from at_each_place(sample_moments, field, quantity, most=2)


def quantiles_at_places(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the requested quantiles at each place of a field."""
    yield from at_each_place(quantile_estimates, field, quantity)


def probabilities_at_places(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Probabilities of lying beyond each of the requested thresholds, at each place of a field."""
    yield from at_each_place(exceedance_probabilities, field, quantity)
    yield from at_each_place(below_probabilities, field, quantity)


def reached(field: FieldSample, quantity: QuantityOfInterest) -> NamedArrays:
    """Probability that a curve reaches each place, where curves may end before.

    Yields
    ------
    name : str
        ``reached``.
    estimate : DataArray
        Along the dimension of the curve and ``bound``.
    """
    if not quantity.output.may_end:
        return
    events = replace(field.runs, values=field.exists.astype(np.float64))
    always = replace(field.output, may_end=False)
    yield from at_each_place(_reached, FieldSample(events, always), quantity)


def _reached(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Probability that a value is 1."""
    long_name = f"probability that {quantity.output.title} reaches a place"
    found = event_probability(sample, sample.values > 0)
    yield "reached", found.to_array(units="1", long_name=long_name, level=sample.level)
