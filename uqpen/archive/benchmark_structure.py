"""What an archive of methods head to head must hold to be read as one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.layout import find_reference_faults, has_kind
from uqpen.core.labels import (
    BOUND,
    BUDGET,
    ENTRIES,
    ERRORS,
    ESTIMATES,
    EXCEEDANCE,
    METHOD_DIMENSION,
    METHODS,
    MOMENTS,
    QUANTILES,
    REFERENCE,
    REPEAT,
    REPLICATED,
    SINGLE,
    SLOPES,
    VARIANT,
    VERDICTS,
)

__all__ = ["find_benchmark_faults"]

# The variables of a method, and what those of a statistic are along in each group, before its own
# entries and a bound, with what they are. What ends a name there tells its variables apart.
_METHOD_VARIABLES = {
    "runs": ((METHOD_DIMENSION, BUDGET), "count"),
    "replicates": ((METHOD_DIMENSION, BUDGET), "count"),
    "source": ((METHOD_DIMENSION,), "text"),
    "contests": ((METHOD_DIMENSION,), "text"),
    BUDGET: ((BUDGET,), "count"),
    METHOD_DIMENSION: ((METHOD_DIMENSION,), "text"),
}
_STATISTIC_VARIABLES: dict[str, dict[str, tuple[tuple[str, ...], str]]] = {
    ESTIMATES: {"": ((METHOD_DIMENSION, BUDGET, REPEAT), "number")},
    ERRORS: {
        "": ((METHOD_DIMENSION, BUDGET), "number"),
        "_coverage": ((METHOD_DIMENSION, BUDGET), "number"),
        "_scale": ((), "number"),
    },
    SLOPES: {"": ((METHOD_DIMENSION,), "number")},
    VERDICTS: {
        "_lead": ((VARIANT, BUDGET), "number"),
        **{
            f"_{what}": ((VARIANT, BUDGET), "text")
            for what in ("winner", "runner_up", "level", "verdict", "note")
        },
    },
}
_BOUNDED = {(ERRORS, ""), (SLOPES, ""), (VERDICTS, "_lead")}
# Where the reference has a statistic that has entries; all others are among the moments.
_IN_REFERENCE = {"quantile": QUANTILES, EXCEEDANCE: EXCEEDANCE}


def find_benchmark_faults(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with such an archive, for one line each."""
    yield from _method_faults(tree)
    yield from _reference_faults(tree)
    outputs = tree.children[ESTIMATES].children if ESTIMATES in tree.children else {}
    if not outputs:
        yield f"no {ESTIMATES}"
    # What lies along each dimension, which is the same in all groups.
    entries = {
        name: tree.children[METHODS].dataset.coords[name].values.tolist()
        for name in (METHOD_DIMENSION, BUDGET)
        if METHODS in tree.children and name in tree.children[METHODS].dataset.coords
    } | {VARIANT: [SINGLE, REPLICATED]}
    for output, estimates in outputs.items():
        if not estimates.data_vars:
            yield f"/{ESTIMATES}/{output}: no statistic"
        for statistic, array in estimates.data_vars.items():
            if not {"units", "display_units"} <= set(array.attrs):
                yield f"/{ESTIMATES}/{output}: no units of {statistic}"
            yield from _statistic_faults(tree, str(output), str(statistic), entries)
            yield from _truth_faults(tree, str(output), str(statistic))


def _reference_faults(tree: xr.DataTree) -> Iterator[str]:
    reference = tree.children.get(REFERENCE, xr.DataTree())
    for group in (MOMENTS, QUANTILES):
        if group not in reference.children:
            yield f"/{REFERENCE}: no {group}"
        elif "runs_used" not in reference.children[group].attrs:
            yield f"/{REFERENCE}/{group}: no runs_used"
    yield from (f"/{REFERENCE}{fault}" for fault in find_reference_faults(reference))


def _method_faults(tree: xr.DataTree) -> Iterator[str]:
    if METHODS not in tree.children:
        yield f"no {METHODS}"
        return
    methods = tree.children[METHODS].dataset
    for name in ("repeats", "reference_runs"):
        if not isinstance(methods.attrs.get(name), int | np.integer):
            yield f"/{METHODS}: no number of {name.replace('_', ' ')}"
    noted = False
    for name, (dimensions, kind) in _METHOD_VARIABLES.items():
        if not _has_variable(methods, name, dimensions, kind):
            yield f"/{METHODS}: no {name} along {', '.join(dimensions)}"
            noted = True
    if noted:
        return
    if ((methods["runs"] > 0) & (methods["replicates"] < 1)).any():
        yield f"/{METHODS}: runs without replicates"
    budgets = methods[BUDGET].values
    if not (budgets.size and methods[METHOD_DIMENSION].size):
        yield f"/{METHODS}: no method that was given runs"
    elif budgets[0] < 1 or (budgets[1:] <= budgets[:-1]).any():
        yield f"/{METHODS}: numbers of runs that do not ascend from 1"


def _has_variable(dataset: xr.Dataset, name: str, dimensions: tuple[str, ...], kind: str) -> bool:
    """Whether a dataset has a variable along these dimensions, of that kind."""
    variable = dataset.variables.get(name)
    return variable is not None and variable.dims == dimensions and has_kind(variable, kind)


def _statistic_faults(
    tree: xr.DataTree, output: str, statistic: str, known: dict[str, list[Any]]
) -> Iterator[str]:
    entries = (ENTRIES[statistic],) if statistic in ENTRIES else ()
    for group, variables in _STATISTIC_VARIABLES.items():
        outputs = tree.children[group].children if group in tree.children else {}
        dataset = outputs[output].dataset if output in outputs else xr.Dataset()
        for suffix, (dimensions, kind) in variables.items():
            bound = (BOUND,) if (group, suffix) in _BOUNDED else ()
            along = (*dimensions, *entries, *bound)
            name = f"{statistic}{suffix}"
            if not _has_variable(dataset, name, along, kind):
                yield f"/{group}/{output}: no {name} along {', '.join(along) or 'nothing'}"
            elif not set(along) <= set(dataset.coords):
                yield f"/{group}/{output}: no coordinates of {name}"
            for dimension in (
                {*along} & {*dataset.coords} & {METHOD_DIMENSION, BUDGET, VARIANT, *entries}
            ):
                found = dataset.coords[dimension].values.tolist()
                if known.setdefault(dimension, found) != found:
                    yield f"/{group}/{output}: another {dimension} than elsewhere"


def _truth_faults(tree: xr.DataTree, output: str, statistic: str) -> Iterator[str]:
    """Whether the reference has what the errors of a statistic are those of."""
    group, dimension = _IN_REFERENCE.get(statistic, MOMENTS), ENTRIES.get(statistic)
    name = output if dimension else f"{output}_{statistic}"
    reference = tree.children.get(REFERENCE, xr.DataTree()).children
    dataset = reference[group].dataset if group in reference else xr.Dataset()
    estimates = tree.children[ESTIMATES].children[output].dataset
    if name not in dataset:
        yield f"/{REFERENCE}/{group}: no {name}"
    elif dimension and dataset.sizes.get(f"{output}_{dimension}") != estimates.sizes.get(dimension):
        yield f"/{REFERENCE}/{group}: other entries of {name} than are estimated"
