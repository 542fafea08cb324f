"""Versions of a model: that of an archive beside that of a study."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from uqpen.archive.files import FILES, archived_files, files_by_name
from uqpen.archive.read import model_trees, read_group
from uqpen.checkpoints.earlier_runs import depends_on_batch
from uqpen.checkpoints.fingerprint_file import fingerprint_changes
from uqpen.core.dependency import IMPORTED, LIBRARY, MODULE, OPENED, Dependency
from uqpen.core.labels import DEPENDENCIES
from uqpen.core.model import Model
from uqpen.models.dependencies import current_sha256
from uqpen.models.python_function import PythonFunction
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.study.fingerprint import flatten_tables
from uqpen.study.study import ValidatedStudy

__all__ = ["ModelComparison", "compare_models", "compared_names"]

_SOURCE, _VERSION = "source_sha256", "version"


class ModelComparison(NamedTuple):
    """Comparison of the model of an archive with that of a study.

    Attributes
    ----------
    changes : tuple of str
        What has changed, in words; empty if both would make the same runs.
    dependencies : frozenset of str
        What the archive's runs depend on besides their inputs, as in `Results.files`.
    is_same_limit : bool
        True if both have the same limit on the time of a run.
    is_same_domain : bool
        True if both studies have the same constraints.
    same : tuple of str
        Names of files, modules and variables of the environment that were compared, and are the
        same. The model's table in the study is not named.
    uncompared : tuple of str
        What decides the runs and was not compared, in words, such as
        ``"what ./solver reads and starts"``.
    """

    changes: tuple[str, ...]
    dependencies: frozenset[str] = frozenset()
    is_same_limit: bool = True
    is_same_domain: bool = True
    same: tuple[str, ...] = ()
    uncompared: tuple[str, ...] = ()


def compare_models(
    study: ValidatedStudy, name: str, tree: xr.DataTree, archived_name: str
) -> ModelComparison:
    """Compare a model of an archive with one of a study; nothing of the archive is executed.

    What the archive's runs depend on is compared with what is there now, under the same names, also
    what only a run has imported or read.

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
    known = [*map(Dependency.from_line, model.dependencies())]
    # Those that it opens are compared below: a start may have written what the next one reads.
    opened = {each.name for each in known if each.role in (OPENED, LIBRARY)}
    named = files_by_name(model.files(), study.folder)
    own = {file: snapshot for file, snapshot in named.items() if file not in opened}
    attributes = {
        str(key): str(value) for key, value in model_trees(tree)[archived_name].attrs.items()
    }
    lines = frozenset(filter(None, attributes.get(DEPENDENCIES, "").split("\n")))
    archived = sorted(map(Dependency.from_line, lines))
    dependencies = _compared_dependencies(model, known, archived, study.folder)
    before, now = _identity(attributes), model.identity()
    changed = list(
        fingerprint_changes(
            {
                **_table(texts[0], archived_name),
                **_versions(before, model),
                **{f"file {file}": files[file].sha256 for file in own if file in files},
                **dependencies.before,
            },
            {
                **_table(texts[1], name),
                **_versions(now, model),
                **{f"file {file}": snapshot.sha256 for file, snapshot in own.items()},
                **dependencies.now,
            },
        )
    )
    domain = [change.text for change in fingerprint_changes(*map(_constraints, texts))]
    changes = [change.text for change in changed if not change.is_limit]
    changes += domain if depends_on_batch(model) else []
    same, uncompared = compared_names(model, lines, study.folder)
    return ModelComparison(
        tuple(changes),
        lines,
        not any(change.is_limit for change in changed),
        not domain,
        same,
        uncompared,
    )


def compared_names(
    model: Model, lines: Iterable[str], folder: Path
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what is compared of a model whose runs are taken, and what is not.

    Parameters
    ----------
    model : Model
        The model.
    lines : iterable of str
        What the runs depend on, as in `Results.files`.
    folder : Path
        Folder of the study.

    Returns
    -------
    same, uncompared : tuple of str
        As in `ModelComparison`.
    """
    found = sorted({Dependency.from_line(line) for line in {*lines, *model.dependencies()}})
    names = [*files_by_name(model.files(), folder), *(each.name for each in found if each.sha256)]
    unhashed = filter(None, (each.uncompared for each in found))
    return tuple(dict.fromkeys(names)), tuple(dict.fromkeys([*model.uncompared, *unhashed]))


class _ComparedDependencies(NamedTuple):
    """Hashes of dependencies in an archive and now, by their names in a message."""

    before: dict[str, str]
    now: dict[str, str]


def _compared_dependencies(
    model: Model, loaded: Sequence[Dependency], archived: Sequence[Dependency], folder: Path
) -> _ComparedDependencies:
    """Return the dependencies of archived runs, and the same ones as they are now.

    Modules that the model has loaded now are compared, too, if the archive has none of their names:
    a source decides what is imported. That it opens another file follows from one that has changed.
    """
    known = {each[:2]: each.sha256 for each in loaded}
    before: dict[str, str] = {}
    now: dict[str, str] = {}
    context = surroundings.on_import_path() if (surroundings := _folder(model)) else nullcontext()
    with context:
        for each in archived:
            if each.sha256:
                found = known.get(each[:2]) or current_sha256(each, folder)
                before[each.label] = each.sha256
                now |= {each.label: found} if found else {}
    roles = (IMPORTED, MODULE)
    now |= {
        Dependency(*key).label: sha256 for key, sha256 in sorted(known.items()) if key[0] in roles
    }
    return _ComparedDependencies(before, now)


def _unknown_version(model: Model) -> str:
    """Return the reason why versions of a model cannot be distinguished; empty if they can."""
    folder = _folder(model)
    if model.unknown_dependency:
        return f"its model has versions that cannot be distinguished: {model.unknown_dependency}"
    if isinstance(model, PythonFunction) and folder is not None and not folder.imported:
        return f"no archive says which version of {model.name} its runs were made with"
    return ""


def _folder(model: Model) -> ModelFolder | None:
    """Return the folder of a user-defined model, whose modules it may import in its runs."""
    return model.surroundings if isinstance(model, PythonFunction | UserDefinedModel) else None


def _identity(attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the identity of a model among the attributes of its group."""
    start = "model_"
    return {key.removeprefix(start): attributes[key] for key in attributes if key.startswith(start)}


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
