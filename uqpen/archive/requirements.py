"""Faults in what one part of an archive says of another: runs, trajectories, surrogates, levels.

The hashes of an archive do not show them, since whoever edits it can hash anew. Opening it checks
the form of its statistics by the catalogue besides.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.estimates import statistic_names
from uqpen.archive.layout import has_kind
from uqpen.archive.tree import group_names, read_group
from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.blocks import is_true_by_blocks
from uqpen.core.labels import (
    ABSENT,
    FAILURES_GROUP,
    INPUT,
    INTERVAL_LEVEL,
    MATRIX,
    ROLE,
    ROUND,
    RUN,
    RUNS,
    SAMPLING,
    SOURCE_KIND,
    STATISTICS_GROUP,
    STATUS,
    SURROGATES,
    TRAJECTORY,
)
from uqpen.core.sampling import Sampling
from uqpen.core.statistic_dimensions import PROBABILITY
from uqpen.core.status import Status

__all__ = ["find_level_faults", "find_model_faults"]

# Statistics of the inputs of failed runs, which tables show together.
_ASSOCIATIONS = ("larger", "further_out")
# A surrogate that no independent runs check says so by this.
_NO_CHECK = "none"


def find_model_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the faults in the groups of a model, a line each."""
    designs = {name: read_group(tree, RUNS, name) for name in group_names(tree, RUNS)}
    known = _variable_roles(next(iter(designs.values()), xr.Dataset()))
    inputs = {name for name, is_output in known.items() if not is_output}
    for name, runs in designs.items():
        if _variable_roles(runs) != known:
            yield f"/{RUNS}/{name}: other inputs or outputs than elsewhere"
        failures = read_group(tree, FAILURES_GROUP, name)
        if names := set(statistic_names(failures)) - {PROBABILITY}:
            for missing in (each for each in _ASSOCIATIONS if each not in names):
                yield f"{missing} of failed runs of {name}: not of numbers for each {INPUT}"
        for fault in _input_faults(failures, inputs):
            yield f"/{FAILURES_GROUP}/{name}: {fault}"
        yield from (f"/{RUNS}/{name}: {fault}" for fault in _run_faults(runs))
    yield from (f"/{TRAJECTORY}: {fault}" for fault in _trajectory_faults(tree, known))
    yield from _surrogate_faults(tree, known)
    yield from _source_faults(tree, known)


def _surrogate_faults(tree: xr.DataTree, known: dict[str, bool]) -> Iterator[str]:
    """Find surrogates of runs or outputs that the archive does not have."""
    designs = group_names(tree, RUNS)
    for name in group_names(tree, SURROGATES):
        attributes = tree.children[SURROGATES].children[name].attrs
        if attributes.get("design") not in designs:
            yield f"/{SURROGATES}/{name}: fitted to runs of no design"
        if attributes.get("check") not in (*designs, _NO_CHECK):
            yield f"/{SURROGATES}/{name}: checked by runs of no design"
        for output in str(attributes.get("outputs", "")).split():
            if not known.get(output):
                yield f"/{SURROGATES}/{name}: of {output}, which is no output of the runs"


def _source_faults(tree: xr.DataTree, known: dict[str, bool]) -> Iterator[str]:
    """Find statistics of runs, surrogates, outputs or inputs that the archive does not have."""
    inputs = {name for name, is_output in known.items() if not is_output}
    groups = {"design": RUNS, "surrogate": SURROGATES}
    sources = group_names(tree, STATISTICS_GROUP)
    for group in groups.values():
        for name in group_names(tree, group):
            if name not in sources:
                yield f"/{group}/{name}: without a group of statistics"
    for source in sources:
        node = tree.children[STATISTICS_GROUP].children[source]
        place = f"/{STATISTICS_GROUP}/{source}"
        origin = groups.get(str(node.attrs.get(SOURCE_KIND)))
        if origin is not None and source not in group_names(tree, origin):
            yield f"{place}: of what /{origin} does not have"
        for output in node.children:
            if not known.get(str(output)):
                yield f"{place}: of {output}, which is no output of the runs"
            for fault in _input_faults(read_group(node, str(output)), inputs):
                yield f"{place}/{output}: {fault}"


