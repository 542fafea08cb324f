"""The inputs' part in an output as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqpen.core.catalogue import CATALOGUE, CATEGORY, THRESHOLD
from uqpen.core.labels import INPUT
from uqpen.results.estimate_json import estimate_json
from uqpen.results.measure_labels import CATEGORY_INDICES, EXCEEDANCE_INDICES, INDICES, PAIR_INDICES

__all__ = ["sensitivity_json"]

Figures = dict[str, dict[str, Any]]

# Measures of each of several events: their key, the indices, and what the events lie along.
_EVENTS = (
    ("sensitivity_of_exceedance", EXCEEDANCE_INDICES, THRESHOLD),
    ("sensitivity_of_shares", CATEGORY_INDICES, CATEGORY),
)


def sensitivity_json(arrays: Mapping[str, xr.DataArray]) -> dict[str, Any]:
    """Return all measures that a source has of an output; nothing for none.

    Parameters
    ----------
    arrays : mapping of str to DataArray
        The statistics that the source has of the output.

    Returns
    -------
    dict
        ``sensitivity.<input>.<measure>``; ``sensitivity_of_exceedance.<threshold>`` and
        ``sensitivity_of_shares.<kind>`` likewise; ``sensitivity_of_pairs.<pair>.second_order``.
    """
    of_inputs = [name for name in arrays if name in CATALOGUE and CATALOGUE[name].dims == (INPUT,)]
    found: dict[str, Any] = {
        "sensitivity": _entry_measures(arrays, {name: name for name in of_inputs})
    }
    for key, measures, dimension in _EVENTS:
        # The key says of what; the measure is called like that of the output itself.
        keys = {
            of_event.statistic: measure.statistic
            for of_event, measure in zip(measures, INDICES, strict=True)
        }
        found[key] = _event_measures(arrays, keys, dimension)
    keys = {measure.statistic: measure.statistic for measure in PAIR_INDICES}
    found["sensitivity_of_pairs"] = _entry_measures(arrays, keys)
    return {key: figures for key, figures in found.items() if figures}


def _entry_measures(arrays: Mapping[str, xr.DataArray], keys: Mapping[str, str]) -> Figures:
    """Measures by input or pair, and by their key."""
    found: Figures = {}
    for statistic, key in keys.items():
        if statistic in arrays:
            array = arrays[statistic]
            for position, name in enumerate(array[array.dims[0]].values):
                found.setdefault(str(name), {})[key] = estimate_json(array[position])
    return found


def _event_measures(
    arrays: Mapping[str, xr.DataArray], keys: Mapping[str, str], dimension: str
) -> dict[str, Figures]:
    """Measures by event, input and key."""
    found: dict[str, Figures] = {}
    for statistic, key in keys.items():
        if statistic in arrays:
            for position, event in enumerate(arrays[statistic][dimension].values):
                at_event = {statistic: arrays[statistic][position]}
                for name, figures in _entry_measures(at_event, {statistic: key}).items():
                    found.setdefault(str(event), {}).setdefault(name, {}).update(figures)
    return found
