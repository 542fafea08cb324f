"""An archive held against its own hashes, its own study and its own runs."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from uqpen.archive.content import hashes, recorded
from uqpen.archive.files import FILES, kept_files
from uqpen.archive.migrations import migrated
from uqpen.archive.provenance import (
    SCHEMA,
    SCHEMA_ATTRIBUTE,
    of_python_functions,
    provenance,
    provenance_differences,
)
from uqpen.archive.read import group, models_in, read_as_written
from uqpen.archive.skeleton import faults
from uqpen.errors import ArchiveError, UqpenError
from uqpen.evaluation import Map, Progress
from uqpen.labels import KIND
from uqpen.models import MODELS
from uqpen.models.source import source_sha256
from uqpen.study.study import Study
from uqpen.verification.agreement import TOLERANCE
from uqpen.verification.archived import archived_runs, foreign_models, misfit
from uqpen.verification.repetition import repeated_runs, repeated_statistics
from uqpen.verification.report import Part, Verdict
from uqpen.verification.restored import restored_study

__all__ = ["elsewhere", "verify"]

# What is not known of a model unless it is loaded.
_OF_LOADED = ("model_name",)

# What tells one version of a model from another, which has parts of its own.
_SOURCE = "model_source_sha256"
_PROGRAM = "model_program_sha256"
_OF_VERSIONS = ("model_version", _SOURCE, _PROGRAM)


class _Allowed(NamedTuple):
    """What may differ, as an archive was made elsewhere."""

    tolerance: float
    is_earlier: bool


def verify(
    path: Path,
    *,
    folder: Path | None = None,
    runs: int | None = 100,
    trust: bool = False,
    map: Map = map,
    progress: Progress | None = None,
) -> Iterator[Part]:
    """Check an archive, part by part.

    Parameters
    ----------
    path : Path
        The archive.
    folder : Path, optional
        Where to take the files that its study names, in place of those that it keeps.
    runs : int or None
        How many runs to repeat, drawn at random; None for all.
    trust : bool
        Whether code that the archive names may be executed.
    map : callable
        Like the built-in: where batches of runs are made.
    progress : Progress, optional
        Told how far it is.

    Raises
    ------
    ArchiveError
        If it is no archive.
    """
    written = read_as_written(path)
    yield _hashes(written)
    tree = migrated(written)
    yield _text(tree)
    if fault := next(faults(tree), None):
        yield Part("structure", Verdict.DIFFERENT, f"damaged: {fault}")
    elif KIND in tree.attrs:
        told = "those of methods head to head are not repeated: hashes only"
        yield Part("runs", Verdict.UNCHECKED, told)
    else:
        if FILES in tree.children:
            yield _files(tree)
        progress = progress or Progress()
        others = elsewhere(written)
        yield _made_with(others)
        allowed = _Allowed(TOLERANCE if others else 0.0, _is_earlier(written))
        yield from _repeated(tree, folder, runs, allowed, map, progress, trust=trust)


def elsewhere(tree: xr.DataTree) -> list[str]:
    """List what decides last bits and is otherwise here: versions, the processor, models."""
    # What only Python functions depend on is no difference where there is none of them.
    is_foreign = bool(foreign_models(str(tree.attrs.get("study_text", ""))))
    here = {**provenance(), **of_python_functions()}
    then = {str(name): value for name, value in tree.attrs.items()}
    then |= {} if is_foreign else of_python_functions()
    versions = [
        f"{name} {made_with} (here {found})"
        for name, made_with, found in provenance_differences(then, here)
    ]
    schema = tree.attrs[SCHEMA_ATTRIBUTE]
    schemas = [f"schema {schema} (here {SCHEMA})"] if schema != SCHEMA else []
    return [*schemas, *versions, *dict.fromkeys(_other_sources(tree))]


def _made_with(others: list[str]) -> Part:
    told = ", ".join(others) or "the same versions and kind of processor as here"
    return Part("made with", Verdict.CLOSE if others else Verdict.EQUAL, told)


def _is_earlier(tree: xr.DataTree) -> bool:
    """Whether another uqpen has made an archive, which may not have told all that this one does."""
    version = "version_uqpen"
    is_other = tree.attrs.get(version) != provenance()[version]
    return is_other or bool(tree.attrs[SCHEMA_ATTRIBUTE] != SCHEMA)


def _other_sources(tree: xr.DataTree) -> Iterator[str]:
    """The built-in models whose source is another here."""
    for model in models_in(tree).values():
        name, made_with = (str(model.attrs.get(key, "")) for key in ("model_name", _SOURCE))
        if name in MODELS and made_with:
            here = source_sha256(MODELS[name].partition(":")[0])
            if here != made_with:
                yield f"source of {name} {made_with[:8]} (here {here[:8]})"


def _hashes(tree: xr.DataTree) -> Part:
    """Whether every group is as it was written."""
    found, written = hashes(tree), recorded(tree)
    if written is None:
        told = "none: written by a uqpen that did not hash yet"
        return Part("hashes", Verdict.UNCHECKED, told)
    shared = found.keys() & written.keys()
    details = [
        f"{path} {what}"
        for what, paths in (
            ("is changed", {path for path in shared if found[path] != written[path]}),
            ("is missing", written.keys() - found.keys()),
            ("was added", found.keys() - written.keys()),
        )
        for path in sorted(paths)
    ]
    if details:
        return Part("hashes", Verdict.DIFFERENT, "not those of its groups", tuple(details))
    return Part("hashes", Verdict.EQUAL, f"those of its {len(found)} groups")


def _text(tree: xr.DataTree) -> Part:
    """Whether the study's text is the one whose hash stands beside it."""
    text = str(tree.attrs.get("study_text", ""))
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    if digest == str(tree.attrs.get("study_sha256")):
        return Part("study", Verdict.EQUAL, "its text has the hash that stands beside it")
    told = "its text is changed: it does not have the hash that stands beside it"
    return Part("study", Verdict.DIFFERENT, told)


