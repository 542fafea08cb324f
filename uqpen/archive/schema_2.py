"""Statistics as archives of schema 2 have them: in groups by kind, named after their output."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array
from uqpen.core.catalogue import CATALOGUE, CATEGORY, CONTENT_LEVEL, PROBABILITY, THRESHOLD
from uqpen.core.labels import BOUND, INPUT, INTERVAL_LABEL, INTERVAL_LEVEL, STATUS

__all__ = ["GROUPS", "SENSITIVITY_GROUP", "read_failures", "read_statistic"]

SENSITIVITY_GROUP = "sensitivity"

# The group of each statistic, and what followed the output in its variable's name.
_PLACES = {
    **{
        name: ("moments", f"_{name}")
        for name in ("mean", "std", "half_spread", "skewness", "kurtosis", "effective_runs")
    },
    "quantile": ("quantiles", ""),
    "tolerance_limit": ("holds", ""),
    "exceedance": ("exceedance", ""),
    "share": ("shares", ""),
    "cdf": ("cdfs", "_probability"),
    "cdf_band": ("cdfs", "_band"),
    "cdf_value": ("cdfs", ""),
}

# What a dimension was called there, after its output.
_DIMENSIONS = {
    PROBABILITY: "probability",
    CONTENT_LEVEL: "hold",
    THRESHOLD: "threshold",
    CATEGORY: "category",
}

GROUPS = ("moments", "quantiles", "holds", "exceedance", "cdfs", "shares", SENSITIVITY_GROUP)


def read_statistic(
    tree: xr.DataTree, source: str, output: str, statistic: str
) -> xr.DataArray | None:
    """Return an estimate array of a model, or of a pair of models; None where there is none.

    Parameters
    ----------
    tree : DataTree
        Whose children are the groups.
    source, output, statistic : str
        The names of a design, surrogate or publication; of an output; of an entry of the catalogue.
    """
    group, suffix = _PLACES.get(statistic, (SENSITIVITY_GROUP, f"_{statistic}"))
    if group not in tree.children or source not in tree.children[group].children:
        return None
    dataset = tree.children[group].children[source].to_dataset(inherit=False)
    name = f"{output}{suffix}"
    if name not in dataset.data_vars:
        return None
    variable = dataset.variables[name]
    renamed = {f"{output}_{old}": new for new, old in _DIMENSIONS.items()}
    dims = tuple(renamed.get(str(dim), str(dim)) for dim in variable.dims)
    if set(dims) - {BOUND} != set(CATALOGUE[statistic].dims):
        return None
    own = dict(variable.attrs)
    texts = dict(_texts(dataset, name, own))
    coordinates = dict(_coordinates(dataset, variable, output, renamed))
    attributes = {**own, **{key: v for key, v in dataset.attrs.items() if _is_of_runs(str(key))}}
    return xr.DataArray(variable.values, {**coordinates, **texts}, dims, name, attributes)


def read_failures(tree: xr.DataTree, design: str) -> dict[str, xr.DataArray]:
    """Return what a model's archive says of a design's runs that did not complete."""
    found = {}
    ends = _child(tree, "statuses", design)
    if ends.data_vars:
        names = [str(name) for name in ends.data_vars]
        arrays = [ends[name] for name in names]
        texts = {key: [str(array.attrs.get(key, "")) for array in arrays] for key in INTERVAL_TEXTS}
        found["probability"] = estimate_array(
            np.stack([array.values for array in arrays]),
            {STATUS: len(names)},
            texts,
            units="1",
            long_name="probability that a run ends so",
            attributes={INTERVAL_LEVEL: 0.95, **ends.attrs},
        ).assign_coords({STATUS: (STATUS, np.array(names, dtype=object), {"long_name": "end"})})
    associations = _child(tree, "losses", design)
    for name, array in associations.data_vars.items():
        own = dict(array.attrs)
        texts = dict(_texts(associations, str(name), own))
        kept = {
            key: (each.dims, each.values, each.attrs)
            for key, each in array.coords.items()
            if key in (INPUT, BOUND)
        }
        found[str(name)] = xr.DataArray(array.values, {**kept, **texts}, array.dims, attrs=own)
        found[str(name)].attrs |= associations.attrs
    return found


def _child(tree: xr.DataTree, *path: str) -> xr.Dataset:
    for name in path:
        if name not in tree.children:
            return xr.Dataset()
        tree = tree.children[name]
    return tree.to_dataset(inherit=False)


def _is_of_runs(key: str) -> bool:
    """Return whether an attribute of a group is of the runs that its statistics are of."""
    return not key.endswith("_largest_contribution") and key != "source"


def _texts(
    dataset: xr.Dataset, name: str, attributes: dict[str, Any]
) -> Iterator[tuple[str, tuple[Any, Any]]]:
    """Yield how the intervals were made, taking it out of the attributes where it stands there."""
    variable = dataset.variables[name]
    if BOUND not in variable.dims:
        return
    dims = tuple(str(dim) for dim in variable.dims[:-1])
    prefixes = (name, *dims)
    prefix = next((each for each in prefixes if f"{each}_{INTERVAL_LABEL}" in dataset.coords), "")
    renamed = _renamed_dims(dims, name)
    for key in INTERVAL_TEXTS:
        own = str(attributes.pop(key, ""))
        if prefix:
            values = dataset.variables[f"{prefix}_{key}"].values.astype(object)
        else:
            values = np.full(variable.shape[:-1], own, dtype=object)
        yield key, (renamed, values)


def _renamed_dims(dims: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Return the dimensions by their present names."""
    found = []
    for dim in dims:
        new = [new for new, old in _DIMENSIONS.items() if dim.endswith(f"_{old}")]
        found.append(new[0] if new else dim)
    return tuple(found)


def _coordinates(
    dataset: xr.Dataset, variable: xr.Variable, output: str, renamed: Mapping[str, str]
) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Yield the coordinates along a variable's dimensions by their present names."""
    for key, coordinate in dataset.coords.items():
        name = str(key)
        if name.endswith(tuple(f"_{text}" for text in INTERVAL_TEXTS)):
            continue
        if not coordinate.dims or not set(coordinate.dims) <= set(variable.dims):
            continue
        along = next((old for old in renamed if name == old or name.startswith(f"{old}_")), None)
        called = name if along is None else renamed[along] + name.removeprefix(along)
        dims = tuple(renamed.get(str(dim), str(dim)) for dim in coordinate.dims)
        yield called, (dims, coordinate.values, coordinate.attrs)
