"""Versions of a model: that of an archive beside that of a study."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any, NamedTuple

import xarray as xr

from uqpen.archive.files import FILES, ArchivedFile, archived_files, files_by_name
from uqpen.archive.read import model_trees, read_group
from uqpen.checkpoints.earlier_runs import depends_on_batch
from uqpen.checkpoints.fingerprint_file import fingerprint_changes
from uqpen.core.errors import ArchiveError
from uqpen.core.model import Model
from uqpen.models.python_function import PythonFunction
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.study.fingerprint import flatten_tables
from uqpen.study.study import ValidatedStudy

__all__ = ["ModelComparison", "compare_models"]

_SOURCE, _VERSION = "source_sha256", "version"


class ModelComparison(NamedTuple):
    """Comparison of the model of an archive with that of a study.

    Attributes
    ----------
    changes : tuple of str
        What has changed, in words; empty if both would make the same runs.
    imported : frozenset of str
        The files that the archive's runs have imported, as in `Results.files`.
    is_same_limit : bool
        True if both have the same limit on the time of a run.
    is_same_domain : bool
        True if both studies have the same constraints.
    """

    changes: tuple[str, ...]
    imported: frozenset[str] = frozenset()
    is_same_limit: bool = True
    is_same_domain: bool = True


def compare_models(
    study: ValidatedStudy, name: str, tree: xr.DataTree, archived_name: str
) -> ModelComparison:
    """Compare a model of an archive with one of a study; nothing of the archive is executed.

    The files of the archive are compared with those on the disk, also those that its runs have
    imported.

    Parameters
    ----------
    study, name
        The study, and the name of its model.
    tree, archived_name
        The archive, and the name of its model.
    """
    model = study.models[name].model
    if reason := _unknown_version(model):
        return ModelComparison((reason,))
    texts = tomllib.loads(str(tree.attrs["study_text"])), tomllib.loads(study.text)
    files = {file.name: file for file in archived_files(read_group(tree, FILES))}
    own = files_by_name(model.files(), study.folder)
    then, now = _archived_identity(tree, archived_name), model.identity()
    imports = _find_imports(study, model, files, then.get(_SOURCE, ""))
    changed = list(
        fingerprint_changes(
            {
                **_table(texts[0], archived_name),
                **_versions(then, model),
                **{f"file {file}": files[file].sha256 for file in own if file in files},
            },
            {
                **_table(texts[1], name),
                **_versions(now, model),
                **{f"file {file}": snapshot.sha256 for file, snapshot in own.items()},
            },
        )
    )
    domain = [change.text for change in fingerprint_changes(*map(_constraints, texts))]
    changes = [change.text for change in changed if not change.is_limit]
    changes += domain if depends_on_batch(model) else []
    if imports is None and not changes:
        changes.append(f"model {_SOURCE} has changed")
    changes += [f"file {file.name} has changed" for file in imports or () if _differs(study, file)]
    return ModelComparison(
        tuple(changes),
        frozenset(f"{file.sha256}  {file.name}" for file in imports or ()),
        not any(change.is_limit for change in changed),
        not domain,
    )


def _unknown_version(model: Model) -> str:
    """Return the reason why versions of a model cannot be distinguished; empty if they can."""
    folder = _folder(model)
    if model.unknown_dependency:
        return f"its model has versions that cannot be distinguished: {model.unknown_dependency}"
    if isinstance(model, PythonFunction) and folder is not None and not folder.files():
        return f"no archive says which version of {model.name} its runs were made with"
    return ""


def _folder(model: Model) -> ModelFolder | None:
    """Return the folder of a user-defined model, whose modules it may import in its runs."""
    return model.surroundings if isinstance(model, PythonFunction | UserDefinedModel) else None


def _archived_identity(tree: xr.DataTree, name: str) -> dict[str, str]:
    attributes = model_trees(tree)[name].attrs.items()
    start = "model_"
    found = {str(key): str(value) for key, value in attributes}
    return {key.removeprefix(start): found[key] for key in found if key.startswith(start)}


def _versions(identity: Mapping[str, str], model: Model) -> dict[str, str]:
    """Return an identity without what follows from files, or from the source of the model."""
    replaced = _VERSION if _SOURCE in identity else ""
    left_out = replaced if _folder(model) is None else _SOURCE
    return {f"model {key}": value for key, value in identity.items() if key != left_out}


def _table(content: Mapping[str, Any], name: str) -> dict[str, str]:
    """Return the table of a model as texts by key, without the inputs that it sets itself."""
    table = content.get("models", {}).get(name, {}) if name else content.get("model", {})
    kept = {key: value for key, value in table.items() if key != "with"}
    return dict(flatten_tables({"model": kept}))


def _constraints(content: Mapping[str, Any]) -> dict[str, str]:
    return dict(flatten_tables({"constraints": content.get("constraints", {})}))


def _find_imports(
    study: ValidatedStudy, model: Model, files: Mapping[str, ArchivedFile], sha256: str
) -> list[ArchivedFile] | None:
    """Find the archived files that only runs have imported; None if the source is another one.

    The hash of the model's source says which of the archived modules they are: others belong to
    designs, surrogates or statistics.
    """
    folder = _folder(model)
    if folder is None:
        return []
    own = {file.path: file.content or file.path.read_bytes() for file in folder.files()}
    loaded = {file.path for file in study.files()}
    late = {
        folder.folder / file.name: file
        for file in files.values()
        if file.is_whole and _is_module(file.name) and folder.folder / file.name not in own
    }
    unknown = {path: file for path, file in late.items() if path not in loaded}
    for imports in ({}, unknown, late):
        contents = own | {path: _content(file) for path, file in imports.items()}
        source = b"".join(content for _, content in sorted(contents.items()))
        if hashlib.sha256(source).hexdigest() == sha256:
            return list(imports.values())
    return None


def _is_module(name: str) -> bool:
    """Check for the name of a module in the folder of the study."""
    path = PurePosixPath(name)
    return path.suffix == ".py" and not path.is_absolute() and ".." not in path.parts


def _content(file: ArchivedFile) -> bytes:
    try:
        return file.read()
    except ArchiveError:  # a damaged one has no hash in common with any source
        return b""


def _differs(study: ValidatedStudy, file: ArchivedFile) -> bool:
    """Check whether a file in the folder of a study is another than the archived one."""
    try:
        content = (study.folder / file.name).read_bytes()
    except OSError:
        return True
    return hashlib.sha256(content).hexdigest() != file.sha256
