"""What an archive of methods head to head must hold to be read as one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.layout import faults_of_reference, is_kind
from uqpen.labels import (
    BOUND,
    BUDGET,
    ENTRIES,
    ERRORS,
    ESTIMATES,
    EXCEEDANCE,
    METHOD,
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

__all__ = ["faults_of_contest"]

# The variables of a method, and what those of a statistic are along in each group, before its own
# entries and a bound, with what they are. What ends a name there tells its variables apart.
_OF_METHODS = {
    "runs": ((METHOD, BUDGET), "count"),
    "replicates": ((METHOD, BUDGET), "count"),
    "source": ((METHOD,), "text"),
    "contests": ((METHOD,), "text"),
    BUDGET: ((BUDGET,), "count"),
    METHOD: ((METHOD,), "text"),
}
_OF_STATISTICS: dict[str, dict[str, tuple[tuple[str, ...], str]]] = {
    ESTIMATES: {"": ((METHOD, BUDGET, REPEAT), "number")},
    ERRORS: {
        "": ((METHOD, BUDGET), "number"),
        "_coverage": ((METHOD, BUDGET), "number"),
        "_scale": ((), "number"),
    },
    SLOPES: {"": ((METHOD,), "number")},
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


def faults_of_contest(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with such an archive, for one line each."""
    yield from _faults_of_methods(tree)
    yield from _faults_of_reference(tree)
    outputs = tree.children[ESTIMATES].children if ESTIMATES in tree.children else {}
    if not outputs:
        yield f"no {ESTIMATES}"
    # What lies along each dimension, which is the same in all groups.
    entries = {
        name: tree.children[METHODS].dataset.coords[name].values.tolist()
        for name in (METHOD, BUDGET)
        if METHODS in tree.children and name in tree.children[METHODS].dataset.coords
    } | {VARIANT: [SINGLE, REPLICATED]}
    for output, estimates in outputs.items():
        if not estimates.data_vars:
            yield f"/{ESTIMATES}/{output}: no statistic"
        for statistic, array in estimates.data_vars.items():
            if not {"units", "display_units"} <= set(array.attrs):
                yield f"/{ESTIMATES}/{output}: no units of {statistic}"
            yield from _faults_of_statistic(tree, str(output), str(statistic), entries)
            yield from _faults_of_truth(tree, str(output), str(statistic))


def _faults_of_reference(tree: xr.DataTree) -> Iterator[str]:
    reference = tree.children.get(REFERENCE, xr.DataTree())
    for group in (MOMENTS, QUANTILES):
        if group not in reference.children:
            yield f"/{REFERENCE}: no {group}"
        elif "runs_used" not in reference.children[group].attrs:
            yield f"/{REFERENCE}/{group}: no runs_used"
    yield from (f"/{REFERENCE}{fault}" for fault in faults_of_reference(reference))


def _faults_of_methods(tree: xr.DataTree) -> Iterator[str]:
    if METHODS not in tree.children:
        yield f"no {METHODS}"
        return
    methods = tree.children[METHODS].dataset
    for name in ("repeats", "reference_runs"):
        if not isinstance(methods.attrs.get(name), int | np.integer):
            yield f"/{METHODS}: no number of {name.replace('_', ' ')}"
    noted = False
    for name, (dimensions, kind) in _OF_METHODS.items():
        if not _is_like(methods, name, dimensions, kind):
            yield f"/{METHODS}: no {name} along {', '.join(dimensions)}"
            noted = True
    if noted:
        return
    if ((methods["runs"] > 0) & (methods["replicates"] < 1)).any():
        yield f"/{METHODS}: runs without replicates"
    budgets = methods[BUDGET].values
    if not (budgets.size and methods[METHOD].size):
        yield f"/{METHODS}: no method that was given runs"
    elif budgets[0] < 1 or (budgets[1:] <= budgets[:-1]).any():
        yield f"/{METHODS}: numbers of runs that do not ascend from 1"


def _is_like(dataset: xr.Dataset, name: str, dimensions: tuple[str, ...], kind: str) -> bool:
    """Whether a dataset has a variable along these dimensions, of that kind."""
    held = dataset.variables.get(name)
    return held is not None and held.dims == dimensions and is_kind(held, kind)


def _faults_of_statistic(
    tree: xr.DataTree, output: str, statistic: str, known: dict[str, list[Any]]
) -> Iterator[str]:
    entries = (ENTRIES[statistic],) if statistic in ENTRIES else ()
    for group, variables in _OF_STATISTICS.items():
        outputs = tree.children[group].children if group in tree.children else {}
        held = outputs[output].dataset if output in outputs else xr.Dataset()
        for suffix, (dimensions, kind) in variables.items():
            bound = (BOUND,) if (group, suffix) in _BOUNDED else ()
            along = (*dimensions, *entries, *bound)
            name = f"{statistic}{suffix}"
            if not _is_like(held, name, along, kind):
                yield f"/{group}/{output}: no {name} along {', '.join(along) or 'nothing'}"
            elif not set(along) <= set(held.coords):
                yield f"/{group}/{output}: no coordinates of {name}"
            for dimension in {*along} & {*held.coords} & {METHOD, BUDGET, VARIANT, *entries}:
                found = held.coords[dimension].values.tolist()
                if known.setdefault(dimension, found) != found:
                    yield f"/{group}/{output}: another {dimension} than elsewhere"


def _faults_of_truth(tree: xr.DataTree, output: str, statistic: str) -> Iterator[str]:
    """Whether the reference has what the errors of a statistic are those of."""
    group, dimension = _IN_REFERENCE.get(statistic, MOMENTS), ENTRIES.get(statistic)
    name = output if dimension else f"{output}_{statistic}"
    reference = tree.children.get(REFERENCE, xr.DataTree()).children
    held = reference[group].dataset if group in reference else xr.Dataset()
    estimates = tree.children[ESTIMATES].children[output].dataset
    if name not in held:
        yield f"/{REFERENCE}/{group}: no {name}"
    elif dimension and held.sizes.get(f"{output}_{dimension}") != estimates.sizes.get(dimension):
        yield f"/{REFERENCE}/{group}: other entries of {name} than are estimated"
