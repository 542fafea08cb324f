"""What becomes of the runs of an archive that is made again with other designs or another model."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.files import FILES, archived_files, files_by_name
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.checkpoints.identity import compare_models
from uqpen.checkpoints.sources import (
    PointIndex,
    RunFinder,
    first_points,
    input_columns,
    unused_designs,
)
from uqpen.core.arrays import Arrays
from uqpen.core.errors import StudyError
from uqpen.core.labels import RUN, RUNS, STATUS
from uqpen.core.model import Model
from uqpen.core.status import Status
from uqpen.designs.design import Design, Extension, UnloadedDesign
from uqpen.study.designs_section import read_designs
from uqpen.study.document import parse_document
from uqpen.study.identity import POINT_TABLES
from uqpen.study.study import ValidatedStudy
from uqpen.study.table_reader import TableReader
from uqpen.surrogates.refinement import RefinedDesign

__all__ = ["lacks_runs", "runs_not_kept", "unusable_runs"]

# Where one of these has changed, the points or the model have, whatever the designs are.
_DECISIVE = ("seed", "model", "models", "inputs", "joint", "dependence", "constraints")


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


def runs_not_kept(study: ValidatedStudy, archive: xr.DataTree) -> dict[str, str]:
    """Return what becomes of the runs of an archive that the designs of a study do not keep.

    Each text has the number of runs, and the settings nearest to the study's that keep them. Of
    a study with another model, other inputs or another seed there is none.

    Parameters
    ----------
    study : ValidatedStudy
        The study that is going to replace the archive.
    archive : DataTree
        An archive without faults.

    Returns
    -------
    dict of str to str
        By the name of a design.
    """
    try:
        document = parse_document(str(archive.attrs.get("study_text", "")), study.name)
    except StudyError:
        return {}
    before, now = document.content, tomllib.loads(study.text)
    if any(before.get(key) != now.get(key) for key in _DECISIVE):
        return {}
    # Without trust, no code that the archive names is executed.
    table = TableReader(document, study.folder, trust=False, content=before).table("designs")
    designs, _ = read_designs(table)
    first = next(iter(model_trees(archive).values()))
    found = {}
    for name, settings in table.content.items():
        runs = read_group(first, RUNS, name).sizes.get(RUN, 0)
        table_now = now.get("designs", {}).get(name)
        text = _use_text(study, name, settings, table_now, designs.get(name), runs)
        if runs and text:
            found[name] = text
    return found


def _use_text(
    study: ValidatedStudy,
    name: str,
    before: dict[str, Any],
    now: dict[str, Any] | None,
    earlier: Design | None,
    runs: int,
) -> str:
    """Return what becomes of the runs of a design, given its tables; empty if all are kept."""
    if before == now:
        return ""
    if now is None:
        return f"its {runs} earlier runs are not used: the study has no design of this name"
    if before.get("kind") != now.get("kind"):
        return f"its {runs} earlier runs are not used: it is of another kind"
    design = study.designs[name]
    if earlier is None or isinstance(earlier, UnloadedDesign):
        return Extension(None).text(runs, design.run_count(study.joint))
    # A design that redraws points has made more runs than its settings say, one that stops fewer.
    settled = min(runs, earlier.run_count(study.joint))
    return design.extension(earlier, study.joint).text(settled, design.run_count(study.joint))


def unusable_runs(
    study: ValidatedStudy,
    finder: RunFinder,
    known: Collection[str],
) -> dict[str, str]:
    """Return a text for each changed design of whose finished runs none is at its first points.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    finder : RunFinder
        The runs that the study may take.
    known : collection of str
        Names of designs that are left out.

    Returns
    -------
    dict of str to str
        By the name of a design.
    """
    texts = {}
    for name in study.designs:
        for model, found in finder.sources.items():
            runs = sum(len(each.runs.runs) for each in found if each.changed_design == name)
            if not runs or name in known:
                continue
            if not finder.used_places(model, first_points(study, name, model)):
                texts[name] = f"none of its {runs} earlier runs is at a point of the changed design"
    return texts
