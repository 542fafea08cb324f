"""Sobol' indices from pick-freeze blocks: shares of the inputs in an output's variance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.labels import OF_CATEGORY, OF_EXCEEDANCE, OF_LOGARITHM, PAIR
from uqpen.statistics.distribution_function.probabilities import (
    category_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.block_variable import INDEX_ORDERS, BlockVariable
from uqpen.statistics.sensitivity.input_measures import event_array, input_array
from uqpen.statistics.sensitivity.pick_freeze_blocks import PickFreezeBlocks

__all__ = ["sobol_indices"]


def sobol_indices(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Sobol' indices of an output, of its logarithm and of its exceedance of thresholds.

    Yields
    ------
    name : str
        ``first_order``, ``total_order`` and, for a design with second order, ``second_order``;
        ``log_first_order``, ``log_total_order`` where all values are positive;
        ``exceedance_first_order``, ``exceedance_total_order`` where thresholds are requested. For a
        categorical output, ``category_first_order`` and ``category_total_order`` alone.
    estimate : DataArray
        Along ``input`` (``second_order`` along ``pair``) and ``bound``; the indices of exceedance
        first along ``threshold``, those of categories first along ``category``.
    """
    blocks = PickFreezeBlocks.from_runs(runs)
    level = quantity.confidence_level
    name, title = quantity.output.name, quantity.output.title
    values = runs[name].values
    if kinds := quantity.output.categories:
        events = (
            BlockVariable(blocks, values == kind, is_event=True, level=level)
            for kind in range(len(kinds))
        )
        coordinates = category_coordinates(quantity)
        what = f"the kind of {title}"
        yield from _event_indices(blocks, level, events, OF_CATEGORY, what, coordinates)
        return
    column = BlockVariable(blocks, values, level=level)
    yield from _variable_indices(column, "", title)
    if blocks.layout.pairs:
        yield _pair_indices(column, title)
    if column.is_positive:
        yield from _variable_indices(column.logarithm(), OF_LOGARITHM, f"the logarithm of {title}")
    if quantity.thresholds:
        events = (
            BlockVariable(blocks, values > each.value, is_event=True, level=level)
            for each in quantity.thresholds
        )
        what = f"whether {title} exceeds a value"
        coordinates = threshold_coordinates(quantity)
        yield from _event_indices(blocks, level, events, OF_EXCEEDANCE, what, coordinates)


def _variable_indices(
    column: BlockVariable, prefix: str, title: str
) -> Iterator[tuple[str, xr.DataArray]]:
    """First- and total-order indices along ``input``."""
    blocks = column.blocks
    for order, adjective in INDEX_ORDERS.items():
        long_name = f"{adjective} Sobol' indices of {title}"
        estimates, inputs = _input_estimates(column, order), blocks.layout.inputs
        array = input_array(estimates, inputs, long_name, level=column.level)
        yield f"{prefix}{order}", array.assign_attrs(blocks.attributes)


def _event_indices(
    blocks: PickFreezeBlocks,
    level: float,
    events: Iterable[BlockVariable],
    prefix: str,
    title: str,
    coordinates: Mapping[str, Any],
) -> Iterator[tuple[str, xr.DataArray]]:
    """First- and total-order indices of several events, a row for each."""
    # Of many thresholds, the runs are in memory once.
    found = [[_input_estimates(event, order) for order in INDEX_ORDERS] for event in events]
    for place, (order, adjective) in enumerate(INDEX_ORDERS.items()):
        rows = [each[place] for each in found]
        long_name = f"{adjective} Sobol' indices of {title}"
        array = event_array(rows, coordinates, blocks.layout.inputs, long_name, level)
        yield f"{prefix}{order}", array.assign_attrs(blocks.attributes)


def _pair_indices(column: BlockVariable, title: str) -> tuple[str, xr.DataArray]:
    """Second-order indices along ``pair``."""
    layout = column.blocks.layout
    names = [(layout.inputs[i], layout.inputs[j]) for i, j in layout.pairs]
    array = Estimate.stack(
        [column.second_order(number) for number in range(len(names))],
        PAIR,
        units="1",
        long_name=f"second-order Sobol' indices of {title}",
        level=column.level,
    )
    texts = {
        PAIR: ([f"{one}, {other}" for one, other in names], "pair of inputs"),
        f"{PAIR}_first": ([one for one, _ in names], "first input of the pair"),
        f"{PAIR}_second": ([other for _, other in names], "second input of the pair"),
    }
    coordinates = {
        coordinate: (PAIR, np.array(entries, dtype=object), {"long_name": long_name})
        for coordinate, (entries, long_name) in texts.items()
    }
    attributes = column.blocks.attributes
    return "second_order", array.assign_coords(coordinates).assign_attrs(attributes)


def _input_estimates(column: BlockVariable, order: str) -> list[Estimate]:
    return [getattr(column, order)(i) for i in range(column.blocks.layout.dimension)]
