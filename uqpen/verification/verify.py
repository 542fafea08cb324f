"""Check of an archive against its own hashes, its own study and its own runs."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from uqpen.archive.content import group_hashes, recorded_hashes
from uqpen.archive.files import FILES, archived_files
from uqpen.archive.migrations import migrate
from uqpen.archive.provenance import (
    SCHEMA,
    SCHEMA_ATTRIBUTE,
    of_python_functions,
    provenance,
    provenance_differences,
)
from uqpen.archive.read import model_trees, read_as_written, read_group
from uqpen.archive.structure import find_faults
from uqpen.core.errors import ArchiveError, StudyError, UqpenError
from uqpen.core.labels import KIND, REUSED_RUNS
from uqpen.execution import Map, Progress
from uqpen.models import MODELS
from uqpen.models.data.data_model import DataModel
from uqpen.models.source import source_sha256
from uqpen.study.document import Objects
from uqpen.study.study import ValidatedStudy
from uqpen.verification.absent_code import (
    check_points,
    unchecked_analyses,
    unrepeated_runs,
    without_absent,
)
from uqpen.verification.archived_study import (
    archived_runs,
    external_models,
    external_names,
    find_incompatibility,
    outside_analyses,
)
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.verification.differences import TOLERANCE
from uqpen.verification.earlier_surrogates import check_surrogate_recipe
from uqpen.verification.interval_recipes import check_recipe
from uqpen.verification.omitted_designs import (
    omitted_designs,
    repeated_batches,
    without_omitted,
)
from uqpen.verification.outside_statistics import without_outside_statistics
from uqpen.verification.repetition import (
    Runs,
    repeated_runs,
    repeated_statistics,
    reread_runs,
)
from uqpen.verification.restored_study import restored_study

__all__ = ["environment_differences", "verify"]

# Attributes that distinguish versions of a model.
_SOURCE = "model_source_sha256"
_PROGRAM = "model_program_sha256"
_VERSION_ATTRIBUTES = ("model_version", _SOURCE, _PROGRAM)


class _Tolerances(NamedTuple):
    """Permitted differences for an archive that was made elsewhere."""

    tolerance: float
    is_earlier: bool


def verify(
    path: Path,
    *,
    folder: Path | None = None,
    runs: int | None = 100,
    trust: bool = False,
    objects: Objects | None = None,
    map: Map = map,
    progress: Progress | None = None,
) -> Iterator[CheckResult]:
    """Check an archive, part by part.

    Parameters
    ----------
    path : Path
        The archive.
    folder : Path, optional
        Folder with the files that its study names; by default, the archived files are used.
    runs : int or None
        Number of runs to repeat, drawn at random; None for all.
    trust : bool
        True if code that the archive names may be executed.
    objects : mapping of tuple to object, optional
        Python objects that its study names, as for `parse_study`.
    map : callable
        Like the built-in; it makes the batches of runs.
    progress : Progress, optional
        Receives reports of progress.

    Raises
    ------
    ArchiveError
        If it is no archive.
    """
    written = read_as_written(path)
    yield _check_hashes(written)
    tree = migrate(written)
    yield _check_text(tree)
    if fault := next(find_faults(tree), None):
        yield CheckResult("structure", CheckOutcome.DIFFERENT, f"damaged: {fault}")
    elif KIND in tree.attrs:
        message = "runs of a benchmark of methods are not repeated; only hashes are checked"
        yield CheckResult("runs", CheckOutcome.UNCHECKED, message)
    else:
        if FILES in tree.children:
            yield _check_files(tree)
        progress = progress or Progress()
        others = environment_differences(written)
        message = ", ".join(others) or "the same versions and kind of processor as here"
        outcome = CheckOutcome.CLOSE if others else CheckOutcome.EQUAL
        yield CheckResult("made with", outcome, message)
        # Another uqpen may lack statistics that this one computes.
        version = "version_uqpen"
        is_other = written.attrs.get(version) != provenance()[version]
        is_earlier = is_other or bool(written.attrs[SCHEMA_ATTRIBUTE] != SCHEMA)
        allowed = _Tolerances(TOLERANCE if others else 0.0, is_earlier)
        yield from _repeat_checks(
            tree, folder, runs, allowed, map, progress, trust=trust, objects=objects
        )


def environment_differences(tree: xr.DataTree) -> list[str]:
    """List what decides last bits and is otherwise here: versions, the processor, models.

    Runs that were taken from earlier archives may have been made with others again.
    """
    # What only Python functions depend on is no difference where there is none of them.
    is_foreign = bool(external_names(str(tree.attrs.get("study_text", ""))))
    here = {**provenance(), **of_python_functions()}
    then = {str(name): value for name, value in tree.attrs.items()}
    then |= {} if is_foreign else of_python_functions()
    versions = [
        f"{name} {archived_hash} (here {found})"
        for name, archived_hash, found in provenance_differences(then, here)
    ]
    schema = tree.attrs[SCHEMA_ATTRIBUTE]
    schemas = [f"schema {schema} (here {SCHEMA})"] if schema != SCHEMA else []
    reused = str(tree.attrs.get(REUSED_RUNS, "")).split("\n")
    return [*schemas, *versions, *filter(None, reused), *dict.fromkeys(_other_sources(tree))]


def _other_sources(tree: xr.DataTree) -> Iterator[str]:
    """Yield the built-in models whose source differs from the installed one."""
    for model in model_trees(tree).values():
        name, archived_hash = (str(model.attrs.get(key, "")) for key in ("model_name", _SOURCE))
        if name in MODELS and archived_hash:
            here = source_sha256(MODELS[name].partition(":")[0])
            if here != archived_hash:
                yield f"source of {name} {archived_hash[:8]} (here {here[:8]})"


def _check_hashes(tree: xr.DataTree) -> CheckResult:
    """Check that every group is as it was written."""
    found, written = group_hashes(tree), recorded_hashes(tree)
    if written is None:
        message = "none: written by a uqpen without hashes"
        return CheckResult("hashes", CheckOutcome.UNCHECKED, message)
    shared = found.keys() & written.keys()
    details = tuple(
        f"{path} {what}"
        for what, paths in (
            ("is changed", {path for path in shared if found[path] != written[path]}),
            ("is missing", written.keys() - found.keys()),
            ("was added", found.keys() - written.keys()),
        )
        for path in sorted(paths)
    )
    if details:
        return CheckResult("hashes", CheckOutcome.DIFFERENT, "not those of its groups", details)
    return CheckResult("hashes", CheckOutcome.EQUAL, f"those of its {len(found)} groups")


def _check_text(tree: xr.DataTree) -> CheckResult:
    """Check that the study's text matches the archived hash."""
    text = str(tree.attrs.get("study_text", ""))
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    if digest == str(tree.attrs.get("study_sha256")):
        message = "its text has the recorded hash"
        return CheckResult("study", CheckOutcome.EQUAL, message)
    message = "its text is changed: it does not have the recorded hash"
    return CheckResult("study", CheckOutcome.DIFFERENT, message)


