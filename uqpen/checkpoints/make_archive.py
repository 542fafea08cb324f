"""Make the archive of a study on disk from its finished runs, wherever they are, and new ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from uqpen.archive.read import read_unchecked
from uqpen.archive.write import prepare_destination, write
from uqpen.checkpoints.archived_runs import unused_designs
from uqpen.checkpoints.changed_designs import unusable_runs
from uqpen.checkpoints.checkpoint_folder import FAILED, CheckpointFolder
from uqpen.checkpoints.earlier_runs import RunSource
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.lock import lock_archive
from uqpen.checkpoints.read_again import read_again as reading_again
from uqpen.checkpoints.replaced_designs import runs_not_kept
from uqpen.checkpoints.reused_runs import ReusedRuns
from uqpen.checkpoints.run_sources import (
    EarlierArchive,
    open_named,
    open_replaced,
    sources_of_archives,
)
from uqpen.checkpoints.unchanged import has_missing_runs, is_unchanged
from uqpen.core.errors import ArchiveError, ClusterError, TooManyFailedError
from uqpen.core.labels import REUSED_RUNS
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.execution import Map, Progress
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.fingerprint import model_fingerprint, run_fingerprint
from uqpen.study.study import ValidatedStudy
from uqpen.study.user_defined_members import user_defined_objects
from uqpen.workflow import Checkpoints, run

__all__ = ["make_archive"]


def make_archive(
    study: ValidatedStudy,
    path: str | Path,
    *,
    map: Map = map,
    fresh: bool = False,
    lost_again: bool = False,
    read_again: bool = False,
    reuse: Sequence[str | Path] | None = (),
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
        The archive; one that is there is replaced when this one is complete.
    map : callable
        Like the built-in; it makes batches of runs. It cannot change a result.
    fresh : bool
        Whether all checkpointed runs are removed, and all runs made.
    lost_again : bool
        Whether the missing ones among the finished runs are made again.
    read_again : bool
        Whether the outputs of runs whose folders are kept are read from these, without a run. If
        finished runs have no folder, this needs `fresh`.
    reuse : sequence of str or Path, or None
        Further archives whose runs may be taken; None for no archive, not even that at `path`.
    progress : Progress, optional
        Receives progress reports.
    runs_in_memory : int
        A design of more runs has them in files, also in the tree that is returned.

    Raises
    ------
    ArchiveError
        If the archive or its checkpoint cannot be written, another process is making it, or one of
        `reuse` cannot be read.
    CheckpointError
        If there are checkpointed runs that this study would not make, or an archive of `reuse` has
        runs of other models only; it states the changes.
    StudyError
        If folders are to be read again, and no model keeps any.
    """
    path = Path(path).absolute()
    prepare_destination(path)
    title = f"{study.name}: study {study.sha256[:16]}"
    with (
        lock_archive(path),
        Journal(_sibling_path(path, "log"), title, progress or Progress()) as journal,
    ):
        takes_archives = reuse is not None and not fresh
        named = open_named(reuse or (), path) if takes_archives else []
        replaced = open_replaced(path, journal) if takes_archives else None
        if replaced and _is_complete(study, replaced.tree, lost_again=lost_again):
            journal.inform(f"{replaced.place}: nothing has changed, so it stays as it is")
            return replaced.tree
        is_unknown = _warn_if_unknown(study, journal)
        kept = _checkpoint_folder(study, path, journal, runs_in_memory)
        if read_again:
            study = reading_again(study, kept, repeats_others=fresh)
        _discard_runs(kept, every=fresh, failed=lost_again)
        archives = [replaced, *named] if replaced else named
        sources = _run_sources(study, kept, archives, journal, lost_again=lost_again)
        reused = ReusedRuns(study, sources, journal)
        for archive in archives:
            for name, reason in unused_designs(archive.tree).items():
                journal.inform(f"{archive.place}: no run of its {name} is taken, as {reason}")
        not_kept = runs_not_kept(study, replaced.tree) if replaced else {}
        for name, text in (not_kept | unusable_runs(study, sources, reused, not_kept)).items():
            journal.inform(f"{name}: {text}")

        def checkpoint(design: str, model: str, number: int) -> Checkpoint:
            own = (kept.scratch if is_unknown else kept.checkpoint)(design, model, number)
            return reused.checkpoint(own, design, model)

        try:
            tree = _run_study(study, map, journal, kept, checkpoint)
            if record := reused.record():
                tree.attrs[REUSED_RUNS] = record
            journal.start_step("writing the archive")
            _write(tree, path, kept)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept_text(kept) or "nothing was written") from None
        journal.write_line(f"{path.name}: is written")
        if any(study.design_runs(name) > runs_in_memory for name in study.designs):
            tree = read_unchecked(path, runs_in_memory)  # as the files of the runs are removed
        kept.remove_archived(reused.used_folders())
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


