"""Estimate arrays: coordinates that are not copied, statistics unpacked when they are needed."""

import copy

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive import estimates
from uqpen.archive.estimates import (
    BOUND_COORDINATE,
    UnpackedStatistics,
    array_entries,
    labelled_array,
    statistic_names,
    unpack,
)
from uqpen.core.labels import BOUND, BOUNDS
from uqpen.results.output_tables import output_tables

LABELS = np.array(["a", "b"], dtype=object)
INTERVAL_LABELS = xr.Variable(("input",), np.array(["nominal", "none"], dtype=object))
COORDINATES = {
    "input": ("input", LABELS, {"long_name": "input"}),
    "interval_label": INTERVAL_LABELS,
    "note": xr.Variable((), "of all"),
}


def example():
    return labelled_array(
        np.arange(6.0).reshape(2, 3),
        ("input", BOUND),
        {BOUND: BOUND_COORDINATE, **COORDINATES},
        {"units": "m"},
        "mean",
    )


def test_the_array_is_that_of_the_constructor():
    expected = xr.DataArray(
        np.arange(6.0).reshape(2, 3),
        {BOUND: list(BOUNDS), **COORDINATES},
        ("input", BOUND),
        "mean",
        {"units": "m"},
    )
    xr.testing.assert_identical(example(), expected)
    assert list(example().coords) == list(expected.coords)
    assert list(example().xindexes) == list(expected.xindexes)
    chosen = example().sel({"input": "b", BOUND: "upper"})
    xr.testing.assert_identical(chosen, expected.sel({"input": "b", BOUND: "upper"}))


@pytest.mark.parametrize(
    "labels",
    [
        ["x", "z"],
        ("input", ["x", "z"], {"long_name": "input"}),
        xr.DataArray([1.0, 2.0], dims="input", name="input"),
        xr.Variable("input", [1.0, 2.0], {"units": "m"}),
    ],
)
def test_coordinates_are_what_the_constructor_takes(labels):
    values = np.zeros(2)
    array = labelled_array(values, ("input",), {"input": labels}, {})
    xr.testing.assert_identical(array, xr.DataArray(values, {"input": labels}, ("input",)))


def test_coordinates_keep_their_indexes():
    array = example()
    again = labelled_array(array.values, array.dims, array.coords, array.attrs, "mean")
    xr.testing.assert_identical(again, array)
    assert again.xindexes["input"] is array.xindexes["input"]


@pytest.mark.parametrize("dims", [("input", BOUND), (BOUND, "input")])
def test_entries_are_those_of_an_iteration(dims):
    array = example().transpose(*dims)
    for entry, expected in zip(array_entries(array), array, strict=True):
        xr.testing.assert_identical(entry, expected)
        assert list(entry.xindexes) == list(expected.xindexes)


def test_equal_labels_have_one_index():
    assert example().xindexes["input"] is example().xindexes["input"]
    first, second = (
        labelled_array(np.zeros(2), ("at",), {"at": np.array(labels)}, {})
        for labels in ([0.0, 1.0], [-0.0, 1.0])
    )
    assert np.signbit([first["at"].values[0], second["at"].values[0]]).tolist() == [False, True]


def test_attributes_of_a_coordinate_are_those_of_one_array():
    one, other = example(), example()
    one[BOUND].attrs["units"] = "1"
    one["input"].attrs["units"] = "1"
    assert "units" not in other[BOUND].attrs
    assert "units" not in other["input"].attrs


def test_no_text_is_copied(monkeypatch):
    copied = []
    monkeypatch.setattr(copy, "deepcopy", lambda each, memo=None: copied.append(each))
    array = example()
    assert not copied
    assert np.shares_memory(array["interval_label"].values, INTERVAL_LABELS.values)


def test_a_coordinate_of_another_size_is_an_error():
    with pytest.raises(ValueError, match="coordinate input has 2 values along input, but the arr"):
        labelled_array(np.zeros(3), ("input",), COORDINATES, {})
    with pytest.raises(ValueError, match="coordinate input has 2 values along input, but the arr"):
        labelled_array(np.zeros(3), ("run",), COORDINATES, {})


@pytest.fixture(scope="module")
def archive():
    study = uqpen.Study(
        model=lambda a, b: {f"y{k}": a + k * b for k in range(4)},
        inputs={"a": uqpen.Normal(0, 1), "b": uqpen.Normal(0, 1)},
        outputs=dict.fromkeys(("y0", "y1", "y2", "y3"), "1"),
        designs={"plain": uqpen.MonteCarlo(runs=64)},
        seed=1,
    )
    return uqpen.run(study)


def test_they_are_those_of_the_group(archive):
    dataset = archive["statistics/plain/y1"].to_dataset()
    found = UnpackedStatistics(dataset)
    assert list(found) == statistic_names(dataset)
    assert len(found) == len(list(found.attributes()))
    assert "mean_interval" not in found
    assert found.get("frobnicate") is None
    for name, array in found.items():
        assert array.identical(unpack(dataset, name))
        assert found[name] is array


def test_tables_unpack_no_statistic_of_an_output_they_do_not_show(archive, monkeypatch):
    asked = []

    def counted(dataset, name):  # type: ignore[no-untyped-def]
        asked.append(name)
        return unpack(dataset, name)

    monkeypatch.setattr(estimates, "unpack", counted)
    assert list(output_tables(archive))
    # A distribution function is never in a table.
    assert asked
    assert not {"cdf", "cdf_band", "percentile"} & set(asked)
