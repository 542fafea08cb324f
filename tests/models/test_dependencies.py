"""What a model's runs depend on is recorded by one run, and compared under the same names."""

import os
import sys

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.core.dependency import Dependency
from uqpen.core.errors import CheckpointError, ModelError
from uqpen.core.labels import DEPENDENCIES
from uqpen.execution.processes import processes
from uqpen.models import installed
from uqpen.models.installed import is_installed
from uqpen.models.observation import Observation

SECRET = "a-password-of-a-user"

MODEL = """\
import os, pathlib, sys
here = pathlib.Path(__file__).parent
sys.path.append(str(here.parent / "lib"))
import outside
def f(x):
    factor = float((here / "k.txt").read_text()) * len(os.environ["FACTOR_OF_MODEL"])
    if x > 1:
        import late
    if (here / "stop").exists():
        raise KeyboardInterrupt
    return {"y": factor * x + float((here.parent / "lib" / "far.txt").read_text())}
"""
PROGRAM = """\
def f(x):
    with open(file) as stream:
        return {"y": float(stream.read()) * x}
"""
# A program writes what the code then reads.
WRITING = """\
import pathlib, subprocess, tempfile
(folder / "in.txt").write_text("1")
out = {}
subprocess.run(["cp", folder / "in.txt", out], check=True)
out.read_text()
"""
STUDY = study_text(
    {"python": "m.py:f", "inputs": {"x": "1"}, "outputs": {"y": "1"}},
    inputs={"x": "0 ± 1"},
    designs={"d": {"kind": "monte-carlo", "runs": 24}},
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of a study whose model uses files, a module elsewhere and a variable."""
    monkeypatch.setenv("FACTOR_OF_MODEL", SECRET)
    monkeypatch.setattr(sys, "path", [*sys.path])
    return write(tmp_path / "one")


def write(root):
    folder = root / "study"
    folder.mkdir(parents=True)
    (root / "lib").mkdir()
    (root / "lib" / "far.txt").write_text("0.5")
    (root / "lib" / "outside.py").write_text("k = 1\n")
    (folder / "m.py").write_text(MODEL)
    (folder / "late.py").write_text("k = 1\n")
    (folder / "k.txt").write_text("2")
    (folder / "study.toml").write_text(STUDY)
    return folder


def make(folder, name="study.nc", **options):
    # A module elsewhere is imported once in a process; that of another folder is another one.
    sys.modules.pop("outside", None)
    uqpen.make_archive(uqpen.load_study(folder / "study.toml"), folder / name, **options)
    return (folder / name).read_bytes()


def recorded(folder):
    """The roles of what an archive names, by name."""
    lines = uqpen.open_archive(folder / "study.nc").attrs[DEPENDENCIES].splitlines()
    return {each.name: each.role for each in map(Dependency.from_line, lines)}


def test_one_run_says_what_the_runs_of_a_study_depend_on(folder):
    content = make(folder)
    assert recorded(folder) == {
        "m.py": "imported",
        "late.py": "imported",
        "outside": "module",
        "k.txt": "opened",
        "../lib/far.txt": "opened",
        "FACTOR_OF_MODEL": "environment",
        "run": "observed",
    }
    files = uqpen.open_archive(folder / "study.nc")["files"]
    assert files["name"].values.tolist() == ["k.txt", "late.py", "m.py"]
    assert str(folder.parent).encode() not in content
    assert SECRET.encode() not in content


def change(folder, monkeypatch, name):
    """Change a text, a module or the variable."""
    if name == "FACTOR_OF_MODEL":
        monkeypatch.setenv(name, "3")
    else:
        (folder / name).write_text("3" if name.endswith("txt") else "k = 3\n")


@pytest.mark.slow
@pytest.mark.processor
def test_the_record_is_the_same_wherever_runs_are_made(folder, tmp_path):
    # Workers are forks of a server, which another test may have started without the variable.
    (folder / "m.py").write_text(MODEL.replace('os.environ["FACTOR_OF_MODEL"]', "'12'"))
    content = make(folder)
    with processes(2) as pool:
        assert make(folder, "workers.nc", map=pool) == content
    (folder / "stop").touch()
    with pytest.raises(KeyboardInterrupt):
        make(folder, "interrupted.nc")
    (folder / "stop").unlink()
    assert make(folder, "interrupted.nc") == content
    another = write(tmp_path / "another" / "deeper")
    (another / "m.py").write_text((folder / "m.py").read_text())
    assert make(another) == content


def test_what_has_changed_is_reported(folder, monkeypatch):
    make(folder)
    for name, reported in (
        ("k.txt", "file k.txt has changed"),
        ("../lib/far.txt", "file ../lib/far.txt has changed"),
        ("../lib/outside.py", "module outside has changed"),
        ("late.py", "file late.py has changed"),
        ("FACTOR_OF_MODEL", "environment variable FACTOR_OF_MODEL has changed"),
    ):
        before = (folder / name).read_text() if "." in name else ""
        change(folder, monkeypatch, name)
        with pytest.raises(CheckpointError) as caught:
            make(folder, "other.nc", reuse=[folder / "study.nc"])
        assert [line.strip() for line in str(caught.value).splitlines()[1:-1]] == [reported]
        if before:
            (folder / name).write_text(before)


def test_a_file_that_is_gone_is_reported(folder):
    (folder / "m.py").write_text(MODEL.replace("text()) * float", "text() or 1) * float"))
    make(folder)
    (folder / "k.txt").unlink()
    (folder / "m.py").write_text((folder / "m.py").read_text())
    with pytest.raises(CheckpointError, match=r"file k\.txt was .*, is not there"):
        make(folder, "other.nc", reuse=[folder / "study.nc"])


@pytest.mark.parametrize(
    ("name", "reported"),
    [
        ("k.txt", r'"k\.txt" was changed while the study ran'),
        ("FACTOR_OF_MODEL", '"FACTOR_OF_MODEL" had another value'),
    ],
)
def test_an_interrupted_study_does_not_go_on_with_another(folder, monkeypatch, name, reported):
    stopping = "x > 0 and any(here.glob('stop'))"
    (folder / "m.py").write_text(MODEL.replace('(here / "stop").exists()', stopping))
    (folder / "stop").touch()
    with pytest.raises(KeyboardInterrupt):
        make(folder)
    (folder / "stop").unlink()
    change(folder, monkeypatch, name)
    with pytest.raises(ModelError, match=reported):
        make(folder)


def observed(code, folder):
    """What code is seen to use, by a user in a folder."""
    observation = Observation()
    with observation.active():
        exec(compile(code, str(folder / "user.py"), "exec"), {"folder": folder})
    return {each for each, _ in observation.dependencies(str(folder))}


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("(folder / 'a.txt').read_text()", {"a.txt"}),
        ("import numpy as np; np.loadtxt(folder / 'a.txt')", {"a.txt"}),
        ("import sqlite3; sqlite3.connect(folder / 'a.txt').close()", {"a.txt"}),
        ("import os; os.close(os.open(folder / 'a.txt', os.O_RDONLY))", {"a.txt"}),
        ("(folder / 'new.txt').write_text(''); (folder / 'new.txt').read_text()", set()),
        ("import tempfile; tempfile.TemporaryFile().close()", set()),
        (WRITING.format("folder / 'out.txt'"), {"cp"}),
        (WRITING.format("pathlib.Path(tempfile.mkdtemp(dir=folder)) / 'out.txt'"), {"cp"}),
        ("import pathlib; pathlib.Path('/proc/self/stat').read_text()", set()),
        ("import scipy.integrate, json.tool, xml.dom.minidom", set()),
        ("import os; os.environ.get('NOT_SET')", {"NOT_SET"}),
        ("import os; os.environ['OWN'] = '1'; os.environ['OWN']", set()),
        ("import os; os.environ['HOME']", set()),
        ("import os; os.environ.copy()", {""}),
        ("import os; os.system('true')", {"true"}),
        ("import tempfile, pathlib; pathlib.Path.home()", set()),
    ],
)
def test_only_what_decides_a_result_is_recorded(code, names, tmp_path):
    (tmp_path / "a.txt").write_text("1")
    os.environ.pop("OWN", None)
    assert {each.name for each in observed(code, tmp_path)} == names


def test_a_file_that_a_run_changes_is_named(tmp_path):
    (tmp_path / "a.txt").write_text("1")
    code = "(folder / 'a.txt').read_text(); (folder / 'a.txt').write_text('12')"
    (found,) = observed(code, tmp_path)
    assert (found.sha256, found.uncompared) == ("", "a.txt, which a run changes")


def test_the_value_of_a_variable_is_not_recorded(tmp_path, monkeypatch):
    monkeypatch.setenv("PASSWORD", SECRET)
    (found,) = observed("import os; os.getenv('PASSWORD')", tmp_path)
    assert found.name == "PASSWORD"
    assert SECRET not in found.line


def test_nothing_is_left_of_an_observation(tmp_path):
    before = os._Environ.__getitem__
    with pytest.raises(ZeroDivisionError):
        observed("1 / 0", tmp_path)
    assert os._Environ.__getitem__ is before


class TestInstalled:
    def test_python_and_this_package_are(self):
        for file in (os.__file__, np.__file__, pytest.__file__, installed.__file__):
            assert is_installed(str(file))

    def test_a_file_beside_a_study_is_not(self, tmp_path):
        assert not is_installed(str(tmp_path / "m.py"))
        assert not is_installed(__file__)

    def test_a_folder_on_the_path_is_if_a_record_lists_its_files(self, tmp_path, monkeypatch):
        information = tmp_path / "package-1.0.dist-info"
        information.mkdir()
        (information / "RECORD").write_text("package/__init__.py,sha256=abc,3\n")
        monkeypatch.syspath_prepend(tmp_path)
        assert is_installed(str(tmp_path / "package" / "__init__.py"))
        assert not is_installed(str(tmp_path / "package" / "dropped.py"))

    def test_a_file_dropped_among_packages_is_not(self, tmp_path, monkeypatch):
        monkeypatch.setattr(installed, "_SITE", (f"{tmp_path}/",))
        monkeypatch.syspath_prepend(tmp_path)
        (tmp_path / "one-1.0.dist-info").mkdir()
        (tmp_path / "one-1.0.dist-info" / "RECORD").write_text("one.py,,\none/__init__.py,,\n")
        assert is_installed(str(tmp_path / "one.py"))
        assert is_installed(str(tmp_path / "one" / "__init__.py"))
        assert not is_installed(str(tmp_path / "dropped.py"))


def test_a_run_that_fails_early_is_not_all_that_is_observed(folder):
    # The first run alone fails, before it opens a file.
    first = (
        "    if not (here / 'called').exists():\n        (here / 'called').touch()\n        1 / 0\n"
    )
    (folder / "m.py").write_text(MODEL.replace("    factor =", first + "    factor ="))
    make(folder)
    assert int(uqpen.open_archive(folder / "study.nc")["runs/d"]["status"][0]) != 0
    assert recorded(folder)["k.txt"] == "opened"


def test_without_a_trial_run_the_first_run_is_observed(folder):
    (folder / "study.toml").write_text(STUDY + "[failures]\ntrial = false\n")
    make(folder)
    assert recorded(folder)["k.txt"] == "opened"


def test_files_in_the_folder_are_archived_so_that_runs_can_be_repeated(folder):
    source = MODEL.replace("import outside", "").replace('(here.parent / "lib" / "far.txt")', "k")
    (folder / "m.py").write_text(source.replace("    factor", "    k = here / 'k.txt'\n    factor"))
    make(folder)
    (folder / "k.txt").unlink()
    for result in uqpen.verify(folder / "study.nc", trust=True, runs=5):
        assert result.verdict.name == "EQUAL", result


def test_a_function_of_a_program_is_known_by_the_files_that_it_opens(folder):
    program = {"file": str(folder / "k.txt")}
    exec(PROGRAM, program)

    def study():
        designs = {"d": uqpen.MonteCarlo(runs=10)}
        given = {"inputs": {"x": "0 ± 1"}, "outputs": {"y": "1"}}
        return uqpen.Study(program["f"], designs=designs, seed=1, folder=folder, **given)

    uqpen.make_archive(study(), folder / "study.nc")
    assert recorded(folder)["k.txt"] == "opened"
    uqpen.make_archive(study(), folder / "again.nc", reuse=[folder / "study.nc"])
    (folder / "k.txt").write_text("3")
    with pytest.raises(CheckpointError, match=r"file k\.txt has changed"):
        uqpen.make_archive(study(), folder / "other.nc", reuse=[folder / "study.nc"])
