"""From a study to its archive on the disk, whatever has interrupted it before."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from uqpen.archive.write import prepare_destination, write
from uqpen.errors import ArchiveError, ClusterError, TooManyLostError
from uqpen.evaluation import Map, Progress
from uqpen.making.journal import Journal
from uqpen.making.kept_runs import KeptRuns
from uqpen.making.lock import locked
from uqpen.study.decisive import decisive
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
    KeptRunsError
        If runs were kept that this study would not make; says what has changed.
    """
    path = Path(path).absolute()
    prepare_destination(path)
    with (
        locked(path),
        Journal(_beside(path, "log"), study, progress or Progress()) as journal,
    ):
        made_of = {
            (model, design): decisive(study, model, design)
            for model in study.models
            for design in study.designs
        }
        kept = KeptRuns(_beside(path, "parts"), made_of, journal)
        kept.clean()
        if fresh:
            kept.remove()
        kept.refuse_others()
        if lost_again:
            kept.forget_lost()
        try:
            tree = _made(study, map, journal, kept)
            _write(tree, path, kept)
        except KeyboardInterrupt:
            told = f"{kept.runs} runs are kept; the same command goes on from there"
            raise KeyboardInterrupt(told if kept.runs else "nothing was written") from None
        journal.say(f"{path.name}: is written")
        kept.finish()
    return tree


def _made(study: Study, map: Map, journal: Journal, kept: KeptRuns) -> xr.DataTree:
    """What a study tells; the runs that are done are kept if it comes to no end."""
    try:
        return run(study, map=map, progress=journal, keepers=kept.keeper)
    except TooManyLostError as error:
        kept.keep()
        told = (
            f"{kept.runs} runs are kept: with a larger share the same command goes on from them,\n"
            "with --lost-again it makes the lost ones of them again"
        )
        raise TooManyLostError(f"{error}\n{told}") from None
    except ClusterError as error:
        kept.keep()
        told = f"{kept.runs} runs are kept; the same command goes on from there"
        raise ClusterError(f"{error}\n{told}" if kept.runs else str(error)) from None
    except BaseException:
        kept.keep()
        raise


def _write(tree: xr.DataTree, path: Path, kept: KeptRuns) -> None:
    """Write the archive; if that cannot be done, its runs are kept."""
    try:
        write(tree, path)
    except ArchiveError as error:
        kept.keep()
        told = f"all {kept.runs} runs are kept; the same command goes on from there"
        raise ArchiveError(f"{error}\n{told}") from None
    except BaseException:
        kept.keep()
        raise


def _beside(path: Path, ending: str) -> Path:
    return path.with_name(f"{path.name}.{ending}")
