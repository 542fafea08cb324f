"""Faults of runs, trajectories and levels, on which only figures depend.

Opening an archive checks the form of its statistics by the catalogue.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.layout import has_kind
from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import (
    INPUT,
    INTERVAL_LEVEL,
    MATRIX,
    ROLE,
    ROUND,
    RUN,
    RUNS,
    SAMPLING,
    TRAJECTORY,
)
from uqpen.core.sampling import Sampling
from uqpen.results.failure_tables import ASSOCIATIONS
from uqpen.results.source_statistics import SourceStatistics

__all__ = ["find_faults", "find_level_faults"]


def find_faults(tree: xr.DataTree) -> Iterator[str]:
    """Yield the faults in the groups of a model, a line each."""
    designs = {name: read_group(tree, RUNS, name) for name in group_names(tree, RUNS)}
    known = _variable_roles(next(iter(designs.values())))
    statistics = SourceStatistics(tree)
    for name, runs in designs.items():
        if _variable_roles(runs) != known:
            yield f"/{RUNS}/{name}: other inputs or outputs than elsewhere"
        if failures := statistics.failures(name).keys() - {"probability"}:
            for missing in (each for each in ASSOCIATIONS if each not in failures):
                yield f"{missing} of failed runs of {name}: not of numbers for each {INPUT}"
        yield from (f"/{RUNS}/{name}: {fault}" for fault in _run_faults(runs))
    yield from (f"/{TRAJECTORY}: {fault}" for fault in _trajectory_faults(tree, known))
    yield from find_level_faults(tree)


def _variable_roles(runs: xr.Dataset) -> dict[str, bool]:
    """Return the inputs and outputs, and whether each is an output."""
    roles = {str(name): v.attrs.get(ROLE) for name, v in runs.data_vars.items()}
    return {name: role == "output" for name, role in roles.items() if role in ("input", "output")}


def _run_faults(runs: xr.Dataset) -> Iterator[str]:
    for name, is_output in _variable_roles(runs).items():
        variable = runs[name]
        # The fields of runs have been checked when the archive was opened.
        lies_right = variable.dims[:1] == (RUN,) if is_output else variable.dims in ((), (RUN,))
        if not (lies_right and has_kind(variable, "number")):
            yield f"{name} is not of numbers along {RUN}"
        elif "flag_meanings" in variable.attrs and not _has_flags(variable):
            yield f"{name} does not define its categories"
    if runs.attrs.get(SAMPLING) == Sampling.PICK_FREEZE and MATRIX not in runs.variables:
        yield f"no {MATRIX} to distinguish its blocks"
    for name in (MATRIX, ROUND):
        if name in runs.variables and runs[name].dims != (RUN,):
            yield f"{name} does not lie along {RUN}"


def _has_flags(variable: xr.DataArray) -> bool:
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
        for name, variable in node.data_vars.items():
            level = variable.attrs.get(INTERVAL_LEVEL, 0.95)
            if np.ndim(level) or not has_kind(level, "number") or not 0 < level < 1:
                yield f"{node.path}/{name}: {INTERVAL_LEVEL} is no probability"
