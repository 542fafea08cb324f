"""Coordinates of sensitivity measures along the inputs, and reasons for missing measures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.sample import Sample

__all__ = [
    "event_array",
    "input_array",
    "input_coordinate",
    "reason_of_input",
    "reason_of_output",
    "reason_without_measure",
]


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


def input_coordinate(inputs: Sequence[str]) -> dict[str, Any]:
    """Return the coordinate along ``input``: the names of inputs."""
    return {INPUT: (INPUT, np.array(inputs, dtype=object), {"long_name": "input"})}


def reason_without_measure(
    sample: Sample, column: int, fewest: int, constant: str = texts.CONSTANT_OUTPUT
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
    constant : str
        The reason for an output that does not vary.
    """
    return reason_of_output(sample, fewest, constant) or reason_of_input(sample, column)


def reason_of_output(sample: Sample, fewest: int, constant: str = texts.CONSTANT_OUTPUT) -> str:
    """Reason why no input has a measure; empty if inputs may have. See `reason_without_measure`."""
    if sample.size < fewest:
        return sample.too_few_runs
    return constant if sample.is_constant else ""


def reason_of_input(sample: Sample, column: int) -> str:
    """Reason why an input has no measure; empty if it may. See `reason_without_measure`."""
    return "" if sample.run_inputs.varies(column) else texts.CONSTANT_INPUT
