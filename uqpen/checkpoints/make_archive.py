"""Make the archive of a study on disk; resume after an interruption."""

from __future__ import annotations

import contextlib
from pathlib import Path

import xarray as xr

from uqpen.archive.read import open_archive
from uqpen.archive.write import prepare_destination, write
from uqpen.checkpoints.checkpoint_folder import CheckpointFolder
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.lock import lock_archive
from uqpen.checkpoints.replaced_designs import warn_of_runs_not_kept
from uqpen.core.errors import ArchiveError, ClusterError, TooManyFailedError
from uqpen.execution import Map, Progress
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.fingerprint import run_fingerprint
from uqpen.study.outside_members import own_objects
from uqpen.study.study import ValidatedStudy
from uqpen.workflow import Checkpoints, run

__all__ = ["make_archive"]


def make_archive(
    study: ValidatedStudy,
    path: str | Path,
    *,
    map: Map = map,
    fresh: bool = False,
    lost_again: bool = False,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Make the runs of a study, analyse them, write the archive, and return it.

    Finished runs are kept in ``<path>.parts`` until the archive is complete. After an interruption
    of any kind, the next call makes only the remaining runs, and the same archive. Information that
    depends on time and place is in ``<path>.log``.

    Parameters
    ----------
    study : ValidatedStudy
        The result of `load_study`.
    path : str or Path
        The archive; one that is there is replaced when this one is complete.
    map : callable
        Like the built-in; it makes batches of runs. It cannot change a result.
    fresh : bool
        Whether all checkpointed runs are removed, and made again.
    lost_again : bool
        Whether only the missing ones among them are.
    progress : Progress, optional
        Receives progress reports.

    Raises
    ------
    ArchiveError
        If the archive or its checkpoint cannot be written, or another process is making it.
    CheckpointError
        If there are checkpointed runs that this study would not make; it states the changes.
    """
    path = Path(path).absolute()
    prepare_destination(path)
    title = f"{study.name}: study {study.sha256[:16]}"
    with (
        lock_archive(path),
        Journal(_sibling_path(path, "log"), title, progress or Progress()) as journal,
    ):
        if not fresh and path.exists():
            with contextlib.suppress(ArchiveError):  # a damaged one is replaced all the same
                warn_of_runs_not_kept(study, open_archive(path), journal)
        is_unknown = _warn_if_unknown(study, journal)
        fingerprints = {
            (model, design): run_fingerprint(study, model, design)
            for model in study.models
            for design in study.designs
        }
        kept = CheckpointFolder(_sibling_path(path, "parts"), fingerprints, journal)
        kept.remove_temporary_files()
        if fresh:
            kept.remove_all()
        kept.check_compatibility()
        if lost_again:
            kept.discard_failed()
        checkpoints = _no_checkpoints if is_unknown else kept.checkpoint
        try:
            tree = _run_study(study, map, journal, kept, checkpoints)
            journal.start_step("writing the archive")
            _write(tree, path, kept)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(_kept_text(kept) or "nothing was written") from None
        journal.write_line(f"{path.name}: is written")
        kept.remove_archived()
    return tree


def _warn_if_unknown(study: ValidatedStudy, journal: Journal) -> bool:
    """Warn of a model whose versions `Model.identity` cannot distinguish; its runs are not kept."""
    unknown = [(variant.model.unknown_dependency, "the model") for variant in study.models.values()]
    unknown += [(f"{name} is a Python object", "it") for name in own_objects(study.text)]
    for reason, what in unknown:
        if reason:
            journal.warn(
                f"an interrupted start is not resumed: {reason}, so another version of {what} "
                "cannot be distinguished from this one"
            )
    return any(reason for reason, _ in unknown)


def _no_checkpoints(design: str, model: str, number: int) -> Checkpoint:
    return Checkpoint()


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
        message = (
            f"{kept.runs} runs are kept. With a larger share, the same command continues from "
            "them;\nwith --lost-again, it repeats the failed ones"
        )
        raise TooManyFailedError(f"{error}\n{message}" if kept.runs else str(error)) from None
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
