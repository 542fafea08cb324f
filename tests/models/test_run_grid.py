"""Runs with a grid of their own, put onto the declared one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from uqpen.core.model import Dimension, Output
from uqpen.core.status import Status
from uqpen.models.run_grid import RunGrid, UnusableOutputError

TIME = Dimension("time", "s", "", "min", (0.0, 60.0, 120.0, 180.0))  # 0 to 3 min
DEPTH = Dimension("depth", "m", values=(0.0, 1.0))
CURVE = Output("y", "m", dims=(TIME,))
ENDING = Output("y", "m", dims=(TIME,), may_end=True)
SHEET = Output("y", "m", dims=(DEPTH, TIME))


def put(values, own, interpolation="linear", output=CURVE):
    """The values at the declared times, or why there are none; own times are in minutes."""
    grid = RunGrid({"time": "t"}, interpolation=interpolation)
    try:
        coordinates = {"time": np.asarray(own, dtype=float)}
        found = grid.interpolate(output, np.asarray(values, dtype=float), coordinates)
    except UnusableOutputError as error:
        return str(error)
    return found.tolist()


class TestInterpolation:
    def test_linear_is_the_default(self):
        assert put([0, 1, 5], [0, 2, 3]) == [0.0, 0.5, 1.0, 5.0]

    def test_previous_holds_the_last_step(self):
        assert put([0, 1, 5], [0, 1.5, 3], "previous") == [0.0, 0.0, 1.0, 5.0]

    def test_cubic_is_monotone(self):
        own, values = np.array([0, 0.5, 1.2, 1.7, 2.6, 3]), np.array([0, 0.1, 0.1, 4, 4, 4.1])
        expected = PchipInterpolator(own, values)([0, 1, 2, 3])
        assert put(values, own, "cubic") == pytest.approx(expected)
        assert put(values, own, "cubic")[1] == pytest.approx(0.1)

    def test_none_wants_the_declared_grid(self):
        assert put([1, 2, 3, 4], [0, 1, 2, 3 + 1e-7], "none") == [1.0, 2.0, 3.0, 4.0]
        assert put([1, 2, 3, 4], [0, 1, 2.1, 3], "none") == (
            'y is not there at time = 2 min: "t" has another place at time = 2.1 min'
        )
        assert put([1, 2, 3], [0, 1, 2], "none") == 'returned a "t" of 3 coordinates, not 4'

    @given(
        st.lists(st.floats(-1e6, 1e6), min_size=4, max_size=4),
        st.sampled_from(["linear", "cubic", "previous", "none"]),
    )
    def test_the_declared_grid_is_kept_to_the_bit(self, values, way):
        assert put(values, [0, 1, 2, 3], way) == values

    @given(
        st.lists(st.floats(0.01, 2.99), unique=True, max_size=20),
        st.sampled_from(["linear", "cubic"]),
    )
    def test_a_straight_line_stays_straight(self, steps, way):
        own = np.array([0, *sorted(steps), 3])
        assert put(2 * own - 1, own, way) == pytest.approx([-1, 1, 3, 5])

    def test_of_several_dimensions_one_may_be_its_own(self):
        assert put([[0, 6], [1, 4]], [0, 3], output=SHEET) == [[0, 2, 4, 6], [1, 2, 3, 4]]

    def test_of_equal_coordinates_the_last_counts(self):
        assert put([0, 0, 1, 1], [0, 1, 1, 3]) == [0.0, 1.0, 1.0, 1.0]

    def test_the_run_may_have_another_unit(self):
        grid = RunGrid({"time": "t"}, {"time": "s"})
        found = grid.interpolate(CURVE, np.array([0.0, 3.0]), {"time": np.array([0.0, 180.0])})
        assert found.tolist() == [0.0, 1.0, 2.0, 3.0]


class TestRange:
    def test_rounded_ends_will_do(self):
        assert put([1, 1], [1e-6, 3 - 1e-6]) == [1.0] * 4

    @pytest.mark.parametrize(
        ("own", "reason"),
        [
            ([0.1, 3], 'time = 0 min: its own "t" begins at time = 0.1 min'),
            ([0, 1.5], 'time = 2 min: its own "t" ends at time = 1.5 min'),
        ],
    )
    def test_outside_the_place_is_named(self, own, reason):
        assert put([1, 2], own) == f"y is not there at {reason}"

    @pytest.mark.parametrize("way", ["linear", "cubic", "previous"])
    def test_beyond_the_end_of_a_curve_that_may_end_there_is_nothing(self, way):
        found = put([0, 1, 1.5], [0, 1, 1.5], way, ENDING)
        np.testing.assert_equal(found, [0, 1, np.nan, np.nan])
        found = put([0, 1, 1.5, np.nan], [0, 1, 1.5, 2.5], way, ENDING)
        np.testing.assert_equal(found, [0, 1, np.nan, np.nan])
        assert put([0, 1], [0.5, 1], way, ENDING) == (
            'y is not there at time = 0 min: its own "t" begins at time = 0.5 min'
        )

    def test_a_curve_may_end_at_once(self):
        for way in ("linear", "cubic", "previous", "none"):
            np.testing.assert_equal(put([7], [0], way, ENDING), [7, np.nan, np.nan, np.nan])
        assert put([np.nan], [0], "linear", ENDING) == 'returned no value of "y"'


class TestWrongGrids:
    @pytest.mark.parametrize(
        ("values", "own", "reason"),
        [
            ([1, 2, 3], [0, 3], 'returned 3 values of "y" at 2 of "t"'),
            ([1, 2], [[0, 3]], 'returned a "t" of shape (1, 2), not numbers along one dimension'),
            ([], [], 'returned no value of "y"'),
            ([1, 2, 3], [0, 2, 1],
             'returned a "t" that does not ascend: time = 1 min after time = 2 min'),
            ([1, 2], [np.nan, 3], 'returned a "t" that does not ascend: time = nan min'),
            ([1, np.nan, 3], [0, 1.5, 3], 'y is nan at time = 1.5 min of its own "t"'),
        ],
    )  # fmt: skip
    def test_the_reason_names_the_place(self, values, own, reason):
        assert put(values, own) == reason

    def test_a_value_that_is_no_number_is_not_finite(self):
        grid, own = RunGrid({"time": "t"}), {"time": np.array([0.0, 3.0])}
        with pytest.raises(UnusableOutputError) as refused:
            grid.interpolate(CURVE, np.array([1.0, np.inf]), own)
        assert refused.value.status is Status.NOT_FINITE
