"""How far a study is, as one value."""

import pytest

from uqpen.core.progress import ProgressRecord


class Clock:
    """A clock that is set by hand."""

    def __init__(self):
        self.time = 100.0

    def __call__(self):
        return self.time


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def record(clock):
    record = ProgressRecord(clock)
    record.announce_designs({"one": 100, "two": 300})
    return record


def test_the_runs_of_all_designs_are_counted_together(record, clock):
    record.start_design("one", 100)
    clock.time += 10
    record.advance(50, 3, 8)
    state = record.state
    assert (state.design, state.design_number, state.designs) == ("one", 1, 2)
    assert (state.done, state.runs, state.failed, state.in_progress) == (50, 400, 3, 8)
    assert state.runs_per_second == 5.0
    assert state.seconds_left == 70.0


def test_a_design_that_ends_early_leaves_fewer_runs(record):
    record.start_design("one", 100)
    record.advance(40, 0, 0)
    record.start_design("two", 300)
    assert record.state.runs == 340
    record.advance(310, 0, 0)
    assert record.state.runs == record.state.done == 350, "or more of them"


def test_restored_runs_are_done_and_say_nothing_of_the_rate(record, clock):
    record.start_design("one", 100)
    record.count_restored(80)
    assert record.state.seconds_left is None
    clock.time += 2
    record.advance(20, 0, 0)
    assert (record.state.done, record.state.runs_per_second) == (100, 10.0)


def test_the_rate_is_that_of_the_last_runs(record, clock):
    record.announce_designs({"one": 10_000})
    record.start_design("one", 10_000)
    for _ in range(200):  # slow ones
        clock.time += 1
        record.advance(1, 0, 0)
    for _ in range(100):
        clock.time += 1
        record.advance(20, 0, 0)
    assert record.state.runs_per_second == 20.0


def test_a_design_that_nobody_announced_is_counted_by_itself():
    record = ProgressRecord()
    record.start_design("some", 10)
    record.advance(10, 0, 0)
    assert (record.state.designs, record.state.runs) == (0, 10)


def test_a_step_has_a_place_and_a_start(record, clock):
    record.start_design("one", 100)
    record.advance(10, 0, 5)
    clock.time = 300
    record.start_step("fitting chaos", 3, 7)
    state = record.state
    assert (state.step, state.step_number, state.steps, state.began) == ("fitting chaos", 3, 7, 300)
    assert (state.done, state.in_progress) == (10, 0)
    record.start_design("two", 300)
    assert record.state.step == ""
