"""A study made into an archive: interrupted, started again, changed, damaged, made twice."""

import json
import os
import platform
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from study_calls import StudyCalls
from study_text import TWO_INPUTS

import uqpen
from uqpen.checkpoints.folder import lock_archive
from uqpen.checkpoints.identity import encode_fingerprint
from uqpen.checkpoints.journal import Journal
from uqpen.checkpoints.stored_runs import DamagedRunsError, FinishedRuns, read_runs, write_runs
from uqpen.core.errors import ArchiveError, CheckpointError, ModelError, TooManyFailedError
from uqpen.core.model import Results
from uqpen.core.progress import ProgressBroadcast
from uqpen.execution import Progress
from uqpen.execution.batch import BatchResult
from uqpen.execution.processes import processes

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]

# Stops, as Ctrl-C would, at the run that a file names: by the name of a file, as a file that a run
# opens would belong to the model.
MODEL = """\
import pathlib, signal
here = pathlib.Path(__file__).parent
def simulate(x, y):
    with (here / "calls").open("a") as stream:
        stream.write("call\\n")
    stops = [int(file.name[5:]) for file in here.glob("stop_*")]
    if len((here / "calls").read_text().split()) in stops:
        signal.raise_signal(signal.SIGINT)
    if x > 1:
        raise ValueError("x is too large")
    return {"z": x * y}
"""
STUDY = f'title = "Interrupted"\n{TWO_INPUTS}'
OTHER = """\
[designs.other]
kind = "latin-hypercube"
runs = 40
"""
PAUSE = "import random, time\ndef pause(): time.sleep(random.random() / 200)"
VECTORIZED = MODEL.replace(
    "    if x > 1:\n        raise ValueError", "    if False:\n        raise"
)


@pytest.fixture(autouse=True)
def _slow(monkeypatch):
    """Runs are sent one by one, as those are that take a second each."""
    monkeypatch.setattr("uqpen.execution.evaluation.WORTH_SENDING", 0.0)
    # Only a machine that goes down loses what was not brought to the disk.
    monkeypatch.setattr(os, "fsync", lambda file: None)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "model.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


@pytest.fixture
def of_two(folder):
    """A folder whose study has two designs."""
    (folder / "study.toml").write_text(STUDY + OTHER)
    return folder


def calls(folder):
    return len((folder / "calls").read_text().split())


def make(folder, **options):
    """The bytes of the archive of the study in a folder."""
    reported = ProgressBroadcast(options.pop("progress", Progress()), StudyCalls(folder / "calls"))
    study = uqpen.load_study(folder / "study.toml")
    uqpen.make_archive(study, folder / "study.nc", progress=reported, **options)
    return (folder / "study.nc").read_bytes()


def interrupt(folder, after):
    """Make an archive that is interrupted at a run, and what is reported of it."""
    stop = folder / f"stop_{after}"
    stop.touch()
    with pytest.raises(KeyboardInterrupt) as interrupted:
        make(folder, recheck=False)
    stop.unlink()
    return str(interrupted.value)


def change(folder, old, new, file="study.toml"):
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))


