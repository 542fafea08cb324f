"""Check of an archive against its own hashes, its own study and its own runs."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import xarray as xr

from uqpen.archive.files import FILES, archived_files
from uqpen.archive.hashes import group_hashes, recorded_hashes
from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import is_benchmark, model_trees, read_group, read_tree
from uqpen.archive.structure import find_faults
from uqpen.core.errors import ArchiveError, StudyError, UqpenError
from uqpen.core.labels import (
    CONTENT,
    DEPENDENCIES,
    FORMULAS_OVER,
    NOISE,
    NOT_MADE_AGAIN,
    RECIPE,
    REUSED_RUNS,
    REWEIGHTED_FROM,
    REWEIGHTED_STUDY,
    RUN,
    WEIGHT,
)
from uqpen.execution import Map, Progress
from uqpen.models import MODELS
from uqpen.models.data.data_model import DataModel
from uqpen.models.source import source_sha256
from uqpen.statistics.reweighting import changed_inputs, relative_weights
from uqpen.study.document import Objects
from uqpen.study.identity import (
    MODEL_PREFIX,
    StudyIdentity,
    archived_identity,
    study_identity,
)
from uqpen.verification.archived_study import (
    NamedCode,
    archived_runs,
    archived_study,
    find_incompatibility,
    named_code,
    restored_study,
)
from uqpen.verification.check_result import CheckOutcome, CheckResult, find_differences
from uqpen.verification.repetition import SOME, Repetition
from uqpen.verification.unrepeated import ADVICE, leave_out, omitted_designs
from uqpen.workflow.repetition import TOLERANCE, Difference

# Keys of what distinguishes the versions of a model.
_SOURCE, _PROGRAM = "source_sha256", "program_sha256"


def verify(
    path: Path,
    *,
    folder: Path | None = None,
    runs: int | None = SOME,
    trust: bool = False,
    objects: Objects | None = None,
    map: Map = map,
    progress: Progress | None = None,
) -> Iterator[CheckResult]:
    """Check an archive, part by part.

    Parameters
    ----------
    path, folder, runs, trust, progress
        As for `uqpen.verify`.
    objects : mapping of tuple to object, optional
        Python objects that its study names, as for `parse_study`.
    map : callable
        Like the built-in; it makes the batches of runs.

    Raises
    ------
    ArchiveError
        If it is no archive.
    """
    tree = read_tree(path)
    yield _check_hashes(tree)
    yield _check_text(tree)
    if fault := next(find_faults(tree), None):
        yield CheckResult("structure", CheckOutcome.DIFFERENT, f"damaged: {fault}")
        return
    if is_benchmark(tree):
        message = "runs of a benchmark of methods are not repeated; only hashes are checked"
        yield CheckResult("runs", CheckOutcome.UNCHECKED, message)
        return
    if FILES in tree.children:
        yield _check_files(tree)
    environment = _check_environment(tree)
    yield environment
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
        study, found = restored.study, archived_runs(tree)
        if reason := find_incompatibility(study, found):
            yield CheckResult("repetition", CheckOutcome.DIFFERENT, reason)
            return
        tolerance = 0.0 if environment.verdict is CheckOutcome.EQUAL else TOLERANCE
        repetition = Repetition(study, found, runs, tolerance, map, progress or Progress())
        yield from _repeat(repetition, tree, trust=trust)


# Its content, and what it was made with


def _check_hashes(tree: xr.DataTree) -> CheckResult:
    """Check that every group is as it was written."""
    found, written = group_hashes(tree), recorded_hashes(tree)
    if not written:
        return CheckResult("hashes", CheckOutcome.DIFFERENT, "no longer recorded in the archive")
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
        return CheckResult("study", CheckOutcome.EQUAL, "its text has the recorded hash")
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


def _check_environment(tree: xr.DataTree) -> CheckResult:
    """Compare what an archive was made with to this installation.

    Versions, the processor and the sources of built-in models may change the last bits of results;
    so may those that runs were made with which were taken from earlier archives.
    """
    # Versions that only Python functions depend on do not matter where there is no function.
    has_user_defined_code = bool(named_code(tree).code)
    here = {**provenance(), **of_python_functions()}
    then = {str(name): value for name, value in tree.attrs.items()}
    then |= {} if has_user_defined_code else of_python_functions()
    reports = [
        f"{name} {archived} (here {found})"
        for name, archived, found in provenance_differences(then, here)
    ]
    reused = [line for line in str(tree.attrs.get(REUSED_RUNS, "")).split("\n") if line]
    sources: list[str] = []
    for model in archived_identity(tree).models.values():
        name, archived = (model.attributes.get(key, "") for key in ("name", _SOURCE))
        if name in MODELS and archived:
            found = source_sha256(MODELS[name].partition(":")[0])
            if found != archived:
                sources.append(f"source of {name} {archived[:8]} (here {found[:8]})")
    reports += [*reused, *dict.fromkeys(sources)]
    if any(not each.endswith(NOT_MADE_AGAIN) for each in reports):
        return CheckResult("made with", CheckOutcome.CLOSE, ", ".join(reports))
    message = ", ".join(["the same versions and kind of processor as here", *reports])
    return CheckResult("made with", CheckOutcome.EQUAL, message)


# Its runs and statistics


def _repeat(repetition: Repetition, tree: xr.DataTree, *, trust: bool) -> Iterator[CheckResult]:
    """Repeat the runs, points and statistics that can be repeated."""
    study, named = repetition.study, named_code(tree)
    absent = [each.model.name for each in study.models.values() if each.model.is_absent]
    is_untrusted = bool(named.models) and not trust
    if isinstance(study.model, DataModel):
        yield repetition.check_data()
    elif is_untrusted:
        what = f"they execute code that the archive names ({', '.join(named.models)})"
        yield _unrepeated("runs", f"not repeated: {what}", ADVICE)
    elif absent:
        what = f"{', '.join(absent)} is an object of the Python program that made the archive"
        advice = "give the function: uqpen.verify(path, model=function)"
        yield _unrepeated("runs", f"not repeated: {what}", advice)
    else:
        yield from _repeat_runs(repetition, tree)
    repetition.progress.start_analysis()
    yield from _repeat_points(repetition, named)
    if REWEIGHTED_FROM in tree.attrs:
        yield _check_weights(repetition, tree, trust=trust)
    study, tree, left_out = leave_out(study, tree, trust=trust)
    yield from left_out
    if not study.designs:
        return
    ignored = {
        CONTENT,
        NOISE,
        RECIPE,
        REUSED_RUNS,
        REWEIGHTED_FROM,
        REWEIGHTED_STUDY,
        FORMULAS_OVER,
        DEPENDENCIES,
        *provenance(),
        *of_python_functions(),
    }
    ignored |= {f"{MODEL_PREFIX}{name}" for name in ("version", _SOURCE, _PROGRAM)}
    if is_untrusted:  # some attributes are known only of a loaded model
        attributes = {str(name) for model in model_trees(tree).values() for name in model.attrs}
        ignored |= {name for name in attributes if name.startswith(MODEL_PREFIX)}
    try:
        yield replace(repetition, study=study).check_statistics(tree, ignored)
    except StudyError as error:  # a user-defined analysis fails here
        message = "an analysis that its study names fails"
        yield CheckResult("statistics", CheckOutcome.IMPOSSIBLE, message, (str(error),))


def _repeat_runs(repetition: Repetition, tree: xr.DataTree) -> Iterator[CheckResult]:
    """Repeat runs, with the programs and sources of today."""
    study = repetition.study
    for variant in study.models.values():
        repetition.progress.start_preparation(variant.model.name)
        variant.model.prepare()
    archived = archived_identity(tree)
    programs = [
        f"{name} {before[:8]} (here {now[:8]})"
        for name, before, now in _changed(_PROGRAM, study_identity(study), archived)
    ]
    if programs:
        message = f"another than then: {', '.join(programs)}"
        yield CheckResult("program", CheckOutcome.CLOSE, message)
        repetition = replace(repetition, tolerance=TOLERANCE)
    omitted = omitted_designs(repetition.runs)
    if set(study.designs) != set(omitted):
        yield from repetition.check_runs()
    if omitted and any(map(repetition.is_random, study.models)):
        what = "not repeated: those of a model with noise and no seed are others each time"
        advice = 'keep = "runs" in the design keeps them, to be compared by their distribution'
        yield CheckResult("batches", CheckOutcome.UNCHECKED, what, (advice,))
    elif omitted:
        yield repetition.check_batches()
    # Archived files are what a model in a file was made with. The runs tell what it imports.
    objects = [each.model.name for each in study.models.values() if each.model.is_object]
    details = tuple(
        f"{name} and what it imports: found the SHA-256 {now or None}, expected {before}"
        for name, before, now in _changed(_SOURCE, study_identity(study), archived)
        if before and name not in MODELS and (name in objects or not archived.files)
    )
    if details:
        message = "not the source of the models that it was made with"
        yield CheckResult("source", CheckOutcome.DIFFERENT, message, details)


def _changed(
    key: str, study: StudyIdentity, archived: StudyIdentity
) -> Iterator[tuple[str, str, str]]:
    """Yield the name of each model with another attribute: its value in the archive, and here."""
    for label, model in study.models.items():
        before, now = (each.attributes.get(key, "") for each in (archived.models[label], model))
        if before != now:
            yield model.attributes["name"], before, now


def _repeat_points(repetition: Repetition, named: NamedCode) -> Iterator[CheckResult]:
    """Draw the points again that code of the archive has drawn, if it is loaded."""
    unloaded = repetition.study.unloaded_members
    untrusted = [name for name in unloaded if name in named.members]
    if untrusted:
        what = f"they are drawn by code that the archive names ({', '.join(untrusted)})"
        yield _unrepeated("points", f"not checked: {what}", ADVICE)
    elif unloaded:
        what = f"{', '.join(unloaded)} is an object of the Python program that made the archive"
        yield _unrepeated("points", f"not checked: {what}", "run that program again")
    elif named.members:
        try:
            yield repetition.check_points()
        except StudyError as error:  # a user-defined design fails here
            message = "a design that its study names fails"
            yield CheckResult("points", CheckOutcome.IMPOSSIBLE, message, (str(error),))


def _check_weights(repetition: Repetition, tree: xr.DataTree, *, trust: bool) -> CheckResult:
    """Compute the weights of runs again, from the study that drew them and the one that asks."""
    before = tree.copy()
    before.attrs["study_text"] = str(tree.attrs.get(REWEIGHTED_STUDY, ""))
    asked, found = repetition.study, list[Difference]()
    try:
        drawn = archived_study(before, asked.folder, trust=trust).joint
    except UqpenError as error:
        message = "not checked: the study that drew the runs cannot be read here"
        return _unrepeated("weights", message, str(error).partition("\n")[0])
    if asked.joint.reason_without_density(changed_inputs(drawn, asked.joint)):
        return _unrepeated(
            "weights", "not checked: they follow from code that is not loaded", ADVICE
        )
    for model, of_model in repetition.runs.items():
        for name, made in of_model.items():
            values = {each.variable.name: made[each.variable.name].values for each in drawn.random}
            weights = (RUN, relative_weights(values, drawn, asked.joint))
            pair = xr.Dataset({WEIGHT: made[WEIGHT].variable}), xr.Dataset({WEIGHT: weights})
            label = f"{model}: {name}" if model else name
            found += [each.within(label) for each in find_differences(*pair, besides=None)]
    what = "computed again from both distributions of the inputs"
    return CheckResult.of_differences("weights", what, found, repetition.tolerance)


def _unrepeated(part: str, message: str, advice: str) -> CheckResult:
    return CheckResult(part, CheckOutcome.UNCHECKED, message, (advice,))
