"""Fields in an archive: written, opened, checked, verified, compared."""

import tempfile
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from study_text import study_text

import uqpen
from uqpen.archive.netcdf import write_tree
from uqpen.archive.read import open_archive, read_groups
from uqpen.archive.structure import find_field_faults
from uqpen.core.errors import ArchiveError
from uqpen.core.labels import BOUND, ROLE, RUN
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.diff import diff_runs

MODEL = """\
def simulate(x):
    return {"curve": [x, x + 1, float("nan") if x > 1 else x + 2], "y": x}
"""
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "inputs": {"x": "1"},
        "outputs": {
            "curve": {
                "unit": "cm",
                "along": {"time": {"unit": "day", "values": [0, 1, 4]}},
                "may_end": True,
            },
            "y": "1",
        },
    },
    seed=11,
    inputs={"x": "0 ± 1"},
    designs={"mc": {"kind": "monte-carlo", "runs": 30}, "blocks": {"kind": "saltelli", "base": 32}},
    surrogates={"pce": {"kind": "polynomial-chaos", "design": "mc"}},
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    (folder / "model.py").write_text(MODEL)
    study = uqpen.parse_study(STUDY, folder=folder)
    uqpen.write(uqpen.run(study), folder / "study.nc")
    return folder


@pytest.fixture(scope="module")
def archive(folder):
    return open_archive(folder / "study.nc")


def test_a_field_lies_along_its_coordinates(archive):
    runs = archive["runs/mc"].to_dataset()
    assert runs["curve"].dims == (RUN, "time")
    assert runs["curve"].attrs == {
        "units": "m",
        "display_units": "cm",
        "long_name": "curve",
        ROLE: "output",
        "comment": "NaN after the end of the curve",
    }
    assert runs["time"].values.tolist() == [0.0, 86_400.0, 4 * 86_400.0]
    assert runs["time"].attrs["units"] == "s"
    assert np.array_equal(runs["curve"].values[:, 0], runs["x"].values * 0.01)


def test_a_statistic_has_the_coordinates_of_its_field(archive):
    runs = archive["runs/mc"].to_dataset()
    for design in ("mc", "blocks"):
        group = archive[f"statistics/{design}/curve"].to_dataset()
        assert {"mean", "std", "quantile", "reached"} <= set(group.data_vars)
        assert group["quantile"].dims == ("time", "probability", BOUND)
        assert group["time"].identical(runs["time"])
        assert group["mean"].attrs["units"] == "m"
    fit = archive["surrogates/pce"]
    assert fit.attrs["outputs"] == "curve y"
    assert fit["curve/mean_field"].dims == ("time",)
    known = np.isfinite(fit["curve/mean_field"].values)
    assert known.sum() == fit["curve"].attrs["common_places"]
    assert 0 < fit["curve/end"].attrs["q2"] < 1  # a step in x is no polynomial


def test_verify_repeats_it(folder):
    results = uqpen.verify(folder / "study.nc", folder=folder, trust=True)
    assert {each.verdict for each in results} == {CheckOutcome.EQUAL}


def test_an_archive_of_other_coordinates_is_not_of_its_study(folder):
    tree = open_archive(folder / "study.nc")
    runs = tree["runs/mc"].to_dataset().assign_coords(time=[0.0, 86_400.0, 5 * 86_400.0])
    runs["time"].attrs = {"units": "s", "display_units": "day", "long_name": "time"}
    tree["runs/mc"] = xr.DataTree(runs)
    uqpen.write(tree, folder / "other.nc")
    texts = " ".join(map(str, uqpen.verify(folder / "other.nc", folder=folder, trust=True)))
    assert "mc lacks time, which its text contains" in texts


def test_a_difference_names_its_place(archive):
    one = archive["runs/mc"].to_dataset()
    other = one.copy(deep=True)
    other["curve"].values[3, 1] += 1
    found = diff_runs(one, other).outputs
    assert len(found) == 1
    assert found[0].startswith("curve of run 3 at time = 1 day: ")
    assert found[0].endswith("; 1 run differs")


def _of_texts(runs):
    texts = runs["curve"].astype(str).astype(object)
    return runs.assign(curve=texts.assign_attrs(runs["curve"].attrs))


@pytest.mark.parametrize(
    ("damage", "fault"),
    [
        (lambda runs: runs.drop_vars("time"), "no coordinates along time"),
        (lambda runs: runs.isel(time=[2, 1, 0]), "coordinates along time that do not ascend"),
        (
            lambda runs: runs.assign(curve=runs["curve"].transpose("time", RUN)),
            "curve does not lie along run and its own dimensions",
        ),
        (lambda runs: runs.assign_coords(time=runs["time"].drop_attrs()), "no units of time"),
        (_of_texts, "curve is not of numbers"),
    ],
)
def test_a_fault_is_named_on_opening(folder, tmp_path, damage, fault):
    tree = open_archive(folder / "study.nc")
    runs = tree["runs/mc"].to_dataset()
    assert list(find_field_faults(runs)) == []
    tree["runs/mc"] = xr.DataTree(damage(runs))
    uqpen.write(tree, tmp_path / "damaged.nc")
    with pytest.raises(ArchiveError, match=f"is damaged: /runs/mc: {fault}"):
        open_archive(tmp_path / "damaged.nc")


@settings(max_examples=10, deadline=None)
@given(st.lists(st.integers(1, 4), min_size=1, max_size=3), st.data())
def test_a_field_is_read_back_to_the_bit(shape, data):
    size = int(np.prod([2, *shape]))
    numbers = st.floats(allow_nan=True, allow_infinity=True)
    values = np.array(data.draw(st.lists(numbers, min_size=size, max_size=size)))
    dims = ["a", "b", "c"][: len(shape)]
    field = xr.Dataset(
        {"v": ((RUN, *dims), values.reshape(2, *shape))},
        {RUN: [0, 1]} | {name: np.arange(n) / 3 for name, n in zip(dims, shape, strict=True)},
    )
    with tempfile.TemporaryDirectory() as folder:
        write_tree(xr.DataTree.from_dict({"/runs/mc": field}), Path(folder) / "x.nc")
        with netCDF4.Dataset(Path(folder) / "x.nc") as root:
            again = read_groups(root)["runs/mc"].to_dataset()
    assert again["v"].dims == field["v"].dims
    assert again["v"].values.tobytes() == field["v"].values.tobytes()
    for name in dims:
        assert again[name].values.tobytes() == field[name].values.tobytes()
