"""Make the archive of a study on disk from its finished runs, wherever they are, and new ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from uqpen.archive.read import read_unchecked
from uqpen.archive.write import prepare_destination, write
from uqpen.checkpoints.folder import FAILED, CheckpointFolder, lock_archive
from uqpen.checkpoints.identity import has_missing_runs, is_unchanged
from uqpen.checkpoints.journal import Journal, are_costly
from uqpen.checkpoints.recheck import Recheck, is_as_made, runs_that_are_as_made
from uqpen.checkpoints.replaced import lacks_runs, runs_not_kept, unusable_runs
from uqpen.checkpoints.sources import (
    ArchivePlace,
    RunFinder,
    RunSource,
    open_archives,
    sources_of_archives,
    unused_designs,
)
from uqpen.core.errors import (
    ArchiveError,
    CheckpointError,
    ClusterError,
    StudyError,
    TooManyFailedError,
)
from uqpen.core.labels import REUSED_RUNS
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.status import Status
from uqpen.execution import Map, Progress
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.identity import model_fingerprint, run_fingerprint
from uqpen.study.study import ValidatedStudy
from uqpen.study.user_defined_members import user_defined_objects
from uqpen.workflow import Checkpoints, run

__all__ = ["ResumeOptions", "make_archive"]


@dataclass(frozen=True)
class ResumeOptions:
    """Use of the runs that earlier calls have finished.

    Parameters
    ----------
    fresh : bool
        Whether all checkpointed runs are removed, and all runs made.
    repeat_failed : bool
        Whether the missing ones among the finished runs are made again.
    read_again : bool
        Whether the outputs of runs whose folders are kept are read from these, without a run. If
        finished runs have no folder, this needs `fresh`.
    recheck : bool or None
        Whether some of the finished runs are made again before all are taken; None for all but
        costly ones.
    reuse : sequence of str or Path, or None
        Further archives whose runs may be taken; None for no archive, not even the one that is
        replaced.
    """

    fresh: bool = False
    repeat_failed: bool = False
    read_again: bool = False
    recheck: bool | None = None
    reuse: Sequence[str | Path] | None = ()

    @property
    def takes_archived_runs(self) -> bool:
        """True if runs may be taken from archives."""
        return self.reuse is not None and not self.fresh


def make_archive(
    study: ValidatedStudy,
    path: str | Path,
    resume: ResumeOptions | None = None,
    *,
    map: Map = map,
    progress: Progress | None = None,
    runs_in_memory: int = RUNS_IN_MEMORY,
) -> xr.DataTree:
    """Make the runs of a study, analyse them, write the archive, and return it.

    Finished runs are kept in ``<path>.parts`` until the archive is complete. After an interruption
    of any kind, the next call makes only the remaining runs, and the same archive. Runs that the
    archive at `path` has already, or another one, are not made either. If nothing has changed since
    that archive was made, it stays as it is. Information that depends on time and place is in
    ``<path>.log``.

    Parameters
    ----------
    study : ValidatedStudy
        The result of `load_study`.
    path : str or Path
        The archive; one that is there is replaced when this one is complete. If it has costly runs
        that this one does not have, it is kept beside it, with a part of its hash in the name.
    resume : ResumeOptions, optional
        Use of finished runs; by default, all are taken.
    map : callable
        Like the built-in; it makes batches of runs. It cannot change a result.
    progress : Progress, optional
        Receives progress reports.
    runs_in_memory : int
        A design of more runs has them in files, also in the tree that is returned.

    Raises
    ------
    ArchiveError
        If the archive or its checkpoint cannot be written, another process is making it, or an
        archive to take runs from cannot be read.
    CheckpointError
        If there are checkpointed runs that this study would not make, or an archive to take runs
        from has runs of other models only; it states the changes.
    StudyError
        If folders are to be read again, and no model keeps any.
    """
    path = Path(path).absolute()
    resume = resume or ResumeOptions()
    prepare_destination(path)
    title = f"{study.name}: study {study.sha256[:16]}"
    log = path.with_name(f"{path.name}.log")
    is_worth_keeping = not resume.fresh and are_costly(log, path.name)
    with (
        lock_archive(path),
        Journal(log, title, progress or Progress()) as journal,
    ):
        named = resume.reuse or ()
        archives = open_archives(path, named, journal) if resume.takes_archived_runs else []
        replaced = next((each for each in archives if not each.is_named), None)
        recheck = Recheck(study, resume.recheck, map, journal)
        if (
            replaced
            and _is_complete(study, replaced.tree, resume)
            and is_as_made(study, replaced, recheck)
        ):
            journal.inform(f"{replaced.name}: nothing has changed, so it stays as it is")
            return replaced.tree
        is_unknown = _warn_if_unknown(study, journal)
        finished = _checkpoint_folder(study, path, journal, runs_in_memory)
        if resume.read_again:
            study = _read_again(study, finished, repeats_others=resume.fresh)
        _discard_runs(finished, resume)
        finder = _finder(
            study, finished, archives, journal, resume, recheck, has_parts=not is_unknown
        )

        def checkpoint(design: str, model: str, number: int) -> Checkpoint:
            own = (finished.scratch if is_unknown else finished.checkpoint)(design, model, number)
            return finder.checkpoint(own, design, model)

        try:
            tree = _run_study(study, map, journal, finished, checkpoint)
            if record := finder.record():
                tree.attrs[REUSED_RUNS] = record
            journal.start_step("writing the archive")
            # Of an archive that cannot be read, nobody knows what it has.
            loses = is_worth_keeping and (
                replaced is None or lacks_runs(study, tree, replaced.tree)
            )
            copy = _write(tree, path, finished, keeps_earlier=loses)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept_text(finished) or "nothing was written") from None
        journal.write_line(f"{path.name}: is written")
        if copy:
            journal.inform(f"{path.name}: the earlier archive is kept as {copy.name}")
        if any(study.design_runs(name) > runs_in_memory for name in study.designs):
            tree = read_unchecked(path, runs_in_memory)  # as the files of the runs are removed
        finished.remove_archived(finder.used_folders())
    return tree


def _warn_if_unknown(study: ValidatedStudy, journal: Journal) -> bool:
    """Warn of a model whose versions `Model.identity` cannot distinguish; its runs are not kept."""
    unknown = [(variant.model.unknown_dependency, "the model") for variant in study.models.values()]
    unknown += [(f"{name} is a Python object", "it") for name in user_defined_objects(study.text)]
    for reason, what in unknown:
        if reason:
            journal.warn(
                f"an interrupted start is not resumed: {reason}, so another version of {what} "
                "cannot be distinguished from this one"
            )
    return any(reason for reason, _ in unknown)


def _is_complete(study: ValidatedStudy, tree: xr.DataTree, resume: ResumeOptions) -> bool:
    """Check that an archive has all that a study would make."""
    return is_unchanged(study, tree) and not (resume.repeat_failed and has_missing_runs(tree))


def _checkpoint_folder(
    study: ValidatedStudy, path: Path, journal: Journal, runs_in_memory: int
) -> CheckpointFolder:
    """Return the folder of finished runs beside an archive."""
    fingerprints = {
        (model, design): run_fingerprint(study, model, design)
        for model in study.models
        for design in study.designs
    }
    folder = path.with_name(f"{path.name}.parts")
    finished = CheckpointFolder(folder, fingerprints, journal, runs_in_memory)
    finished.remove_temporary_files()
    return finished


def _read_again(
    study: ValidatedStudy, finished: CheckpointFolder, *, repeats_others: bool
) -> ValidatedStudy:
    """Return a study that reads the folders of its runs where they are kept.

    All finished runs are removed from the checkpoint, as other readings may give other outputs.
    With `repeats_others`, these may be runs without a folder, too.

    Raises
    ------
    StudyError
        If no model of the study keeps folders.
    CheckpointError
        If finished runs have no folder.
    """
    models = {name: variant.model.reading_again() for name, variant in study.models.items()}
    if all(variant.model is models[name] for name, variant in study.models.items()):
        raise StudyError("no model of the study keeps the folders of its runs; a command does")
    if not repeats_others and (without := _runs_without_folder(study, finished)):
        raise CheckpointError(
            f"{finished.folder}: {without} finished runs have no folder that could be read again\n"
            'keep = "all" in [model] keeps those of later runs; with --fresh, the others are '
            "repeated"
        )
    finished.remove_all()
    variants = {name: variant.with_model(models[name]) for name, variant in study.models.items()}
    return replace(study, models=variants)


def _runs_without_folder(study: ValidatedStudy, finished: CheckpointFolder) -> int:
    """Return the number of finished runs whose folders are not kept."""
    count = 0
    for model, found in finished.finished_runs():
        for position in np.flatnonzero(found.results.status == Status.OK).tolist():
            inputs = {name: float(values[position]) for name, values in found.inputs.items()}
            count += study.models[model].model.run_folder(inputs) is None
    return count


def _discard_runs(finished: CheckpointFolder, resume: ResumeOptions) -> None:
    """Remove the finished runs that are to be made again; check that the others are of use."""
    if resume.fresh:
        finished.remove_all()
    finished.check_compatibility()
    if resume.repeat_failed:
        finished.discard_failed()


def _finder(
    study: ValidatedStudy,
    finished: CheckpointFolder,
    archives: Sequence[ArchivePlace],
    journal: Journal,
    resume: ResumeOptions,
    recheck: Recheck,
    *,
    has_parts: bool,
) -> RunFinder:
    """Return the finished runs that a study may take, and report those that it cannot take.

    Some of those that it would take are made again; `has_parts` if it takes those of its designs.
    """
    archived = sources_of_archives(study, archives, journal)
    sources = {
        name: _model_sources(study, name, finished, archived[name], resume) for name in study.models
    }
    finder = runs_that_are_as_made(
        study, sources, archives, finished, recheck, journal, has_parts=has_parts
    )
    for archive in archives:
        for name, reason in unused_designs(archive.tree).items():
            journal.inform(f"{archive.name}: no run of its {name} is taken, as {reason}")
    replaced = (archive for archive in archives if not archive.is_named)
    not_kept = next((runs_not_kept(study, archive.tree) for archive in replaced), {})
    for name, text in (not_kept | unusable_runs(study, finder, not_kept)).items():
        journal.inform(f"{name}: {text}")
    return finder


def _model_sources(
    study: ValidatedStudy,
    model: str,
    finished: CheckpointFolder,
    archived: Sequence[RunSource],
    resume: ResumeOptions,
) -> list[RunSource]:
    """Return the finished runs that a model of a study may take; those set aside come first."""
    sources = [*archived]
    if not study.models[model].model.unknown_dependency:
        sources = [*finished.set_aside_sources(model, model_fingerprint(study, model)), *sources]
    if not resume.repeat_failed:
        return sources
    return [*filter(None, (each.without_statuses(FAILED) for each in sources))]


def _kept_text(finished: CheckpointFolder) -> str:
    """Return a sentence on the number of kept runs; empty for none."""
    return (
        f"{finished.runs} runs are kept; the same command continues from there"
        if finished.runs
        else ""
    )


def _run_study(
    study: ValidatedStudy,
    map: Map,
    journal: Journal,
    finished: CheckpointFolder,
    checkpoints: Checkpoints,
) -> xr.DataTree:
    """Run a study; keep its finished runs if it is stopped."""
    try:
        return run(study, map=map, progress=journal, checkpoints=checkpoints)
    except TooManyFailedError as error:
        finished.save()
        message = f"{finished.runs} runs are kept. {error.remedy}"
        raise type(error)(f"{error}\n{message}" if finished.runs else str(error)) from None
    except ClusterError as error:
        finished.save()
        raise ClusterError("\n".join(filter(None, (str(error), _kept_text(finished))))) from None
    except BaseException:
        finished.save()
        raise


def _write(
    tree: xr.DataTree, path: Path, finished: CheckpointFolder, *, keeps_earlier: bool
) -> Path | None:
    """Write the archive; if that fails, keep its runs."""
    try:
        return write(tree, path, keeps_earlier=keeps_earlier)
    except ArchiveError as error:
        finished.save()
        message = f"all {finished.runs} runs are kept; the same command continues from there"
        raise ArchiveError(f"{error}\n{message}") from None
    except BaseException:
        finished.save()
        raise
