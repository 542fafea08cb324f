"""Initial value problems side by side, against solutions in closed form."""

import numpy as np
import pytest
from scipy.integrate import DOP853

from uqpen.models import dop853
from uqpen.models.dense_integration import integrate

RATES = np.array([[0.1, 1.0, 30.0]])


def decay(state, rates):
    return np.stack([-rates[0] * state[0], np.ones_like(state[1])])


def is_half(state, rates):
    return state[0] < 0.5


def solve(rates, tolerance=1e-9):
    start = np.stack([np.ones(rates.shape[1]), np.zeros(rates.shape[1])])
    scales = np.stack([np.ones(rates.shape[1]), 1 / rates[0]])
    return list(integrate(decay, start, rates, scales, is_half, tolerance))


def test_states_inside_steps_are_those_of_the_solution():
    seen = np.zeros(3)
    for steps in solve(RATES):
        every = np.arange(steps.problem.size)
        for part in (0.0, 0.3, 0.9, 1.0):
            value, time = steps.states(every, np.full(every.size, part))
            assert time == pytest.approx(steps.start + part * steps.size)
            # Ten times the tolerance of a step, as errors add up.
            assert value == pytest.approx(np.exp(-RATES[0, steps.problem] * time), rel=1e-8)
        seen[steps.problem] += steps.size
    assert (seen > np.log(2) / RATES[0]).all()


def test_the_end_of_each_problem_is_found_in_its_last_step():
    ends = np.full(3, np.nan)
    for steps in solve(RATES):
        last = np.flatnonzero(steps.is_last)
        part = steps.parts_at(last, 0, np.full(last.size, 0.5))
        ends[steps.problem[last]] = steps.states(last, part)[1]
    assert ends == pytest.approx(np.log(2) / RATES[0], rel=1e-8)


def test_a_value_at_either_end_of_a_step_is_found_there():
    for steps in solve(RATES):
        every = np.arange(steps.problem.size)
        assert (steps.parts_at(every, 0, steps.before[0]) == 0).all()
        assert (steps.parts_at(every, 0, steps.after[0]) == 1).all()


def test_a_problem_has_the_same_bits_alone():
    together = [steps for steps in solve(RATES) if 1 in steps.problem]
    alone = solve(RATES[:, 1:2])
    for some, own in zip(together, alone, strict=True):
        at = some.problem.tolist().index(1)
        for one, other in zip(some[1:], own[1:], strict=True):
            assert np.array_equal(one[..., at], other[..., 0])


def test_what_is_no_number_is_given_up_and_the_others_go_on():
    rates = np.array([[1.0, np.nan, 2.0]])
    ended = np.concatenate([steps.problem[steps.is_last] for steps in solve(rates)])
    assert sorted(ended.tolist()) == [0, 2]


@pytest.mark.parametrize(
    ("own", "known"),
    [
        (dop853.STAGES, DOP853.A[1:]),
        ([dop853.SOLUTION], [DOP853.B]),
        ([dop853.ERROR_3, dop853.ERROR_5], [DOP853.E3, DOP853.E5]),
        (dop853.FURTHER, DOP853.A_EXTRA),
        (dop853.INTERPOLANT, DOP853.D),
    ],
)
def test_the_weights_are_those_of_scipy(own, known):
    for weights, expected in zip(own, known, strict=True):
        np.testing.assert_array_equal(weights, np.trim_zeros(expected, "b"))
