"""Runs of an archive that the one in its place does not have."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.files import FILES, archived_files, files_by_name
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.checkpoints.archived_runs import input_columns, unused_designs
from uqpen.checkpoints.model_versions import compare_models
from uqpen.checkpoints.point_index import PointIndex
from uqpen.core.arrays import Arrays
from uqpen.core.labels import RUNS, STATUS
from uqpen.core.model import Model
from uqpen.core.status import Status
from uqpen.study.fingerprint import POINT_TABLES
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.refinement.refined_design import RefinedDesign

__all__ = ["lacks_runs"]


def lacks_runs(study: ValidatedStudy, tree: xr.DataTree, earlier: xr.DataTree) -> bool:
    """Check whether an earlier archive has runs that the new one does not have.

    Only runs that are ok count: of the others, a study takes those that it would make.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    tree : DataTree
        Its archive.
    earlier : DataTree
        An archive without faults.
    """
    if _lacks_designs(study, earlier):
        return True
    for archived, group in model_trees(earlier).items():
        # A model that stands under several names has its runs under each of them.
        names = [
            name
            for name in study.models
            if not compare_models(study, name, earlier, archived).changes
        ]
        if not any(_has_runs(study.models[name].model, tree, name, group) for name in names):
            return True
    return False


def _lacks_designs(study: ValidatedStudy, earlier: xr.DataTree) -> bool:
    """Check whether a design without runs, or with very many, was another one."""
    unused = unused_designs(earlier)
    if not unused:
        return False
    before, now = tomllib.loads(str(earlier.attrs["study_text"])), tomllib.loads(study.text)
    if any(before.get(key) != now.get(key) for key in POINT_TABLES):
        return True
    known = {file.name: file.sha256 for file in archived_files(read_group(earlier, FILES))}
    return not all(_is_same_design(study, name, before, now, known) for name in unused)


def _is_same_design(
    study: ValidatedStudy,
    name: str,
    before: Mapping[str, Any],
    now: Mapping[str, Any],
    known: Mapping[str, str],
) -> bool:
    """Check that a study has a design of an earlier one, whose files are given by their hashes."""
    if name not in study.designs or before["designs"][name] != now["designs"][name]:
        return False
    # These place the points of a refinement.
    tables = ("surrogates", "outputs") if isinstance(study.designs[name], RefinedDesign) else ()
    if any(before.get(key) != now.get(key) for key in tables):
        return False
    files = files_by_name([*study.joint.files, *study.design_files(name)], study.folder)
    return all(known.get(file) == snapshot.sha256 for file, snapshot in files.items())


def _has_runs(model: Model, tree: xr.DataTree, name: str, earlier: xr.DataTree) -> bool:
    """Check that the group of a model in an archive has all runs of an earlier group."""
    new = model_trees(tree)[name]
    own = [*_ok_inputs(new, model)]
    for inputs in _ok_inputs(earlier, model):
        same = [each for each in own if each.keys() == inputs.keys()]
        known = {key: np.concatenate([each[key] for each in same]) for key in inputs if same}
        runs = len(next(iter(inputs.values())))
        if runs and not (known and (PointIndex(known).find(inputs, 0, runs) >= 0).all()):
            return False
    return True


def _ok_inputs(group: xr.DataTree, model: Model) -> Iterator[Arrays]:
    """Yield the inputs of the runs that are ok, design by design, as far as they are at hand."""
    unused = unused_designs(group)
    for design in group_names(group, RUNS):
        if design not in unused:
            runs = read_group(group, RUNS, design)
            is_ok = runs[STATUS].values == Status.OK
            columns = input_columns(runs, model)
            yield {key: values[is_ok] for key, values in columns.items()}
