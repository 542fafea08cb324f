"""Runs of an archive as a source of finished runs for another study."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.content import group_hashes, recorded_hashes
from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import group_names, model_trees, read_group, read_tree
from uqpen.archive.structure import find_faults
from uqpen.checkpoints.identity import ModelComparison, compare_models
from uqpen.checkpoints.parts import FinishedRuns, select_results
from uqpen.checkpoints.sources import RunSource
from uqpen.core.arrays import FloatArray
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import (
    FAILED_RUN,
    FAILURE_REASON,
    KIND,
    NOT_MADE_AGAIN,
    REUSED_RUNS,
    ROUND,
    RUN,
    RUNS,
    STATUS,
)
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.model import Model, Output, Results
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK
from uqpen.execution.omitted_runs import are_omitted
from uqpen.study.fingerprint import is_user_defined
from uqpen.study.study import ValidatedStudy

__all__ = ["ArchivedSources", "archived_sources", "input_columns", "open_intact", "unused_designs"]


class ArchivedSources(NamedTuple):
    """Runs of an archive that a model may take, or the reasons why it may take none."""

    sources: tuple[RunSource, ...]
    changes: tuple[str, ...] = ()


def open_intact(path: Path) -> xr.DataTree:
    """Read the archive of a study whose groups are those that were written.

    Raises
    ------
    ArchiveError
        If it cannot be read, has been changed, or is no archive of a study.
    """
    tree = read_tree(path)
    if recorded_hashes(tree) != group_hashes(tree):
        raise ArchiveError(f"{path}: has been changed since it was written")
    if fault := next(find_faults(tree), None):
        raise ArchiveError(f"{path}: is damaged: {fault}")
    try:
        tomllib.loads(str(tree.attrs["study_text"]))
    except ValueError as error:
        raise ArchiveError(f"{path}: is damaged: the text of its study: {error}") from None
    if KIND in tree.attrs:
        raise ArchiveError(f"{path}: is the archive of a benchmark, which has no runs of a study")
    return tree


def unused_designs(tree: xr.DataTree) -> dict[str, str]:
    """Return the designs whose runs no study takes from an archive, each with the reason."""
    found = {}
    for model in model_trees(tree).values():
        for design in group_names(model, RUNS):
            runs = read_group(model, RUNS, design)
            if are_omitted(runs):
                found[design] = "the archive has only their statistics"
            elif runs.sizes[RUN] > RUNS_IN_MEMORY:
                found[design] = f"it has more than {RUNS_IN_MEMORY} runs"
    return found


def archived_sources(
    study: ValidatedStudy, name: str, tree: xr.DataTree, place: str, *, first_blocks: bool = False
) -> ArchivedSources:
    """Return the runs of an archive that are runs of a model.

    Of a design with very many runs there is none, or the first block only.

    Parameters
    ----------
    study, name
        The study, and the name of its model.
    tree : DataTree
        The result of `open_intact`.
    place : str
        The name of the archive, for display.
    first_blocks : bool
        Whether designs with very many runs have their first block.
    """
    names = list(model_trees(tree))
    # The model of the same name first: its changes are told if there is no other.
    names.sort(key=lambda each: each != name)
    comparisons = {each: compare_models(study, name, tree, each) for each in names}
    found = tuple(
        source
        for archived, comparison in comparisons.items()
        if not comparison.changes
        for source in _sources(study, name, tree, archived, comparison, place, first_blocks)
    )
    return ArchivedSources(found, () if found else comparisons[names[0]].changes)


def _sources(
    study: ValidatedStudy,
    name: str,
    tree: xr.DataTree,
    archived_name: str,
    comparison: ModelComparison,
    place: str,
    first_blocks: bool,
) -> Iterator[RunSource]:
    model = study.models[name].model
    left_out = [] if comparison.is_same_limit else [Status.TIMED_OUT]
    left_out += [] if comparison.is_same_domain else [Status.INADMISSIBLE]
    here = {**provenance(), **(of_python_functions() if is_user_defined(model) else {})}
    then = {key: value for key, value in tree.attrs.items() if key in here}
    others = ", ".join(f"{what} {value}" for what, value, _ in provenance_differences(then, here))
    made_with = [f"runs made with {others}"] if others else []
    group = model_trees(tree)[archived_name]
    changed = _changed_designs(study, tree)
    for design in group_names(group, RUNS):
        archived = read_group(group, RUNS, design)
        is_whole = archived.sizes[RUN] <= RUNS_IN_MEMORY
        if not is_whole:
            if not first_blocks:
                continue  # they are found by their inputs, for which all have to be in memory
            archived = archived.isel({RUN: slice(BLOCK)})
        for runs in _rounds(archived, model, comparison.dependencies):
            source = RunSource(
                place,
                runs,
                is_complete=is_whole,
                made_with=(*made_with, *_inherited(tree, archived_name, design)),
                changed_design=design if design in changed else "",
                design=design,
            ).without_statuses(left_out)
            if source is not None:
                yield source


def _inherited(tree: xr.DataTree, model: str, design: str) -> Iterator[str]:
    """Yield what an archive says of runs of a design that it has taken from others."""
    label = f"{model}: {design}: " if model else f"{design}: "
    for line in str(tree.attrs.get(REUSED_RUNS, "")).split("\n"):
        # Whether they are made again is decided wherever they are taken.
        if line.startswith(label) and not line.endswith(NOT_MADE_AGAIN):
            yield line.removeprefix(label)


def _changed_designs(study: ValidatedStudy, tree: xr.DataTree) -> set[str]:
    """Return the names of the designs that the archive's study has with other settings."""
    texts = str(tree.attrs["study_text"]), study.text
    before, now = (tomllib.loads(text).get("designs", {}) for text in texts)
    return {name for name in before.keys() & now.keys() if before[name] != now[name]}


