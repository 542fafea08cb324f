"""Check of an archive against its own hashes, its own study and its own runs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import xarray as xr

from uqpen.archive.files import FILES
from uqpen.archive.provenance import of_python_functions, provenance
from uqpen.archive.read import is_benchmark, read_tree
from uqpen.archive.structure import find_faults
from uqpen.core.errors import StudyError, UqpenError
from uqpen.core.labels import DEPENDENCIES, NOT_MADE_AGAIN, REUSED_RUNS
from uqpen.execution import Map, Progress
from uqpen.models.data.data_model import DataModel
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
    find_incompatibility,
    user_defined_analyses,
    user_defined_models,
)
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.verification.content_checks import check_files, check_hashes, check_text
from uqpen.verification.earlier_surrogates import check_surrogate_recipe
from uqpen.verification.interval_recipes import check_recipe
from uqpen.verification.made_with import (
    VERSION_ATTRIBUTES,
    check_sources,
    different_programs,
    environment_differences,
    has_other_version,
    model_attributes,
)
from uqpen.verification.omitted_designs import (
    omitted_designs,
    repeated_batches,
    without_omitted,
)
from uqpen.verification.repetition import (
    Runs,
    repeated_runs,
    repeated_statistics,
    reread_runs,
)
from uqpen.verification.restored_study import restored_study
from uqpen.verification.user_defined_statistics import without_user_defined_statistics
from uqpen.workflow.repetition import TOLERANCE

__all__ = ["verify"]


class _Options(NamedTuple):
    """Options of the repetition of an archive.

    Parameters
    ----------
    run_count : int or None
        Number of runs to repeat; None for all.
    tolerance : float
        Permitted difference; 0 where versions and processor are those of the archive.
    is_earlier : bool
        True if another uqpen made the archive, which may lack statistics of this one.
    trust : bool
        True if code that the archive names may be executed.
    map : callable
        Like the built-in; it makes the batches of runs.
    progress : Progress
        Receives reports of progress.
    """

    run_count: int | None
    tolerance: float
    is_earlier: bool
    trust: bool
    map: Map
    progress: Progress


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
    tree = read_tree(path)
    yield check_hashes(tree)
    yield check_text(tree)
    if fault := next(find_faults(tree), None):
        yield CheckResult("structure", CheckOutcome.DIFFERENT, f"damaged: {fault}")
    elif is_benchmark(tree):
        message = "runs of a benchmark of methods are not repeated; only hashes are checked"
        yield CheckResult("runs", CheckOutcome.UNCHECKED, message)
    else:
        if FILES in tree.children:
            yield check_files(tree)
        reports = environment_differences(tree)
        others = [each for each in reports if not each.endswith(NOT_MADE_AGAIN)]
        same = [] if others else ["the same versions and kind of processor as here"]
        message = ", ".join([*same, *reports])
        outcome = CheckOutcome.CLOSE if others else CheckOutcome.EQUAL
        yield CheckResult("made with", outcome, message)
        options = _Options(
            run_count=runs,
            tolerance=TOLERANCE if others else 0.0,
            is_earlier=has_other_version(tree),
            trust=trust,
            map=map,
            progress=progress or Progress(),
        )
        yield from _repeat_checks(tree, folder, objects, options)


def _repeat_checks(
    tree: xr.DataTree, folder: Path | None, objects: Objects | None, options: _Options
) -> Iterator[CheckResult]:
    """Repeat the runs and statistics that can be repeated."""
    with contextlib.ExitStack() as stack:
        try:
            restored = stack.enter_context(
                restored_study(tree, folder, trust=options.trust, objects=objects)
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
        untrusted = [] if options.trust else user_defined_models(study.text)
        if isinstance(study.model, DataModel):
            yield reread_runs(study, runs)
        elif unrepeated := unrepeated_runs(study, untrusted):
            yield unrepeated
        else:
            yield from _repeat_runs(study, tree, runs, options)
        options.progress.start_analysis()
        yield from check_points(study, runs, options.tolerance)
        besides = model_attributes(tree) if untrusted else []
        yield from _repeat_statistics(study, tree, runs, besides, options)


def _repeat_runs(
    study: ValidatedStudy, tree: xr.DataTree, runs: Runs, options: _Options
) -> Iterator[CheckResult]:
    """Repeat runs, with the programs and sources of today."""
    for variant in study.models.values():
        options.progress.start_preparation(variant.model.name)
        variant.model.prepare()
    tolerance = options.tolerance
    if others := list(different_programs(study, tree)):
        tolerance = TOLERANCE
        message = f"another than then: {', '.join(others)}"
        yield CheckResult("program", CheckOutcome.CLOSE, message)
    omitted = omitted_designs(runs)
    if set(study.designs) != set(omitted):
        yield repeated_runs(
            study, runs, options.run_count, tolerance, map=options.map, progress=options.progress
        )
    if omitted:
        yield repeated_batches(
            study, runs, options.run_count, tolerance, map=options.map, progress=options.progress
        )
    yield from check_sources(study, tree)


def _repeat_statistics(
    study: ValidatedStudy,
    tree: xr.DataTree,
    runs: Runs,
    besides: list[str],
    options: _Options,
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
    if not options.trust and (analyses := user_defined_analyses(study.text)):
        yield unchecked_analyses(analyses, tree)
        study, tree = replace(study, analyses=()), without_user_defined_statistics(tree)
    if recipe := check_recipe(tree):
        yield recipe
    ignored = [*provenance(), *of_python_functions(), *VERSION_ATTRIBUTES, *besides]
    ignored += [REUSED_RUNS, DEPENDENCIES]
    try:
        yield repeated_statistics(
            study,
            tree,
            runs,
            options.tolerance,
            ignored,
            is_earlier=options.is_earlier,
            progress=options.progress,
        )
    except StudyError as error:  # a user-defined analysis fails here
        message = "an analysis that its study names fails"
        yield CheckResult("statistics", CheckOutcome.IMPOSSIBLE, message, (str(error),))