def _input_faults(dataset: xr.Dataset, inputs: set[str]) -> Iterator[str]:
    """Find entries of statistics that are of no input."""
    entries = dataset.coords[INPUT].values.tolist() if INPUT in dataset.coords else []
    for entry in entries if isinstance(entries, list) else [entries]:
        if entry not in inputs:
            yield f"of {entry}, which is no input of the runs"


def _variable_roles(runs: xr.Dataset) -> dict[str, bool]:
    """Return the inputs and outputs, and whether each is an output."""
    roles = {str(name): runs.variables[name].attrs.get(ROLE) for name in runs.data_vars}
    return {name: role == "output" for name, role in roles.items() if role in ("input", "output")}


def _run_faults(runs: xr.Dataset) -> Iterator[str]:
    for name, is_output in _variable_roles(runs).items():
        variable = runs.variables[name]
        # The dimensions of fields have been checked by the structure of the archive.
        lies_right = variable.dims[:1] == (RUN,) if is_output else variable.dims in ((), (RUN,))
        if not (lies_right and has_kind(variable, "number")):
            yield f"{name} is not of numbers along {RUN}"
        elif "flag_meanings" in variable.attrs and not _has_flags(variable):
            yield f"{name} does not define its categories"
        elif is_output and not _is_finite(variable, runs.variables[STATUS]):
            yield f"{name} of a completed run is not finite"
    if runs.attrs.get(SAMPLING) == Sampling.PICK_FREEZE and MATRIX not in runs.variables:
        yield f"no {MATRIX} to distinguish its blocks"
    for name in (MATRIX, ROUND):
        if name in runs.variables and runs.variables[name].dims != (RUN,):
            yield f"{name} does not lie along {RUN}"


def _is_finite(variable: xr.Variable, status: xr.Variable) -> bool:
    # A curve may end before its dimension does; it is NaN from there.
    # A derived number may be one that some runs do not have; it is NaN in them, too.
    may_be_nan = variable.ndim == 2 or ABSENT in variable.attrs

    def is_finite(values: FloatArray, statuses: IntArray) -> bool:
        completed = np.asarray(values, dtype=np.float64)[statuses == Status.OK]
        return bool((np.isfinite(completed) | (may_be_nan & np.isnan(completed))).all())

    return is_true_by_blocks(is_finite, variable, status)


def _has_flags(variable: xr.Variable) -> bool:
    words = str(variable.attrs["flag_meanings"]).split()
    labels = np.atleast_1d(variable.attrs.get("flag_labels", words))
    return np.size(variable.attrs.get("flag_values", ())) == len(words) == len(labels)


def _trajectory_faults(tree: xr.DataTree, known: dict[str, bool]) -> Iterator[str]:
    trajectory = read_group(tree, TRAJECTORY)
    if not trajectory:
        return
    dimensions = [str(name) for name in trajectory.dims]
    if len(dimensions) != 1 or dimensions[0] not in trajectory.coords or dimensions[0] not in known:
        yield "does not lie along an output"
        return
    for name, variable in trajectory.variables.items():
        if variable.dims != (dimensions[0],) or not has_kind(variable.values, "number"):
            yield f"{name} is not of numbers along {dimensions[0]}"
    for name, value in trajectory.attrs.items():
        if str(name).startswith("nominal_") and not (
            np.ndim(value) == 0 and has_kind(value, "number")
        ):
            yield f"{name} is not a number"


def find_level_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the intervals whose level is no probability, a line each."""
    for node in tree.subtree:
        for name, variable in node.to_dataset(inherit=False).variables.items():
            if INTERVAL_LEVEL not in variable.attrs:
                continue
            level = variable.attrs[INTERVAL_LEVEL]
            if np.ndim(level) or not has_kind(level, "number") or not 0 < level < 1:
                yield f"{node.path}/{name}: {INTERVAL_LEVEL} is no probability"