def _rounds(runs: xr.Dataset, model: Model, dependencies: frozenset[str]) -> Iterator[FinishedRuns]:
    """Yield the runs of each round of a design; none if a variable is not as the model has it."""
    inputs = input_columns(runs, model)
    if not all(_has_output(runs, output) for output in model.outputs):
        return
    outputs = {output.name: _values(runs, output) for output in model.outputs}
    status = runs[STATUS].values.astype(np.int8)
    reasons = dict.fromkeys(np.flatnonzero(status != Status.OK).tolist(), "no reason was recorded")
    if FAILED_RUN in runs:
        failed = zip(runs[FAILED_RUN].values.tolist(), runs[FAILURE_REASON].values, strict=True)
        reasons |= {run: str(reason) for run, reason in failed if run in reasons}
    whole = Results(outputs, status, reasons, dependencies)
    if ROUND not in runs:
        if runs.sizes[RUN]:
            yield FinishedRuns(np.arange(runs.sizes[RUN]), inputs, whole)
        return
    number = runs[ROUND].values
    for each in np.unique(number):
        at = np.flatnonzero(number == each)
        own = {name: values[at] for name, values in inputs.items()}
        yield FinishedRuns(np.arange(len(at)), own, select_results(whole, at))


def input_columns(runs: xr.Dataset, model: Model) -> dict[str, FloatArray]:
    """Return the inputs of a model that archived runs have, each a value a run."""
    size = runs.sizes[RUN]
    return {
        variable.name: np.broadcast_to(runs.variables[variable.name].values, size)
        for variable in model.inputs
        if variable.name in runs
    }


def _has_output(runs: xr.Dataset, output: Output) -> bool:
    """Check that runs have an output along the dimensions and coordinates of the model's."""
    if output.name not in runs:
        return False
    if runs[output.name].dims != (RUN, *(dim.name for dim in output.dims)):
        return False
    return all(np.array_equal(runs[dim.name].values, dim.values) for dim in output.dims)


def _values(runs: xr.Dataset, output: Output) -> FloatArray:
    """Return the values of an output as a model returns them."""
    values = runs[output.name].values.astype(np.float64, copy=False)
    # A failed run has a category of its own there.
    return np.where(values < 0, np.nan, values) if output.categories else values
