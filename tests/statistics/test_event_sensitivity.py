"""Sensitivities of the probabilities of events to the distributions of the inputs."""

import numpy as np
import pytest
from scipy import special

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.distributions.univariate import (
    Beta,
    Discrete,
    Gamma,
    Gumbel,
    Lognormal,
    Normal,
    Truncated,
    Uniform,
    Weibull,
)
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables
from uqpen.statistics.event_sensitivity.event_sensitivities import event_sensitivities
from uqpen.statistics.event_sensitivity.sample_sensitivity import InputScores

NODES = np.linspace(-8.2, 8.2, 400_001)
SHARES = np.exp(-(NODES**2) / 2) / np.exp(-(NODES**2) / 2).sum()


def derivatives(distribution, limit):
    """Return the derivatives of P(X > limit), times the standard deviation, by the scores."""
    scores = InputScores.of(distribution)
    assert scores is not None
    below, above = special.ndtr(NODES), special.ndtr(-NODES)
    values = np.where(NODES < 0, distribution.ppf(below), distribution.isf(above))
    return (scores(values) * (values > limit) * SHARES).sum(axis=1)


@pytest.mark.parametrize("family", [Normal, Lognormal, Gamma, Gumbel])
def test_scores_are_those_of_the_distributions_own_family(family):
    mean, std, limit, step = 3.0, 0.5, 4.2, 1e-4

    def probability(mean, std):
        return float(family(mean, std).sf(np.array(limit)))

    by_mean = probability(mean + step, std) - probability(mean - step, std)
    by_std = probability(mean, std + step) - probability(mean, std - step)
    exact = [std * each / (2 * step) for each in (by_mean, by_std)]
    # The limit lies between two nodes of the integral.
    assert derivatives(family(mean, std), limit) == pytest.approx(exact, rel=1e-4)


def test_scores_of_a_weibull_distribution_follow_its_two_parameters():
    shape, scale, limit, step = 2.0, 3.0, 5.0, 1e-4

    def moments(shape, scale):
        first, second = special.gamma(1 + 1 / shape), special.gamma(1 + 2 / shape)
        return np.array([scale * first, scale * np.sqrt(second - first**2)])

    def probability(shape, scale):
        return float(Weibull(shape, scale).sf(np.array(limit)))

    steps = (np.array([step, 0]), np.array([0, step]))
    here = np.array([shape, scale])
    moved = np.array([moments(*(here + each)) - moments(*(here - each)) for each in steps])
    changed = np.array([probability(*(here + e)) - probability(*(here - e)) for e in steps])
    exact = np.linalg.solve(moved, changed) * moments(shape, scale)[1]
    assert derivatives(Weibull(shape, scale), limit) == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize(
    "distribution",
    [
        Uniform(1, 2),
        Beta(2, 3, 0, 5),
        Truncated(Normal(0, 1), 0, 2),
        Discrete((1.0, 2.0, 4.0)),
        Normal(1e6, 1e-3),
    ],
    ids=lambda each: type(each).__name__,
)
def test_each_score_moves_one_moment_alone(distribution):
    scores = InputScores.of(distribution)
    assert scores is not None
    rng = np.random.default_rng(1)
    # A stratified sample; its error is below a thousandth of the moments.
    unit = (np.arange(200_000) + rng.random(200_000)) / 200_000
    values = distribution.ppf(unit)
    standard = (values - scores.mean) / scores.std
    moved = np.array([standard, (standard**2 - 1) / 2])
    assert (scores(values)[:, np.newaxis] * moved).mean(axis=-1) == pytest.approx(
        np.eye(2), abs=5e-3
    )


def model(a, b, c):
    y = a + 2 * b
    return {"y": np.where((c > 0.5) & (y > 7.5), np.nan, y), "z": a + 2 * b}


def study(*, fails=False, **changes):
    output = "y" if fails else "z"
    settings = {
        "inputs": {
            "a": uqpen.Normal("1 m", "0.5 m"),
            "b": uqpen.Normal("2 m", "0.4 m"),
            "c": uqpen.Discrete([0, 1]),
        },
        "designs": {
            "mc": uqpen.MonteCarlo(runs=4000),
            "lhs": uqpen.LatinHypercube(runs=4000),
            "subset": uqpen.SubsetSimulation(event=f"{output} > 7 m", samples=500),
        },
        "joint_probabilities": {
            "deep": {"all": [f"{output} > 7 m"], "sensitivities": True},
            "other": [f"{output} > 5 m"],
        },
        "seed": 1,
        **changes,
    }
    made = uqpen.PythonModel(
        model, {"a": "m", "b": "m", "c": "1"}, {"y": "m", "z": "m"}, vectorized=True
    )
    return uqpen.Study(made, **settings)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study())


# y is normal with mean 5 and variance 0.25 + 0.64, and 7 is β standard deviations above it.
STD = np.sqrt(0.89)
BETA = 2 / STD
DENSITY = np.exp(-(BETA**2) / 2) / np.sqrt(2 * np.pi)
MEANS = DENSITY / STD * np.array([0.5, 0.8])
STDS = DENSITY * BETA / 0.89 * np.array([0.25, 0.64])
PROBABILITY = special.ndtr(-BETA)