def _is_complete(study: ValidatedStudy, tree: xr.DataTree, *, lost_again: bool) -> bool:
    """Check that an archive has all that a study would make."""
    return is_unchanged(study, tree) and not (lost_again and has_missing_runs(tree))


def _checkpoint_folder(
    study: ValidatedStudy, path: Path, journal: Journal, runs_in_memory: int
) -> CheckpointFolder:
    """Return the folder of finished runs beside an archive."""
    fingerprints = {
        (model, design): run_fingerprint(study, model, design)
        for model in study.models
        for design in study.designs
    }
    folder = _sibling_path(path, "parts")
    kept = CheckpointFolder(folder, fingerprints, journal, runs_in_memory)
    kept.remove_temporary_files()
    return kept


def _discard_runs(kept: CheckpointFolder, *, every: bool, failed: bool) -> None:
    """Remove the finished runs that are to be made again; check that the others are of use."""
    if every:
        kept.remove_all()
    kept.check_compatibility()
    if failed:
        kept.discard_failed()


def _run_sources(
    study: ValidatedStudy,
    kept: CheckpointFolder,
    archives: Sequence[EarlierArchive],
    journal: Journal,
    *,
    lost_again: bool,
) -> dict[str, list[RunSource]]:
    """Return the earlier runs that the study may take, by the name of a model."""
    archived = sources_of_archives(study, archives, journal)
    found: dict[str, list[RunSource]] = {}
    for name, variant in study.models.items():
        sources = archived[name]
        if not variant.model.unknown_dependency:
            sources = [*kept.set_aside_sources(name, model_fingerprint(study, name)), *sources]
        if lost_again:
            sources = [*filter(None, (each.without_statuses(FAILED) for each in sources))]
        found[name] = sources
    return found


def _kept_text(kept: CheckpointFolder) -> str:
    """Return a sentence on the number of kept runs; empty for none."""
    return f"{kept.runs} runs are kept; the same command continues from there" if kept.runs else ""


def _run_study(
    study: ValidatedStudy,
    map: Map,
    journal: Journal,
    kept: CheckpointFolder,
    checkpoints: Checkpoints,
) -> xr.DataTree:
    """Run a study; keep its finished runs if it is stopped."""
    try:
        return run(study, map=map, progress=journal, checkpoints=checkpoints)
    except TooManyFailedError as error:
        kept.save()
        message = f"{kept.runs} runs are kept. {error.remedy}"
        raise type(error)(f"{error}\n{message}" if kept.runs else str(error)) from None
    except ClusterError as error:
        kept.save()
        raise ClusterError("\n".join(filter(None, (str(error), _kept_text(kept))))) from None
    except BaseException:
        kept.save()
        raise


def _write(tree: xr.DataTree, path: Path, kept: CheckpointFolder) -> None:
    """Write the archive; if that fails, keep its runs."""
    try:
        write(tree, path)
    except ArchiveError as error:
        kept.save()
        message = f"all {kept.runs} runs are kept; the same command continues from there"
        raise ArchiveError(f"{error}\n{message}") from None
    except BaseException:
        kept.save()
        raise


def _sibling_path(path: Path, ending: str) -> Path:
    return path.with_name(f"{path.name}.{ending}")
