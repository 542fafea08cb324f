"""Runs are made and yielded by blocks, and no result depends on it."""

import gc
import tracemalloc
from itertools import chain, islice

import numpy as np
import pytest
import xarray as xr

from uqpen.core.blocks import LoadedDataset, join_blocks
from uqpen.core.errors import TooManyFailedError, WorkerError
from uqpen.core.labels import RUN
from uqpen.core.model import POSITIVE, Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Uniform
from uqpen.execution import (
    EvaluationOptions,
    Evaluator,
    FailurePolicy,
    Progress,
    evaluate,
    evaluate_blocks,
)
from uqpen.execution.batch import BatchResult
from uqpen.execution.checkpoint import Checkpoint
from uqpen.models.python_function import PythonFunction

X = Input("x", "m", bounds=POSITIVE)
RUNS = 2 * BLOCK + 10_000


class Square(Model):
    """A model that is the same in any batch, which fails above 9."""

    name = "square"
    inputs = (X,)
    outputs = (Output("y", "m^2"),)

    def evaluate(self, inputs):
        x = inputs["x"]
        status = np.where(x > 9, Status.FAILED, Status.OK).astype(np.int8)
        reasons = {int(run): "too large" for run in np.flatnonzero(x > 9)}
        return Results({"y": np.where(x > 9, np.nan, x**2)}, status, reasons)


def function(vectorized):
    units = {"x": "m", "y": "m^2"}
    return PythonFunction(lambda x: {"y": x**2}, "f", (X,), Square.outputs, units, vectorized)


def drawn(runs=RUNS, lower=-0.5, upper=9.5):
    joint = JointDistribution((RandomInput(X, Uniform(lower, upper), "m"),), (X,))
    return next(MonteCarlo(runs).rounds(joint, Stream(1, "designs", "mc")))


@pytest.fixture(scope="module")
def plain():
    """The runs of points that are all in memory."""
    return evaluate(Evaluator(Square()), drawn().dataset(), {})


@pytest.fixture
def small_blocks(monkeypatch):
    """Makes blocks small, where they are no matter of random streams."""

    def shrink(size):
        for module in ("core.blocks", "execution.open_blocks"):
            monkeypatch.setattr(f"uqpen.{module}.BLOCK", size)

    return shrink


def backwards(work, batches):
    """Make five batches ahead, and return their results in reverse order, each in two parts."""
    coming = iter(batches)
    while some := list(islice(coming, 5)):
        for batch in reversed(some):
            for half in reversed(batch.halves() if len(batch) > 1 else (batch,)):
                yield work(half)


def test_blocks_have_their_size_and_stand_in_order():
    sizes = [each.sizes[RUN] for each in evaluate_blocks(Evaluator(Square()), drawn(), {})]
    assert sizes == [BLOCK, BLOCK, 10_000]


@pytest.mark.parametrize("map", [map, backwards])
def test_joined_blocks_are_the_runs_of_points_in_memory(plain, map):
    assert {Status.OK, Status.INADMISSIBLE, Status.FAILED} == set(plain["status"].values)
    blocks = evaluate_blocks(Evaluator(Square()), drawn(), {}, EvaluationOptions(map=map))
    found = join_blocks(blocks, RUNS)
    assert found.identical(plain)
    assert list(found.variables) == list(plain.variables), "an archive keeps the order"
    assert evaluate(Evaluator(Square()), drawn(), {}, EvaluationOptions(map=map)).identical(plain)


def test_blocks_of_a_dataset_are_the_blocks_of_the_evaluation(plain):
    made = evaluate_blocks(Evaluator(Square()), drawn(), {})
    for block, found in zip(LoadedDataset(plain).blocks(), made, strict=True):
        assert block.identical(found)
    assert LoadedDataset(plain).template.sizes == {RUN: 0, "lost_run": 0}


@pytest.mark.parametrize("size", [1_000, 1_024])
@pytest.mark.parametrize("vectorized", [False, True])
def test_batches_of_any_kind_keep_their_results(small_blocks, size, vectorized):
    points, evaluator = drawn(2_500), Evaluator(function(vectorized))
    whole = evaluate(evaluator, points, {})
    small_blocks(size)
    for each in (map, backwards):
        options = EvaluationOptions(map=each)
        assert evaluate(evaluator, points, {}, options).identical(whole)


def test_batches_begin_where_they_do_without_blocks(small_blocks):
    batches = []

    def noting(work, coming):
        for batch in coming:
            batches.append((batch.start, len(batch)))
            yield work(batch)

    small_blocks(1_500)
    evaluate(Evaluator(function(True)), drawn(4_500), {}, EvaluationOptions(map=noting))
    assert batches == [(0, 1024), (1024, 1024), (2048, 1024), (3072, 1024), (4096, 404)]


def test_no_batch_waits_for_the_end_of_a_block(small_blocks):
    ahead = []

    def eager(work, batches):
        taken = list(batches)
        ahead.append(taken[-1].start)
        yield from builtin_map(work, taken)

    builtin_map = map
    small_blocks(1_024)
    evaluate(Evaluator(function(True)), drawn(4_500), {}, EvaluationOptions(map=eager))
    assert ahead == [4_096], "one call takes the batches of all blocks, before any has a result"


