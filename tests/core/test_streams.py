"""Random streams follow from names, never from the order in which they are made."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from uqpen.core.streams import Stream

PATHS = st.lists(st.one_of(st.text(max_size=5), st.integers(0, 100)), max_size=4)


def test_the_same_names_give_the_same_numbers():
    first = Stream(5876, "designs", "a").generator("points", 0).random(4)
    again = Stream(5876, "designs", "a", "points").generator(0).random(4)
    np.testing.assert_array_equal(first, again)


@given(one=PATHS, other=PATHS)
def test_a_stream_below_another_is_that_of_both_names(one, other):
    below = Stream(1, *one).child(*other).generator().random()
    assert below == Stream(1, *one, *other).generator().random()


@given(one=PATHS, other=PATHS)
def test_other_names_give_other_numbers(one, other):
    same = Stream(1, *one).generator().random() == Stream(1, *other).generator().random()
    assert same == (one == other)


def test_another_seed_gives_other_numbers():
    drawn = {Stream(seed, "a").generator().random() for seed in (0, 1, 2**32, 2**64, 2**200)}
    assert len(drawn) == 5


def test_the_numbers_are_these():
    # An archive is reproduced from its seed, so the streams are part of the format.
    drawn = Stream(5876, "designs", "monte_carlo").generator("points", 0).random(2)
    np.testing.assert_array_equal(drawn, [0.5679350770285704, 0.23463638777363827])


def test_the_global_state_is_left_alone():
    state = np.random.get_state()[1]  # noqa: NPY002 - to see that nothing touches it
    Stream(1, "a").generator().random(10)
    np.testing.assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002