def _check_files(tree: xr.DataTree) -> CheckResult:
    """Check that the archived files match their hashes."""
    files = archived_files(read_group(tree, FILES))
    details = []
    for file in files:
        try:
            _ = file.read() if file.is_whole else b""
        except ArchiveError as error:
            details.append(str(error))
    if details:
        message = "not those of its study"
        return CheckResult("files", CheckOutcome.DIFFERENT, message, tuple(details))
    by_hash = [f"{file.name}: kept by its hash alone" for file in files if not file.is_whole]
    message = f"{len(files)} archived, with the recorded hashes"
    return CheckResult("files", CheckOutcome.EQUAL, message, tuple(by_hash))


def _repeat_checks(
    tree: xr.DataTree,
    folder: Path | None,
    number: int | None,
    allowed: _Tolerances,
    map: Map,
    progress: Progress,
    *,
    trust: bool,
    objects: Objects | None,
) -> Iterator[CheckResult]:
    """Repeat the runs and statistics that can be repeated."""
    with contextlib.ExitStack() as stack:
        try:
            restored = stack.enter_context(
                restored_study(tree, folder, trust=trust, objects=objects)
            )
        except UqpenError as error:
            message, details = "its study cannot be read here", tuple(str(error).split("\n"))
            yield CheckResult("repetition", CheckOutcome.IMPOSSIBLE, message, details)
            return
        if details := tuple(restored.different_files):
            yield CheckResult("folder", CheckOutcome.DIFFERENT, "not the archived ones", details)
        study, runs = restored.study, archived_runs(tree)
        if reason := find_incompatibility(study, runs):
            yield CheckResult("repetition", CheckOutcome.DIFFERENT, reason)
            return
        external = [] if trust else external_models(study.text)
        if isinstance(study.model, DataModel):
            yield reread_runs(study, runs)
        elif unrepeated := unrepeated_runs(study, external):
            yield unrepeated
        else:
            yield from _repeat_runs(study, tree, runs, number, allowed, map, progress)
        progress.start_analysis()
        yield from check_points(study, runs, allowed.tolerance)
        besides = _model_attributes(tree) if external else []
        yield from _repeat_statistics(study, tree, runs, allowed, besides, progress, trust=trust)


