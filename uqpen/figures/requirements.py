"""What an archive must hold beyond what tables go by, for figures to be drawn of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.layout import has_kind
from uqpen.archive.read import group_names, read_group
from uqpen.core.labels import (
    BOUND,
    BOUNDS,
    CDFS,
    EXCEEDANCE,
    INPUT,
    INTERVAL_LEVEL,
    MATRIX,
    RANK,
    ROLE,
    ROUND,
    RUN,
    RUNS,
    SAMPLING,
    SENSITIVITY,
    TRAJECTORY,
    Sampling,
)
from uqpen.statistics.failure_analysis import FAILURES

__all__ = ["find_faults", "find_level_faults"]


def find_faults(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with what is told of a model, a line each."""
    designs = {name: read_group(tree, RUNS, name) for name in group_names(tree, RUNS)}
    known = _variable_roles(next(iter(designs.values())))
    for name, runs in designs.items():
        if _variable_roles(runs) != known:
            yield f"/{RUNS}/{name}: other inputs or outputs than elsewhere"
        yield from (f"/{RUNS}/{name}: {fault}" for fault in _run_faults(runs))
    outputs = [name for name, is_output in known.items() if is_output]
    for kind, check in (
        (CDFS, _cdf_faults),
        (EXCEEDANCE, _exceedance_faults),
        (FAILURES, _failure_faults),
        (SENSITIVITY, _sensitivity_faults),
    ):
        for name in group_names(tree, kind):
            dataset = read_group(tree, kind, name)
            is_design = name in designs
            yield from (f"/{kind}/{name}: {fault}" for fault in check(dataset, outputs, is_design))
    yield from (f"/{TRAJECTORY}: {fault}" for fault in _trajectory_faults(tree, known))
    yield from find_level_faults(tree)


def _variable_roles(runs: xr.Dataset) -> dict[str, bool]:
    """The inputs and outputs, and which they are."""
    roles = {str(name): v.attrs.get(ROLE) for name, v in runs.data_vars.items()}
    return {name: role == "output" for name, role in roles.items() if role in ("input", "output")}


def _run_faults(runs: xr.Dataset) -> Iterator[str]:
    for name, is_output in _variable_roles(runs).items():
        variable = runs[name]
        lies_right = variable.dims == (RUN,) or (not variable.dims and not is_output)
        if not (lies_right and has_kind(variable, "number")):
            yield f"{name} is not of numbers along {RUN}"
        elif "flag_meanings" in variable.attrs and not _has_flags(variable):
            yield f"{name} does not tell its kinds"
    if runs.attrs.get(SAMPLING) == Sampling.PICK_FREEZE and MATRIX not in runs.variables:
        yield f"no {MATRIX} to tell its blocks apart"
    for name in (MATRIX, ROUND):
        if name in runs.variables and runs[name].dims != (RUN,):
            yield f"{name} does not lie along {RUN}"


def _has_flags(variable: xr.DataArray) -> bool:
    words = str(variable.attrs["flag_meanings"]).split()
    labels = np.atleast_1d(variable.attrs.get("flag_labels", words))
    return np.size(variable.attrs.get("flag_values", ())) == len(words) == len(labels)


def _cdf_faults(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    for name in (output for output in outputs if output in told):
        for suffix, along in (("", (RANK,)), ("_band", (RANK, BOUND))):
            if not _has_variable(told, f"{name}{suffix}", along):
                yield f"{name}{suffix} is not of numbers along {', '.join(along)}"


def _exceedance_faults(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    for name in (output for output in outputs if output in told):
        if not _has_variable(told, f"{name}_threshold_value", (f"{name}_threshold",)):
            yield f"no {name}_threshold_value for each entry"


def _failure_faults(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    if INPUT not in told.coords:
        yield f"no {INPUT} to tell its entries apart"
    for name in ("larger", "further_out"):
        if not _has_variable(told, name, (INPUT, BOUND)) or told.sizes[BOUND] != len(BOUNDS):
            yield f"{name} is not of figures along {INPUT}, {BOUND}"


def _sensitivity_faults(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    if is_design and "runs" not in told.attrs:
        yield "does not say of how many runs"


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
            yield f"{name} is no number"


def find_level_faults(tree: xr.DataTree) -> Iterator[str]:
    """Intervals whose level is no probability, a line each."""
    for node in tree.subtree:
        for name, variable in node.data_vars.items():
            level = variable.attrs.get(INTERVAL_LEVEL, 0.95)
            if np.ndim(level) or not has_kind(level, "number") or not 0 < level < 1:
                yield f"{node.path}/{name}: {INTERVAL_LEVEL} is no probability"


def _has_variable(told: xr.Dataset, name: str, along: tuple[str, ...]) -> bool:
    return name in told and told[name].dims == along and has_kind(told[name], "number")
