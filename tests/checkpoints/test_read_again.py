"""Kept folders of runs are read again by corrected readings, without a run."""

import sys

import pytest
from study_text import study_text

import uqpen
from uqpen.core.errors import CheckpointError, FirstRunsFailedError, StudyError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only")

STUDY = """\
seed = 1
[model]
command = ["./solver", "{{length}}"]
noise = false
keep = "{keep}"
inputs = {{ length = "mm" }}
outputs = {{ y = "mm" }}
read = {{ text = "stdout", pattern = '{pattern}' }}
[inputs]
length = "(7 ± 1) mm"
[designs.some]
kind = "monte-carlo"
runs = 20
"""
RIGHT, WRONG = r"result (\S+)", r"resutl (\S+)"


@pytest.fixture
def folder(tmp_path):
    """A folder with a program that counts its runs."""
    solver = tmp_path / "solver"
    solver.write_text(f"#!/bin/sh\necho run >> {tmp_path}/calls\necho result $1\n")
    solver.chmod(0o755)
    return tmp_path


def made(folder, pattern, keep="failed", **options):
    text = STUDY.format(pattern=pattern, keep=keep)
    study = uqpen.parse_study(text, folder=folder, name="deck")
    return uqpen.make_archive(study, folder / "deck.nc", **options)


def calls(folder):
    """The number of runs since the last question."""
    lines = (folder / "calls").read_text().splitlines() if (folder / "calls").exists() else []
    (folder / "calls").unlink(missing_ok=True)
    return len(lines)


def test_a_corrected_pattern_costs_no_run(folder):
    with pytest.raises(FirstRunsFailedError, match="deck_runs"):
        made(folder, WRONG)
    assert calls(folder) == 10
    with pytest.raises(CheckpointError, match=r"read\.pattern(.|\n)* with --read-again,\n"):
        made(folder, RIGHT)
    made(folder, RIGHT, read_again=True)
    assert calls(folder) == 10
    notes = [kept.read_text() for kept in (folder / "deck_runs").glob("*/outcome.txt")]
    assert len(notes) == 10
    assert all(note.startswith("ok\ny = ") for note in notes)
    read = (folder / "deck.nc").read_bytes()
    made(folder, RIGHT, fresh=True)
    assert calls(folder) == 20
    assert read == (folder / "deck.nc").read_bytes()


def test_folders_of_another_program_are_not_read(folder):
    with pytest.raises(FirstRunsFailedError):
        made(folder, WRONG)
    calls(folder)
    with (folder / "solver").open("a") as script:
        script.write("# another version\n")
    made(folder, RIGHT, read_again=True)
    assert calls(folder) == 20


@pytest.mark.parametrize("damage", ["", "[]", '{"made_by": 1}', "{"])
def test_a_folder_without_a_record_is_made_again(folder, damage):
    made(folder, RIGHT, keep="all")
    calls(folder)
    for kept in sorted((folder / "deck_runs").iterdir())[:3]:
        (kept / "run.json").write_text(damage)
    made(folder, r"(\S+)$", keep="all", read_again=True)
    assert calls(folder) == 3


def test_finished_runs_without_a_folder_are_not_thrown_away(folder):
    fail = "case $1 in 7*) exit 1;; esac\n"
    script = (folder / "solver").read_text()
    (folder / "solver").write_text(script.replace("echo result", f"{fail}echo result"))
    text = "\n[failures]\nat_most = '5 %'\n"
    study = uqpen.parse_study(
        STUDY.format(pattern=RIGHT, keep="failed") + text, folder=folder, name="deck"
    )
    with pytest.raises(uqpen.UqpenError):
        uqpen.make_archive(study, folder / "deck.nc")
    with pytest.raises(CheckpointError, match="finished runs have no folder that could be read"):
        made(folder, WRONG, read_again=True)
    made(folder, RIGHT, read_again=True, fresh=True)


def test_only_programs_have_folders(tmp_path):
    design = {"some": {"kind": "monte-carlo", "runs": 4}}
    inputs = dict.fromkeys(("x1", "x2", "x3"), (-3, 3))
    study = uqpen.parse_study(study_text("ishigami", inputs=inputs, designs=design))
    with pytest.raises(StudyError, match="no model of the study keeps the folders of its runs"):
        uqpen.make_archive(study, tmp_path / "study.nc", read_again=True)