def _files(tree: xr.DataTree) -> Part:
    """Whether the files that it keeps have the hashes that stand beside them."""
    files = kept_files(group(tree, FILES))
    details = []
    for file in files:
        try:
            _ = file.read() if file.is_whole else b""
        except ArchiveError as error:
            details.append(str(error))
    if details:
        return Part("files", Verdict.DIFFERENT, "not those of its study", tuple(details))
    by_hash = [f"{file.name}: kept by its hash alone" for file in files if not file.is_whole]
    told = f"{len(files)} kept, with the hashes that stand beside them"
    return Part("files", Verdict.EQUAL, told, tuple(by_hash))


def _repeated(
    tree: xr.DataTree,
    folder: Path | None,
    number: int | None,
    allowed: _Allowed,
    map: Map,
    progress: Progress,
    *,
    trust: bool,
) -> Iterator[Part]:
    """What can be made again, made again."""
    with contextlib.ExitStack() as stack:
        try:
            restored = stack.enter_context(restored_study(tree, folder, trust=trust))
        except UqpenError as error:
            details = tuple(str(error).split("\n"))
            yield Part("repetition", Verdict.IMPOSSIBLE, "its study cannot be read here", details)
            return
        if restored.differing:
            told = "not those that it keeps"
            yield Part("folder", Verdict.DIFFERENT, told, tuple(restored.differing))
        study, runs = restored.study, archived_runs(tree)
        if reason := misfit(study, runs):
            yield Part("repetition", Verdict.DIFFERENT, reason)
            return
        foreign = [] if trust else foreign_models(study.text)
        if foreign:
            yield _not_trusted(foreign)
        else:
            _prepare(study, progress)
            tolerance = allowed.tolerance
            if others := list(_other_programs(study, tree)):
                tolerance = TOLERANCE
                yield Part("program", Verdict.CLOSE, f"another than then: {', '.join(others)}")
            yield repeated_runs(study, runs, number, tolerance, map=map, progress=progress)
            if FILES not in tree.children:
                yield from _sources(study, tree)
        progress.analysing()
        made_with = [*provenance(), *of_python_functions()]
        besides = [*made_with, *_OF_VERSIONS, *(_OF_LOADED if foreign else [])]
        yield repeated_statistics(
            study, tree, runs, allowed.tolerance, besides, is_earlier=allowed.is_earlier
        )


def _other_programs(study: Study, tree: xr.DataTree) -> Iterator[str]:
    """The programs from elsewhere that go by the same name here and are others."""
    for name, held in models_in(tree).items():
        model, made_with = study.models[name].model, str(held.attrs.get(_PROGRAM, ""))
        here = model.identity().get(_PROGRAM.removeprefix("model_"), "")
        if here != made_with:
            yield f"{model.name} {made_with[:8]} (here {here[:8]})"


def _sources(study: Study, tree: xr.DataTree) -> Iterator[Part]:
    """Whether models of the user's own have the source that they had, where it was not kept."""
    details = []
    for name, held in models_in(tree).items():
        model, made_with = study.models[name].model, held.attrs.get(_SOURCE)
        here = model.identity().get(_SOURCE.removeprefix("model_"))
        if model.name not in MODELS and made_with and here != made_with:
            found = f"found the SHA-256 {here}, expected {made_with}"
            details.append(f"{model.name} and what it imports: {found}")
    if details:
        told = "not that of the models that it was made with"
        yield Part("source", Verdict.DIFFERENT, told, tuple(details))


def _prepare(study: Study, progress: Progress) -> None:
    for variant in study.models.values():
        progress.preparing(variant.model.name)
        variant.model.prepare()


def _not_trusted(models: list[str]) -> Part:
    told = f"not repeated: they execute code that the archive names ({', '.join(models)})"
    advice = "if you trust whoever made it, say --trust"
    return Part("runs", Verdict.UNCHECKED, told, (advice,))
