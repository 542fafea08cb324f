"""An archive is whole or absent, plain NetCDF, and refused in words where it is neither."""

import os
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.provenance import SCHEMA
from uqpen.archive.read import group_names, is_archive, open_archive, read_group
from uqpen.archive.write import prepare_destination, write
from uqpen.core.errors import ArchiveError

RODS = (Path(__file__).parents[1] / "data" / "rods.toml").read_text(encoding="utf-8")
STUDY = f"""
title = "Größe"
seed = 12345678901234567890123
sensitivity = false
convergence = false
{RODS}
[outputs.penetration_depth]
exceeds = ["60 cm"]
hold = [0.95]
[designs.monte_carlo]
kind = "monte-carlo"
runs = 200
[designs.latin_hypercube]
kind = "latin-hypercube"
runs = 200
"""


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(uqpen.parse_study(STUDY))


@pytest.fixture(scope="module")
def archive(tree, tmp_path_factory):
    path = tmp_path_factory.mktemp("archive") / "study.nc"
    write(tree, path)
    return path


@pytest.mark.processor
def test_what_is_read_is_what_was_written(tree, archive):
    read = open_archive(archive)
    assert {node.path for node in read.subtree} == {node.path for node in tree.subtree}
    for node in tree.subtree:
        xr.testing.assert_equal(
            node.to_dataset(inherit=False), read_group(read, *node.path.split("/")[1:])
        )
    assert read.attrs["study_text"] == STUDY
    assert read.attrs["seed"] == "12345678901234567890123"


def test_every_group_opens_in_plain_xarray(archive):
    with xr.open_dataset(archive, group="runs/monte_carlo") as runs:
        assert runs["penetration_depth"].dims == ("run",)
        assert runs["target_density"].attrs["units"] == "kg m-3"
    with xr.open_datatree(archive) as whole:
        assert group_names(whole.load(), "runs") == ["monte_carlo", "latin_hypercube"]


@pytest.mark.processor
@pytest.mark.slow
def test_the_same_study_writes_the_same_bytes(archive, tmp_path):
    again = tmp_path / "again.nc"
    # In a process of its own, whose hashes and addresses differ.
    code = (
        "import sys, pathlib, uqpen;"
        "study = uqpen.parse_study(sys.argv[1]);"
        "uqpen.write(uqpen.run(study), pathlib.Path(sys.argv[2]))"
    )
    subprocess.run([sys.executable, "-c", code, STUDY, str(again)], check=True)
    assert again.read_bytes() == archive.read_bytes()


def test_nothing_of_the_machine_stands_in_it(archive):
    content = archive.read_bytes()
    assert str(archive.parent).encode() not in content
    assert str(Path.home()).encode() not in content
    assert str(Path(sys.executable).parent).encode() not in content


def test_units_are_udunits_and_no_coordinate_has_a_fill_value(archive):
    import cf_units

    def visit(dataset):
        for variable in dataset.variables.values():
            assert "_FillValue" not in variable.ncattrs(), variable.name
            if "units" in variable.ncattrs():
                cf_units.Unit(variable.units)
        for inner in dataset.groups.values():
            visit(inner)

    with netCDF4.Dataset(archive) as dataset:
        visit(dataset)


def test_nothing_but_the_archive_is_left_behind(archive):
    assert [path.name for path in archive.parent.iterdir()] == ["study.nc"]


class TestDestination:
    def test_folders_are_made(self, tmp_path):
        prepare_destination(tmp_path / "new" / "folder" / "a.nc")
        assert (tmp_path / "new" / "folder").is_dir()
        assert not list((tmp_path / "new" / "folder").iterdir())

    @pytest.mark.parametrize(
        ("name", "reported"),
        [("thesis", "not overwritten"), (".", "is a folder"), ("thesis/a.nc", "cannot be written")],
    )
    def test_what_is_no_archive_stays(self, tmp_path, name, reported):
        (tmp_path / "thesis").write_text("years of work")
        with pytest.raises(ArchiveError, match=reported):
            prepare_destination(tmp_path / name)

    def test_what_a_killed_process_left_is_removed(self, tmp_path):
        with subprocess.Popen([sys.executable, "-c", ""]) as ended:
            pass
        left = tmp_path / f".a.nc.{ended.pid}.part"
        ours = tmp_path / f".a.nc.{os.getppid()}.part"
        left.touch()
        ours.touch()
        prepare_destination(tmp_path / "a.nc")
        assert not left.exists()
        assert ours.exists(), "that process is running"


def test_a_failed_write_leaves_what_stood_there(tree, archive, tmp_path, monkeypatch):
    path = tmp_path / "a.nc"
    path.write_bytes(archive.read_bytes())

    def full_disk(tree, where, root_attributes):
        where.write_bytes(b"half of it")
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr("uqpen.archive.write.write_tree", full_disk)
    with pytest.raises(ArchiveError, match="is the disk full"):
        write(tree, path)
    assert path.read_bytes() == archive.read_bytes()
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.nc"]


