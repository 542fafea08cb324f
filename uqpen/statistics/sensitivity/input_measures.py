"""Sensitivity measures along the inputs: of what, and why some are missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import INPUT, OF_CATEGORY, OF_EXCEEDANCE, OF_LOGARITHM
from uqpen.core.model import Output
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import (
    category_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.fields.field_sample import along_field
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample


class OutputFunction(NamedTuple):
    """Function of an output whose variance the inputs share: itself, its logarithm, or events."""

    prefix: str  # before the names of its measures
    title: str  # for display
    # Each takes values of the output: one, or one for each event.
    rows: Sequence[Callable[[Any], FloatArray]]
    # Coordinates of the events, that of the dimension first; empty for no event.
    events: Mapping[str, Any]


def output_functions(
    quantity: QuantityOfInterest, *, has_logarithm: bool
) -> Iterator[OutputFunction]:
    """Yield the functions of an output whose variance inputs share, as a study requests them."""
    title = quantity.output.title
    if kinds := quantity.output.categories:
        events = [partial(_event, np.equal, kind) for kind in range(len(kinds))]
        coordinates = category_coordinates(quantity)
        yield OutputFunction(OF_CATEGORY, f"the kind of {title}", events, coordinates)
        return
    yield OutputFunction("", title, [np.asarray], {})
    if has_logarithm:
        yield OutputFunction(OF_LOGARITHM, f"the logarithm of {title}", [np.log], {})
    if quantity.thresholds:
        events = [partial(_event, np.greater, each.value) for each in quantity.thresholds]
        coordinates = threshold_coordinates(quantity)
        yield OutputFunction(OF_EXCEEDANCE, f"whether {title} exceeds a value", events, coordinates)


def _event(compare: np.ufunc, with_value: float, values: FloatArray) -> FloatArray:
    """Return 1 where an event occurs and 0 elsewhere; NaN where there is no value."""
    return np.where(np.isnan(values), np.nan, compare(values, with_value))


def function_array(
    rows: Sequence[Estimate],
    function: OutputFunction,
    inputs: Sequence[str],
    long_name: str,
    level: float = LEVEL,
) -> xr.DataArray:
    """Return estimates of a function along ``input``, first along its events if it has some.

    Parameters
    ----------
    rows : sequence of Estimate
        One for each row of the function, of shape (input,).
    function : OutputFunction
    inputs : sequence of str
        Names of the inputs.
    long_name : str
        Meaning of the estimates.
    level : float
        Confidence level of their intervals.
    """
    found = Estimate.stacked(rows, axis=0) if function.events else rows[0]
    return found.to_array(
        *[*function.events][:1],
        INPUT,
        units="1",
        long_name=long_name,
        coordinates={**function.events, **input_coordinate(inputs)},
        level=level,
    )


def input_array(
    estimates: Sequence[Estimate],
    inputs: Sequence[str],
    long_name: str,
    *,
    units: str = "1",
    level: float = LEVEL,
) -> xr.DataArray:
    """Return one estimate for each input as an estimate array along ``input`` and ``bound``."""
    along = input_coordinate(inputs)
    return Estimate.stack(
        estimates, INPUT, units=units, long_name=long_name, coordinates=along, level=level
    )


def event_array(
    rows: Sequence[Sequence[Estimate]],
    events: Mapping[str, Any],
    inputs: Sequence[str],
    long_name: str,
    level: float = LEVEL,
) -> xr.DataArray:
    """Return estimates of several events as an estimate array along these and ``input``.

    Parameters
    ----------
    rows : sequence of sequence of Estimate
        For each event, one for each input.
    events : mapping
        Coordinates of the events, that of the dimension first.
    inputs : sequence of str
        Names of the inputs.
    long_name : str
        Meaning of the estimates.
    level : float
        Confidence level of their intervals.
    """
    dimensions = (next(iter(events)), INPUT)
    along = {**events, **input_coordinate(inputs)}
    return Estimate.table(
        rows, dimensions, units="1", long_name=long_name, coordinates=along, level=level
    )


def input_place_array(
    estimates: Estimate,
    output: Output,
    inputs: Sequence[str],
    long_name: str,
    level: float,
) -> xr.DataArray:
    """Return estimates as an estimate array along the dimensions of a field and ``input``.

    Parameters
    ----------
    estimates : Estimate
        Of shape (place, input).
    output : Output
        The field.
    inputs : sequence of str
        Names of the inputs.
    long_name : str
        Meaning of the estimates.
    level : float
        Confidence level of their intervals.
    """
    along = input_coordinate(inputs)
    array = estimates.to_array(
        INPUT, units="1", long_name=long_name, coordinates=along, level=level
    )
    return along_field(array, output, level)


def input_coordinate(inputs: Sequence[str]) -> dict[str, Any]:
    """Return the coordinate along ``input``: the names of inputs."""
    return {INPUT: (INPUT, np.array(inputs, dtype=object), {"long_name": "input"})}


def reason_without_measure(
    sample: Sample, column: int, fewest: int, *, needs_order: bool = False
) -> str:
    """Reason why a measure of an input cannot be estimated from a sample; empty if it can.

    Parameters
    ----------
    sample : Sample
        Of the output.
    column : int
        The input, by its number in `Sample.inputs`.
    fewest : int
        Least number of runs for the measure.
    needs_order : bool
        Whether the measure follows the order of an input's values, which codes of texts lack.
    """
    if needs_order and sample.columns.is_coded(column):
        return texts.CODES_WITHOUT_ORDER
    if sample.size < fewest:
        return sample.too_few_runs
    return texts.CONSTANT_OUTPUT if sample.is_constant else reason_of_input(sample, column)


def reason_of_input(sample: Sample, column: int) -> str:
    """Reason why an input has no measure; empty if it may. See `reason_without_measure`."""
    return "" if sample.run_inputs.varies(column) else texts.CONSTANT_INPUT
