"""Runs that would be taken are made again first: changes of a model that its files do not show."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest
from study_text import TWO_INPUTS as STUDY

import uqpen
from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.core.errors import CheckpointError
from uqpen.core.labels import NOT_MADE_AGAIN, REUSED_RUNS
from uqpen.core.progress import Progress
from uqpen.core.status import Status
from uqpen.verification.check_result import CheckOutcome

pytestmark = pytest.mark.slow

# The size of a file beside it decides its results, and nothing that reads a file tells so.
MODEL = """\
import os, pathlib, random, signal
here = pathlib.Path(__file__).parent
def simulate(x, y):
    with (here / "calls").open("a") as stream:
        stream.write(f"{getattr(x, 'size', 1)}\\n")
    stops = [int(file.name[5:]) for file in here.glob("stop_*")]
    if len((here / "calls").read_text().split()) in stops:
        os.kill(os.getpid(), getattr(signal, os.environ.get("STOP_BY", "SIGINT")))
    hidden = os.stat(here / "hidden").st_size
    if hidden == 7:
        raise ValueError(f"no result at {x}")
    if hidden == 8 or (hidden == 9 and x < 0):
        raise ZeroDivisionError(f"another cause at {x}")
    return {"z": x * y * hidden + (random.random() if hidden == 5 else 0)}
