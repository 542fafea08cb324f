"""Subset simulation: levels, chains, replicates that disagree, many inputs."""

import math

import numpy as np
import pytest
from rare_event_studies import half_space, probability
from rare_event_studies import study as study_by
from scipy import special, stats

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.labels import CHAIN_PARENT, LEVEL_THRESHOLD, SUBSET_LEVEL
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.subset_simulation import ChainStates
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.statistics.rare_events.rare_event_probability import (
    ReplicateProbability,
    half_width_of_logarithm,
    replicate_interval,
)


def study(function=half_space, event=f"depth > {4 * 2**0.5!r} m", *, samples=400, **settings):
    design = uqpen.SubsetSimulation(event=event, samples=samples)
    return study_by(design, function, confidence_level=0.95, **settings)


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study())


def test_a_candidate_is_a_state_where_it_reaches_its_level(tree):
    runs = tree["runs/rare"]
    parent, level = runs[CHAIN_PARENT].values, runs[SUBSET_LEVEL].values
    moved = level > 0
    assert (parent[~moved] == -1).all()
    assert (level[parent[moved]] <= level[moved]).all()
    assert (runs["replicate"].values[parent[moved]] == runs["replicate"].values[moved]).all()
    # The distance of the limit from the median at level 0 is the unit of the performance.
    limit = 4 * math.sqrt(2)
    for replicate in range(5):
        own = runs["replicate"].values == replicate
        depth = runs["depth"].values
        scale = abs(np.median(depth[own & ~moved]) - limit)
        reached = (depth[parent[own & moved]] - limit) / scale
        assert (reached >= runs[LEVEL_THRESHOLD].values[own & moved] - 1e-12).all()


def test_a_failing_region_gives_bounds_not_a_number_between():
    def fails(a, b):
        return {"depth": np.where(a > 2, np.nan, b), "speed": a}

    _, lower, upper = probability(uqpen.run(study(fails, "depth > 3.5 m"))).values
    assert upper > special.ndtr(-2.0), "all failed runs may have it"
    assert lower <= special.ndtr(-3.5) * special.ndtr(2.0)


def test_a_threshold_leaves_the_probability_of_its_level_unbiased():
    # Of uniform values, 1 - t lie above a threshold t. A tenth of the states stands for it, so the
    # mean of 0.1 / (1 - t) is 1. At the smallest of ten of a hundred states it would be 10/9.
    rng = Stream(1).generator()
    drawn = rng.random((4000, 100))
    none, all_runs = np.zeros(100, dtype=np.bool_), np.arange(100)
    found = [
        ChainStates(all_runs, each - 2, none, none).next_threshold(-math.inf) for each in drawn
    ]
    ratios = 0.1 / (1 - (np.array(found, dtype=np.float64) + 2))
    # One ratio scatters by a third: 4 standard errors are 0.02.
    assert abs(ratios.mean() - 1) < 0.02


def test_states_equal_to_the_largest_left_out_are_left_out():
    # States of a chain that has not moved: were they kept, the threshold would depend on them.
    performance = np.repeat([-3.0, -2.0, -1.0], [75, 20, 5])
    none = np.zeros(100, dtype=np.bool_)
    threshold = ChainStates(np.arange(100), performance, none, none).next_threshold(-math.inf)
    assert threshold is not None
    assert -2 < threshold <= -1


def test_many_equal_states_reach_a_threshold_together():
    performance = np.repeat([-3.0, -2.0, -1.0], [50, 30, 20])
    none = np.zeros(100, dtype=np.bool_)
    states = ChainStates(np.arange(100), performance, none, none)
    threshold = states.next_threshold(-math.inf)
    assert threshold is not None
    assert -2 < threshold <= -1
    assert states.at(performance == -1.0).next_threshold(threshold) is None


def test_a_hundred_inputs_leave_no_bias():
    # x₁ + 4.5 - 0.1 Σx² is above 0 where (x₁ - 5)² and the other squares are below 70. Moves with
    # a scale for each input, from the states that move, gave more than twice the probability.
    names = [f"x{number}" for number in range(100)]

    def function(**inputs):
        squares = sum(each**2 for each in inputs.values())
        return {"y": inputs["x0"] + 4.5 - 0.1 * squares}

    model = uqpen.PythonModel(function, dict.fromkeys(names, "1"), {"y": "m"}, vectorized=True)
    rare = uqpen.SubsetSimulation(event="y > 0 m", samples=200, replicates=20)
    inputs = {name: uqpen.Normal(0.0, 1.0) for name in names}
    found = probability(uqpen.run(uqpen.Study(model, inputs, designs={"rare": rare}, seed=1)))
    estimate, lower, upper = found.values / stats.ncx2.cdf(70.0, 100, 25.0)
    # One replicate scatters by about 1, so the mean of 20 by 0.23.
    assert abs(estimate - 1) < 0.7
    assert lower < 1 < upper


def test_replicates_that_differ_by_log_normal_factors_are_covered():
    # Estimates of a small probability are log-normal, here with a standard deviation of 1. The
    # interval by the mean and its standard error alone covers 89 %.
    values = np.exp(Stream(2).generator().standard_normal((5, 4000)) - 0.5)
    half_width = half_width_of_logarithm(values, 0.95)
    covered = np.abs(np.log(values.mean(axis=0))) <= half_width
    assert covered.mean() > 0.915  # 92.7 % of many more samples, less 3 standard errors


def test_without_the_event_in_a_replicate_there_is_no_interval():
    def jumps(a, b):
        return {"depth": 1.0 * (a > 2.5), "speed": b}

    tree = uqpen.run(study(jumps, "depth > 0.5 m", samples=100))
    reason = "not all replicates have met the event: their scatter gives no interval"
    value, lower, upper = probability(tree).values
    assert 0 < value < 0.05
    assert np.isnan([lower, upper]).all()
    (entry,) = archive_json(tree)["designs"]["rare"]["joint_probabilities"].values()
    assert entry["lower"] is entry["upper"] is None
    assert reason in entry["note"]
    table = next(each for each in output_tables(tree) if each.title == "joint probabilities")
    assert reason in str(table)
    assert reason[1:] in str(list(answer(ArchiveView(tree, ""))))


def test_replicates_orders_of_magnitude_apart_have_no_number():
    found = [ReplicateProbability(each, 0.0) for each in (1e-5, 3e-9, 2e-7, 4e-6, 1e-8)]
    estimate = replicate_interval(found, 0.95)
    assert np.isnan(estimate.bounds).all()
    assert "differ by a factor above 1000: they say nothing" in estimate.note


def test_it_takes_the_name_and_limits_of_the_same_requested_event():
    events = {"breach": {"all": ["depth > 3 m"], "at_most": 0.1}, "other": ["speed > 0 m/s"]}
    one = study(event="depth  >  3 m", samples=100, joint_probabilities=events)
    found = uqpen.run(one)["joint_probabilities/rare"]["joint_probability"]
    assert found["event"].values.tolist() == ["breach"]
    assert found["event_at_most"].values.tolist() == [0.1]


def test_the_runs_are_no_sample(tree):
    assert not list(find_faults(tree))
    assert not Sampling(tree["runs/rare"].attrs["sampling"]).is_sample
    assert "depth" not in tree["statistics/rare"].children
