"""Dimensions of outputs, and which values of a field are results."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from uqpen.core.catalogue import DIMENSIONS, NAMES_IN_USE
from uqpen.core.errors import SettingsError
from uqpen.core.labels import BOUND, RANK, RUN
from uqpen.core.variables import Category, Dimension, Output

TIME = Dimension("time", "s", values=(0.0, 1.0, 2.0, 3.0))
DEPTH = Dimension("depth", "m", values=(0.1, 0.2))


def message(make):
    with pytest.raises(SettingsError) as refused:
        make()  # type: ignore[operator]
    return str(refused.value)


class TestDimension:
    @pytest.mark.parametrize("name", [RUN, BOUND, RANK, "mean", *DIMENSIONS])
    def test_a_name_that_archives_use_is_refused(self, name):
        expected = f'name: found "{name}"; expected a name that archives do not use themselves'
        assert message(lambda: Dimension(name, "s", values=(0.0,))) == expected

    def test_names_in_use_come_from_labels_and_catalogue(self):
        assert {"run", "replicate", "lost_run", "percent", "category_label"} <= NAMES_IN_USE

    @pytest.mark.parametrize("values", [(0.0, 0.0), (1.0, 0.0), (0.0, np.nan), (0.0, np.inf)])
    def test_coordinates_ascend(self, values):
        expected = "finite numbers in ascending order"
        assert message(lambda: Dimension("time", "s", values=values)).endswith(expected)

    def test_there_is_a_coordinate(self):
        assert "at least one coordinate" in message(lambda: Dimension("time", "s"))

    def test_equal_ones_are_equal(self):
        same = Dimension("time", "s", values=(0, 1, 2, 3))
        assert same == TIME
        assert hash(same) == hash(TIME)
        assert pickle.loads(pickle.dumps(TIME)) == TIME


class TestOutput:
    def test_a_scalar_has_no_shape(self):
        assert Output("y", "1").shape == ()
        assert Output("y", "1").is_number
        assert not Output("y", "1", categories=(Category("a", "a"),)).is_number

    def test_a_field_has_the_shape_of_its_dimensions(self):
        field = Output("v", "m s-1", dims=(TIME, DEPTH))
        assert field.shape == (4, 2)
        assert not field.is_number

    def test_there_are_three_dimensions_at_most(self):
        dims = tuple(Dimension(name, "1", values=(0.0,)) for name in "abcd")
        assert "at most 3 dimensions" in message(lambda: Output("v", "1", dims=dims))
        assert Output("v", "1", dims=dims[:3]).shape == (1, 1, 1)

    def test_names_differ(self):
        assert "names that differ" in message(lambda: Output("v", "1", dims=(TIME, TIME)))
        assert "names that differ" in message(lambda: Output("time", "1", dims=(TIME,)))

    def test_a_category_has_no_dimensions(self):
        kinds = (Category("a", "a"),)
        assert "one of them" in message(lambda: Output("v", "1", categories=kinds, dims=(TIME,)))

    @pytest.mark.parametrize("dims", [(), (TIME, DEPTH)])
    def test_only_a_curve_may_end(self, dims):
        assert "a curve" in message(lambda: Output("v", "1", dims=dims, may_end=True))


class TestInvalid:
    def test_every_value_of_a_field_must_be_finite(self):
        values = np.zeros((2, 4, 2))
        values[1, 2, 1] = np.nan
        found = Output("v", "1", dims=(TIME, DEPTH)).invalid(values)
        assert np.argwhere(found).tolist() == [[1, 2, 1]]

    @pytest.mark.parametrize(
        ("curve", "invalid"),
        [
            ([1, 2, 3, 4], []),
            ([1, 2, np.nan, np.nan], []),
            ([1, np.nan, np.nan, np.nan], []),
            ([1, np.nan, 3, np.nan], [1]),
            ([np.nan, np.nan, np.nan, np.nan], [0]),
            ([1, 2, 3, np.inf], [3]),
            ([1, np.inf, np.nan, np.nan], [1]),
        ],
    )
    def test_a_curve_may_end_once(self, curve, invalid):
        output = Output("v", "1", dims=(TIME,), may_end=True)
        assert np.flatnonzero(output.invalid(np.array([curve]))).tolist() == invalid

    @given(arrays(float, (3, 4), elements=st.sampled_from([0.0, 1.0, np.nan, np.inf])))
    def test_without_an_end_it_is_what_is_not_finite(self, values):  # type: ignore[type-arg]
        whole = Output("v", "1", dims=(TIME,))
        ending = Output("v", "1", dims=(TIME,), may_end=True)
        assert np.array_equal(whole.invalid(values), ~np.isfinite(values))
        # What may end has no other faults, and a run is valid if a number is followed by NaN alone.
        assert not (ending.invalid(values) & ~whole.invalid(values)).any()
        for row, faults in zip(values, ending.invalid(values), strict=True):
            numbers = int(np.isfinite(row).sum())
            is_whole = np.isfinite(row[:numbers]).all() and np.isnan(row[numbers:]).all()
            assert faults.any() == (not (numbers and is_whole))
