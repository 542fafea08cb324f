"""Correlations: exact answers inside their intervals, on every design."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_samples import sample_of_values
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from uqpen.core.model import Category, Output
from uqpen.core.sampling import Sampling
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.correlations import correlations

QUESTION = QuantityOfInterest(Output("y", "m"), "m")
SEEDS, RUNS, REPLICATES = 60, 400, 10
# One that covers in 93 % falls below this once in 100 000 times.
FEWEST_COVERING = int(stats.binom.ppf(1e-5, SEEDS, 0.93))

# A sum of normal inputs with these weights is normal, and so is all that follows from it.
NAMES = ("x1", "x2", "x3")
WEIGHTS = np.array([1.0, 2.0, 0.5])


def sample(seed, plan="independent", runs=RUNS):
    """The sum, and as much noise as the first input has, over standard normal inputs."""
    generator = np.random.default_rng(seed)
    draws = generator.random((runs, 3))
    replicates = np.zeros(runs, dtype=np.int64)
    if plan != "independent":
        count = REPLICATES if plan == "replicated" else 1
        each = runs // count
        strata = generator.permuted(np.tile(np.arange(each), (count * 3, 1)), axis=1)
        draws = (strata.reshape(count, 3, each).transpose(0, 2, 1).reshape(runs, 3) + draws) / each
        replicates = np.repeat(np.arange(count), each)
    points = stats.norm.ppf(draws)
    values = points @ WEIGHTS + generator.standard_normal(runs)
    sampling = Sampling.INDEPENDENT if plan == "independent" else Sampling.STRATIFIED
    return sample_of_values(values, points, replicates=replicates, sampling=sampling)


def reported(array, what):
    return list(array.coords[what].values.tolist())


def exact():
    pearson = WEIGHTS / math.sqrt(WEIGHTS @ WEIGHTS + 1)
    partial = WEIGHTS / np.sqrt(WEIGHTS**2 + 1)
    return {
        "pearson": pearson,
        "spearman": 6 / math.pi * np.arcsin(pearson / 2),
        "partial": partial,
        "partial_rank": rank_partial(6 / math.pi * np.arcsin(pearson / 2)),
    }


def rank_partial(correlation):
    """Of independent inputs: what the others explain of the ranks is the sum of squares."""
    others = correlation @ correlation - correlation**2
    return correlation / np.sqrt(1 - others)


@pytest.mark.slow
@pytest.mark.parametrize("plan", ["independent", "replicated", "single"])
def test_intervals_cover(plan):
    covering = {name: np.zeros(3) for name in exact()}
    for seed in range(SEEDS):
        answers = dict(correlations(sample(seed, plan), QUESTION))
        for name, value in exact().items():
            _, lower, upper = answers[name].values.T
            covering[name] += (lower <= value) & (value <= upper)
    assert {name for name, count in covering.items() if count.min() < FEWEST_COVERING} == set()


def test_estimates_are_those_of_scipy():
    drawn = sample(1)
    tied = replace(
        drawn,
        values=np.round(drawn.values),
        columns=InputColumns.from_matrix(drawn.inputs, np.round(drawn.points, 1)),
    )
    answers = dict(correlations(tied, QUESTION))
    for i in range(3):
        pair = tied.points[:, i], tied.values
        # Other algorithms round otherwise.
        pearson, spearman = stats.pearsonr(*pair)[0], stats.spearmanr(*pair)[0]
        assert answers["pearson"].values[i, 0] == pytest.approx(pearson, abs=1e-12)
        assert answers["spearman"].values[i, 0] == pytest.approx(spearman, abs=1e-12)


@pytest.mark.slow
@given(seed=st.integers(0, 1000), power=st.sampled_from([1, 3, 5]))
@settings(max_examples=8)
def test_rank_correlations_keep_under_monotone_transforms(seed, power):
    drawn = sample(seed, runs=60)
    other = replace(
        drawn,
        values=np.exp(drawn.values / 3),
        columns=InputColumns.from_matrix(drawn.inputs, drawn.points**power),
    )
    one, two = dict(correlations(drawn, QUESTION)), dict(correlations(other, QUESTION))
    for name in ("spearman", "partial_rank"):
        assert np.array_equal(one[name].values, two[name].values)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"values": np.ones(RUNS)}, "the output does not vary"),
        (
            {"columns": InputColumns.from_matrix(NAMES, np.ones((RUNS, 3)))},
            "the input does not vary",
        ),
        ({"used": np.arange(20), "values": np.arange(20.0)}, "20 runs are too few"),
    ],
)
def test_what_has_no_correlation_says_why(change, reason):
    for _, array in correlations(replace(sample(0), **change), QUESTION):
        assert np.isnan(array.values).all()
        assert reported(array, "note") == [reason] * 3


def test_an_output_that_is_an_input_has_no_interval():
    drawn = sample(0)
    answers = dict(correlations(replace(drawn, values=2 * drawn.points[:, 0]), QUESTION))
    assert answers["pearson"].values[0, 0] == pytest.approx(1.0)
    assert np.isnan(answers["pearson"].values[0, 1:]).all()
    assert np.isnan(answers["partial"].values).all()


@pytest.mark.parametrize("name", ["partial", "partial_rank"])
def test_intervals_are_those_of_leaving_out_a_run(name):
    drawn = sample(3)
    points = drawn.points + 0.7 * drawn.points[:, [1, 2, 0]]
    columns = np.column_stack([points, drawn.values])

    def transformed(some):
        some = stats.rankdata(some, axis=0) if name == "partial_rank" else some
        precision = np.linalg.inv(np.corrcoef(some.T))
        return np.arctanh(-precision[:3, 3] / np.sqrt(np.diag(precision)[:3] * precision[3, 3]))

    without = [transformed(np.delete(columns, run, axis=0)) for run in range(RUNS)]
    half = stats.t.ppf(0.975, RUNS - 1) * np.std(without, axis=0) * math.sqrt(RUNS)
    given = replace(drawn, columns=InputColumns.from_matrix(NAMES, points))
    _, *bounds = np.arctanh(dict(correlations(given, QUESTION))[name].values.T)
    centre = transformed(columns)
    # Of the influence of a run, leaving it out sees a part of the order of 1 / RUNS besides.
    expected = np.array([centre - half, centre + half])
    assert np.array(bounds) == pytest.approx(expected, abs=0.02 * half.max())


def test_an_input_that_does_not_vary_changes_no_other_one():
    drawn = sample(0)
    points = np.column_stack([drawn.points, np.ones(RUNS)])
    more = replace(drawn, columns=InputColumns.from_matrix((*NAMES, "same"), points))
    alone, beside = (dict(correlations(each, QUESTION)) for each in (drawn, more))
    for name, array in alone.items():
        # Sums of more columns round otherwise.
        assert beside[name].values[:3] == pytest.approx(array.values, abs=1e-12)
        assert np.isnan(beside[name].values[3]).all()


def test_on_heavy_tails_and_few_runs_only_ranks_have_intervals():
    heavy = replace(sample(0), values=np.exp(3 * sample(0).values))
    for drawn in (heavy, sample(0, runs=100)):
        answers = dict(correlations(drawn, QUESTION))
        assert np.isnan(answers["pearson"].values[:, 1:]).all()
        assert "rank correlations" in reported(answers["pearson"], "note")[0]
        assert not np.isnan(answers["spearman"].values).any()


def test_kinds_have_no_correlations():
    kinds = Output("y", "1", categories=(Category("low", "low"), Category("high", "high")))
    assert dict(correlations(sample(0), QuantityOfInterest(kinds, "1"))) == {}
