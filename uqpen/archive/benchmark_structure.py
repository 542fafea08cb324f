"""Structure that an archive of a benchmark of methods must have to be read as one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.benchmark_layout import (
    BENCHMARK_COORDINATES,
    BENCHMARK_GROUP,
    BENCHMARK_VARIABLES,
    METHOD_VARIABLES,
    ArchiveVariable,
)
from uqpen.archive.estimates import has_interval_texts, interval_codes, statistic_names
from uqpen.archive.groups import read_group
from uqpen.archive.structure import has_bound_names, has_kind
from uqpen.core.catalogue import CATALOGUE, DIMENSIONS
from uqpen.core.labels import (
    BOUND,
    BUDGET,
    METHOD_DIMENSION,
    METHODS,
    REFERENCE,
    REPEAT,
    REPLICATED,
    SINGLE,
    VARIANT,
)

__all__ = ["find_benchmark_faults"]


def find_benchmark_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield a line for each fault of such an archive."""
    yield from _method_faults(tree)
    outputs = tree.children[BENCHMARK_GROUP].children if BENCHMARK_GROUP in tree.children else {}
    if not outputs:
        yield f"no {BENCHMARK_GROUP}"
    # The coordinates of each dimension, which are the same in all groups.
    known = {
        name: tree.children[METHODS].dataset.coords[name].values.tolist()
        for name in (METHOD_DIMENSION, BUDGET)
        if METHODS in tree.children and name in tree.children[METHODS].dataset.coords
    } | {VARIANT: [SINGLE, REPLICATED]}
    for output, node in outputs.items():
        entries = dict(known)
        if not node.children:
            yield f"/{BENCHMARK_GROUP}/{output}: no statistic"
        reference = read_group(tree, REFERENCE, str(output))
        yield from (f"/{REFERENCE}/{output}: {fault}" for fault in _reference_faults(reference))
        for statistic, group in node.children.items():
            place = f"/{BENCHMARK_GROUP}/{output}/{statistic}"
            if statistic not in CATALOGUE:
                yield f"{place}: of no statistic that this uqpen knows"
                continue
            faults = _statistic_faults(group.to_dataset(inherit=False), str(statistic), entries)
            yield from (f"{place}: {fault}" for fault in faults)
            for fault in _truth_faults(reference, str(statistic), entries):
                yield f"/{REFERENCE}/{output}: {fault}"


def _method_faults(tree: xr.DataTree) -> Iterator[str]:
    if METHODS not in tree.children:
        yield f"no {METHODS}"
        return
    methods = tree.children[METHODS].dataset
    for name in ("repeats", "reference_runs"):
        if not isinstance(methods.attrs.get(name), int | np.integer):
            yield f"/{METHODS}: no number of {name.replace('_', ' ')}"
    needed = [
        *METHOD_VARIABLES.values(),
        *(BENCHMARK_COORDINATES[name] for name in (BUDGET, METHOD_DIMENSION)),
    ]
    missing = [each for each in needed if not _has_variable(methods, each, each.dims)]
    for variable in missing:
        yield f"/{METHODS}: no {variable.name} along {', '.join(variable.dims)}"
    if missing:
        return
    if ((methods["runs"] > 0) & (methods["replicates"] < 1)).any():
        yield f"/{METHODS}: runs without replicates"
    budgets = methods[BUDGET].values
    if not (budgets.size and methods[METHOD_DIMENSION].size):
        yield f"/{METHODS}: no method that was given runs"
    elif budgets[0] < 1 or (budgets[1:] <= budgets[:-1]).any():
        yield f"/{METHODS}: numbers of runs that do not ascend from 1"


def _has_variable(dataset: xr.Dataset, variable: ArchiveVariable, dims: tuple[str, ...]) -> bool:
    """Return whether a dataset has a variable along these dimensions, of its kind."""
    found = dataset.variables.get(variable.name)
    return found is not None and found.dims == dims and has_kind(found, variable.kind)


def _statistic_faults(
    dataset: xr.Dataset, statistic: str, known: dict[str, list[Any]]
) -> Iterator[str]:
    """Yield the faults of the group of a statistic; `known` are the coordinates of others."""
    for name, variable in BENCHMARK_VARIABLES.items():
        dims = variable.dims_of(statistic)
        if not _has_variable(dataset, variable, dims):
            yield f"no {name} along {', '.join(dims) or 'nothing'}"
        elif not set(dims) <= set(dataset.coords):
            yield f"no coordinates of {name}"
        elif name == "estimate" and not {"units", "display_units"} <= set(dataset[name].attrs):
            yield "no units of its estimates"
    for dimension in {*dataset.dims} & {*dataset.coords} - {BOUND, REPEAT}:
        found = dataset.coords[dimension].values.tolist()
        if known.setdefault(str(dimension), found) != found:
            yield f"another {dimension} than elsewhere"


def _reference_faults(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the faults of the statistics of an output that the reference has."""
    for name in statistic_names(dataset):
        variable = dataset[name]
        if name not in CATALOGUE or not CATALOGUE[name].has_bounds:
            continue
        dims = (*CATALOGUE[name].dims, BOUND)
        if variable.dims != dims or not has_kind(variable, "number"):
            yield f"no {name} along {', '.join(dims)}"
        elif not has_bound_names(dataset):
            yield f"{name}: not the bounds of an estimate"
        else:
            if not has_interval_texts(dataset, name):
                several = "s were" if interval_codes(dataset, name) is not None else " was"
                yield f"{name}: does not say how its interval{several} made"
            yield from _coordinate_faults(dataset, dims[:-1])


def _coordinate_faults(dataset: xr.Dataset, dims: tuple[str, ...]) -> Iterator[str]:
    for dimension in dims:
        described = DIMENSIONS[dimension]
        for name, kind in {dimension: described.kind, **described.companions}.items():
            found = dataset.coords.get(name)
            if found is None or found.dims != (dimension,) or not has_kind(found, kind):
                yield f"no {name} to tell its entries apart"


def _truth_faults(
    reference: xr.Dataset, statistic: str, known: dict[str, list[Any]]
) -> Iterator[str]:
    """Yield a fault where the reference does not have what errors are those of."""
    if statistic not in reference:
        yield f"no {statistic}"
        return
    if not has_kind(reference[statistic].attrs.get("runs_used", ""), "count"):
        yield f"no runs_used of {statistic}"
    for dimension in CATALOGUE[statistic].dims:
        if dimension in reference.coords and dimension in known:
            entries = reference[dimension].values.tolist()
            if entries != known[dimension]:
                yield f"other entries of {statistic} than are estimated"
