"""Archives that keep the files of their studies, repeated with no file around."""

import hashlib
import tempfile
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from study_text import study_text

import uqpen as package

pytestmark = pytest.mark.slow

STUDY = study_text(
    {"python": "models/own.py:f", "inputs": {"x": "1", "z": "1"}, "outputs": {"y": "cm"}},
    inputs={"x": {"measured": {"file": "../measured.csv"}}, "z": 1},
    designs={
        "some": {"kind": "monte-carlo", "runs": 30},
        "given": {"kind": "table", "file": "points.csv"},
    },
)
# Leaves a trace wherever it is executed, and imports what only a run can tell.
OWN = """\
import pathlib
pathlib.Path("executed").touch()
def f(x, z):
    from beside import cube
    return {"y": cube(x) + z}
"""
FILES = {
    "study/models/own.py": OWN,
    "study/beside.py": "def cube(x):\n    return x**3\n",
    "study/points.csv": "x,z\n1,2\n2,4\n",
    "measured.csv": "x\n" + "".join(f"{number / 7}\n" for number in range(12)),
}
NAMES = ["../measured.csv", "beside.py", "models/own.py", "points.csv"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the study, its files and its archive."""
    folder = tmp_path_factory.mktemp("made")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        study = package.parse_study(STUDY, folder=folder / "study")
        package.write(package.run(study), folder / "own.nc")
    return folder


@pytest.fixture
def uqpen(made, command_line, tmp_path, monkeypatch):
    """The command line beside a copy of the archive alone; it leaves no files behind."""
    Path("own.nc").write_bytes((made / "own.nc").read_bytes())
    (tmp_path / "for_the_moment").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "for_the_moment"))

    def call(*arguments):
        done = command_line(*arguments)
        assert "Traceback" not in done.err
        return done

    yield call
    assert list((tmp_path / "for_the_moment").iterdir()) == []


def change(variable, name, value, *, hashed_anew=False):
    """Change what the archive has of a file."""
    with netCDF4.Dataset("own.nc", "a") as dataset:
        files = dataset["files"]
        files[variable][list(files["name"][:]).index(name)] = value
    if hashed_anew:
        package.write(package.open_archive("own.nc"), Path("own.nc"))


def test_all_files_are_kept_by_their_names(made):
    files = package.open_archive(made / "own.nc")["files"]
    assert files["name"].values.tolist() == NAMES
    held = {**FILES, "study/../measured.csv": FILES["measured.csv"]}
    for number, name in enumerate(NAMES):
        text = held[f"study/{name}"]
        assert files["content"].values[number] == text
        assert files["size"].values[number] == len(text)
        assert files["sha256"].values[number] == hashlib.sha256(text.encode()).hexdigest()
    assert str(made).encode() not in (made / "own.nc").read_bytes()


def test_it_is_repeated_with_no_file_around(uqpen, made):
    done = uqpen("verify", "own.nc", "--trust", "--all")
    assert done.code == 0, done.out
    assert "files 4 archived, with the recorded hashes" in done.said
    assert "32 of 32 repeated: bit-equal" in done.out
    done = uqpen("rerun", "own.nc", "--trust")
    assert done.code == 0, done.err
    assert Path("own_rerun.nc").read_bytes() == (made / "own.nc").read_bytes()


def test_other_files_around_do_not_count(uqpen):
    Path("points.csv").write_text("x,z\n5,5\n6,6\n")
    Path("beside.py").write_text("def cube(x):\n    return 0\n")
    assert uqpen("verify", "own.nc", "--trust", "--all").code == 0


OTHER = "def cube(x):\n    return x**4\n"  # of the same size


@pytest.mark.parametrize(
    ("variable", "value", "reported", "hashed_anew"),
    [
        ("content", OTHER, '"beside.py" is changed: found 29 bytes', False),
        ("content", OTHER, '"beside.py" is changed: found 29 bytes', True),
        ("size", 7, '"beside.py" is changed: found 29 bytes with the SHA-256', True),
        ("encoding", "base64", '"beside.py" is not encoded as the archive says', True),
        ("encoding", "rot13", '"beside.py" is not encoded as the archive says', True),
    ],
)
def test_a_file_that_was_changed_is_reported_and_not_used(
    uqpen, variable, value, reported, hashed_anew
):
    change(variable, "beside.py", value, hashed_anew=hashed_anew)
    done = uqpen("verify", "own.nc", "--trust")
    assert done.code == 4
    assert ("/files is changed" in done.out) != hashed_anew
    assert f"files not those of its study {reported}" in done.said
    done = uqpen("rerun", "own.nc", "--trust")
    assert done.code == 2
    assert reported in " ".join(done.err.split())
    assert not Path("executed").exists()


@pytest.mark.parametrize(
    "name", ["/etc/own.py", "a/../../../../leads_out.py", "points.csv/leads_out.py"]
)
def test_no_name_leads_out_of_the_folder(uqpen, tmp_path, name):
    change("name", "beside.py", name, hashed_anew=True)
    before = {path for path in tmp_path.rglob("*") if "for_the_moment" not in path.parts}
    done = uqpen("rerun", "own.nc", "--trust")
    lost = "a/.." in name  # it is in the folder above the study's, where nothing imports it
    assert done.code == (3 if lost else 2), done.err
    # Of runs that all failed alike, the first ones are kept beside the archive to be.
    aside = {"for_the_moment", "own_rerun.nc.parts"}
    after = {path for path in tmp_path.rglob("*") if not aside & set(path.parts)}
    assert {path.name for path in after - before} <= {
        "executed",
        "own_rerun.nc",
        "own_rerun.nc.log",
    }
    assert not any(folder.joinpath("leads_out.py").exists() for folder in tmp_path.parents)


class TestFilesOfAFolder:
    """With ``--folder``, in place of those that the archive keeps."""

    def test_the_same_are_the_same(self, uqpen, made):
        where = ("--trust", "--folder", str(made / "study"))
        assert uqpen("verify", "own.nc", *where, "--all").code == 0
        assert uqpen("rerun", "own.nc", *where).code == 0
        assert Path("own_rerun.nc").read_bytes() == (made / "own.nc").read_bytes()

    def test_others_are_reported(self, uqpen, made, tmp_path):
        for name, text in FILES.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text)
        Path("study/beside.py").write_text("def cube(x):\n    return x**3 + 1\n")
        done = uqpen("verify", "own.nc", "--trust", "--folder", "study")
        assert done.code == 4
        assert "folder not the archived ones beside.py: found the SHA-256" in done.said
        assert "runs 32 of 32 repeated: different" in done.said
        done = uqpen("rerun", "own.nc", "--trust", "--folder", "study")
        assert done.code == 0
        assert "not the archive's file: beside.py: found the SHA-256 " in done.err
        done = uqpen("diff", "own.nc", "own_rerun.nc")
        assert "files\n  beside.py differs\n" in done.out

    def test_one_that_is_not_there_is_reported(self, uqpen):
        done = uqpen("verify", "own.nc", "--folder", ".")
        assert done.code == 2
        assert "there is no file" in done.said
        assert "are looked for in" in done.said


class TestLargeFiles:
    """Kept by their hashes alone."""

    @pytest.fixture
    def large(self, uqpen, tmp_path, monkeypatch):
        # A lower limit than theirs: half a million runs would show no more.
        monkeypatch.setattr("uqpen.core.files.LARGEST", 2**12)
        text = "x\n" + "0.5\n1.5\n" * 2**9
        Path("large").mkdir()
        Path("large/points.csv").write_text(text)
        designs = '[designs.given]\nkind = "table"\nfile = "points.csv"\n'
        study = STUDY.partition("[designs")[0] + designs
        study = study.replace('"models/own.py:f"', '"line.py:f"\nvectorized = true')
        study = study.replace('{ measured = { file = "../measured.csv" } }', '"1 ± 1"')
        Path("large/line.py").write_text("def f(x, z): return {'y': x + z}\n")
        loaded = package.parse_study(study, folder=tmp_path / "large")
        package.write(package.run(loaded), tmp_path / "large.nc")
        Path("large/points.csv").rename("aside.csv")
        return uqpen

    def test_they_are_looked_for_and_must_be_the_same(self, large):
        files = package.open_archive("large.nc")["files"]
        assert files["encoding"].values.tolist() == ["utf-8", "none"]
        assert files["content"].values.tolist()[1] == ""

        done = large("verify", "large.nc", "--trust")
        assert done.code == 2
        assert "files 2 archived, with the recorded hashes points.csv: kept by" in done.said
        why = '"points.csv": the archive has its hash alone, and there is no such file in'
        assert why in done.said
        assert 'found there is no file "points.csv"' in done.said, (
            "not where files are for a moment"
        )

        Path("points.csv").write_text("x\n0.5\n")
        done = large("verify", "large.nc", "--trust")
        assert done.code == 2
        assert f"is another: found 6 bytes, expected {files['size'].values[1]}" in done.said
        assert large("rerun", "large.nc", "--trust").code == 2

        Path("points.csv").write_bytes(Path("aside.csv").read_bytes().replace(b"1.5", b"2.5", 1))
        done = large("verify", "large.nc", "--trust")
        assert done.code == 2
        assert "is another: found the SHA-256" in done.said
        assert large("verify", "large.nc", "--trust", "--folder", ".").code == 2

        Path("aside.csv").rename("points.csv")
        done = large("verify", "large.nc", "--trust")
        assert done.code == 0, done.out


def test_a_file_named_by_an_absolute_path_is_kept_without_it(uqpen, tmp_path):
    elsewhere = tmp_path / "elsewhere" / "points.csv"
    elsewhere.parent.mkdir()
    elsewhere.write_text("x,z\n1,1\n3,3\n")
    Path("points.csv").write_text("x,z\n7,1\n")
    text = f"""
seed = 1
[model]
python = "own.py:f"
inputs = {{ x = "1", z = "1" }}
outputs = {{ y = "1" }}
[inputs]
x = "0 ± 1"
z = 0
[designs.near]
kind = "table"
file = "points.csv"
[designs.far]
kind = "table"
file = '{elsewhere}'
"""
    Path("study").mkdir()
    Path("study/own.py").write_text("def f(x, z): return {'y': x}")
    Path("study/points.csv").write_text("x,z\n7,1\n")
    package.write(
        package.run(package.parse_study(text, folder=tmp_path / "study")), tmp_path / "own.nc"
    )
    names = package.open_archive("own.nc")["files"]["name"].values.tolist()
    assert names == ["own.py", "points-2.csv", "points.csv"]
    assert uqpen("verify", "own.nc", "--trust", "--all").code == 0

    elsewhere.write_text("x,z\n1,1\n3,4\n")
    done = uqpen("verify", "own.nc", "--trust", "--all")
    assert done.code == 2
    assert "points-2.csv: found the SHA-256" in done.said
    assert "named by an absolute path, and changed since then" in done.said
    done = uqpen("verify", "own.nc", "--trust", "--all", "--folder", "study")
    assert done.code == 4
    assert "folder not the archived ones points-2.csv: found" in done.said


def test_a_file_that_no_text_can_hold_is_kept_whole(uqpen, tmp_path):
    with netCDF4.Dataset("points.nc", "w") as dataset:
        dataset.createDimension("point", 2)
        dataset.createVariable("x", "f8", ("point",))[:] = np.array([1.0, 2.0])
    Path("own.py").write_bytes("def f(x, z): return {'y': x}  # ä\r\n".encode())
    study = STUDY.replace("models/", "").replace("points.csv", "points.nc")
    study = study.replace('{ measured = { file = "../measured.csv" } }', '"1 ± 1"')
    loaded = package.parse_study(study, folder=tmp_path)
    package.write(package.run(loaded), tmp_path / "own.nc")
    files = package.open_archive("own.nc")["files"]
    assert files["encoding"].values.tolist() == ["utf-8", "base64"]
    Path("own.py").unlink()
    Path("points.nc").unlink()
    assert uqpen("rerun", "own.nc", "--trust").code == 0
    assert Path("own_rerun.nc").read_bytes() == Path("own.nc").read_bytes()