@pytest.mark.parametrize("design", ["mc", "lhs", "subset"])
def test_intervals_contain_the_exact_derivatives(tree, design):
    found = tree[f"joint_probabilities/{design}"]
    exact = {
        "mean_sensitivity": MEANS,
        "std_sensitivity": STDS,
        "mean_elasticity": MEANS / PROBABILITY * np.array([1 / 0.5, 2 / 0.4]),
        "std_elasticity": STDS / PROBABILITY,
    }
    for name, values in exact.items():
        array = found[name]
        assert array.dims == ("sensitivity_event", "input", "bound")
        for place, value in enumerate(values):
            _, lower, upper = array.values[0, place]
            assert lower <= value <= upper, (name, place)
    assert (found["sensitivity_effective_runs"].values[0, :2, 0] > 5).all()


def test_first_order_indices_of_the_event_stand_beside_for_a_sample(tree):
    indices = tree["joint_probabilities/mc"]["event_first_order"]
    assert indices.dims == ("sensitivity_event", "input", "bound")
    assert indices.values[0, 1, 0] > indices.values[0, 2, 0]
    assert "event_first_order" not in tree["joint_probabilities/subset"]


def test_an_input_of_two_values_is_refused_with_the_reason(tree):
    reported = archive_json(tree)["designs"]["mc"]["joint_probabilities"]["deep"]["sensitivities"]
    refused = reported["mean_sensitivity"]["c"]
    assert refused["estimate"] is None
    assert refused["note"] == (
        "its distribution has no mean that can move without its standard deviation"
    )


def test_archive_tables_json_and_the_long_table_agree(tree):
    assert list(find_faults(tree)) == []
    array = tree["joint_probabilities/subset"]["mean_elasticity"]
    reported = archive_json(tree)["designs"]["subset"]["joint_probabilities"]["deep"]
    assert reported["sensitivities"]["mean_elasticity"]["b"]["estimate"] == float(array[0, 1, 0])
    assert (
        "sensitivities" not in archive_json(tree)["designs"]["mc"]["joint_probabilities"]["other"]
    )
    titles = [table.title for table in output_tables(tree)]
    assert "P(deep): changes with the inputs' mean and sd, subset" in titles
    frame = long_table(tree).query("source == 'subset' and statistic == 'mean_elasticity'")
    assert frame["estimate"].tolist()[:2] == array.values[0, :2, 0].tolist()


def test_nothing_is_computed_that_is_not_requested():
    found = uqpen.run(study(joint_probabilities={"deep": ["z > 7 m"]}))
    assert [each for each in found["joint_probabilities/mc"].data_vars if "sens" in each] == []


def test_failed_runs_widen_intervals_to_every_outcome():
    found = uqpen.run(study(fails=True))
    for design in ("mc", "subset"):
        array = found[f"joint_probabilities/{design}"]["mean_sensitivity"]
        for place, value in enumerate(MEANS):
            _, lower, upper = array.values[0, place]
            assert lower <= value <= upper, (design, place)
    packed = archive_json(found)["designs"]["mc"]["joint_probabilities"]["deep"]["sensitivities"]
    assert "for any outcome of the missing runs" in packed["mean_sensitivity"]["a"]["interval"]


def test_dependent_inputs_are_refused_with_the_reason():
    found = uqpen.run(
        study(
            designs={"mc": uqpen.MonteCarlo(runs=200)},
            dependence={"copula": "gumbel", "inputs": ["a", "b"], "theta": 2.0},
        )
    )
    reported = archive_json(found)["designs"]["mc"]["joint_probabilities"]["deep"]["sensitivities"]
    assert "depend on each other" in reported["mean_sensitivity"]["a"]["note"]


def test_a_part_of_many_runs_says_so():
    made = study(designs={"mc": uqpen.MonteCarlo(runs=4000)})
    runs = uqpen.run(made)["runs/mc"].to_dataset()
    found = event_sensitivities(runs, made.joint_events, made.joint, 0.95, in_memory=3000)
    assert "from 3000 of 4000 runs" in str(found["mean_sensitivity"].coords["note"].values)


@pytest.mark.parametrize(
    ("event", "place", "expected"),
    [
        ({"all": ["z > 7 m"], "sensitivities": 1}, "deep.sensitivities", "true or false"),
        (
            {"all": ["z > 7 m"], "given": ["z > 6 m"], "sensitivities": True},
            "deep.sensitivities",
            "an event without given",
        ),
        ({"all": ["z > 7 m"], "given": "z > 6 m"}, "deep.given", "a list of limits"),
        ({"all": ["z > 7 m"], "given": ["q > 6 m"]}, "deep.given[0]", "an output of"),
        ({"all": ["z > 7 m"], "given": {"any": ["z > 6"], "x": 1}}, "deep.given.any[0]", "length"),
        ({"all": ["z > 7 m"], "given": {"all": ["z > 6 m"], "x": 1}}, "deep.given.x", "all or any"),
    ],
)
def test_a_mistake_is_reported_with_its_place(event, place, expected):
    with pytest.raises(uqpen.StudyError) as caught:
        study(joint_probabilities={"deep": event})
    assert f"joint_probabilities.{place}" in str(caught.value)
    assert expected in str(caught.value)
