"""Statistics at each place of a field: moments, quantiles, probabilities, shares of runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.statistics.distribution_function.probabilities import (
    below_probabilities,
    event_probability,
    exceedance_probabilities,
)
from uqpen.statistics.distribution_function.quantiles import quantile_estimates
from uqpen.statistics.fields.at_each_place import at_each_place
from uqpen.statistics.fields.field_sample import FieldSample, field_coordinates
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

__all__ = ["moments_at_places", "probabilities_at_places", "quantiles_at_places", "reached"]

Arrays = Iterator[tuple[str, xr.DataArray]]

# Of the moments; the others are diagnostics of one distribution.
_MOMENTS = ("mean", "std")


def moments_at_places(field: FieldSample, quantity: QuantityOfInterest) -> Arrays:
    """Mean and standard deviation at each place of a field."""
    for name, array in at_each_place(sample_moments, field, quantity):
        if name in _MOMENTS:
            yield name, array


def quantiles_at_places(field: FieldSample, quantity: QuantityOfInterest) -> Arrays:
    """Estimate the requested quantiles at each place of a field."""
    yield from at_each_place(quantile_estimates, field, quantity)


def probabilities_at_places(field: FieldSample, quantity: QuantityOfInterest) -> Arrays:
    """Probabilities of lying beyond each of the requested thresholds, at each place of a field."""
    yield from at_each_place(exceedance_probabilities, field, quantity)
    yield from at_each_place(below_probabilities, field, quantity)


def reached(field: FieldSample, quantity: QuantityOfInterest) -> Arrays:
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
    estimates = [
        event_probability(replace(field.runs, values=event.astype(np.float64)), event)
        for event in field.exists.T
    ]
    texts = zip(*((each.method, each.label, each.note) for each in estimates), strict=True)
    array = estimate_array(
        np.array([estimate.bounds for estimate in estimates]),
        field.sizes,
        dict(zip(INTERVAL_TEXTS, map(list, texts), strict=True)),
        units="1",
        long_name=f"probability that {quantity.output.title} reaches a place",
        attributes={INTERVAL_LEVEL: field.runs.level},
        coordinates=field_coordinates(field.dims),
    )
    yield "reached", array
