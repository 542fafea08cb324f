"""Large samples go by blocks, with the estimates that their runs have in memory."""

import tracemalloc
from functools import cache

import numpy as np
import pytest
import xarray as xr

from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import ABSENT, REPLICATE, ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Category, Output
from uqpen.core.status import Status
from uqpen.statistics.analyze import analyze, analyze_failures
from uqpen.statistics.by_blocks.passes import Grouping
from uqpen.statistics.joint_event import JointEvent, OutputLimit
from uqpen.statistics.joint_probability import joint_probabilities
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold

KINDS = (Category("low", "low"), Category("high", "high"))
QUANTITIES = [
    QuantityOfInterest(
        Output("y", "m"),
        "m",
        thresholds=(Threshold("2 m", 2.0),),
        lower_thresholds=(Threshold("1 m", 1.0),),
        tolerance_contents=(0.9,),
        lower_tolerance_contents=(0.9,),
        tolerance_interval_contents=(0.9,),
    ),
    QuantityOfInterest(Output("tied", "1"), "1"),
    QuantityOfInterest(Output("same", "1"), "1"),
    QuantityOfInterest(Output("gap", "s"), "s"),
    QuantityOfInterest(Output("kind", "1", categories=KINDS), "1"),
]
SENSITIVITY = {
    "first_order", "log_first_order", "exceedance_first_order", "category_first_order",
    "pearson", "spearman", "partial", "partial_rank", "delta",
}  # fmt: skip
EVENTS = [
    JointEvent(
        "both", (OutputLimit("y > 1", "y", True, 1.0), OutputLimit("gap < 3", "gap", False, 3.0))
    )
]
RUNS, REPLICATES = 3000, 6
SMALL = 256


def runs_of(plan, runs=RUNS):
    """Runs of a formula with ties, constants, gaps, categories and failures."""
    generator = np.random.default_rng(7)
    draws = generator.random((runs, 2))
    coordinates = {}
    if plan == "stratified":
        each = runs // REPLICATES
        strata = generator.permuted(np.tile(np.arange(each), (REPLICATES * 2, 1)), axis=1)
        strata = strata.reshape(REPLICATES, 2, each).transpose(0, 2, 1).reshape(runs, 2)
        draws = (strata + draws) / each
        coordinates[REPLICATE] = (RUN, np.repeat(np.arange(REPLICATES), each))
    a, b = draws.T
    c = generator.integers(0, 3, runs).astype(np.float64)
    y = np.exp(a) + 0.2 * b * c
    status = np.where(b > 0.97, Status.FAILED, np.where(a < 0.02, Status.INADMISSIBLE, Status.OK))
    outputs = {
        "y": y,
        "tied": np.round(4 * a) + 0.1,
        "same": np.full(runs, 3.0),
        "gap": np.where(a > 0.1, 5 * a, np.nan),
        "kind": np.where(y > 2, 1.0, 0.0),
    }
    variables = {"a": a, "b": b, "c": c, "fixed": np.ones(runs)}
    dataset = {name: (RUN, values, {ROLE: "input"}) for name, values in variables.items()}
    for name, values in outputs.items():
        known = np.where(status == Status.OK, values, np.nan)
        dataset[name] = (RUN, known, {ABSENT: "a never exceeds 0.1"} if name == "gap" else {})
    dataset[STATUS] = (RUN, status.astype(np.int8), {})
    return xr.Dataset(dataset, coordinates, {SAMPLING: plan})


def small_blocks(monkeypatch, size=SMALL):
    monkeypatch.setattr("uqpen.core.blocks.BLOCK", size)


@cache
def both(plan):
    runs = runs_of(plan)
    whole = analyze(runs, QUANTITIES)
    with pytest.MonkeyPatch.context() as monkeypatch:
        small_blocks(monkeypatch)
        return whole, analyze(runs, QUANTITIES, in_memory=SMALL)


