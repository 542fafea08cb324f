"""Responses: by how much an output changes with each input, at the nominal point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.labels import (
    MOVED_BY,
    MOVED_INPUT,
    MOVED_UNCERTAINTY,
    RELATIVE_TO_SPREAD,
    STATUS,
)
from uqpen.core.status import Status
from uqpen.designs.moves import moved_input_numbers
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.input_measures import input_array

__all__ = ["relative_responses"]

# Difference of the derivatives of the steps up and down, relative to the larger one, above which a
# note states it.
_CURVED = 0.1


def relative_responses(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Relative derivatives of an output, and contributions of the inputs to its uncertainty.

    Yields
    ------
    name : str
        ``response``: relative change of the output divided by that of the input, by central
        differences; ``contribution``: absolute response times the input's standard deviation
        divided by its nominal value.
    estimate : DataArray
        Along ``input`` and ``bound``, without bounds.
    """
    if quantity.output.categories:
        return
    name, title = quantity.output.name, quantity.output.title
    inputs = moved_input_numbers(runs)
    found = [_response(runs, name, entry, number) for entry, number in inputs.items()]
    contributions = [
        _contribution(response, runs, number)
        for response, number in zip(found, inputs.values(), strict=True)
    ]
    for statistic, estimates, long_name in (
        ("response", found, f"relative response of {title}"),
        ("contribution", contributions, f"contribution to the relative uncertainty of {title}"),
    ):
        yield statistic, input_array(estimates, [*inputs], long_name)


@dataclass(frozen=True)
class _Slopes:
    """Relative changes of an output over those of one input, to either side; NaN for failed."""

    down: float
    up: float

    @property
    def is_central(self) -> bool:
        return math.isfinite(self.down) and math.isfinite(self.up)

    @property
    def value(self) -> float:
        """The derivative: central, or of the side that there is."""
        if self.is_central:
            return (self.down + self.up) / 2
        return self.up if math.isfinite(self.up) else self.down

    @property
    def note(self) -> str:
        """Note on a one-sided or a curved response; empty for none."""
        if not self.is_central:
            side = "up" if math.isfinite(self.up) else "down"
            return texts.ONE_SIDED_STEP.format(side=side)
        if abs(self.up - self.down) > _CURVED * max(abs(self.up), abs(self.down)):
            return texts.NONLINEAR.format(down=self.down, up=self.up)
        return ""


def _response(runs: xr.Dataset, name: str, entry: str, number: int) -> Estimate:
    values = np.where(runs[STATUS].values == Status.OK, runs[name].values, np.nan)
    moved, by = runs[MOVED_INPUT].values, runs[MOVED_BY].values
    nominal = float(values[moved < 0][0])
    if math.isnan(nominal):
        return Estimate.without_bounds(math.nan, texts.NOMINAL_RUN_FAILED)
    if not nominal:
        return Estimate.without_bounds(math.nan, texts.NOMINAL_OUTPUT_IS_0)
    down, up = (
        float((values[side][0] / nominal - 1) / by[side][0])
        for side in ((moved == number) & (by < 0), (moved == number) & (by > 0))
    )
    slopes = _Slopes(down, up)
    if math.isnan(slopes.value):
        return Estimate.without_bounds(math.nan, texts.STEP_FAILED)
    # The reference of the input's change, if it is not the nominal value.
    is_of_spread = entry in str(runs[MOVED_BY].attrs.get(RELATIVE_TO_SPREAD, "")).split()
    reference = texts.OF_HALF_SPREAD if is_of_spread else ""
    return Estimate.without_bounds(slopes.value, texts.ONE_POINT, slopes.note, reference)


def _contribution(response: Estimate, runs: xr.Dataset, number: int) -> Estimate:
    its_runs = runs[MOVED_INPUT].values == number
    uncertainty = float(runs[MOVED_UNCERTAINTY].values[its_runs][0])
    if not uncertainty:
        return Estimate.without_bounds(math.nan, texts.FIXED_INPUT)
    return Estimate.without_bounds(abs(response.value) * uncertainty, response.note)
