"""Faults of statistics in an archive: dimensions, data types and texts, by the catalogue."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.estimates import correction_names, has_interval_texts, statistic_names
from uqpen.core.catalogue import CATALOGUE, DIMENSIONS, REQUESTED_DIMENSIONS
from uqpen.core.errors import QuantityError
from uqpen.core.labels import (
    ABSENT,
    AXIS_SCALE,
    BOUND,
    BOUNDS,
    CAVEAT,
    CITED,
    CONDITIONAL,
    CONFIDENCE_LEVEL,
    CONTRADICTION,
    DECISION,
    DECISION_CLAIM,
    DECISION_LOWER,
    DECISION_PROBABILITY,
    DECISION_RUNS,
    DECISION_UPPER,
    DERIVED_FROM,
    INTERVAL,
    INTERVAL_LABEL,
    LARGEST_CONTRIBUTION,
    MISSING,
    NOT_FITTED,
    NOTE,
    RECIPE,
    REFUTED,
    ROLE,
    RUNS_ABSENT,
    RUNS_SPENT,
    SOURCE_KIND,
    STOPPING_CLAIM,
    STOPPING_STATISTICS,
)
from uqpen.core.statistic import EntryDimension, Statistic
from uqpen.core.units import scale

__all__ = [
    "find_attribute_faults",
    "find_dataset_faults",
    "find_statistics_faults",
    "has_kind",
]

# What an attribute of some name is, wherever it stands.
_ATTRIBUTES = {
    **dict.fromkeys(
        (INTERVAL, INTERVAL_LABEL, NOTE, ROLE, CONDITIONAL, MISSING, "units", "display_units"),
        "text",
    ),
    **dict.fromkeys((ABSENT, CONTRADICTION, DERIVED_FROM), "text"),
    **dict.fromkeys(("source", "minus", "outputs", "check", "flag_meanings"), "text"),
    **dict.fromkeys(
        (AXIS_SCALE, CAVEAT, SOURCE_KIND, CITED, LARGEST_CONTRIBUTION, NOT_FITTED, REFUTED), "text"
    ),
    **dict.fromkeys(
        (RECIPE, RUNS_SPENT, RUNS_ABSENT, "runs", "runs_used"),
        "count",
    ),
    **dict.fromkeys(("order", "terms", "q2", "check_q2_of_output"), "number"),
    CONFIDENCE_LEVEL: "number",
    **dict.fromkeys((DECISION, DECISION_CLAIM, STOPPING_CLAIM, STOPPING_STATISTICS), "text"),
    **dict.fromkeys((DECISION_PROBABILITY, DECISION_LOWER, DECISION_UPPER), "number"),
    DECISION_RUNS: "count",
}

_KINDS = {"text": "OUS", "count": "iu", "number": "iuf"}


def has_kind(values: npt.ArrayLike, kind: str) -> bool:
    """Return True if values are of a kind: texts, counts or numbers."""
    known = getattr(values, "dtype", None)  # without reading them, where they are in a file
    return (np.asarray(values).dtype if known is None else known).kind in _KINDS[kind]


def _has_bound_names(dataset: xr.Dataset) -> bool:
    """Return True if a dataset names the bounds of its estimates."""
    # Not dataset[BOUND]: building a DataArray takes most of the time of these checks.
    return BOUND in dataset.coords and dataset.variables[BOUND].values.tolist() == list(BOUNDS)


def find_attribute_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the faults of attributes whose type is not the one that their name implies."""
    for node in tree.subtree:
        dataset = node.to_dataset(inherit=False)
        path = node.path
        owners: dict[str, Mapping[Any, Any]] = {path: dataset.attrs}
        owners |= {f"{path}/{key}": v.attrs for key, v in dataset.variables.items()}
        for place, attributes in owners.items():
            for name, value in attributes.items():
                kind = _ATTRIBUTES.get(str(name))
                if kind and not (np.ndim(value) == 0 and has_kind(value, kind)):
                    yield f"{place}: {name} is no {kind}"
            if not _is_unit(attributes.get("display_units", "1")):
                yield f"{place}: display_units that are no unit"


def _is_unit(text: object) -> bool:
    try:
        scale(str(text))
    except QuantityError:
        return False
    return True


