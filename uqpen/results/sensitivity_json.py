"""The inputs' part in an output as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import INPUT
from uqpen.results.estimate_json import estimate_json
from uqpen.results.measure_labels import CATEGORY_INDICES, EXCEEDANCE_INDICES, INDICES, PAIR_INDICES

__all__ = ["sensitivity_json"]

# Statistics with a dimension besides the inputs, by JSON key, and their names there. Indices of
# an event have the same names as those of the output itself.
_OTHER_MEASURES = {
    key: {measure.statistic: name.statistic for measure, name in zip(measures, names, strict=True)}
    for key, measures, names in (
        ("sensitivity_of_exceedance", EXCEEDANCE_INDICES, INDICES),
        ("sensitivity_of_shares", CATEGORY_INDICES, INDICES),
        ("sensitivity_of_pairs", PAIR_INDICES, PAIR_INDICES),
    )
}


def sensitivity_json(arrays: Mapping[str, xr.DataArray]) -> dict[str, Any]:
    """Return all measures out of the statistics that a source has of an output.

    Returns
    -------
    dict
        ``sensitivity.<input>.<measure>``; ``sensitivity_of_exceedance.<threshold>`` and
        ``sensitivity_of_shares.<kind>`` likewise; ``sensitivity_of_pairs.<pair>.second_order``.
        Without the keys of no measure.
    """
    of_inputs = [name for name in arrays if name in CATALOGUE and CATALOGUE[name].dims == (INPUT,)]
    found = {
        "sensitivity": _measures_json(arrays, dict(zip(of_inputs, of_inputs, strict=True))),
        **{key: _measures_json(arrays, names) for key, names in _OTHER_MEASURES.items()},
    }
    return {key: figures for key, figures in found.items() if figures}


def _measures_json(
    arrays: Mapping[str, xr.DataArray], statistics: Mapping[str, str]
) -> dict[str, Any]:
    """Return measures by the entries that they lie along, then by their names."""
    found: dict[str, Any] = {}
    for statistic, name in statistics.items():
        if statistic not in arrays:
            continue
        array = arrays[statistic]
        labels = [array[dim].values for dim in array.dims[:-1]]
        for place in np.ndindex(array.shape[:-1]):
            entry = found
            for along, position in zip(labels, place, strict=True):
                entry = entry.setdefault(str(along[position]), {})
            entry[name] = estimate_json(array[place])
    return found
