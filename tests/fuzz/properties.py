"""What holds of every file, right or wrong: a command succeeds, or says what is wrong."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import NamedTuple
from unittest import mock

from uqpen.archive.read import read_tree
from uqpen.cli.main import main
from uqpen.core.errors import StudyError, UqpenError
from uqpen.study.load import load_study
from uqpen.study.study import ValidatedStudy
from uqpen.verification.archived_study import archived_study

__all__ = ["ARCHIVE_COMMANDS", "archive_outcome", "study_outcome"]

# More of a mutant's runs than these are not made.
_MOST_RUNS = 400

# Commands on an archive; {file} is the damaged one, {other} a whole one.
ARCHIVE_COMMANDS = (
    "show {file}",
    "show --all {file}",
    "show --json {file}",
    "report {file} -o page.html",
    "figure {file} --list",
    "figure {file} cdf histogram methods -o figure.png",
    "verify {file}",
    "verify --runs 5 {file}",
    "diff {file} {other}",
    "diff {other} {file}",
    "rerun {file} -o again.nc",
)

# Done; a mistake in what was given; all runs lost; a difference found.
_CODES = (0, 2, 3, 4)


class Outcome(NamedTuple):
    """What became of a call of the command line."""

    code: int
    out: str
    err: str


def called(*arguments: str) -> Outcome:
    """The command line; whatever is no exit is raised, a warning that got out included."""
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["uqpen", *arguments]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        _strictly(),
    ):
        try:
            main()
        except SystemExit as left:
            return Outcome(int(left.code or 0), out.getvalue(), err.getvalue())
    raise AssertionError("the command line did not leave with a code")


@contextlib.contextmanager
def _strictly() -> Iterator[None]:
    # A model's own warnings are caught where it is run, and shown to the user.
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    assert not caught, [str(each) for each in caught]


def study_outcome(file: Path, random: Random) -> str:
    """In a word what became of a study; an assertion where that is a fault of uqpen's."""
    study = _study(file)
    done = called("check", str(file))
    assert done.code == (2 if study is None else 0), done
    if study is None:
        # Whatever else a file says, its mistakes stand under its name.
        assert str(file) in done.err, done.err
        return "refused"
    return _run_outcome(study, file, random)


def _study(file: Path) -> ValidatedStudy | None:
    try:
        with _strictly():
            return load_study(file)
    except StudyError:
        return None


def _run_outcome(study: ValidatedStudy, file: Path, random: Random) -> str:
    if study.runs > _MOST_RUNS:
        return "right, too many runs to make"
    done = called("study", str(file), "-o", "made.nc")
    assert done.code in (0, 2, 3), done
    if done.code == 2:
        assert done.err, done
        return "refused by its runs"
    command = random.choice(("show --all", "show --json", "verify --trust --runs 5"))
    again = called(*command.split(), "made.nc")
    assert again.code == 0, again
    return {0: "run", 3: "lost"}[done.code]


def archive_outcome(file: Path, other: Path, command: str) -> str:
    """In a word what a command says of an archive; an assertion where it is at fault."""
    if command.startswith("rerun") and _asks_for_too_much(file):
        return "asks for too many runs"
    arguments = [part.format(file=file, other=other) for part in command.split()]
    done = called(*arguments)
    assert done.code in _CODES, done
    assert done.out or done.err, done
    if done.code == 2 and not command.startswith("verify"):
        assert done.err, done
    assert not Path("executed").exists(), "executed what the archive names"
    return {0: "taken", 2: "refused", 3: "lost", 4: "different"}[done.code]


def _asks_for_too_much(file: Path) -> bool:
    """Whether the study of an archive would make more runs than there is time for."""
    try:
        study = archived_study(read_tree(file), Path(), trust=False)
    except UqpenError:
        return False
    return study.runs > _MOST_RUNS