"""
ASKED = STUDY.replace("[designs.one]", "[outputs.z]\nquantiles = [0.2]\n[designs.one]")
VECTORIZED = STUDY.replace("[inputs]", "vectorized = true\n[inputs]", 1)
EQUAL = "model.py is the same; 30 of 30 runs made again are equal"


class Recorded(Progress):
    """What a user is shown."""

    def __init__(self):
        self.texts = []
        self.steps = []
        self.reused = self.restored = 0

    def inform(self, text):
        self.texts.append(text.replace("\u202f", " "))

    def start_step(self, name, number=0, total=0):
        self.steps.append(name)

    def count_reused(self, runs, place):
        self.reused += runs

    def count_restored(self, runs):
        self.restored += runs

    def warn(self, text):
        self.texts.append(text)


class Studies:
    """A study in a folder, whose model depends on what its files do not show."""

    def __init__(self, folder):
        self.folder = folder
        self.reported = Recorded()
        (folder / "model.py").write_text(MODEL)
        self.hide(2)

    def hide(self, size):
        """Change the model: the size of a file."""
        (self.folder / "hidden").write_text("x" * size)

    def make(self, text=STUDY, name="study.nc", **options):
        self.reported = Recorded()
        (self.folder / "study.toml").write_text(text)
        study = uqpen.load_study(self.folder / "study.toml")
        path = self.folder / name
        uqpen.make_archive(study, path, progress=self.reported, **options)
        return path.read_bytes()

    def stop(self, calls, text=STUDY, **options):
        """Make an archive that is interrupted at a call, and what is reported of it."""
        (self.folder / "calls").write_text("")
        (self.folder / f"stop_{calls}").touch()
        with pytest.raises(KeyboardInterrupt) as interrupted:
            self.make(text, **options)
        (self.folder / f"stop_{calls}").unlink()
        return str(interrupted.value)

    def calls(self):
        """The sizes of the calls since the last look."""
        found = (self.folder / "calls").read_text().split()
        (self.folder / "calls").write_text("")
        return [*map(int, found)]

    def log(self, line):
        with (self.folder / "study.nc.log").open("a") as stream:
            stream.write(f"2026-11-23T12:00:00.000+00:00 {line}\n")


@pytest.fixture(autouse=True)
def _slow(monkeypatch):
    """Runs are sent one by one, as those are that take a second each."""
    monkeypatch.setattr("uqpen.execution.evaluation.WORTH_SENDING", 0.0)
    monkeypatch.setattr(os, "fsync", lambda file: None)
    # On any machine, as many are made again as there are.
    monkeypatch.setattr("uqpen.checkpoints.recheck._AT_MOST", 1e9)


@pytest.fixture
def studies(tmp_path):
    return Studies(tmp_path)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """The folder of the study with its archive, which is made once."""
    studies = Studies(tmp_path_factory.mktemp("first"))
    studies.make()
    return studies.folder


@pytest.fixture
def made(studies, first):
    """A folder with the archive of the study, and its log."""
    shutil.copytree(first, studies.folder, dirs_exist_ok=True)
    return studies


def test_an_archive_stays_only_if_its_runs_are_the_same(made):
    before = (made.folder / "study.nc").stat().st_mtime_ns
    made.make()
    assert [text.rpartition("study.nc: ")[2] for text in made.reported.texts] == [
        EQUAL,
        "nothing has changed, so it stays as it is",
    ]
    assert made.reported.steps == ["making finished runs again, for comparison"]
    assert (made.folder / "study.nc").stat().st_mtime_ns == before
    made.hide(3)
    changed = made.make()
    [reported] = made.reported.texts
    assert "study.nc: its runs are not taken: one: z of run " in reported
    assert (
        "\n  the model has changed in a way that its files do not show, or its results " in reported
    )
    assert reported.endswith("\ntake them nevertheless with --no-recheck")
    assert made.reported.reused == 0
    assert changed == made.make(name="afresh.nc", fresh=True)


def test_equal_runs_leave_the_archive_as_if_all_were_made_here(made):
    taken = made.make(ASKED)
    assert made.reported.texts[0].endswith(EQUAL)
    assert made.reported.reused == 30
    assert taken == made.make(ASKED, "afresh.nc", fresh=True)
    assert "runs made again are equal" in (made.folder / "study.nc.log").read_text()


def test_a_named_archive_of_other_runs_is_an_error(made):
    made.hide(3)
    named = [made.folder / "study.nc"]
    with pytest.raises(CheckpointError, match="its runs are not taken: one: z of run") as refused:
        made.make(ASKED, "new.nc", reuse=named)
    last = "leave it out to make all runs, or take them nevertheless with --no-recheck"
    assert str(refused.value).endswith(last)
    assert not (made.folder / "new.nc").exists()
    made.make(ASKED, "new.nc", reuse=named, recheck=False)
    assert made.reported.reused == 30
    assert "no run is made again, as asked by --no-recheck" in made.reported.texts[0]
    new = open_archive(made.folder / "new.nc")
    assert new.attrs[REUSED_RUNS] == f"one: {NOT_MADE_AGAIN}"


def test_an_archive_says_that_no_run_was_made_again_until_some_are(made):
    made.make(ASKED, "new.nc", reuse=[made.folder / "study.nc"], recheck=False)
    checks = {
        each.name: each
        for each in uqpen.verify(made.folder / "new.nc", trust=True, folder=made.folder)
    }
    assert checks["made with"].text.endswith(f", one: {NOT_MADE_AGAIN}")
    assert checks["made with"].verdict is checks["runs"].verdict is CheckOutcome.EQUAL
    again = made.make(ASKED, "again.nc", reuse=[made.folder / "new.nc"])
    assert again == made.make(ASKED, "afresh.nc", fresh=True)


def test_finished_runs_are_never_thrown_away(studies):
    whole = studies.make(name="whole.nc")
    studies.stop(21)
    parts = sorted((studies.folder / "study.nc.parts").rglob("*.npz"))
    studies.hide(3)
    for _ in range(2):
        with pytest.raises(CheckpointError, match=r"study\.nc\.parts: its runs are not") as refused:
            studies.make()
        assert str(refused.value).endswith(
            "continue with the model as it was, take them nevertheless with --no-recheck, or start "
            "over with --fresh"
        )
    assert sorted((studies.folder / "study.nc.parts").rglob("*.npz")) == parts != []
    studies.hide(2)
    assert studies.make() == whole
    assert studies.reported.restored == 20
    assert "20 of 20 runs made again are equal" in studies.reported.texts[0]


def test_finished_runs_that_are_not_made_again_are_named(studies):
    studies.stop(21)
    studies.make(recheck=False)
    assert studies.reported.restored == 20
    tree = open_archive(studies.folder / "study.nc")
    assert tree.attrs[REUSED_RUNS] == f"one: {NOT_MADE_AGAIN}"


def test_runs_that_were_set_aside_are_made_again_too(studies):
    studies.stop(21)
    more = STUDY.replace("runs = 30", "runs = 40")
    studies.hide(3)
    with pytest.raises(CheckpointError, match=r"parts.set_aside: its runs are not taken"):
        studies.make(more)
    studies.hide(2)
    studies.make(more)
    assert "20 of 20 runs made again are equal" in studies.reported.texts[0]
    assert studies.reported.reused == 20


@pytest.mark.parametrize("stop_by", ["SIGINT", "SIGKILL"])
def test_an_interruption_meanwhile_loses_nothing(studies, stop_by):
    whole = studies.make(name="whole.nc")
    studies.stop(21)
    if stop_by == "SIGINT":
        message = studies.stop(7)
        assert message == "all finished runs are kept; the same command continues from there"
    else:
        (studies.folder / "calls").write_text("")
        (studies.folder / "stop_7").touch()
        command = [sys.executable, "-m", "uqpen", "study", "study.toml", "-o", "study.nc"]
        environment = {**os.environ, "STOP_BY": stop_by}
        done = subprocess.run(command, cwd=studies.folder, env=environment, check=False)
        assert done.returncode == -signal.SIGKILL
        (studies.folder / "stop_7").unlink()
    assert len(studies.calls()) == 7
    assert studies.make() == whole
    assert studies.reported.restored == 20


def test_a_model_with_noise_is_not_called_changed(studies):
    studies.hide(5)
    studies.make()
    with pytest.raises(CheckpointError) as refused:
        studies.make(ASKED, "new.nc", reuse=[studies.folder / "study.nc"])
    reported = str(refused.value)
    assert "its model gives other results for the same inputs:\n  one: z of run" in reported
    assert "at first and" in reported
    assert "when it is made once more" in reported
    assert "changed" not in reported
    studies.make(ASKED, "new.nc", reuse=[studies.folder / "study.nc"], recheck=False)
    assert studies.reported.reused == 30


def test_a_run_of_failed_ones_has_to_fail_alike(studies):
    text = STUDY + "[failures]\nstop_after = 0\n"
    asked = ASKED + "[failures]\nstop_after = 0\n"
    studies.hide(7)
    studies.make(text)
    studies.make(asked)
    assert "1 of 30 runs made again is equal" in studies.reported.texts[0]
    studies.hide(8)
    studies.make(text)
    expected = r"one: run \d+ was failed \(ValueError: no .* is failed \(ZeroDivisionError: another"
    assert re.search(expected, studies.reported.texts[0])


def test_a_run_that_fails_now_is_another_one(made):
    made.hide(9)
    made.make()
    assert " was ok, and is failed (ZeroDivisionError: another cause" in made.reported.texts[0]


def test_runs_that_ended_by_the_machine_are_never_made_again(made):
    tree = open_archive(made.folder / "study.nc")
    late = tree["runs/one"]["status"].values
    late[5:25] = Status.TIMED_OUT
    late[25:] = Status.CRASHED
    tree["runs/one"]["z"].values[5:] = np.nan
    write(tree, made.folder / "late.nc")
    made.make(ASKED, "new.nc", reuse=[made.folder / "late.nc"])
    assert "; 5 of 30 runs made again are equal" in made.reported.texts[0]


COSTLY = "one: the first runs took 7200.000 s"


def test_costly_runs_are_not_made_again_unless_asked(made):
    made.log(COSTLY)
    made.calls()
    made.make()
    expected = "no run is made again, as that takes 120 min; --recheck makes one nevertheless"
    assert made.reported.texts[0].endswith(f"model.py is the same; {expected}")
    assert made.calls() == []
    made.make(recheck=True)
    assert made.reported.texts[0].endswith(EQUAL)


@pytest.mark.parametrize(
    ("seconds", "workers", "runs", "is_made_again"),
    [(59, 1, 30, True), (61, 1, 129, False), (61, 1, 130, True), (61, 10, 130, False)],
)
def test_whether_runs_are_costly_depends_on_what_is_left(
    made, seconds, workers, runs, is_made_again
):
    made.log(f"one: the first runs took {seconds}.000 s")
    made.log(f"one: 30 runs in {30 * seconds / workers:.3f} s, 0 of them failed")
    made.make(ASKED.replace("runs = 30", f"runs = {runs}"))
    assert ("runs made again are equal" in made.reported.texts[0]) == is_made_again
    attributes = open_archive(made.folder / "study.nc").attrs
    assert (attributes.get(REUSED_RUNS) is None) == is_made_again


@pytest.mark.parametrize(("seconds", "is_made_again"), [(9, True), (11, False)])
def test_where_nothing_is_made_less_is_costly(made, seconds, is_made_again):
    made.log(f"one: the first runs took {seconds}.000 s")
    made.make()
    assert ("made again are equal" in made.reported.texts[0]) == is_made_again


def test_the_log_has_the_time_of_the_first_runs(made):
    assert "one: the first runs took 0." in (made.folder / "study.nc.log").read_text()


@pytest.mark.parametrize(("factor", "is_taken"), [(1 + 1e-12, True), (1 + 1e-6, False)])
def test_runs_of_other_versions_are_equal_within_a_tolerance(made, factor, is_taken):
    tree = open_archive(made.folder / "study.nc")
    tree.attrs["version_numpy"] = "0.1"
    tree["runs/one"]["z"].values[:] *= factor
    write(tree, made.folder / "old.nc")
    if is_taken:
        made.make(STUDY, "new.nc", reuse=[made.folder / "old.nc"])
        assert "30 of 30 runs made again are equal within 1e-09" in made.reported.texts[0]
    else:
        with pytest.raises(CheckpointError, match=r"by up to [0-9.]+e-07 of the largest value"):
            made.make(STUDY, "new.nc", reuse=[made.folder / "old.nc"])


def test_of_a_vectorised_function_a_whole_batch_is_made_again(studies):
    text = VECTORIZED.replace("runs = 30", "runs = 2_500")
    studies.make(text)
    studies.calls()
    studies.make(text)
    assert studies.calls() == [1024]
    assert "1 024 of 2 500 runs made again are equal" in studies.reported.texts[0]
    studies.hide(3)
    studies.make(text)
    assert "its runs are not taken" in studies.reported.texts[0]


def test_runs_that_are_not_kept_are_compared_by_the_hash_of_a_batch(studies):
    text = STUDY.replace("[designs.one]", "[designs.one]\nkeep = 'statistics'")
    studies.make(text)
    studies.make(text)
    assert studies.reported.texts[0].endswith(EQUAL)
    studies.hide(3)
    studies.make(text)
    assert "its runs are not taken: one: runs 0 to 29 are others now\n" in studies.reported.texts[0]
    studies.hide(5)
    studies.make(text)
    studies.make(text)
    assert "gives other results for the same inputs\ntake" in studies.reported.texts[0]


def test_runs_that_the_study_would_not_make_are_not_made_again(made):
    other = STUDY.replace("seed = 11", "seed = 12")
    made.calls()
    made.make(other, "new.nc", reuse=[made.folder / "study.nc"])
    assert len(made.calls()) == 30
    assert made.reported.steps[0] != "making finished runs again, for comparison"


def test_only_the_runs_of_the_model_that_differs_are_refused(studies):
    start, end = STUDY.index("python"), STUDY.index("[inputs]")
    model = STUDY[start:end]
    other = model.replace("model.py", "other.py")
    (studies.folder / "other.py").write_text("def simulate(x, y):\n    return {'z': x + y}\n")
    text = STUDY.replace(f"[model]\n{model}", f"[models.a]\n{model}[models.b]\n{other}")
    text = text.replace('y = "m"', 'y = "1"').replace('z = "m"', 'z = "1"')
    text = text.replace('"(0 ± 1) m"', '"0 ± 1"')
    studies.make(text)
    studies.make(text)
    assert [each.partition("study.nc: ")[2] for each in studies.reported.texts[:2]] == [
        f"a: {EQUAL}",
        "b: other.py is the same; 30 of 30 runs made again are equal",
    ]
    studies.hide(3)
    studies.make(text)
    assert studies.reported.reused == 30


@pytest.mark.processor
def test_the_archive_is_the_same_with_any_number_of_workers(made):
    archives = {
        made.make(ASKED, f"{workers}.nc", workers=workers, reuse=[made.folder / "study.nc"])
        for workers in (1, 2)
    }
    assert len(archives) == 1
    assert "runs made again are equal" in made.reported.texts[0]
    made.hide(3)
    with pytest.raises(CheckpointError, match="its runs are not taken"):
        made.make(ASKED, "new.nc", workers=2, reuse=[made.folder / "study.nc"])


def test_kept_folders_of_a_program_stay_as_they_are(studies):
    program = studies.folder / "program.py"
    program.write_text("import sys\nprint('z =', float(sys.argv[1]) ** 2)\n")
    text = f"""\
seed = 11
[model]
command = [{json.dumps(sys.executable)}, "program.py", "{{x}}"]
inputs = {{ x = "1" }}
outputs = {{ z = "1" }}
read = {{ z = {{ text = "stdout", pattern = 'z = (\\S+)' }} }}
keep = "all"
[inputs]
x = "0 ± 1"
[designs.one]
kind = "monte-carlo"
runs = 3
"""
    studies.make(text)

    def kept():
        found = [each for each in studies.folder.rglob("*") if "_runs" in str(each)]
        return {each: each.stat().st_mtime_ns for each in found}

    before = kept()
    assert len(before) > 3
    studies.make(text)
    assert "3 of 3 runs made again are equal" in studies.reported.texts[0]
    assert kept() == before


def test_the_command_takes_runs_as_they_are_if_asked(made, command_line):
    made.hide(3)
    outcome = command_line("study", "study.toml", "-o", "b.nc", "--reuse", "study.nc")
    assert outcome.code == 2
    assert "study.nc: its runs are not taken" in outcome.err
    options = ("-o", "b.nc", "--reuse", "study.nc", "--no-recheck")
    assert command_line("study", "study.toml", *options).code == 0
