"""Sobol' indices from pick-freeze blocks: which inputs an output's variance comes from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from uqpen.analyses.blocks import Blocks, Column
from uqpen.analyses.estimate import Estimate
from uqpen.analyses.given_inputs import along_inputs
from uqpen.analyses.probabilities import category_coordinates, threshold_coordinates
from uqpen.analyses.question import Question
from uqpen.labels import INPUT, PAIR

__all__ = ["sobol_indices"]

_KINDS = {"first_order": "first-order", "total_order": "total-order"}


def sobol_indices(runs: xr.Dataset, question: Question) -> Iterator[tuple[str, xr.DataArray]]:
    """Sobol' indices of an output, of its logarithm and of its exceeding a value.

    Parameters
    ----------
    runs : Dataset
        Of a pick-freeze design.
    question : Question
        Of the output.

    Yields
    ------
    name : str
        ``<output>_first_order``, ``_total_order`` and, of a design with second order,
        ``_second_order``; ``_log_first_order``, ``_log_total_order`` where all values are positive;
        ``_exceedance_first_order``, ``_exceedance_total_order`` where exceedance is asked. Of an
        output with kinds, ``_category_first_order`` and ``_category_total_order``.
    estimate : DataArray
        Along ``input`` (or ``pair``) and ``bound``; before them, ``<output>_threshold`` or
        ``<output>_category``.
    """
    blocks = Blocks.of(runs)
    name, title = question.output.name, question.output.title
    values = runs[name].values
    if kinds := question.output.categories:
        events = [Column(blocks, values == kind, is_event=True) for kind in range(len(kinds))]
        coordinates = category_coordinates(question)
        yield from _of_events(events, f"{name}_category", f"the kind of {title}", coordinates)
        return
    column = Column(blocks, values)
    yield from _of_column(column, name, title)
    if blocks.layout.pairs:
        yield _of_pairs(column, f"{name}_second_order", title)
    if column.is_positive:
        yield from _of_column(column.logarithm(), f"{name}_log", f"the logarithm of {title}")
    if question.exceeds:
        events = [Column(blocks, values > each.value, is_event=True) for each in question.exceeds]
        what = f"whether {title} exceeds a value"
        yield from _of_events(events, f"{name}_exceedance", what, threshold_coordinates(question))


def _of_column(column: Column, stem: str, title: str) -> Iterator[tuple[str, xr.DataArray]]:
    """First- and total-order indices along ``input``."""
    inputs = column.blocks.layout.inputs
    for order, adjective in _KINDS.items():
        name = f"{stem}_{order}"
        array = Estimate.stack(
            _of_inputs(column, order),
            INPUT,
            units="1",
            long_name=f"{adjective} Sobol' indices of {title}",
            name=name,
        )
        yield name, _described(array, column.blocks, along_inputs(inputs))


def _of_events(
    events: Sequence[Column], stem: str, title: str, coordinates: Mapping[str, Any]
) -> Iterator[tuple[str, xr.DataArray]]:
    """First- and total-order indices of several events, a row for each."""
    blocks = events[0].blocks
    along = next(iter(coordinates))
    for order, adjective in _KINDS.items():
        name = f"{stem}_{order}"
        array = Estimate.table(
            [_of_inputs(event, order) for event in events],
            (along, INPUT),
            units="1",
            long_name=f"{adjective} Sobol' indices of {title}",
            name=name,
        )
        yield (
            name,
            _described(array, blocks, {**coordinates, **along_inputs(blocks.layout.inputs)}),
        )


def _of_pairs(column: Column, name: str, title: str) -> tuple[str, xr.DataArray]:
    """Second-order indices along ``pair``."""
    layout = column.blocks.layout
    names = [(layout.inputs[i], layout.inputs[j]) for i, j in layout.pairs]
    array = Estimate.stack(
        [column.second_order(number) for number in range(len(names))],
        PAIR,
        units="1",
        long_name=f"second-order Sobol' indices of {title}",
        name=name,
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
    return name, _described(array, column.blocks, coordinates)


def _of_inputs(column: Column, order: str) -> list[Estimate]:
    index = column.first_order if order == "first_order" else column.total_order
    return [index(i) for i in range(column.blocks.layout.dimension)]


def _described(array: xr.DataArray, blocks: Blocks, coordinates: Mapping[str, Any]) -> xr.DataArray:
    """Indices with their coordinates, and of what law and how many blocks they are."""
    return array.assign_coords(coordinates).assign_attrs(blocks.attributes)
