"""The inputs' part in an output as JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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


def sensitivity_json(
    arrays: Mapping[str, xr.DataArray], *, field: Sequence[str] = ()
) -> dict[str, Any]:
    """Return all measures out of the statistics that a source has of an output.

    Returns
    -------
    dict
        ``sensitivity.<input>.<measure>``; ``sensitivity_of_exceedance.<threshold>`` and
        ``sensitivity_of_shares.<kind>`` likewise; ``sensitivity_of_pairs.<pair>.second_order``.
        Without the keys of no measure. `field` are the dimensions of a field.
    """
    of_inputs = [name for name in arrays if name in CATALOGUE and CATALOGUE[name].dims == (INPUT,)]
    found = {
        "sensitivity": _measures_json(arrays, dict(zip(of_inputs, of_inputs, strict=True)), field),
        **{key: _measures_json(arrays, names, field) for key, names in _OTHER_MEASURES.items()},
    }
    return {key: figures for key, figures in found.items() if figures}


def _measures_json(
    arrays: Mapping[str, xr.DataArray], statistics: Mapping[str, str], field: Sequence[str]
) -> dict[str, Any]:
    """Return measures by the entries that they lie along, then by their names."""
    found: dict[str, Any] = {}
    for statistic, name in statistics.items():
        if statistic not in arrays:
            continue
        array = arrays[statistic]
        dims = [dim for dim in array.dims[:-1] if dim not in field]
        for place in np.ndindex(*(array.sizes[dim] for dim in dims)):
            entry = found
            for dim, position in zip(dims, place, strict=True):
                entry = entry.setdefault(str(array[dim].values[position]), {})
            entry[name] = estimate_json(array[dict(zip(dims, place, strict=True))])
    return found
