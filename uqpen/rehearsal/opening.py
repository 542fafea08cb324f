"""Open what is to be rehearsed: a study with its archive, or an archive alone."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from uqpen.archive.read import group_names, model_trees, open_archive, read_group
from uqpen.core.errors import ArchiveError, ModelError, UnknownNameError
from uqpen.core.labels import RUNS, SURROGATES
from uqpen.core.lookup import choices
from uqpen.rehearsal.rehearsed_study import RehearsedStudy
from uqpen.study.load import load_study
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.archived_surrogate import restore_surrogate, surrogate_paths
from uqpen.surrogates.diagnostics import refuted_outputs
from uqpen.verification.archived_study import restored_study

__all__ = ["open_rehearsed"]


@contextlib.contextmanager
def open_rehearsed(
    file: Path,
    *,
    archive: Path | None = None,
    surrogate: str = "",
    folder: Path | None = None,
    trust: bool = False,
) -> Iterator[RehearsedStudy]:
    """Provide a study with its surrogate in place of its model.

    Parameters
    ----------
    file : Path
        A study file, or an archive.
    archive : Path, optional
        The archive of a study file, by default the one that ``uqpen study`` writes.
    surrogate : str
        As in `surrogate_paths`; may be empty for the only one.
    folder, trust
        As for `restored_study`, of an archive alone.

    Raises
    ------
    ArchiveError
        If the study has no archive yet, or has changed since.
    UnknownNameError
        If the archive has no such surrogate, or several and no name is given.
    ModelError
        If the inputs or designs follow from code that may not be executed.
    """
    if file.suffix == ".nc":
        tree = open_archive(file)
        label = _label(tree, file, surrogate)
        with restored_study(tree, folder, trust=trust) as restored:
            yield _rehearsed(restored.study, tree, label)
        return
    study = load_study(file)
    path = archive or Path("archives") / f"{study.name}.nc"
    if not path.exists():
        raise ArchiveError(f"{path}: is not there; to make it: uqpen study {file}")
    tree = open_archive(path)
    label = _label(tree, path, surrogate)
    if tree.attrs.get("study_sha256") != study.sha256:
        raise ArchiveError(
            f"{path}: is of another study than {file}; to make it: uqpen study {file}"
        )
    yield _rehearsed(study, tree, label)


def _label(tree: xr.DataTree, path: Path, surrogate: str) -> str:
    """Return the label of the surrogate that is meant."""
    paths = surrogate_paths(tree)
    if not paths:
        raise UnknownNameError(
            f"{path}: contains no surrogate to rehearse on; [surrogates] of a study has them"
        )
    if not surrogate and len(paths) > 1:
        raise UnknownNameError(f"--surrogate: expected one of {', '.join(paths)}")
    label = surrogate or next(iter(paths))
    if label not in paths:
        raise UnknownNameError(f'no surrogate "{label}"; {choices(label, paths)}')
    return label


def _rehearsed(study: ValidatedStudy, tree: xr.DataTree, label: str) -> RehearsedStudy:
    """Restore a surrogate, and put it in place of its model."""
    if unloaded := study.unloaded_members:
        raise ModelError(
            f"the study draws its points by code that the archive names: {', '.join(unloaded)}\n"
            "  if you trust whoever made it, say --trust"
        )
    model, name = surrogate_paths(tree)[label]
    model_tree = model_trees(tree)[model]
    settings = study.surrogates[name]
    is_loaded = name in study.surrogate_origins and not settings.absence
    group = model_tree.children[SURROGATES].children[name]
    fitted = restore_surrogate(
        group,
        label,
        study.models[model].model,
        loaded=type(settings) if is_loaded else None,
    )
    designs = group_names(model_tree, RUNS)
    runs = {design: read_group(model_tree, RUNS, design) for design in designs}
    return RehearsedStudy(study, model, fitted, runs, refuted_outputs(group))
