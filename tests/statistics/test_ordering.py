"""Columns in ascending order, and the ranks and sums that follow from it."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from uqpen.statistics.input_columns import InputColumns, Ordering, sums_above

# Equal values, values that differ in their last bits alone, both zeros, and the ends of numbers.
NEAR_ONE = [1.0, 1.0 + 2**-52, 1.0 - 2**-53, 1.0 + 2**-30]
ENDS = [0.0, -0.0, 5e-324, -5e-324, 1.7e308, -1.7e308, np.inf, -np.inf]
NUMBERS = st.sampled_from(NEAR_ONE + ENDS) | st.floats(allow_nan=False)
COLUMNS = arrays(np.float64, st.integers(0, 60), elements=NUMBERS)


@given(COLUMNS)
@example(np.array(NEAR_ONE * 3))
@example(np.arange(40.0) ** 9)
def test_the_order_is_that_of_a_stable_sort(values):
    assert Ordering.of(values).order.tolist() == np.argsort(values, kind="stable").tolist()


@given(COLUMNS)
def test_levels_and_ranks_are_those_of_distinct_values(values):
    ordering = Ordering.of(values)
    distinct, level = np.unique(values, return_inverse=True)
    assert ordering.level.tolist() == level.tolist()
    assert ordering.mean_ranks.tolist() == stats.rankdata(values).tolist()
    assert (ordering.is_above is None) == (len(distinct) == len(values))


@given(arrays(np.float64, st.tuples(st.integers(1, 40), st.just(2)), elements=st.integers(-9, 9)))
@example(np.arange(80.0).reshape(40, 2) ** [1, 2])
def test_sums_above_count_equal_values_half(columns):
    others = np.stack([np.arange(len(columns)) - 3.0, np.cos(np.arange(len(columns)))], axis=1)
    factors = np.array([[1.0, -2.0], [0.5, 3.0]])
    above = columns[None, :] > columns[:, None]
    shares = above + (columns[None, :] == columns[:, None]) / 2
    expected = np.einsum("rsk,kv,sv->rv", shares, factors, others)
    orderings = [Ordering.of(column) for column in columns.T]
    assert sums_above(orderings, factors, others) == pytest.approx(expected)


@given(COLUMNS, st.data())
def test_the_order_of_some_is_a_part_of_the_order_of_all(values, data):
    chosen = data.draw(arrays(np.bool_, len(values)))
    used = np.flatnonzero(chosen)
    columns = InputColumns.from_matrix(("x",), values[:, None])
    part = columns.at(used).ordering(0)
    assert part.order.tolist() == np.argsort(values[used], kind="stable").tolist()
    assert part.level.tolist() == np.unique(values[used], return_inverse=True)[1].tolist()


def test_samples_of_the_same_runs_share_their_inputs():
    columns, used = InputColumns.from_matrix(("x",), np.ones((5, 1))), np.arange(5)
    inputs = columns.at(used)
    assert columns.at(used) is inputs
    assert columns.at(np.arange(5)) is not inputs
    assert not inputs.varies(0)
