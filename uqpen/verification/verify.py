"""An archive held against its own hashes, its own study and its own runs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from uqpen.archive.content import hashes, recorded
from uqpen.archive.provenance import provenance
from uqpen.archive.read import read_tree
from uqpen.archive.skeleton import faults
from uqpen.errors import UqpenError
from uqpen.evaluation import Progress
from uqpen.labels import KIND
from uqpen.study.study import Study
from uqpen.verification.agreement import TOLERANCE
from uqpen.verification.archived import archived_runs, archived_study, foreign_models, misfit
from uqpen.verification.repetition import repeated_runs, repeated_statistics
from uqpen.verification.report import Part, Verdict

__all__ = ["elsewhere", "verify"]

# What tells one version of a model of the user's own from another; not known unless it is loaded.
_SOURCE = "model_source_sha256"


def verify(
    path: Path,
    *,
    folder: Path,
    runs: int | None = 100,
    trust: bool = False,
    progress: Progress | None = None,
) -> Iterator[Part]:
    """Check an archive, part by part.

    Parameters
    ----------
    path : Path
        The archive.
    folder : Path
        Where the files lie that its study names.
    runs : int or None
        How many runs to repeat, drawn at random; None for all.
    trust : bool
        Whether code that the archive names may be executed.
    progress : Progress, optional
        Told how far it is.

    Raises
    ------
    ArchiveError
        If it is no archive.
    """
    tree = read_tree(path)
    yield _hashes(tree)
    yield _text(tree)
    if fault := next(faults(tree), None):
        yield Part("structure", Verdict.DIFFERENT, f"damaged: {fault}")
    elif KIND in tree.attrs:
        told = "those of methods head to head are not repeated: hashes only"
        yield Part("runs", Verdict.UNCHECKED, told)
    else:
        yield from _repeated(tree, folder, runs, progress or Progress(), trust=trust)


def elsewhere(tree: xr.DataTree) -> list[str]:
    """What an archive was made with that is otherwise here: versions, the platform."""
    return [
        f"{name.removeprefix('version_')} {tree.attrs.get(name, 'unknown')} (here {here})"
        for name, here in provenance().items()
        if tree.attrs.get(name) != here
    ]


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
    if digest == tree.attrs.get("study_sha256"):
        return Part("study", Verdict.EQUAL, "its text has the hash that stands beside it")
    told = "its text is changed: it does not have the hash that stands beside it"
    return Part("study", Verdict.DIFFERENT, told)


def _repeated(
    tree: xr.DataTree, folder: Path, number: int | None, progress: Progress, *, trust: bool
) -> Iterator[Part]:
    """What can be made again, made again."""
    others = elsewhere(tree)
    told = f"made with {', '.join(others)}" if others else "the same versions and platform as here"
    verdict = Verdict.CLOSE if others else Verdict.EQUAL
    yield Part("made with", verdict, told)
    tolerance = TOLERANCE if others else 0.0
    try:
        study = archived_study(tree, folder, trust=trust)
    except UqpenError as error:
        details = tuple(str(error).split("\n"))
        yield Part("repetition", Verdict.IMPOSSIBLE, "its study cannot be read here", details)
        return
    runs = archived_runs(tree)
    if reason := misfit(study, runs):
        yield Part("repetition", Verdict.DIFFERENT, reason)
        return
    foreign = [] if trust else foreign_models(study.text)
    if foreign:
        yield _not_trusted(foreign)
    else:
        _prepare(study, progress)
        yield repeated_runs(study, runs, number, tolerance, progress)
    progress.analysing()
    besides = [*provenance(), *([_SOURCE] if foreign else [])]
    yield repeated_statistics(study, tree, runs, tolerance, besides)


def _prepare(study: Study, progress: Progress) -> None:
    for variant in study.models.values():
        progress.preparing(variant.model.name)
        variant.model.prepare()


def _not_trusted(models: list[str]) -> Part:
    told = f"not repeated: they execute code that the archive names ({', '.join(models)})"
    advice = "if you trust whoever made it, say --trust"
    return Part("runs", Verdict.UNCHECKED, told, (advice,))
