"""Statistics at each place of a field: moments, quantiles, probabilities, shares of runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.statistics.distribution_function.probabilities import (
    below_probabilities,
    event_probability,
    exceedance_probabilities,
)
from uqpen.statistics.distribution_function.quantiles import quantile_estimates
from uqpen.statistics.fields.at_each_place import at_each_place
from uqpen.statistics.fields.field_sample import FieldSample
from uqpen.statistics.moments.sample_moments import sample_moments
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample

__all__ = ["moments_at_places", "probabilities_at_places", "quantiles_at_places", "reached"]

Arrays = Iterator[tuple[str, xr.DataArray]]


def moments_at_places(field: FieldSample, quantity: QuantityOfInterest) -> Arrays:
    """Mean and standard deviation at each place of a field."""
    # The others are diagnostics of one distribution.
    yield from at_each_place(sample_moments, field, quantity, most=2)


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
    events = replace(field.runs, values=field.exists.astype(np.float64))
    always = replace(field.output, may_end=False)
    yield from at_each_place(_reached, FieldSample(events, always), quantity)


def _reached(sample: Sample, quantity: QuantityOfInterest) -> Arrays:
    """Probability that a value is 1."""
    long_name = f"probability that {quantity.output.title} reaches a place"
    found = event_probability(sample, sample.values > 0)
    yield "reached", found.to_array(units="1", long_name=long_name, level=sample.level)