def find_statistics_faults(node: xr.DataTree) -> Iterator[str]:
    """Yield the faults of the statistics of a model, or of a pair of models.

    The children of the node are the sources, and their children are the outputs. A fault begins
    with the path of a group below the node.
    """
    entries: dict[tuple[str, str], list[Any]] = {}
    for source, outputs in node.children.items():
        for output, child in outputs.children.items():
            dataset = child.to_dataset(inherit=False)
            for fault in find_dataset_faults(dataset, CATALOGUE):
                yield f"/{source}/{output}: {fault}"
            for dimension in dataset.dims:
                if dimension in dataset.coords and dimension in REQUESTED_DIMENSIONS:
                    found = dataset.variables[dimension].values.tolist()
                    if entries.setdefault((str(output), str(dimension)), found) != found:
                        yield f"/{source}/{output}: another {dimension} than elsewhere"


def find_dataset_faults(
    dataset: xr.Dataset,
    catalogue: Mapping[str, Statistic],
    dimensions: Mapping[str, EntryDimension] = DIMENSIONS,
) -> Iterator[str]:
    """Yield the faults of the statistics of one group.

    A statistic that is not in the catalogue may have any dimensions. A statistic that the group
    lacks is no fault. The entries of statistics lie along `dimensions`, those of fields along any
    others.
    """
    for name in statistic_names(dataset):
        variable = dataset.variables[name]
        entry = catalogue.get(name)
        dims = tuple(str(dim) for dim in variable.dims)
        if entry is not None:
            expected = (*entry.dims, *((BOUND,) if entry.has_bounds else ()))
            of_field = dims[: len(dims) - len(expected)]
            of_statistic = dims[len(of_field) :]
            if (
                of_statistic != expected
                or not dimensions.keys().isdisjoint(of_field)
                or not has_kind(variable, entry.kind)
            ):
                yield f"{name} is not of {entry.kind}s along {', '.join(expected)}"
                continue
        if BOUND in dims:
            yield from _interval_faults(dataset, name)
        for dimension in dims:
            yield from _coordinate_faults(dataset, dimension, dimensions)
    yield from _field_faults(dataset, catalogue, dimensions)


def _field_faults(
    dataset: xr.Dataset,
    catalogue: Mapping[str, Statistic],
    dimensions: Mapping[str, EntryDimension],
) -> Iterator[str]:
    """Find dimensions of a field that have no coordinates with a unit."""
    known = {
        str(dim)
        for name in dataset.data_vars
        if name in catalogue
        for dim in dataset.variables[name].dims
    }
    for dimension in sorted(known.difference(dimensions, (BOUND,))):
        if dimension not in dataset.coords or "units" not in dataset.variables[dimension].attrs:
            yield f"no coordinates with a unit along {dimension}"


def _interval_faults(dataset: xr.Dataset, name: str) -> Iterator[str]:
    """Find what is wrong with the bounds of a statistic, and with the texts on them."""
    variable = dataset.variables[name]
    if not _has_bound_names(dataset):
        yield f"{name}: not the bounds of an estimate"
    elif not has_interval_texts(dataset, name):
        yield f"{name}: does not say how its interval was made"
    elif variable.dims[-1] != BOUND or not has_kind(variable, "number"):
        yield f"{name}: not the bounds of an estimate"
    for beside in correction_names(name):
        found = dataset.variables.get(beside)
        if found is not None and (found.dims, True) != (
            variable.dims[:-1],
            has_kind(found, "number"),
        ):
            yield f"{beside} is not of a number for each entry of {name}"


def _coordinate_faults(
    dataset: xr.Dataset, dimension: str, dimensions: Mapping[str, EntryDimension]
) -> Iterator[str]:
    """Find what is wrong with the coordinates along a dimension of the catalogue."""
    described = dimensions.get(dimension)
    if described is None:
        return
    is_there = dimension in dataset.coords
    if not is_there or not has_kind(dataset.variables[dimension], described.kind):
        yield f"no {dimension} to tell its entries apart"
        return
    for name, kind in described.companions.items():
        beside = dataset.variables.get(name)
        if beside is None or beside.dims != (dimension,) or not has_kind(beside, kind):
            yield f"no {name} for each entry"
    for name, kind in described.optional.items():
        beside = dataset.variables.get(name)
        if beside is not None and (beside.dims != (dimension,) or not has_kind(beside, kind)):
            yield f"no {name} for each entry"
