"""Arrays with coordinates that are not copied."""

import copy

import numpy as np
import pytest
import xarray as xr

from uqpen.archive.labelled_arrays import BOUND_COORDINATE, array_entries, labelled_array
from uqpen.core.labels import BOUND, BOUNDS

LABELS = np.array(["a", "b"], dtype=object)
INTERVAL_LABELS = xr.Variable(("input",), np.array(["nominal", "none"], dtype=object))
COORDINATES = {
    "input": ("input", LABELS, {"long_name": "input"}),
    "interval_label": INTERVAL_LABELS,
    "note": xr.Variable((), "of all"),
}


def example() -> xr.DataArray:
    return labelled_array(
        np.arange(6.0).reshape(2, 3),
        ("input", BOUND),
        {BOUND: BOUND_COORDINATE, **COORDINATES},
        {"units": "m"},
        "mean",
    )


def test_the_array_is_that_of_the_constructor() -> None:
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
def test_coordinates_are_what_the_constructor_takes(labels: object) -> None:
    values = np.zeros(2)
    array = labelled_array(values, ("input",), {"input": labels}, {})
    xr.testing.assert_identical(array, xr.DataArray(values, {"input": labels}, ("input",)))


def test_coordinates_keep_their_indexes() -> None:
    array = example()
    again = labelled_array(array.values, array.dims, array.coords, array.attrs, "mean")
    xr.testing.assert_identical(again, array)
    assert again.xindexes["input"] is array.xindexes["input"]


@pytest.mark.parametrize("dims", [("input", BOUND), (BOUND, "input")])
def test_entries_are_those_of_an_iteration(dims: tuple[str, ...]) -> None:
    array = example().transpose(*dims)
    for entry, expected in zip(array_entries(array), array, strict=True):
        xr.testing.assert_identical(entry, expected)
        assert list(entry.xindexes) == list(expected.xindexes)


def test_equal_labels_have_one_index() -> None:
    assert example().xindexes["input"] is example().xindexes["input"]
    first, second = (
        labelled_array(np.zeros(2), ("at",), {"at": np.array(labels)}, {})
        for labels in ([0.0, 1.0], [-0.0, 1.0])
    )
    assert np.signbit([first["at"].values[0], second["at"].values[0]]).tolist() == [False, True]


def test_attributes_of_a_coordinate_are_those_of_one_array() -> None:
    one, other = example(), example()
    one[BOUND].attrs["units"] = "1"
    one["input"].attrs["units"] = "1"
    assert "units" not in other[BOUND].attrs
    assert "units" not in other["input"].attrs


def test_no_text_is_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    copied: list[object] = []
    monkeypatch.setattr(copy, "deepcopy", lambda each, memo=None: copied.append(each))
    array = example()
    assert not copied
    assert np.shares_memory(array["interval_label"].values, INTERVAL_LABELS.values)


def test_a_coordinate_of_another_size_is_an_error() -> None:
    with pytest.raises(ValueError, match="coordinate input has 2 values along input, but the arr"):
        labelled_array(np.zeros(3), ("input",), COORDINATES, {})
    with pytest.raises(ValueError, match="coordinate input has 2 values along input, but the arr"):
        labelled_array(np.zeros(3), ("run",), COORDINATES, {})
