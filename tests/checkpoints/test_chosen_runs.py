"""Choice of the runs that are made again, and what it meets of a change in a part of the inputs."""

import numpy as np
import pytest

from uqpen.checkpoints.recheck import choose_runs, order_runs
from uqpen.checkpoints.sources import RunSource
from uqpen.checkpoints.stored_runs import FinishedRuns
from uqpen.core.model import Results
from uqpen.core.status import Status
from uqpen.models.known_functions import Ishigami

RUNS, SEEDS = 4000, 200


def points(seed, runs=RUNS):
    """Return independent standard uniform inputs."""
    drawn = np.random.default_rng(seed).random((3, runs))
    return dict(zip("abc", drawn, strict=True))


# Where a model has changed: the runs that meet it, its share of the inputs' space, and whether it
# lies at an end of an input.
CHANGES = {
    "an input above its 99 % quantile": (lambda x: x["a"] > 0.99, 0.01, True),
    "an input below its 1 % quantile": (lambda x: x["c"] < 0.01, 0.01, True),
    "a band of an input": (lambda x: abs(x["b"] - 0.5) < 0.005, 0.01, False),
    "a box in the middle": (
        lambda x: np.all([abs(each - 0.5) < 0.01 ** (1 / 3) / 2 for each in x.values()], axis=0),
        0.01,
        False,
    ),
    "a corner of two inputs": (lambda x: (x["a"] > 0.9) & (x["b"] > 0.9), 0.01, False),
    "an input above its 99.9 % quantile": (lambda x: x["b"] > 0.999, 0.001, True),
    "a strip along a diagonal": (lambda x: abs(x["a"] - x["b"]) < 0.005013, 0.01, False),
    "one run of a hundred, scattered": (lambda x: (x["a"] * 1e6) % 1 < 0.01, 0.01, False),
}


@pytest.mark.parametrize(("meets", "share", "is_at_an_end"), CHANGES.values(), ids=CHANGES)
def test_a_change_of_a_part_of_the_inputs_is_met_as_often_as_stated(meets, share, is_at_an_end):
    met = np.zeros(SEEDS)
    possible = np.zeros(SEEDS)
    for seed in range(SEEDS):
        columns = points(seed)
        is_met = meets(columns)
        order = order_runs(columns, np.random.default_rng(10_000 + seed))
        possible[seed] = is_met.any()
        met[seed] = is_met[order[:64]].any()
        # As many as a second makes of a fast model: nothing of 1 % is missed.
        assert share < 0.01 or is_met[order].any()
    if is_at_an_end:
        assert (met == possible).all()
        return
    # Half of the 64 are random, and the others are of no use in the middle. Four standard errors.
    expected = 1 - (1 - share) ** 32
    assert met.mean() >= expected - 4 * np.sqrt(expected * (1 - expected) / SEEDS)


def test_ends_and_random_runs_take_turns_and_none_stands_twice():
    columns = points(1)
    order = order_runs(columns, np.random.default_rng(2))
    assert len(order) == len(set(order.tolist())) == 1024
    assert order[0] == columns["a"].argmin()
    assert columns["a"].argmax() in order[:4]
    for values in columns.values():
        assert {values.argmin(), values.argmax()} <= set(order[:14].tolist())
    few = order_runs(points(1, 5), np.random.default_rng(2))
    assert sorted(few.tolist()) == [0, 1, 2, 3, 4]


def test_a_constant_input_has_no_ends():
    constant = {"a": np.ones(100), "b": np.zeros(100)}
    assert len(order_runs(constant, np.random.default_rng(1))) == 100


def test_the_lowest_of_very_many_are_found():
    values = np.random.default_rng(3).random(300_000)
    order = order_runs({"a": values}, np.random.default_rng(4))
    ends = np.argsort(values)
    assert {*ends[:200].tolist(), *ends[-200:].tolist()} <= set(order.tolist())


def source(statuses):
    """Return runs of the Ishigami function with some statuses."""
    runs = len(statuses)
    inputs = {name: np.arange(runs, dtype=float) for name in ("x1", "x2", "x3")}
    status = np.array(statuses, dtype=np.int8)
    reasons = dict.fromkeys(np.flatnonzero(status).tolist(), "why")
    results = Results({"y": np.where(status, np.nan, 1.0)}, status, reasons)
    return RunSource("place", FinishedRuns(np.arange(runs), inputs, results), is_complete=True)


def test_only_runs_that_are_ok_are_made_again_or_one_that_failed():
    ok, failed, late, crashed = Status.OK, Status.FAILED, Status.TIMED_OUT, Status.CRASHED
    inadmissible = Status.INADMISSIBLE

    def chosen(*statuses):
        found = choose_runs(Ishigami(), [source([*statuses])], np.random.default_rng(1))
        return None if found is None else sorted(found.runs.runs.tolist())

    assert chosen(ok, failed, late, ok, crashed) == [0, 3]
    assert chosen(failed, late, inadmissible, crashed) == [0]
    assert chosen(late, inadmissible, crashed) is None
    assert choose_runs(Ishigami(), [], np.random.default_rng(1)) is None


def test_runs_of_several_sources_keep_their_numbers_and_values():
    sources = [source([Status.OK] * 5), source([Status.FAILED, Status.OK])]
    found = choose_runs(Ishigami(), sources, np.random.default_rng(1))
    assert found is not None
    assert sorted(found.runs.runs.tolist()) == [0, 1, 1, 2, 3, 4]
    assert (found.runs.inputs["x1"] == found.runs.runs).all()
    assert found.total == 7
