"""Studies without a change since their archive was made."""

from __future__ import annotations

import tomllib

import xarray as xr

from uqpen.archive.files import FILES, archived_files, files_by_name
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.checkpoints.model_versions import compare_models
from uqpen.core.labels import DEPENDENCIES, RUNS
from uqpen.core.lookup import class_version
from uqpen.core.status import Status
from uqpen.execution import status_counts
from uqpen.study.fingerprint import point_classes
from uqpen.study.study import ValidatedStudy
from uqpen.study.user_defined_members import object_surrogates, user_defined_objects
from uqpen.workflow.root_attributes import level_attribute, root_attributes

__all__ = ["has_missing_runs", "is_unchanged"]


def is_unchanged(study: ValidatedStudy, tree: xr.DataTree) -> bool:
    """Check that a study would make the archive again that is there: text, files, versions.

    If that is not sure, as something comes from an installed package or is an object of a program,
    it is not unchanged.
    """
    expected = {**root_attributes(study), **level_attribute(study)}
    # Models are compared below, also by what only their runs have used.
    of_models = (*(key for key in expected if key.startswith("model_")), DEPENDENCIES)
    kept = {key: value for key, value in expected.items() if key not in of_models}
    if any(str(tree.attrs.get(key)) != str(value) for key, value in kept.items()):
        return False
    if not _is_identified(study):
        return False
    archived_models = model_trees(tree)
    if [*archived_models] != [*study.models]:
        return False
    comparisons = [compare_models(study, name, tree, name) for name in study.models]
    if any(each.changes or not each.is_same_limit for each in comparisons):
        return False
    # Some of these are opened or imported by a run alone.
    compared = {name for each in comparisons for name in each.same}
    loaded = files_by_name(study.files(), study.folder)
    files = {name: file.sha256 for name, file in loaded.items() if name not in compared}
    archived = archived_files(read_group(tree, FILES))
    return files == {file.name: file.sha256 for file in archived if file.name not in compared}


def has_missing_runs(tree: xr.DataTree) -> bool:
    """Check whether an archive has failed runs that another attempt might not lose."""
    return any(
        any(
            count and status > Status.INADMISSIBLE
            for status, count in status_counts(read_group(model, RUNS, design)).items()
        )
        for model in model_trees(tree).values()
        for design in group_names(model, RUNS)
    )


def _is_identified(study: ValidatedStudy) -> bool:
    """Check that an archive states the version of all that a study consists of."""
    if user_defined_objects(study.text) or object_surrogates(tomllib.loads(study.text)):
        return False
    classes = [cls for design in study.designs for _, cls in point_classes(study, design)]
    classes += map(type, study.surrogates.values())
    if any(class_version(cls) for cls in classes):
        return False
    return all(analysis.surroundings is not None for analysis in study.analyses)