class Recorded(Progress):
    """Progress as it was reported."""

    def __init__(self):
        self.before = []
        self.warnings = []

    def count_restored(self, runs):
        self.before.append(runs)

    def warn(self, text):
        self.warnings.append(text)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The archive of the study when nothing interrupts it."""
    return _whole(tmp_path_factory.mktemp("whole"), STUDY)


@pytest.fixture(scope="module")
def whole_of_two(tmp_path_factory):
    """The same of two designs."""
    return _whole(tmp_path_factory.mktemp("whole"), STUDY + OTHER)


def _whole(folder, study):
    (folder / "model.py").write_text(MODEL)
    (folder / "study.toml").write_text(study)
    return make(folder)


def test_what_is_left_in_the_end_is_the_archive_and_its_log(folder):
    make(folder)
    assert {file.name for file in folder.iterdir() if file.name.startswith((".", "study"))} == {
        "study.toml",
        "study.nc",
        "study.nc.log",
    }


@pytest.mark.processor
@pytest.mark.parametrize("stops", [(1,), (31,), (10, 11, 40, 41, 60)], ids=str)
def test_an_interrupted_study_goes_on_where_it_was(of_two, whole_of_two, stops):
    for number, after in enumerate(stops, 1):
        message = interrupt(of_two, after)
        kept = after - number  # the last call of each start was not finished
        assert message.startswith(f"{kept} runs are kept" if kept else "nothing was written")
        assert not (of_two / "study.nc").exists()
    progress = Recorded()
    assert make(of_two, progress=progress) == whole_of_two
    assert sum(progress.before) == kept
    assert calls(of_two) == 70 + len(stops), "only runs that were interrupted are made twice"


def test_a_fresh_start_makes_all_runs_again(of_two, whole_of_two):
    interrupt(of_two, 50)
    assert make(of_two, fresh=True) == whole_of_two
    assert calls(of_two) == 50 + 70


@pytest.mark.filterwarnings("ignore:other. 40 of its 40 earlier runs are not used")
def test_an_archive_stays_until_the_next_one_is_complete(of_two, whole_of_two):
    make(of_two)
    change(of_two, "seed = 11", "seed = 12")
    (of_two / "calls").unlink()
    interrupt(of_two, 50)
    assert (of_two / "study.nc").read_bytes() == whole_of_two


# Each of the first ones would cost all runs if it counted.
NO_MATTER = {
    'title = "Interrupted"': 'title = "Another"',
    "[designs.one]": "[outputs.z]\nquantiles = [0.2]\n[designs.one]",
    "seed = 11": "# a remark\nseed = 11",
    'x = "0 ± 1"': 'x    =   "0 ± 1"',
}


@pytest.mark.parametrize(
    "changes",
    [NO_MATTER, {"runs = 40": "runs = 60"}, {OTHER: ""}],
    ids=["what is said and asked", "another design", "no other design"],
)
def test_what_decides_no_run_keeps_those_that_are_done(of_two, changes):
    interrupt(of_two, 21)
    for old, new in changes.items():
        change(of_two, old, new)
    progress = Recorded()
    changed = make(of_two, progress=progress)
    assert progress.before == [20]
    shutil.rmtree(of_two / "study.nc.parts", ignore_errors=True)
    assert make(of_two, fresh=True) == changed


@pytest.mark.parametrize(
    ("file", "old", "new", "reported"),
    [
        ("study.toml", "seed = 11", "seed = 12", "seed was 11, is 12"),
        ("study.toml", 'x = "0 ± 1"', 'x = "0 ± 2"', 'inputs.x was "0 ± 1", is "0 ± 2"'),
        (
            "study.toml",
            "[inputs]",
            '[constraints]\nkeep = ["x < 2"]\n[inputs]',
            'constraints.keep was not there, is ["x < 2"]',
        ),
        ("study.toml", 'z = "m"', 'z = "cm"', 'model.outputs.z was "m", is "cm"'),
        ("model.py", "x * y", "y * x", "file model.py has changed"),
    ],
)
def test_runs_that_the_study_would_not_make_are_refused(folder, file, old, new, reported):
    interrupt(folder, 21)
    change(folder, old, new, file)
    with pytest.raises(CheckpointError) as refused:
        make(folder)
    assert reported in str(refused.value)
    assert "study.nc.parts: contains runs of one that were made with other settings" in str(
        refused.value
    )
    assert str(refused.value).endswith("or start over with --fresh")
    assert calls(folder) == 21, "no model has run"
    progress = Recorded()
    make(folder, fresh=True, progress=progress)
    assert progress.before == []


def test_another_time_limit_makes_only_late_runs_again(folder):
    # Late until there is a file, so that no run depends on the pace of the machine.
    wait = "while x > 1.3 and not (here / 'open').exists(): time.sleep(0.01)"
    pause = f"    import time\n    {wait}"
    change(folder, "    if x > 1:", f"{pause}\n    if x > 1:", "model.py")
    change(folder, "[model]", '[model]\ntime_limit = "1 s"')
    change(folder, "runs = 30", "runs = 12")
    change(folder, "runs = 12\n", 'runs = 12\n[failures]\nat_most = "10 %"\n')
    with pytest.raises(TooManyFailedError, match="2 timed out"):
        make(folder)
    (folder / "open").touch()
    change(folder, '"1 s"', '"60 s"')
    change(folder, '"10 %"', '"100 %"')
    assert calls(folder) == 4
    progress = Recorded()
    made = make(folder, progress=progress)
    assert progress.before == [2], "without those that were late"
    (folder / "study.nc").unlink()
    assert make(folder) == made


def test_another_environment_is_refused(folder):
    interrupt(folder, 21)
    record = folder / "study.nc.parts" / "runs" / "one" / "made_of.json"
    made_of = json.loads(record.read_text())
    version = made_of["version_numpy"]
    del made_of["checksum"]
    record.write_bytes(encode_fingerprint({**made_of, "version_numpy": "0.1"}))
    with pytest.raises(CheckpointError, match=rf"version_numpy was 0\.1, is {version}"):
        make(folder)


def test_points_that_have_changed_are_refused_to_the_bit(folder):
    interrupt(folder, 21)
    file = folder / "study.nc.parts" / "runs" / "one" / "0_000000.npz"
    part = read_runs(file)
    x = part.inputs["x"].copy()
    x[3] = np.nextafter(x[3], 1)
    write_runs(file, FinishedRuns(part.runs, {**part.inputs, "x": x}, part.results))
    with pytest.raises(CheckpointError, match="its points: has a file changed"):
        make(folder)


@pytest.mark.parametrize(
    ("name", "content"),
    [("0_000000.npz", b"runs"), ("made_of.json", b"{"), ("made_of.json", None)],
    ids=["part", "record", "no record"],
)
def test_runs_of_a_damaged_file_are_made_again_and_that_is_said(folder, whole, name, content):
    interrupt(folder, 21)
    file = folder / "study.nc.parts" / "runs" / "one" / name
    file.unlink()
    if content is not None:
        file.write_bytes(content)
    progress = Recorded()
    assert make(folder, progress=progress) == whole
    assert progress.before == []
    runs = "its runs" if name.endswith("npz") else "the runs of one"
    [said] = progress.warnings
    assert said.endswith(f"{name}: is damaged; {runs} are made again")
    assert "is damaged" in (folder / "study.nc.log").read_text()


def test_any_bit_of_a_part_may_be_damaged(tmp_path):
    part = tmp_path / "0_000000.npz"
    results = Results({"y": np.arange(3.0)}, np.zeros(3, dtype=np.int8), {}, frozenset({"a"}))
    write_runs(part, FinishedRuns(np.arange(3), {"x": np.arange(3.0)}, results))
    content = part.read_bytes()
    rng = np.random.default_rng(1)
    read = 0
    # The directory of the zip stands at the end; its flags and sizes decide how the rest is read.
    bits = [
        *rng.integers(8 * len(content), size=300),
        *range(8 * (len(content) - 60), 8 * len(content)),
    ]
    for bit in bits:
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        part.write_bytes(damaged)
        try:
            runs = read_runs(part)
        except DamagedRunsError:
            continue
        read += 1
        assert runs.inputs["x"].tolist() == [0, 1, 2]
        assert runs.results.outputs["y"].tolist() == [0, 1, 2]
    assert read < len(bits) / 2


def test_another_file_is_no_part(tmp_path):
    class Hostile:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "executed"),)

    zeros = np.zeros(10_000)
    results = Results({"y": zeros}, zeros.astype(np.int8), {}, frozenset())
    write_runs(tmp_path / "part.npz", FinishedRuns(np.arange(10_000), {"x": zeros}, results))
    with np.load(tmp_path / "part.npz") as part:
        arrays = {**part}
    (tmp_path / "part.npz").unlink()
    np.savez_compressed(tmp_path / "compressed.npz", **arrays)  # it may ask for any memory
    np.savez(tmp_path / "edited.npz", **{**arrays, "input_x": arrays["input_x"] + 1})
    hostile = np.array([Hostile()], dtype=object)
    np.savez(tmp_path / "object.npz", allow_pickle=True, **{**arrays, "run": hostile})
    (tmp_path / "empty.npz").touch()
    for file in [*tmp_path.iterdir()]:
        with pytest.raises(DamagedRunsError):
            read_runs(file)
    assert not (tmp_path / "executed").exists()


def test_a_part_gives_back_what_it_was_given(tmp_path):
    points = {"x": np.arange(10) / 3, "y": np.full(10, -0.0)}

    def piece(start, runs, reasons):
        status = np.array([2 * (run in reasons) for run in range(runs)], dtype=np.int8)
        outputs = {"z": np.where(status, np.nan, points["x"][start : start + runs] ** 2)}
        return BatchResult(start, Results(outputs, status, reasons, frozenset({"hash  file"})))

    batch_results = [piece(7, 2, {1: "späť – “x”"}), piece(0, 3, {}), piece(3, 1, {0: "one"})]
    inputs = [
        {name: values[each.start : each.start + len(each)] for name, values in points.items()}
        for each in batch_results
    ]
    made = FinishedRuns.from_batch_results(list(zip(inputs, batch_results, strict=True)))
    write_runs(tmp_path / "part.npz", made)
    part = read_runs(tmp_path / "part.npz")
    assert part.match_inputs(points)
    assert not part.match_inputs({"x": points["x"], "y": np.full(10, 0.0)}), "−0 is not 0"
    assert not part.match_inputs({"x": points["x"]})
    assert not part.match_inputs({name: values[:8] for name, values in points.items()})
    first, second = part.batch_results()
    assert (first.start, len(first), dict(first.results.reasons)) == (0, 4, {3: "one"})
    assert (second.start, len(second), dict(second.results.reasons)) == (7, 2, {1: "späť – “x”"})
    assert second.results.outputs["z"][0] == points["x"][7] ** 2
    assert first.results.files == {"hash  file"}


@pytest.mark.processor
def test_runs_of_several_models_and_of_vectorized_ones_are_kept(tmp_path):
    (tmp_path / "model.py").write_text(VECTORIZED)
    text = (STUDY + OTHER).replace("runs = 30", "runs = 3000")
    model = text[text.index("python") : text.index("[inputs]")]
    both = f"[models.a]\n{model}vectorized = true\n[models.b]\n{model}vectorized = true\n"
    (tmp_path / "study.toml").write_text(text.replace("[model]\n" + model, both))
    expected = make(tmp_path)
    whole_batches = calls(tmp_path)
    (tmp_path / "study.nc").unlink()
    interrupt(tmp_path, whole_batches + 5)
    progress = Recorded()
    assert make(tmp_path, progress=progress) == expected
    assert progress.before == [3000, 1024]
    assert calls(tmp_path) == 2 * whole_batches + 1


def test_runs_that_the_study_does_not_have_any_more_stay(of_two):
    interrupt(of_two, 40)
    text = (of_two / "study.toml").read_text()
    change(of_two, "[designs.one]", "[designs.first]")
    progress = Recorded()
    make(of_two, progress=progress)
    parts = of_two / "study.nc.parts"
    assert progress.before == [9], "those of the other design"
    assert progress.warnings == [
        f"{parts}: still holds runs of one, which this study does not have; "
        "remove them if they are not needed any more"
    ]
    (of_two / "study.toml").write_text(text)
    progress = Recorded()
    make(of_two, progress=progress)
    assert (progress.before, progress.warnings) == ([30], [])
    assert not parts.exists()


def test_runs_of_a_model_that_gets_a_name_stay(folder):
    interrupt(folder, 21)
    change(folder, "[model]", "[models.a]")
    progress = Recorded()
    make(folder, progress=progress)
    assert "still holds runs of one, which" in progress.warnings[0]
    change(folder, "[models.a]", "[model]")
    progress = Recorded()
    make(folder, progress=progress)
    assert progress.before == [20]


@pytest.mark.parametrize("place", ["seed", "checksum", "first"])
def test_a_flipped_bit_in_a_record_costs_no_run(folder, whole, place):
    interrupt(folder, 21)
    record = folder / "study.nc.parts" / "runs" / "one" / "made_of.json"
    content = bytearray(record.read_bytes())
    at = {
        "seed": content.index(b'"11"') + 2,
        "checksum": content.index(b'"checksum": "') + 20,
        "first": 0,
    }[place]
    content[at] ^= 1
    record.write_bytes(content)
    progress = Recorded()
    assert make(folder, progress=progress) == whole
    assert progress.before == [20]
    expected = f"{record}: is damaged; it was of this study, so its runs stay"
    assert progress.warnings == [expected]


def test_the_runs_of_a_damaged_record_of_another_study_are_made_again(folder):
    interrupt(folder, 21)
    record = folder / "study.nc.parts" / "runs" / "one" / "made_of.json"
    record.write_bytes(record.read_bytes().replace(b"11", b"13"))
    change(folder, "seed = 11", "seed = 12")
    progress = Recorded()
    make(folder, progress=progress)
    assert progress.before == []
    assert "made_of.json: is damaged; the runs of one are made again" in progress.warnings[0]


def test_a_record_without_runs_refuses_nothing(of_two):
    interrupt(of_two, 21)
    (of_two / "study.nc.parts" / "runs" / "one" / "0_000000.npz").unlink()
    change(of_two, "seed = 11", "seed = 12")
    interrupt(of_two, 40)
    progress = Recorded()
    make(of_two, progress=progress)
    assert progress.before == [18]


def test_what_others_put_beside_kept_runs_stays(folder, whole):
    interrupt(folder, 21)
    parts = folder / "study.nc.parts"
    names = {"notes.txt", "notes.tmp", "runs/one/0_notes.npz", "runs/one/0_notes.npz.tmp"}
    for name in names:
        (parts / name).write_text("mine")
    (parts / "runs/one/0_000007.npz").mkdir()
    progress = Recorded()
    assert make(folder, progress=progress) == whole
    assert progress.before == [20]
    assert {str(file.relative_to(parts)) for file in parts.rglob("*") if file.is_file()} == names
    make(folder, fresh=True)
    assert (parts / "runs/one/0_notes.npz").read_text() == "mine"


def test_a_file_in_place_of_the_folder_is_reported_before_a_run(folder):
    (folder / "study.nc.parts").write_text("mine")
    for fresh in (False, True):
        with pytest.raises(ArchiveError, match=r"study\.nc\.parts: is no folder"):
            make(folder, fresh=fresh)
    assert not (folder / "calls").exists()


def test_kept_runs_may_lie_behind_a_link(of_two, whole_of_two):
    interrupt(of_two, 21)
    parts = of_two / "study.nc.parts"
    parts.rename(of_two / "elsewhere")
    parts.symlink_to("elsewhere")
    progress = Recorded()
    assert make(of_two, progress=progress) == whole_of_two
    assert progress.before == [20]
    assert list((of_two / "elsewhere").iterdir()) == []
    (of_two / "study.nc").unlink()
    interrupt(of_two, 90)
    assert make(of_two, fresh=True) == whole_of_two


def test_another_module_that_a_run_imports_is_reported_with_what_to_do(folder):
    (folder / "late.py").write_text("factor = 1\n")
    change(folder, '"z": x * y', '"z": x * y * __import__("late").factor', "model.py")
    interrupt(folder, 21)
    (folder / "late.py").write_text("factor = 2\n")
    for _ in range(2):
        with pytest.raises(ModelError) as message:
            make(folder)
        assert str(message.value).startswith('"late.py" was changed while the study ran: ')
        assert str(message.value).endswith("change it back, or start over with --fresh")
    make(folder, fresh=True)


def test_ctrl_c_while_the_archive_is_written_keeps_all_runs(folder, whole, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("uqpen.checkpoints.make_archive.write", _interrupted)
        with pytest.raises(KeyboardInterrupt, match="30 runs are kept; the same command continues"):
            make(folder)
    assert make(folder) == whole
    assert calls(folder) == 30


def _interrupted(*arguments, **options):
    raise KeyboardInterrupt


def test_a_log_that_cannot_be_written_hides_no_reason(folder):
    with pytest.raises(KeyboardInterrupt):
        _ended_without_a_log(uqpen.load_study(folder / "study.toml"), folder / "log")


def _ended_without_a_log(study, log):
    with Journal(log, study, Progress()):
        log.unlink()
        log.mkdir()
        raise KeyboardInterrupt


def test_an_archive_behind_a_link_is_written_where_it_lies(folder, whole):
    (folder / "far").mkdir()
    (folder / "study.nc").symlink_to("far/study.nc")
    assert make(folder) == whole
    assert (folder / "study.nc").is_symlink()
    assert [file.name for file in (folder / "far").iterdir()] == ["study.nc"]


@pytest.mark.parametrize(
    ("name", "reported"),
    [
        (f"{'n' * 300}.nc", "File name too long"),
        ("model.py/study.nc", r".*model\.py is not a fold"),
    ],
    ids=["long", "file"],
)
def test_a_place_that_cannot_be_written_is_reported(folder, name, reported):
    study = uqpen.load_study(folder / "study.toml")
    with pytest.raises(ArchiveError, match=f"cannot be written: {reported}"):
        uqpen.make_archive(study, folder / name)


def test_two_processes_do_not_make_one_archive(folder):
    with (
        lock_archive(folder / "study.nc"),
        pytest.raises(ArchiveError, match=r"study\.nc: another process is making it right now"),
    ):
        make(folder)
    assert not (folder / "calls").exists()
    make(folder)


def test_a_link_to_an_archive_is_that_archive(folder):
    study = uqpen.load_study(folder / "study.toml")
    (folder / "link.nc").symlink_to("study.nc")
    with (
        lock_archive(folder / "study.nc"),
        pytest.raises(ArchiveError, match="another process is making it right now"),
    ):
        uqpen.make_archive(study, folder / "link.nc")
    uqpen.make_archive(study, folder / "link.nc")
    assert (folder / "link.nc").is_symlink()
    assert uqpen.open_archive(folder / "study.nc").attrs["study_name"] == "study"


def test_a_lock_that_was_left_behind_means_nothing(folder):
    # What another process has of it, without all that uqpen imports.
    holder = "from filelock import FileLock; import time\nwith FileLock('.study.nc.lock'):\n"
    holder += "    print('locked', flush=True)\n    time.sleep(60)"
    line = [sys.executable, "-c", holder]
    with subprocess.Popen(line, cwd=folder, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"locked\n"
        with pytest.raises(ArchiveError, match="another process"):
            make(folder)
        process.kill()
    assert (folder / ".study.nc.lock").exists()
    make(folder)
    assert not (folder / ".study.nc.lock").exists()


def test_a_full_disk_is_reported_and_loses_nothing(folder, whole, monkeypatch):
    interrupt(folder, 21)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", _is_full)
        with pytest.raises(ArchiveError) as message:
            make(folder)
    assert "finished runs cannot be kept: No space left on device" in str(message.value)
    assert "those kept before stay there" in str(message.value)
    assert not list((folder / "study.nc.parts").rglob("*.tmp"))
    progress = Recorded()
    assert make(folder, progress=progress) == whole
    assert progress.before == [20]


def _is_full(file):
    raise OSError(28, os.strerror(28))


def test_the_log_tells_what_an_archive_must_not(folder, monkeypatch):
    monkeypatch.setattr("platform.node", lambda: "name-of-this-machine")
    (folder / "model.py").write_text(
        MODEL.replace("    if x > 1:", "    import warnings; warnings.warn('odd')\n    if x > 1:")
    )
    with pytest.warns(RuntimeWarning, match="odd"):
        make(folder)
    log = (folder / "study.nc.log").read_text()
    assert f"on name-of-this-machine ({platform.platform()}), process {os.getpid()}" in log
    assert "one: 30 runs in " in log
    assert "UserWarning: odd (model.py:" in log
    assert "study.nc: is written" in log
    moment = time.strftime("%Y-%m-%dT")
    assert all(line.startswith(moment) for line in log.splitlines())
    content = (folder / "study.nc").read_bytes()
    assert b"name-of-this-machine" not in content
    assert str(folder).encode() not in content


def test_ctrl_c_says_what_is_kept_and_how_to_go_on(folder, command_line):
    (folder / "stop_21").touch()
    outcome = command_line("study", "study.toml")
    assert outcome.code == 130
    said = "interrupted: 20 runs are kept; the same command continues from there\n"
    assert outcome.err.endswith(said)
    (folder / "stop_21").unlink()
    outcome = command_line("study", "study.toml")
    assert outcome.code == 0
    assert "one: 20 of 30 runs already done\n" in outcome.err
    outcome = command_line("study", "study.toml", "--fresh")
    assert "already done" not in outcome.err


def test_a_study_that_is_killed_at_any_moment_completes_at_the_next_start():
    done = subprocess.run(
        [sys.executable, "benchmarks/kills.py", "--kills", "1"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 kills" in done.stdout


def test_eight_workers_in_any_order_write_the_same_bytes(folder):
    change(folder, "    if x > 1:", "    pause()\n    if x > 1:", "model.py")
    change(folder, "def simulate", f"{PAUSE}\ndef simulate", "model.py")
    expected = make(folder)
    with processes(8) as pool:
        assert make(folder, map=pool, fresh=True) == expected
