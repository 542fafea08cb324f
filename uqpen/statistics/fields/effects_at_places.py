"""Effects of single steps at each place of a field: elementary effects and responses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import xarray as xr

from uqpen.core.labels import RUN
from uqpen.statistics.fields.place_arrays import joined_places
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.elementary_effects import elementary_effects
from uqpen.statistics.sensitivity.responses import relative_responses

__all__ = ["effects_at_places", "responses_at_places"]

Arrays = Iterator[tuple[str, xr.DataArray]]
DesignAnalysis = Callable[[xr.Dataset, QuantityOfInterest], Iterable[tuple[str, xr.DataArray]]]


def effects_at_places(runs: xr.Dataset, quantity: QuantityOfInterest) -> Arrays:
    """Mean, mean absolute value and standard deviation of elementary effects at each place."""
    yield from _at_places(elementary_effects, runs, quantity)


def responses_at_places(runs: xr.Dataset, quantity: QuantityOfInterest) -> Arrays:
    """Relative responses and contributions at each place, in some units changes, too."""
    yield from _at_places(relative_responses, runs, quantity)


def _at_places(analysis: DesignAnalysis, runs: xr.Dataset, quantity: QuantityOfInterest) -> Arrays:
    """Apply the analysis of a design at each place; a run without a value there has failed."""
    output = quantity.output
    scalar = replace(quantity, output=replace(output, dims=(), may_end=False))
    values = runs[output.name].values.reshape(runs.sizes[RUN], -1)
    others = [name for name, each in runs.data_vars.items() if each.dims != (RUN,)]
    bare = runs.drop_vars(others)
    found: dict[str, list[xr.DataArray]] = {}
    for place in values.T:
        for name, array in analysis(bare.assign({output.name: (RUN, place)}), scalar):
            found.setdefault(name, []).append(array)
    for name, arrays in found.items():
        yield name, joined_places(arrays, output)