def _repeat_runs(
    study: ValidatedStudy,
    tree: xr.DataTree,
    runs: Runs,
    number: int | None,
    allowed: _Tolerances,
    map: Map,
    progress: Progress,
) -> Iterator[CheckResult]:
    """Repeat runs, with the programs and sources of today."""
    for variant in study.models.values():
        progress.start_preparation(variant.model.name)
        variant.model.prepare()
    tolerance = allowed.tolerance
    if others := list(_other_programs(study, tree)):
        tolerance = TOLERANCE
        message = f"another than then: {', '.join(others)}"
        yield CheckResult("program", CheckOutcome.CLOSE, message)
    omitted = omitted_designs(runs)
    if set(study.designs) != set(omitted):
        yield repeated_runs(study, runs, number, tolerance, map=map, progress=progress)
    if omitted:
        yield repeated_batches(study, runs, number, tolerance, map=map, progress=progress)
    yield from _check_sources(study, tree)


def _repeat_statistics(
    study: ValidatedStudy,
    tree: xr.DataTree,
    runs: Runs,
    allowed: _Tolerances,
    besides: list[str],
    progress: Progress,
    *,
    trust: bool,
) -> Iterator[CheckResult]:
    """Repeat statistics, except those that follow from code that is not loaded."""
    if omitted := omitted_designs(runs):
        study, tree, left_out = without_omitted(study, tree, omitted)
        yield left_out
        if not study.designs:
            return
    study, tree, unchecked = without_absent(study, tree)
    yield from unchecked
    study, tree, unchecked = check_surrogate_recipe(study, tree)
    yield from unchecked
    if not trust and (analyses := outside_analyses(study.text)):
        yield unchecked_analyses(analyses, tree)
        study, tree = replace(study, analyses=()), without_outside_statistics(tree)
    if recipe := check_recipe(tree):
        yield recipe
    ignored = [*provenance(), *of_python_functions(), *_VERSION_ATTRIBUTES, REUSED_RUNS, *besides]
    try:
        yield repeated_statistics(
            study,
            tree,
            runs,
            allowed.tolerance,
            ignored,
            is_earlier=allowed.is_earlier,
            progress=progress,
        )
    except StudyError as error:  # an analysis of the user's own fails here
        message = "an analysis that its study names fails"
        yield CheckResult("statistics", CheckOutcome.IMPOSSIBLE, message, (str(error),))


def _model_attributes(tree: xr.DataTree) -> list[str]:
    """Return the attributes that describe the models; some are known only of a loaded model."""
    found = [name for model in model_trees(tree).values() for name in map(str, model.attrs)]
    return [name for name in found if name.startswith("model_")]


def _other_programs(study: ValidatedStudy, tree: xr.DataTree) -> Iterator[str]:
    """Yield the external programs of the same name that differ from those on this machine."""
    for name, model_tree in model_trees(tree).items():
        model, archived_hash = study.models[name].model, str(model_tree.attrs.get(_PROGRAM, ""))
        here = model.identity().get(_PROGRAM.removeprefix("model_"), "")
        if here != archived_hash:
            yield f"{model.name} {archived_hash[:8]} (here {here[:8]})"


def _check_sources(study: ValidatedStudy, tree: xr.DataTree) -> Iterator[CheckResult]:
    """Check that the source of user-supplied models is unchanged, where it was not archived."""
    details = []
    for name, model_tree in model_trees(tree).items():
        model, made_with = study.models[name].model, model_tree.attrs.get(_SOURCE)
        if FILES in tree.children and not model.is_object:
            continue  # the archived files are what it was made with
        here = model.identity().get(_SOURCE.removeprefix("model_"))
        if model.name not in MODELS and made_with and here != made_with:
            found = f"found the SHA-256 {here}, expected {made_with}"
            details.append(f"{model.name} and what it imports: {found}")
    if details:
        message = "not the source of the models that it was made with"
        yield CheckResult("source", CheckOutcome.DIFFERENT, message, tuple(details))
