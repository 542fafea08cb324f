"""From a study to its archive on the disk, whatever has interrupted it before."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from uqpen.archive.write import prepare_destination, write
from uqpen.checkpoints.checkpoint_folder import CheckpointFolder
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.lock import lock_archive
from uqpen.core.errors import ArchiveError, ClusterError, TooManyFailedError
from uqpen.execution import Map, Progress
from uqpen.study.fingerprint import run_fingerprint
from uqpen.study.study import Study
from uqpen.workflow import run

__all__ = ["make_archive"]


def make_archive(
    study: Study,
    path: str | Path,
    *,
    map: Map = map,
    fresh: bool = False,
    lost_again: bool = False,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Make the runs of a study, analyse them, and write the archive.

    Runs that are done are kept in ``<path>.parts`` until the archive is there. However this ends
    before, the next call makes only those that are missing, and the same archive. What depends on
    time and place is told in ``<path>.log``.

    Parameters
    ----------
    study : Study
        What `load_study` returns.
    path : str or Path
        The archive; one that is there is replaced when this one is complete.
    map : callable
        Like the built-in: where batches of runs are made. It cannot change a result.
    fresh : bool
        Whether runs that were kept are removed, and made again.
    lost_again : bool
        Whether only those of them are that were lost.
    progress : Progress, optional
        Told how far it is.

    Returns
    -------
    DataTree
        What `run` returns.

    Raises
    ------
    ArchiveError
        If the archive, or what is kept, cannot be written, or another process is at it.
    CheckpointError
        If runs were kept that this study would not make; says what has changed.
    """
    path = Path(path).absolute()
    prepare_destination(path)
    with (
        lock_archive(path),
        Journal(_sibling_path(path, "log"), study, progress or Progress()) as journal,
    ):
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
        try:
            tree = _run_study(study, map, journal, kept)
            _write(tree, path, kept)
        except KeyboardInterrupt:
            message = f"{kept.runs} runs are kept; the same command goes on from there"
            raise KeyboardInterrupt(message if kept.runs else "nothing was written") from None
        journal.write_line(f"{path.name}: is written")
        kept.remove_archived()
    return tree


def _run_study(study: Study, map: Map, journal: Journal, kept: CheckpointFolder) -> xr.DataTree:
    """What a study tells; the runs that are done are kept if it comes to no end."""
    try:
        return run(study, map=map, progress=journal, checkpoints=kept.checkpoint)
    except TooManyFailedError as error:
        kept.save()
        message = (
            f"{kept.runs} runs are kept: with a larger share the same command goes on from them,\n"
            "with --lost-again it makes the lost ones of them again"
        )
        raise TooManyFailedError(f"{error}\n{message}") from None
    except ClusterError as error:
        kept.save()
        message = f"{kept.runs} runs are kept; the same command goes on from there"
        raise ClusterError(f"{error}\n{message}" if kept.runs else str(error)) from None
    except BaseException:
        kept.save()
        raise


def _write(tree: xr.DataTree, path: Path, kept: CheckpointFolder) -> None:
    """Write the archive; if that cannot be done, its runs are kept."""
    try:
        write(tree, path)
    except ArchiveError as error:
        kept.save()
        message = f"all {kept.runs} runs are kept; the same command goes on from there"
        raise ArchiveError(f"{error}\n{message}") from None
    except BaseException:
        kept.save()
        raise


def _sibling_path(path: Path, ending: str) -> Path:
    return path.with_name(f"{path.name}.{ending}")