MC = "statistics/monte_carlo"
DEPTH = f"{MC}/penetration_depth"


class TestDamage:
    """A file that claims to be an archive and is not whole."""

    @pytest.fixture
    def dataset(self, archive, tmp_path):
        (tmp_path / "a.nc").write_bytes(archive.read_bytes())
        with netCDF4.Dataset(tmp_path / "a.nc", "a") as dataset:
            yield dataset

    @pytest.mark.parametrize(
        ("damage", "reported"),
        [
            (lambda d: d.delncattr("title"), 'no text "title"'),
            (lambda d: d.setncattr("title", 3), 'no text "title"'),
            (lambda d: d.setncattr("seed", "many"), "a seed that is no number"),
            (lambda d: d.renameGroup("runs", "walks"), "no runs"),
            (lambda d: d["runs/monte_carlo"].renameVariable("status", "state"), "no status"),
            (lambda d: d["runs/monte_carlo/status"].__setitem__(0, -5), "a status that is none"),
            (lambda d: d[MC].delncattr("kind"), f"/{MC}: of no kind that is known"),
            (lambda d: d[MC].delncattr("runs_spent"), f"/{MC}: no runs_spent"),
            (
                lambda d: d[f"{DEPTH}/mean"].delncattr("interval_label"),
                "mean: does not say how its interval was made",
            ),
            (
                lambda d: d[DEPTH].renameVariable("probability", "share"),
                f"/{DEPTH}: no probability to tell its entries",
            ),
            (
                lambda d: d[f"{MC}/termination"].renameVariable("category_label", "label"),
                f"/{MC}/termination: no category_label for each entry",
            ),
        ],
    )
    def test_it_is_reported(self, dataset, damage, reported):
        path = dataset.filepath()
        damage(dataset)
        dataset.sync()
        with pytest.raises(ArchiveError, match=f"is damaged: .*{reported}"):
            open_archive(path)


class TestForeignFiles:
    def test_text_is_no_archive(self, tmp_path):
        (tmp_path / "a.nc").write_text("not NetCDF")
        with pytest.raises(ArchiveError, match="is not an archive"):
            open_archive(tmp_path / "a.nc")
        assert not is_archive(tmp_path / "a.nc")

    def test_another_netcdf_file_is_no_archive(self, tmp_path):
        xr.Dataset({"a": 1}).to_netcdf(tmp_path / "a.nc")
        with pytest.raises(ArchiveError, match="but not an archive"):
            open_archive(tmp_path / "a.nc")

    @pytest.mark.parametrize(
        ("schema", "reported"),
        [
            (0, f"a.nc: has schema 0, and this uqpen reads schema {SCHEMA}; take the version"),
            (SCHEMA + 1, f"a.nc: has schema {SCHEMA + 1}, and this uqpen reads schema {SCHEMA};"),
            ([1, 2], "is not an archive"),
        ],
    )
    def test_another_schema_is_reported(self, tmp_path, schema, reported):
        xr.Dataset(attrs={"uqpen_schema": schema}).to_netcdf(tmp_path / "a.nc")
        with pytest.raises(ArchiveError, match=reported):
            open_archive(tmp_path / "a.nc")

    @pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
    def test_a_truncated_archive_is_reported(self, archive, tmp_path, share):
        content = archive.read_bytes()
        (tmp_path / "a.nc").write_bytes(content[: int(share * len(content))])
        with pytest.raises(ArchiveError):
            open_archive(tmp_path / "a.nc")


def test_a_group_that_is_not_there_is_empty(tree):
    assert not read_group(tree, "statistics", "elsewhere", "penetration_depth")
    assert group_names(tree, "surrogates") == []


def test_lost_runs_are_nan_and_flagged_in_the_file(archive):
    with netCDF4.Dataset(archive) as dataset:
        runs = dataset["runs/monte_carlo"]
        status = np.asarray(runs["status"][:])
        assert (status == 1).sum() > 0, "this study is meant to lose some runs"
        assert np.isnan(np.asarray(runs["penetration_depth"][:])[status != 0]).all()
        assert runs["status"].flag_meanings.split()[1] == "inadmissible"


def test_a_folder_in_the_place_of_the_earlier_archive_loses_none(archive, tmp_path):
    path = tmp_path / "study.nc"
    path.write_bytes(archive.read_bytes())
    tree = open_archive(archive)
    tree.attrs["title"] = "Another"
    kept = write(tree, path, keeps_earlier=True)
    assert kept is not None
    kept.unlink()
    kept.mkdir()
    path.write_bytes(archive.read_bytes())
    with pytest.raises(ArchiveError, match=f"{kept.name}: is no file, and the earlier archive"):
        write(tree, path, keeps_earlier=True)
    assert path.read_bytes() == archive.read_bytes()
