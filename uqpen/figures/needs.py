"""What an archive must hold beyond what tables go by, for figures to be drawn of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.analyses.where_lost import LOSSES
from uqpen.archive.layout import is_kind
from uqpen.archive.read import group, names_in
from uqpen.labels import (
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

__all__ = ["faults", "faults_of_levels"]


def faults(tree: xr.DataTree) -> Iterator[str]:
    """What is wrong with what is told of a model, a line each."""
    designs = {name: group(tree, RUNS, name) for name in names_in(tree, RUNS)}
    known = _described(next(iter(designs.values())))
    for name, runs in designs.items():
        if _described(runs) != known:
            yield f"/{RUNS}/{name}: other inputs or outputs than elsewhere"
        yield from (f"/{RUNS}/{name}: {fault}" for fault in _faults_of_runs(runs))
    outputs = [name for name, is_output in known.items() if is_output]
    for kind, check in (
        (CDFS, _faults_of_cdfs),
        (EXCEEDANCE, _faults_of_exceedance),
        (LOSSES, _faults_of_losses),
        (SENSITIVITY, _faults_of_sensitivity),
    ):
        for name in names_in(tree, kind):
            told = group(tree, kind, name)
            is_design = name in designs
            yield from (f"/{kind}/{name}: {fault}" for fault in check(told, outputs, is_design))
    yield from (f"/{TRAJECTORY}: {fault}" for fault in _faults_of_course(tree, known))
    yield from faults_of_levels(tree)


def _described(runs: xr.Dataset) -> dict[str, bool]:
    """The inputs and outputs, and which they are."""
    roles = {str(name): v.attrs.get(ROLE) for name, v in runs.data_vars.items()}
    return {name: role == "output" for name, role in roles.items() if role in ("input", "output")}


def _faults_of_runs(runs: xr.Dataset) -> Iterator[str]:
    for name, is_output in _described(runs).items():
        variable = runs[name]
        lies_right = variable.dims == (RUN,) or (not variable.dims and not is_output)
        if not (lies_right and is_kind(variable, "number")):
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


def _faults_of_cdfs(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    for name in (output for output in outputs if output in told):
        for suffix, along in (("", (RANK,)), ("_band", (RANK, BOUND))):
            if not _is_of(told, f"{name}{suffix}", along):
                yield f"{name}{suffix} is not of numbers along {', '.join(along)}"


def _faults_of_exceedance(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    for name in (output for output in outputs if output in told):
        if not _is_of(told, f"{name}_threshold_value", (f"{name}_threshold",)):
            yield f"no {name}_threshold_value for each entry"


def _faults_of_losses(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    if INPUT not in told.coords:
        yield f"no {INPUT} to tell its entries apart"
    for name in ("larger", "further_out"):
        if not _is_of(told, name, (INPUT, BOUND)) or told.sizes[BOUND] != len(BOUNDS):
            yield f"{name} is not of figures along {INPUT}, {BOUND}"


def _faults_of_sensitivity(told: xr.Dataset, outputs: list[str], is_design: bool) -> Iterator[str]:
    if is_design and "runs" not in told.attrs:
        yield "does not say of how many runs"


def _faults_of_course(tree: xr.DataTree, known: dict[str, bool]) -> Iterator[str]:
    course = group(tree, TRAJECTORY)
    if not course:
        return
    dimensions = [str(name) for name in course.dims]
    if len(dimensions) != 1 or dimensions[0] not in course.coords or dimensions[0] not in known:
        yield "does not lie along an output"
        return
    for name, variable in course.variables.items():
        if variable.dims != (dimensions[0],) or not is_kind(variable.values, "number"):
            yield f"{name} is not of numbers along {dimensions[0]}"
    for name, value in course.attrs.items():
        if str(name).startswith("nominal_") and not (
            np.ndim(value) == 0 and is_kind(value, "number")
        ):
            yield f"{name} is no number"


def faults_of_levels(tree: xr.DataTree) -> Iterator[str]:
    """Intervals whose level is no probability, a line each."""
    for node in tree.subtree:
        for name, variable in node.data_vars.items():
            level = variable.attrs.get(INTERVAL_LEVEL, 0.95)
            if np.ndim(level) or not is_kind(level, "number") or not 0 < level < 1:
                yield f"{node.path}/{name}: {INTERVAL_LEVEL} is no probability"


def _is_of(told: xr.Dataset, name: str, along: tuple[str, ...]) -> bool:
    return name in told and told[name].dims == along and is_kind(told[name], "number")