def test_a_map_that_leaves_out_runs_is_refused():
    def forgetful(work, batches):
        return (work(batch) for batch in list(batches)[1:])

    with pytest.raises(WorkerError, match="no result of 1024 runs"):
        evaluate(Evaluator(function(True)), drawn(4_500), {}, EvaluationOptions(map=forgetful))


def test_too_many_failed_are_those_of_the_whole_round(small_blocks):
    points = xr.Dataset({"x": (RUN, np.repeat([9.5, 1.0], [1_024, 9_000]))})
    enough, too_few = (
        EvaluationOptions(failures=FailurePolicy(at_most=share)) for share in (0.11, 0.10)
    )
    small_blocks(1_024)
    evaluate(Evaluator(Square()), points, {}, enough)
    with pytest.raises(TooManyFailedError, match="1024 of 10024 runs"):
        evaluate(Evaluator(Square()), points, {}, too_few)


class Kept(Checkpoint):
    """Runs that were made before, as a checkpoint has them; it notes the blocks it is asked for."""

    def __init__(self, results):
        self.results = results
        self.saved = []
        self.restored = []

    def prepare(self, runs):
        return sum(map(len, self.results))

    def restore(self, start, inputs):
        self.restored.append(start)
        stop = start + len(inputs["x"])
        for each in self.results:
            if each.start < stop and each.start + len(each) > start:
                yield each.between(start, stop)

    def save(self, inputs, batch_result):
        assert len(inputs["x"]) == len(batch_result)
        self.saved.append(batch_result.start)


class Counted(Progress):
    def __init__(self):
        self.before = []
        self.runs = 0

    def count_restored(self, runs):
        self.before.append(runs)

    def advance(self, runs, failed, in_progress):
        self.runs += runs


def restored(x, start, stop):
    return BatchResult(start, Results.all_ok({"y": x[start:stop] ** 2}))


@pytest.mark.parametrize("map", [map, backwards])
def test_whole_blocks_that_were_made_before_are_not_piled_up(small_blocks, map):
    x = np.linspace(1, 2, 10_000)
    points = xr.Dataset({"x": (RUN, x)})
    whole = evaluate(Evaluator(function(True)), points, {})
    small_blocks(1_024)
    # One run of the first block, and all but some of the last, are still to be made.
    kept = Kept([restored(x, 1, 9_300)])
    reported = Counted()
    blocks = evaluate_blocks(
        Evaluator(function(True)),
        LoadedDataset(points),
        {},
        EvaluationOptions(map=map, checkpoint=kept, progress=reported),
    )
    drawn_at_each = [(len(kept.restored), block.sizes[RUN]) for block in blocks]
    assert reported.before == [9_299]
    assert reported.runs == 1_024 + (10_000 - 9_216), "a batch is made again as a whole"
    assert kept.saved == ([0, 9_216] if map is not backwards else [512, 0, 9_608, 9_216])
    assert all(read - number <= 2 for number, (read, _) in enumerate(drawn_at_each))
    kept = Kept([restored(x, 1, 9_300)])
    again = evaluate(Evaluator(function(True)), points, {}, EvaluationOptions(checkpoint=kept))
    assert again.identical(whole)


def test_all_runs_of_a_scalar_function_may_have_been_made_before(small_blocks):
    x = np.linspace(1, 2, 3_000)
    small_blocks(1_000)
    kept = Kept([restored(x, 0, 1_500), restored(x, 1_600, 3_000)])
    reported = Counted()
    points, evaluator = xr.Dataset({"x": (RUN, x)}), Evaluator(function(False))
    options = EvaluationOptions(checkpoint=kept, progress=reported)
    found = evaluate(evaluator, points, {}, options)
    assert np.array_equal(found["y"].values, x**2)
    assert reported.runs == 100
    all_kept = EvaluationOptions(checkpoint=Kept([restored(x, 0, 3_000)]))
    assert evaluate(evaluator, points, {}, all_kept).identical(found)


def test_memory_is_that_of_a_few_blocks():
    runs = 2_000_000
    evaluator = Evaluator(Square())
    points = drawn(runs, 0.001, 9.0)
    next(evaluate_blocks(evaluator, points, {}))  # what is loaded at the first use
    gc.collect()
    tracemalloc.start()
    total = 0.0
    for block in evaluate_blocks(evaluator, points, {}):
        total += float(np.nansum(block["y"].values))
        del block
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert total == pytest.approx(runs * 9**2 / 3, rel=0.01)
    # x, y, a status and a number of each run.
    assert peak < 6 * BLOCK * (8 + 8 + 1 + 8) < runs * 25 / 5


@pytest.mark.parametrize("vectorized", [False, True])
def test_no_points_have_no_runs(vectorized):
    found = evaluate(Evaluator(function(vectorized)), xr.Dataset({"x": (RUN, np.empty(0))}), {})
    assert found.sizes == {RUN: 0}
    assert found["y"].attrs["units"] == "m^2"


def test_a_column_takes_the_type_that_has_room_for_all_blocks():
    parts = [
        xr.Dataset({"n": (RUN, np.array([1, 2])), "t": (RUN, np.array(["a", "b"]))}),
        xr.Dataset({"n": (RUN, np.array([0.5])), "t": (RUN, np.array(["long"]))}),
    ]
    joined = join_blocks(chain(parts), 3)
    assert joined["n"].values.tolist() == [1.0, 2.0, 0.5]
    assert joined["t"].values.tolist() == ["a", "b", "long"]
