"""What is damaged is reported in words: by its bytes, and by what figures have to lie along."""

import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from drawn_samples import runs_of_values
from study_text import study_text

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.archive.hashes import is_broken
from uqpen.archive.read import open_archive
from uqpen.archive.structure import find_run_faults
from uqpen.core.errors import ArchiveError
from uqpen.results.long_table import long_table
from uqpen.results.source_statistics import SourceStatistics

ASKED = {
    "inputs": {"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    "outputs": {"y": {"exceeds": [5], "hold": [0.95]}},
}
FIRST_DESIGN = {"first": {"kind": "monte-carlo", "runs": 30}}
SEVERAL = study_text(
    **ASKED,
    models={"one": {"use": "ishigami"}, "other": {"use": "ishigami", "with": {"x3": 0.5}}},
    designs={**FIRST_DESIGN, "second": {"kind": "latin-hypercube", "runs": 30}},
    surrogates={"chaos": {"kind": "polynomial-chaos", "design": "first", "order": 2}},
)
# It is opened in a quarter of the time.
SINGLE = study_text("ishigami", **ASKED, designs=FIRST_DESIGN)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "whole.nc"
    uqpen.write(uqpen.run(uqpen.parse_study(SEVERAL)), path)
    return path


@pytest.fixture(scope="module")
def single(whole):
    path = whole.with_name("single.nc")
    uqpen.write(uqpen.run(uqpen.parse_study(SINGLE)), path)
    return path


@pytest.fixture
def copy(whole, tmp_path):
    return Path(shutil.copy(whole, tmp_path / "copy.nc"))


@pytest.mark.parametrize("at", [0, 100, 0.5, 0.9, -1])
def test_a_byte_that_has_changed_is_reported_before_it_is_read(copy, at):
    data = bytearray(copy.read_bytes())
    position = int(at * len(data)) if isinstance(at, float) else at
    data[position] ^= 1
    copy.write_bytes(data)
    with pytest.raises(ArchiveError) as caught:
        open_archive(copy)
    assert str(caught.value) == f"{copy}: is damaged: its bytes are not those that were written"


def test_a_file_without_its_end_is_refused(copy):
    copy.write_bytes(copy.read_bytes()[:-5000])
    size = copy.stat().st_size
    with pytest.raises(ArchiveError, match=rf"it is cut off: {size} of its \d+ bytes are here"):
        open_archive(copy)


def test_what_others_have_edited_has_no_checksum_and_is_opened(copy):
    with netCDF4.Dataset(copy, "a") as dataset:
        dataset.title = "another"
    assert not is_broken(copy)
    assert b"uqpen sha256" not in copy.read_bytes()[-100:]
    assert open_archive(copy).attrs["title"] == "another"


def drop(group, name):
    return lambda root: root[group].renameVariable(name, "formerly")


def reported(path, name, value):
    return lambda root: (root[path] if path else root).setncattr(name, value)


def filled(path, at, value):
    return lambda root: root[path].__setitem__(at, value)


def replaced(group, name, kind, dims):
    """A variable of another type or along other dimensions in the place of one."""

    def change(root):
        old = root[group][name]
        attributes = {key: old.getncattr(key) for key in old.ncattrs()}
        root[group].renameVariable(name, "formerly")
        root[group].createVariable(name, kind, dims).setncatts(attributes)

    return change


Y = "statistics/first/y"
CODES = f"{Y}/quantile_interval"
# By what is said of an output's statistics.
OF_STATISTICS = {
    "mean: not the bounds of an estimate": [filled(f"{Y}/bound", 1, "least")],
    "no input to tell its entries apart": [drop(Y, "input")],
    "no rank to tell its entries apart": [drop(Y, "rank")],
    "no probability to tell its entries apart": [replaced(Y, "probability", str, ("probability",))],
    "no threshold_value for each entry": [drop(Y, "threshold_value")],
    "no content_runs_needed for each entry": [
        drop(Y, "content_runs_needed"),
        replaced(Y, "content_runs_needed", str, ("content",)),
    ],
    "mean is not of numbers along bound": [
        replaced(Y, "mean", "f8", ("probability", "bound")),
        replaced(Y, "mean", "f8", ()),
    ],
    "exceedance is not of numbers along threshold, bound": [
        replaced(Y, "exceedance", "f8", ("bound", "threshold")),
        replaced(Y, "exceedance", str, ("threshold", "bound")),
    ],
    "quantile: does not say how its interval was made": [
        filled(CODES, 0, 100),
        filled(CODES, 0, -1),
        replaced(Y, "quantile_interval", "f8", ("probability",)),
        replaced(Y, "quantile_interval", "i1", ("content",)),
        reported(CODES, "flag_note", ["one", "two", "three", "four", "five"]),
        reported(CODES, "flag_interval", np.arange(3)),
        lambda root: root[CODES].delncattr("flag_interval_label"),
    ],
}
OF_ONE_MODEL = [
    *((f"/{Y}: {said}", each) for said, changes in OF_STATISTICS.items() for each in changes),
    (
        "/runs/first/y: display_units that are no unit",
        reported("runs/first/y", "display_units", "m^^"),
    ),
    (f"/{Y}/mean: note is no text", reported(f"{Y}/mean", "note", np.array([1, 2]))),
    (f"/{Y}/first_order: runs is no count", reported(f"{Y}/first_order", "runs", "many")),
    ("a seed that is no number", reported("", "seed", "9" * 5000)),
    ("/runs/first: run numbers that do not ascend", filled("runs/first/run", 3, 1)),
]

ONE = "models/one"
FIRST = f"{ONE}/{Y}"
OF_SEVERAL_MODELS = [
    (f"/{FIRST}: mean: not the bounds of an estimate", drop(FIRST, "bound")),
    (
        f"/{ONE}/statistics/second/y: another probability than elsewhere",
        filled(f"{ONE}/statistics/second/y/probability", 1, 0.4),
    ),
    (
        f"/{ONE}/failures/first: no status to tell its entries apart",
        drop(f"{ONE}/failures/first", "status"),
    ),
    (
        f"/{ONE}/statistics/first: of no kind that is known",
        reported(f"{ONE}/statistics/first", "kind", "guess"),
    ),
    (
        f"/{ONE}/statistics/chaos: no check",
        lambda root: root[f"{ONE}/statistics/chaos"].delncattr("check"),
    ),
    (
        "/differences/third: of no model",
        lambda root: root["differences"].renameGroup("other", "third"),
    ),
    (
        "/differences/other/first/y: does not say of which model",
        lambda root: root["differences/other/first/y"].delncattr("minus"),
    ),
    (
        f"/{ONE}/surrogates/chaos: does not say how well it fits y",
        lambda root: root[f"{ONE}/surrogates/chaos/y"].delncattr("q2"),
    ),
]


@pytest.mark.parametrize(("message", "change"), OF_ONE_MODEL)
def test_a_damaged_part_is_named(single, tmp_path, message, change):
    _is_named(Path(shutil.copy(single, tmp_path / "copy.nc")), message, change)


@pytest.mark.slow
@pytest.mark.parametrize(("message", "change"), OF_SEVERAL_MODELS)
def test_a_damaged_part_of_several_models_is_named(copy, message, change):
    _is_named(copy, message, change)


def _is_named(copy, message, change):
    with netCDF4.Dataset(copy, "a") as root:
        change(root)
    with pytest.raises(ArchiveError) as caught:
        open_archive(copy)
    assert str(caught.value) == f"{copy}: is damaged: {message}"


@pytest.mark.parametrize(
    ("weights", "faults"),
    [
        ([0.0, 1.0, 2.0], []),
        *(([1.0, each, 2.0], ["/first: a weight that is none"]) for each in (-1, np.nan, np.inf)),
        ([0.0, 0.0, 0.0], ["/first: a weight that is none"]),
        (["1", "1", "1"], ["/first: a weight that is none"]),
    ],
)
def test_runs_have_weights_and_some_run_counts(weights, faults):
    assert faults_of_runs(runs_of_values([1.0, 2.0, 3.0], weights=weights)) == faults


@pytest.mark.parametrize(
    ("failed", "dimension", "faults"),
    [
        ([0, 2], "lost_run", []),
        ([2, 0], "lost_run", []),
        ([0, 3], "lost_run", ["/first: reasons without a lost_run"]),
        ([-1, 0], "lost_run", ["/first: reasons without a lost_run"]),
        ([0, 1, 2], "run", ["/first: reasons without a lost_run"]),
    ],
)
def test_each_failure_reason_is_of_a_run(failed, dimension, faults):
    runs = runs_of_values([1.0, 2.0, 3.0]).assign_coords(lost_run=failed)
    runs["lost_reason"] = (dimension, ["it broke"] * len(failed))
    assert faults_of_runs(runs) == faults


def faults_of_runs(runs):
    return list(find_run_faults(xr.DataTree.from_dict({"first": runs})))


class TestWhatUqpenDoesNotKnow:
    """Archives of others, which lack a statistic or have one of their own."""

    @pytest.mark.slow
    def test_a_statistic_that_is_absent_is_no_damage(self, copy):
        tree = open_archive(copy)
        del tree[FIRST]["skewness"]
        del tree[f"{ONE}/statistics/second"]["y"]
        del tree[ONE]["failures"]
        uqpen.write(tree, copy)
        found = SourceStatistics(open_archive(copy)[ONE])
        assert found.get("first", "y", "skewness") is None
        assert found.get("first", "y", "mean") is not None
        assert found.statistics("second", "y") == {}
        assert list(found.by_source("y", "mean")) == ["first", "chaos"]
        assert found.failures("first") == {}

    @pytest.mark.slow
    def test_one_that_is_not_in_the_catalogue_is_kept_and_listed(self, copy):
        expected = [0.25, 0.125, 0.5]
        with netCDF4.Dataset(copy, "a") as root:
            group = root[FIRST]
            group.createDimension("shape", 2)
            alone = group.createVariable("trimmed_mean", "f8", ("bound",))
            alone.setncatts({"units": "1", "interval": "bootstrap", "interval_label": "nominal"})
            alone[:] = expected
            along = group.createVariable("wavelet", "f8", ("shape", "bound"))
            along.setncatts({"units": "1", "interval": "none", "interval_label": "none"})
            along[:] = np.array([[1, np.nan, np.nan], [2, np.nan, np.nan]])
        tree = open_archive(copy)
        uqpen.write(tree, copy)
        again = open_archive(copy)
        array = SourceStatistics(again[ONE]).get("first", "y", "trimmed_mean")
        assert array is not None
        assert array.values.tolist() == expected
        assert interval_text(array, "interval") == "bootstrap"
        listed = long_table(again).query("model == 'one' and source == 'first'")
        (row,) = listed[listed["statistic"] == "trimmed_mean"].to_dict("records")
        assert [row["estimate"], row["lower"], row["upper"]] == expected
        assert (row["unit"], row["interval_label"]) == ("1", "nominal")
        assert listed[listed["statistic"] == "wavelet"]["estimate"].tolist() == [1, 2]

    def test_one_along_bounds_says_how_they_were_made(self, copy):
        with netCDF4.Dataset(copy, "a") as root:
            root[FIRST].createVariable("trimmed_mean", "f8", ("bound",))[:] = 1
        with pytest.raises(ArchiveError, match="trimmed_mean: does not say how its interval was"):
            open_archive(copy)
