"""``uqpen verify``, ``diff`` and ``rerun`` as their user meets them."""

import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen as package
from uqpen.archive.netcdf import write_tree
from uqpen.execution.processes import ProcessPool
from uqpen.verification.repetition import Repetition

pytestmark = pytest.mark.slow

ASKED = {
    "sensitivity": False,
    "convergence": False,
    "inputs": {"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    "outputs": {"y": {"hold": [0.95]}},
}
RUNS = {"monte_carlo": {"kind": "monte-carlo", "runs": 120}}
HYPERCUBES = {"latin_hypercube": {"kind": "latin-hypercube", "runs": 40}}
PLAIN = study_text("ishigami", title="Small", **ASKED, designs={**RUNS, **HYPERCUBES})
# Apart, as what is reported of it takes longer than all the rest.
SURROGATE = f"""\
{PLAIN}
[surrogates.chaos]
kind = "polynomial-chaos"
design = "latin_hypercube"
"""
SEVERAL = study_text(
    **ASKED,
    models={"one": {"use": "ishigami"}, "other": {"use": "ishigami", "with": {"x3": 0.5}}},
    designs=RUNS,
)
OWN = study_text(
    {"python": "own.py:f", "inputs": {"x": "1"}, "outputs": {"y": "cm"}},
    inputs={"x": "0 ± 1"},
    designs={"some": {"kind": "monte-carlo", "runs": 60}},
)
# Leaves a trace wherever it is executed.
SOURCE = """\
import pathlib
pathlib.Path("executed").touch()
def f(x):
    if x > 1.5:
        raise ValueError("too large")
    return {"y": x**3}
"""
STUDIES = {
    "plain": PLAIN,
    "surrogate": SURROGATE,
    "several": SEVERAL,
    "own": OWN,
    "other": PLAIN.replace("= 1\n", "= 2\n"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with an archive of each study."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("own.py").write_text(SOURCE)
        for name, text in STUDIES.items():
            study = package.parse_study(text, name=name, folder=folder)
            package.write(package.run(study), folder / f"{name}.nc")
        Path("executed").unlink()
    return folder


@pytest.fixture
def uqpen(made, command_line, tmp_path):
    """The command line beside copies of the archives."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)

    def call(*arguments):
        done = command_line(*arguments)
        assert "Traceback" not in done.err
        assert max(map(len, done.out.splitlines()), default=0) <= 80
        return done

    return call


def damage(how):
    """Damage a copy of the plain archive, as a careless or malicious hand might."""
    shutil.copy("plain.nc", "damaged.nc")
    if how == "group":
        tree = package.open_archive("plain.nc")
        del tree["statistics/monte_carlo"]["y"]
        write_tree(tree, Path("damaged.nc"))
        return
    with netCDF4.Dataset("damaged.nc", "a") as dataset:
        runs = dataset["runs/monte_carlo"]
        if how == "bit":
            values = np.asarray(runs["y"][:])
            values.view(np.uint64)[17] ^= 1
            runs["y"][:] = values
        elif how == "status":
            runs["status"][23] = 2
        elif how == "text":
            dataset.study_text = dataset.study_text.replace("upper = 3", "upper = 4", 1)
        elif how == "version":
            dataset.version_numpy = "1.0.0"


def without_files(archive):
    """Take the files that its study names out of an archive."""
    tree = package.open_archive(archive)
    del tree["files"]
    package.write(tree, Path(archive))


# By the damage: what `verify` says of hashes, what it says besides, what `diff` says.
DAMAGES = {
    "bit": ("/runs/monte_carlo is changed", "monte_carlo: y of run 17 is", "y of run 17:"),
    "status": (
        "/runs/monte_carlo is changed",
        "monte_carlo: status of run 23 is 2 in the archive and 0 now",
        "status of run 23: 0 and 2; 1 run differs",
    ),
    "text": ("/ is changed", "its text is changed", "+x1 = { uniform = { lower = -3, upper = 4"),
    "group": (
        "/statistics/monte_carlo/y is missing",
        "/statistics/monte_carlo/y is missing",
        "/statistics/monte_carlo/y is in the first only",
    ),
}


class TestVerify:
    @pytest.mark.processor
    @pytest.mark.parametrize(
        ("name", "how"), [("plain", ("--runs", "30")), ("surrogate", ()), ("several", ("--all",))]
    )
    def test_a_fresh_archive_passes(self, uqpen, name, how):
        done = uqpen("verify", f"{name}.nc", *how)
        assert done.code == 0, done.out
        assert done.out.count("bit-equal") == 2
        held = 240 if name == "several" else 160
        repeated = {"--runs": 30, "--all": held}.get(how[0] if how else "", 100)
        assert f"{repeated} of {held} repeated" in done.out

    def test_a_model_of_somebody_else_is_run_with_trust(self, uqpen):
        done = uqpen("verify", "own.nc", "--trust", "--all")
        assert done.code == 0, done.out
        assert "60 of 60 repeated: bit-equal" in done.out

    def test_without_trust_nothing_is_executed(self, uqpen):
        done = uqpen("verify", "own.nc")
        assert done.code == 0, done.out
        assert "--trust" in done.out
        assert "own.py:f" in done.out
        assert "computed again: bit-equal" in done.out
        assert uqpen("show", "own.nc").code == 0
        assert uqpen("diff", "own.nc", "own.nc").code == 0
        assert uqpen("rerun", "own.nc").code == 2
        assert not Path("executed").exists()

    @pytest.mark.parametrize("how", list(DAMAGES))
    def test_damage_is_caught(self, uqpen, how):
        damage(how)
        *of_verify, of_diff = DAMAGES[how]
        done = uqpen("verify", "damaged.nc", "--all")
        assert done.code == 4
        assert all(each in done.said for each in of_verify)
        done = uqpen("diff", "plain.nc", "damaged.nc")
        assert done.code == 4
        assert of_diff in done.said

    @pytest.mark.parametrize(
        ("change", "reported"),
        [
            (lambda root: root.createGroup("extra"), ["/extra was added"]),
            (
                lambda root: root.renameGroup("runs", "walks"),
                [
                    "damaged: no runs",
                    "/runs/monte_carlo is missing",
                    "/walks/monte_carlo was added",
                ],
            ),
            (
                lambda root: root.setncattr("study_text", PLAIN.replace(".monte_carlo", ".mc")),
                ["its text names other designs than it holds: mc, latin_hypercube"],
            ),
            (
                lambda root: root.delncattr("content_sha256"),
                ["hashes no longer recorded in the archive"],
            ),
        ],
    )
    def test_another_structure_is_named(self, uqpen, change, reported):
        with netCDF4.Dataset("plain.nc", "a") as dataset:
            change(dataset)
        done = uqpen("verify", "plain.nc")
        assert done.code == 4
        assert all(each in done.said for each in reported)

    def test_a_damage_that_was_hashed_anew_is_found_by_repeating(self, uqpen):
        damage("bit")
        package.write(package.open_archive("damaged.nc"), Path("damaged.nc"))
        done = uqpen("verify", "damaged.nc", "--all")
        assert done.code == 4
        assert "those of its" in done.out
        assert "y of run 17 is" in done.out
        assert "of the largest value" in done.said

    def test_other_versions_are_named_and_may_change_last_bits(self, uqpen):
        tree = package.open_archive("plain.nc")
        tree.attrs["version_numpy"] = "1.0.0"
        values = tree["runs/monte_carlo"]["y"].values
        values[3] = np.nextafter(values[3], np.inf)
        package.write(tree, Path("plain.nc"))
        done = uqpen("verify", "plain.nc", "--all")
        assert done.code == 0, done.out
        assert "numpy 1.0.0 (here " in done.out
        assert "equal within 1e-09" in done.said
        values[3] += 1e-3
        package.write(tree, Path("plain.nc"))
        assert uqpen("verify", "plain.nc", "--all").code == 4

    def test_what_an_earlier_version_did_not_tell_is_no_difference(self, uqpen):
        tree = package.open_archive("plain.nc")
        del tree["failures"]["monte_carlo"]
        del tree["statistics/monte_carlo/y"]["mean"].attrs["note"]
        package.write(tree, Path("plain.nc"))
        assert uqpen("verify", "plain.nc").code == 4
        tree.attrs["version_uqpen"] = "0.0.1"
        package.write(tree, Path("plain.nc"))
        done = uqpen("verify", "plain.nc")
        assert done.code == 0, done.out
        assert "made with uqpen 0.0.1 (here " in done.said
        assert "/failures/monte_carlo is missing" in done.out
        assert "/statistics/monte_carlo/y: attribute note is missing of mean" in done.said

    def test_files_that_were_taken_out_are_reported(self, uqpen, made):
        without_files("own.nc")
        Path("own.py").unlink()
        done = uqpen("verify", "own.nc", "--trust")
        assert done.code == 2
        assert 'there is no file "own.py"' in done.said
        assert "--folder" in done.out
        done = uqpen("verify", "own.nc", "--trust", "--folder", str(made))
        assert done.code == 4
        assert "expected none, as the archive has no such file" in done.said

    def test_another_source_than_that_which_was_taken_out_is_reported(self, uqpen):
        without_files("own.nc")
        Path("own.py").write_text(f"{SOURCE}# the same, but for this\n")
        done = uqpen("verify", "own.nc", "--trust")
        assert done.code == 4
        assert "60 of 60 repeated: bit-equal" in done.out
        assert "source not the source of the models that it was made with" in done.said
        assert "own.py:f and what it imports: found the SHA-256" in done.said

    def test_another_source_of_a_built_in_model_is_like_another_version(self, uqpen):
        here = package.parse_study(PLAIN).model.identity()["source_sha256"]
        tree = package.open_archive("plain.nc")
        tree.attrs["model_source_sha256"] = "0123456789abcdef"
        values = tree["runs/monte_carlo"]["y"].values
        values[3] = np.nextafter(values[3], np.inf)
        package.write(tree, Path("plain.nc"))
        done = uqpen("verify", "plain.nc", "--all")
        assert done.code == 0, done.out
        assert f"made with source of ishigami 01234567 (here {here[:8]})" in done.said
        assert "equal within 1e-09" in done.said

    def test_methods_head_to_head_have_their_hashes_checked(self, uqpen):
        Path("plain.toml").write_text(PLAIN)
        short = ("--budget", "16", "--repeats", "10", "--reference", "64", "-o", "contest.nc")
        assert uqpen("compare", "plain.toml", *short).code == 0
        done = uqpen("verify", "contest.nc")
        assert done.code == 0, done.out
        assert "only hashes are checked" in " ".join(done.out.split())
        refused = uqpen("rerun", "contest.nc")
        assert refused.code == 2
        assert "benchmark of methods" in refused.err

    @pytest.mark.parametrize(
        ("arguments", "reported"),
        [
            (("own.py",), "is not an archive"),
            (("absent.nc",), "there is no such file"),
            (("plain.nc", "--runs", "0"), "--runs"),
            (("plain.nc", "--runs", "5", "--all"), "exclude each other"),
        ],
    )
    def test_a_mistake_leaves_with_2(self, uqpen, arguments, reported):
        done = uqpen("verify", *arguments)
        assert done.code == 2
        assert reported in done.err


class TestDiff:
    @pytest.mark.parametrize("name", ["surrogate", "several", "own"])
    def test_the_same_is_the_same(self, uqpen, name):
        done = uqpen("diff", f"{name}.nc", f"{name}.nc")
        assert (done.code, done.out) == (0, "the same\n")

    def test_two_seeds_are_explained(self, uqpen):
        done = uqpen("diff", "plain.nc", "other.nc")
        assert done.code == 4
        assert "-seed = 1" in done.out
        assert "+seed = 2" in done.out
        assert "seed\n  1 and 2" in done.out
        assert "x1 of run 0" in done.said
        assert "120 runs differ" in done.said
        assert "outputs\n  /runs/monte_carlo: y of run 0" in done.out
        assert "made with" not in done.out

    def test_two_versions_are_explained(self, uqpen):
        damage("version")
        done = uqpen("diff", "plain.nc", "damaged.nc")
        assert done.code == 4
        assert done.out.startswith("made with\n  numpy: ")
        assert done.out.endswith(" and 1.0.0\n")

    def test_figures_outside_each_others_intervals_are_counted(self, uqpen):
        with netCDF4.Dataset("other.nc", "a") as dataset:
            mean = dataset["statistics/monte_carlo/y/mean"]
            mean[:] = np.asarray(mean[:]) + 100
        done = uqpen("diff", "plain.nc", "other.nc")
        assert "outside each other's intervals" in done.out
        assert "/statistics/monte_carlo/y: mean: " in done.out

    def test_other_studies_are_explained(self, uqpen):
        done = uqpen("diff", "plain.nc", "own.nc")
        assert done.code == 4
        assert "/runs/monte_carlo is in the first only" in done.out
        assert "more lines" in done.out

    def test_a_surrogate_more_is_named(self, uqpen):
        done = uqpen("diff", "plain.nc", "surrogate.nc")
        assert done.code == 4
        assert "/surrogates/chaos is in the second only" in done.out

    def test_what_is_no_archive_leaves_with_2(self, uqpen):
        assert uqpen("diff", "plain.nc", "own.py").code == 2


class TestRerun:
    @pytest.mark.processor
    @pytest.mark.parametrize(
        ("name", "arguments"), [("surrogate", ()), ("several", ()), ("own", ("--trust",))]
    )
    def test_it_writes_the_same_bytes(self, uqpen, name, arguments):
        done = uqpen("rerun", f"{name}.nc", *arguments)
        assert done.code == 0, done.err
        assert done.out.endswith(f"compare: uqpen diff {name}.nc {name}_rerun.nc\n")
        assert Path(f"{name}_rerun.nc").read_bytes() == Path(f"{name}.nc").read_bytes()

    def test_it_does_not_overwrite_what_it_repeats(self, uqpen):
        done = uqpen("rerun", "plain.nc", "-o", "./plain.nc")
        assert done.code == 2
        assert "not overwritten" in done.err

    def test_a_function_that_is_not_there_is_reported(self, uqpen):
        without_files("own.nc")
        Path("own.py").unlink()
        done = uqpen("rerun", "own.nc", "--trust")
        assert done.code == 2
        assert 'there is no file "own.py"' in done.err


def test_runs_are_repeated_on_the_workers_that_were_asked_for(uqpen, monkeypatch):
    asked = []

    class Watched(ProcessPool):
        def __call__(self, work, batches, pickled=b""):
            asked.append("workers")
            return super().__call__(work, batches, pickled)

    monkeypatch.setattr("uqpen.execution.processes.ProcessPool", Watched)
    assert uqpen("verify", "plain.nc", "--workers", "2").code == 0
    assert asked


def test_the_runs_that_are_repeated_are_the_same_each_time():
    study = package.parse_study(PLAIN)
    runs = xr.Dataset(coords={"run": np.arange(1000)})
    archived = {"": {"monte_carlo": runs, "latin_hypercube": runs}}
    first, second = (drawn_by_design(study, archived, 70) for _ in range(2))
    assert first == second
    assert sum(map(len, first.values())) == 70
    assert all(len(set(positions)) == len(positions) > 20 for positions in first.values())


def drawn_by_design(study, runs, number):
    drawn = Repetition(study, runs, number).drawn_runs()
    return {design: list(positions) for _, design, positions in drawn}


@pytest.mark.parametrize("command", ["verify", "rerun", "serve"])
def test_a_folder_that_is_not_there_is_reported(made, uqpen, command):
    done = uqpen(command, "own.nc", "--folder", "nowhere")
    assert done.code == 2
    assert "Directory 'nowhere' does not exist" in done.err
