"""Functions of the library that make and check archives, with worker processes and progress."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from uqpen import workflow
from uqpen.checkpoints import make_archive as checkpoints
from uqpen.core.model import Model
from uqpen.execution import EXECUTORS, Map, Progress
from uqpen.execution.processes import processes
from uqpen.notebook import notebook_progress
from uqpen.results.archive import Archive
from uqpen.study.python_study import PythonModel, as_study, joint_paths
from uqpen.study.study import ValidatedStudy
from uqpen.study.table_reader import OBJECT
from uqpen.verification.check_result import CheckResult
from uqpen.verification.verify import verify as verify_parts

# What is run: a study, the path of its file, or a model beside the other arguments of a study.
Runnable = ValidatedStudy | str | Path | Callable[..., Mapping[str, Any]] | Model | PythonModel


def run(
    study: Runnable,
    *,
    workers: int = 1,
    map: Map | None = None,
    progress: Progress | None = None,
    **arguments: Any,
) -> Archive:
    """Make all runs of a study and analyse them, in memory.

    Parameters
    ----------
    study : Study, str, Path, or callable
        A study that was made in Python, or the path of a study file; or a function, with the other
        arguments of `Study`.
    workers : int
        Number of processes that make runs. No result depends on it. A script that uses more than
        one calls this under ``if __name__ == "__main__":``.
    map : callable, optional
        Like the built-in; it makes the batches of runs in place of worker processes.
    progress : Progress, optional
        Receives reports of progress; by default a bar in a notebook.
    **arguments
        Arguments of `Study`, such as ``inputs``: of a function all of them, of a study those that
        take the place of its own.

    Returns
    -------
    Archive
        The content of the archive that `make_archive` would write.

    Raises
    ------
    StudyError
        If the arguments are no study.
    TooManyFailedError
        If more runs fail than the study allows.
    """
    checked = as_study(study, arguments)
    with _progress(progress) as reporter, _map(workers, map, reporter) as spread:
        return Archive.of(workflow.run(checked, map=spread, progress=reporter))


def make_archive(
    study: Runnable,
    path: str | Path,
    *,
    workers: int = 1,
    map: Map | None = None,
    progress: Progress | None = None,
    fresh: bool = False,
    lost_again: bool = False,
    read_again: bool = False,
    recheck: bool | None = None,
    reuse: Sequence[str | Path] = (),
    **arguments: Any,
) -> Archive:
    """Make the runs of a study, analyse them, and write everything into one archive.

    A run that the archive at `path` has already is not made again, if the model is the same. If
    nothing has changed since that archive was made, it stays as it is. Finished runs are kept
    beside the archive until it is complete. After an interruption, the same call goes on from them.

    Parameters
    ----------
    study, workers, map, progress, **arguments
        As in `run`.
    path : str or Path
        The archive to write; its folder is made if there is none. If one is there whose runs took
        more than a minute, and this one does not have them, it is kept beside it under another
        name.
    fresh : bool
        True to make all runs, also those that an earlier call has made, and to replace the archive
        whatever runs it has.
    lost_again : bool
        True to make again those finished runs that failed.
    read_again : bool
        True to read the outputs of a program's runs again where their folders are kept, in place
        of making the runs. If finished runs have no folder, this needs `fresh`.
    recheck : bool, optional
        Whether some of the finished runs are made again before all are taken, to see that they are
        the same. By default, they are unless a run takes long. If not, the archive says so.
    reuse : sequence of str or Path
        Further archives. Their runs are not made again, either.

    Raises
    ------
    TooManyFailedError
        If more runs fail than the study allows.
    ArchiveError
        If the archive or its checkpoint cannot be written, or an archive cannot be read.
    CheckpointError
        If there are kept runs that this study would not make, or `reuse` names an archive of
        another model; it states the changes, or how a run that is made again differs.
    """
    checked = as_study(study, arguments)
    with _progress(progress) as reporter, _map(workers, map, reporter) as spread:
        tree = checkpoints.make_archive(
            checked,
            path,
            checkpoints.ResumeOptions(
                fresh=fresh,
                repeat_failed=lost_again,
                read_again=read_again,
                recheck=recheck,
                reuse=reuse,
            ),
            map=spread,
            progress=reporter,
        )
        return Archive.of(tree)


def verify(
    path: str | Path,
    *,
    model: Callable[..., Mapping[str, Any]] | Mapping[str, Callable[..., Any]] | None = None,
    inputs: Mapping[Any, object] | None = None,
    surrogates: Mapping[str, object] | None = None,
    folder: str | Path | None = None,
    runs: int | None = 0,
    trust: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> list[CheckResult]:
    """Check an archive against its hashes, its study, its runs and its statistics.

    Parameters
    ----------
    path : str or Path
        The archive.
    model : callable, or mapping of str to callable, optional
        The function that the study was made with, where it is an object of a Python program: no
        archive contains it. For several models, a function by the name of each.
    inputs : mapping of str to object, optional
        The distributions of inputs, where they are objects of a Python program; joint ones by the
        tuple of their inputs.
    surrogates : mapping of str to object, optional
        The surrogates, where their classes are those of a Python program.
    folder : str or Path, optional
        Folder with the files that the study names; by default, the archived files are used.
    runs : int or None
        Number of runs to repeat, drawn at random; None for all. By default 100, and 1000 of a model
        with noise whose runs have no seed: those are compared by their distribution.
    trust : bool
        True if code that the archive names may be executed.
    workers : int
        Number of processes that make runs.
    progress : Progress, optional
        Receives reports of progress.

    Returns
    -------
    list of CheckResult
        One for each part, with its outcome and a message.

    Raises
    ------
    ArchiveError
        If it is no archive.
    """
    inputs = inputs or {}
    paths = joint_paths(inputs)
    objects: dict[tuple[str | int, ...], object] = {
        paths[name] if isinstance(name, tuple) else ("inputs", name, OBJECT): distribution
        for name, distribution in inputs.items()
    }
    objects |= {("surrogates", name): surrogate for name, surrogate in (surrogates or {}).items()}
    if isinstance(model, Mapping):
        objects |= {("models", name): function for name, function in model.items()}
    elif model is not None:
        objects["model",] = model
    with _progress(progress) as reporter, _map(workers, None, reporter) as spread:
        return list(
            verify_parts(
                Path(path),
                folder=None if folder is None else Path(folder),
                runs=runs,
                trust=trust,
                objects=objects,
                map=spread,
                progress=reporter,
            )
        )


@contextlib.contextmanager
def _map(workers: int, given: Map | None, progress: Progress) -> Iterator[Map]:
    """Provide the map that makes runs: in this process, or on several."""
    if given is not None or workers == 1:
        yield given or map
        return
    progress.start_step(EXECUTORS["workers"].step.format(workers))
    with processes(workers) as spread:
        yield spread


@contextlib.contextmanager
def _progress(given: Progress | None) -> Iterator[Progress]:
    if given is not None:
        yield given
        return
    with notebook_progress() as reporter:
        yield reporter