@pytest.mark.parametrize("plan", ["independent", "stratified", "given"])
def test_statistics_of_distributions_are_those_in_memory(plan):
    whole, blocked = both(plan)
    for output, statistics in whole.items():
        assert [*blocked[output]] == [*statistics]
        for name in statistics.keys() - SENSITIVITY:
            expected, found = statistics[name], blocked[output][name]
            if name in ("quantile", "percentile", "cdf_value", "tolerance_interval"):
                xr.testing.assert_identical(found, expected)
            np.testing.assert_allclose(found.values, expected.values, 1e-12, 1e-14, err_msg=name)
            for text in found.coords.keys() - {"units"}:
                assert (found[text].values == expected[text].values).all(), (output, name, text)
            assert found.attrs == expected.attrs


@pytest.mark.parametrize("plan", ["independent", "stratified"])
def test_sensitivity_measures_are_those_of_the_first_runs_and_say_so(plan):
    runs, (_, blocked) = runs_of(plan), both(plan)
    first = np.arange(RUNS) < SMALL
    if plan == "stratified":  # the first runs of each replicate
        first = np.arange(RUNS) % (RUNS // REPLICATES) < SMALL // REPLICATES
    part = analyze(runs.isel({RUN: first}), QUANTITIES, only=["sensitivity"])
    said = f"from {first.sum()} of 3000 runs: sensitivities are analysed in memory"
    for output, statistics in part.items():
        assert statistics.keys() == blocked[output].keys() & SENSITIVITY
        for name, expected in statistics.items():
            found = blocked[output][name]
            assert found.dims == expected.dims
            assert found.attrs == expected.attrs
            np.testing.assert_array_equal(found.values, expected.values)
            for note, own in zip(
                found["note"].values.flat, expected["note"].values.flat, strict=True
            ):
                assert note == "; ".join(filter(None, (own, said)))


def test_one_stratified_set_has_the_wider_intervals_of_independent_draws(monkeypatch):
    runs = runs_of("stratified").drop_vars(REPLICATE)
    whole = analyze(runs, QUANTITIES, only=["moments"])["y"]["mean"]
    small_blocks(monkeypatch)
    blocked = analyze(runs, QUANTITIES, only=["moments"], in_memory=SMALL)["y"]["mean"]
    assert blocked.values[0] == pytest.approx(whole.values[0], rel=1e-12)
    assert np.ptp(blocked.values[1:]) > np.ptp(whole.values[1:])
    assert blocked["interval"].item() == "Student t, as of independent draws"
    assert blocked["interval_label"].item() == "conservative"


def test_the_ends_of_runs_and_events_of_several_outputs_are_counted(monkeypatch):
    for plan in ("independent", "stratified"):
        runs = runs_of(plan)
        ends, joint = analyze_failures(runs), joint_probabilities(runs, EVENTS, 0.95)
        small_blocks(monkeypatch)
        few = analyze_failures(runs, in_memory=SMALL * REPLICATES)
        by_blocks = joint_probabilities(runs, EVENTS, 0.95, in_memory=SMALL)
        for found, expected in (
            (few["probability"], ends["probability"]),
            (by_blocks["joint_probability"], joint["joint_probability"]),
        ):
            xr.testing.assert_allclose(found, expected, rtol=1e-12)
            assert found.attrs == expected.attrs
        assert few.keys() == ends.keys()
        assert "from 1536 of 3000 runs" in few["larger"]["note"].values[0]


def test_weighted_runs_are_analysed_in_part_and_say_so(monkeypatch):
    runs = runs_of("independent")
    weights = (RUN, np.random.default_rng(1).random(RUNS))
    weighted = runs.assign_coords(weight=weights)
    small_blocks(monkeypatch)
    found = analyze(weighted, QUANTITIES[:1], only=["moments"], in_memory=1000)["y"]["mean"]
    part = LoadedDataset(weighted).read(0, 1000)
    expected = analyze(part, QUANTITIES[:1], only=["moments"])["y"]["mean"]
    assert (found.values == expected.values).all()
    assert found.attrs == expected.attrs
    assert (
        found["note"]
        .item()
        .endswith("from 1000 of 3000 runs: weighted runs are analysed in memory")
    )


class FormulaRuns(BlockedRuns):
    """Independent runs of a formula, which exist only while they are read."""

    def __init__(self, runs):
        self.runs, self.passes = runs, 0

    @property
    def size(self):
        return self.runs

    def read(self, start, stop):
        columns = self.part(start, stop, ["x", "y", "z", STATUS])
        inputs = {"x": (RUN, columns.pop("x"), {ROLE: "input"})}
        others = {name: (RUN, values) for name, values in columns.items()}
        return xr.Dataset(inputs | others, attrs={SAMPLING: "independent"})

    def part(self, start, stop, names):
        self.passes += stop == self.runs
        # The golden ratio spreads the runs over 0 to 1.
        x = np.arange(start, stop) * 0.6180339887498949 % 1
        columns = {"x": x, "y": x + x**2, "z": np.exp(x), STATUS: np.zeros(x.shape, dtype=np.int8)}
        return {name: columns[name] for name in names}

    def column(self, name):
        return self.part(0, self.runs, [name])[name]


def peak_of(runs):
    question = QuantityOfInterest(Output("y", "1"), "1")
    tracemalloc.start()
    try:
        found = analyze(FormulaRuns(runs), [question], in_memory=1000)["y"]
        return found, tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def test_three_times_as_many_runs_take_little_more_memory(monkeypatch):
    small_blocks(monkeypatch, 8192)
    _, few = peak_of(40_000)
    found, many = peak_of(120_000)
    assert found["mean"].values[0] == pytest.approx(5 / 6, abs=1e-4)
    # The values collected for the distribution function grow with the runs, the rest does not.
    assert many < few + 12.0, f"{few:.1f} MB, then {many:.1f} MB"


def test_independent_runs_are_read_twice_and_their_status_once_more(monkeypatch):
    # Of 40 runs from one percentile to the next, 5 lie in a cell: the ends of an interval, which
    # follow from counts at its middle, lie in cells of their own.
    small_blocks(monkeypatch, 8192)
    runs = FormulaRuns(40_000)
    quantities = [QuantityOfInterest(Output(name, "1"), "1") for name in ("y", "z")]
    analyze(runs, quantities, in_memory=1000)
    assert runs.passes == 2 + 1


def test_many_replicates_are_joined_and_give_the_same_estimates(monkeypatch):
    runs = runs_of("stratified")
    many = runs.assign_coords({REPLICATE: (RUN, np.arange(RUNS) // 5)})
    whole = analyze(many, QUANTITIES, only=["moments", "quantiles"])["y"]
    small_blocks(monkeypatch)
    monkeypatch.setattr("uqpen.statistics.by_blocks.passes._MOST_GROUPS", 250)
    assert Grouping.of_runs(LoadedDataset(many)).sizes.tolist() == [15] * 200
    joined = analyze(many, QUANTITIES, in_memory=SMALL)["y"]
    for name, expected in whole.items():
        np.testing.assert_allclose(joined[name].values[..., 0], expected.values[..., 0], 1e-4)
        widths = np.ptp(joined[name].values[..., 1:]), np.ptp(expected.values[..., 1:])
        np.testing.assert_allclose(*widths, rtol=0.2, err_msg=name)


def test_replicates_may_be_more_than_a_small_number_has_room_for(monkeypatch):
    runs = runs_of("independent", 70_000).assign_attrs({SAMPLING: "stratified"})
    many = runs.assign_coords({REPLICATE: (RUN, np.arange(70_000) // 2)})
    small_blocks(monkeypatch, 2**14)
    found = analyze(many, QUANTITIES[:1], only=["moments"], in_memory=2**15)["y"]["mean"]
    mean, lower, upper = found.values
    assert lower < mean < upper
    assert Grouping.of_runs(LoadedDataset(many)).groups <= 1024
