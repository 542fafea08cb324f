"""Expected shortfall and return levels."""

import math

import numpy as np
import pytest
import scipy
from drawn_samples import sample_of_values

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.model import Output
from uqpen.report.blocks import Columns, Findings
from uqpen.report.sections.answer import answer
from uqpen.report.sections.archive import archive_notes
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics.analyze import analyze
from uqpen.statistics.distribution_function.quantiles import expected_shortfalls
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.tails import fit_tails, fitting_tails, p_value, return_levels

REQUESTS = QuantityOfInterest(
    Output("y", "m"), "m", expected_shortfall=(0.9, 0.99), return_periods=(5.0, 1e3, 1e5)
)


def pareto(shape, runs, seed=1):
    """Return excesses of a generalised Pareto distribution with scale 1."""
    unit = np.random.default_rng(seed).random(runs)
    return np.expm1(-shape * np.log(unit)) / shape if shape else -np.log(unit)


def shortfall(values, replicates=1):
    return dict(expected_shortfalls(sample_of_values(values, replicates=replicates), REQUESTS))[
        "expected_shortfall"
    ]


def test_expected_shortfall_is_the_mean_of_the_largest_runs():
    values = np.random.default_rng(3).permutation(np.arange(1.0, 1001.0))
    found = shortfall(values)
    # Uniform on 0 to 1000: the mean beyond 900 is 950. The quantile lies between two runs.
    assert found.values[0, 0] == pytest.approx(950.5, abs=0.5)
    assert found.values[0, 1] < 950 < found.values[0, 2]


@pytest.mark.parametrize("replicates", [1, 10])
def test_its_interval_contains_that_of_a_known_distribution(replicates):
    found = shortfall(pareto(0.0, 4000), replicates)
    # Of an exponential distribution, the quantile and its mean of 1 beyond.
    for place, level in enumerate((0.9, 0.99)):
        _, lower, upper = found.values[place]
        assert lower < -math.log(1 - level) + 1 < upper


def test_a_multiple_and_a_shift_of_the_output_are_those_of_its_expected_shortfall():
    values = pareto(0.2, 500)
    # The same numbers in other units, but for rounding.
    np.testing.assert_allclose(
        shortfall(3 * values + 7).values, 3 * shortfall(values).values + 7, rtol=1e-9
    )


def test_few_runs_beyond_the_quantile_give_no_interval():
    found = shortfall(pareto(0.0, 500))
    assert np.isfinite(found.values[0]).all()
    assert np.isnan(found.values[1, 1:]).all()
    assert "fewer than ten runs lie on one side of the quantile" in str(found["note"].values[1])


def test_a_generalised_pareto_distribution_is_found_again():
    for shape in (-0.3, 0.0, 0.5):
        fit = fit_tails(pareto(shape, 20_000))
        # Three standard errors: (1 + ξ)/√n of the shape.
        assert float(fit.shape) == pytest.approx(shape, abs=3 * (1 + shape) / 20_000**0.5)
        assert float(fit.scale) == pytest.approx(1, abs=0.05)


def test_p_values_of_true_samples_are_uniform_and_of_others_small():
    excesses = np.stack([pareto(0.2, 200, seed) for seed in range(400)])
    fit = fit_tails(excesses)
    found = np.array([p_value(*each) for each in zip(fit.anderson_darling, fit.shape, strict=True)])
    # Binomial, of 400 samples: three standard errors are 4.5 and 6.5 points.
    assert (found < 0.1).mean() == pytest.approx(0.1, abs=0.045)
    assert (found < 0.25).mean() == pytest.approx(0.25, abs=0.065)
    other = fit_tails(np.random.default_rng(1).normal(5, 1, 400))
    assert p_value(float(other.anderson_darling), float(other.shape)) < 0.01


def levels(values, replicates=1):
    return dict(return_levels(sample_of_values(values, replicates=replicates), REQUESTS))


@pytest.mark.parametrize("shape", [0.0, 0.3])
def test_intervals_of_return_levels_contain_those_of_a_pareto_distribution(shape):
    found = levels(pareto(shape, 3000))["return_level"]
    for place, period in ((1, 1e3), (2, 1e5)):
        exact = math.expm1(shape * math.log(period)) / shape if shape else math.log(period)
        value, lower, upper = found.values[place]
        assert lower < exact < upper
        assert lower < value < upper
    notes = found["note"].values.tolist()
    assert "it lies below the threshold of the fitted tail" in notes[0]
    assert "beyond all runs" in notes[2]
    assert "beyond all runs" not in notes[1]


def test_the_fitted_tail_is_stated():
    found = levels(pareto(0.3, 3000))
    count = float(found["tail_runs"].values[0])
    assert count == 144  # 10 n^(1/3)
    assert found["tail_p_value"].values[0] >= 0.1
    assert (np.sort(pareto(0.3, 3000)) > found["tail_threshold"].values[0]).sum() == count


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        (pareto(0.0, 400), "fewer than 500 runs are too few to fit a tail"),
        (np.round(pareto(0.0, 2000)), "no tail of 50 or more runs"),
        (np.random.default_rng(1).random(2000), "the tail ends so abruptly"),
        (np.ones(2000), "the output does not vary"),
    ],
)
def test_what_has_no_tail_is_refused_with_the_reason(values, reason):
    found = levels(values)["return_level"]
    assert np.isnan(found.values).all()
    assert reason in str(found["note"].values[2])


def spread_evenly(runs):
    """Return lognormal values at equally likely steps, ascending."""
    return np.exp(0.5 * scipy.special.ndtri((np.arange(runs) + 0.5) / runs))


# Of the last, 50 runs beyond a threshold make a share of 0.00076.
@pytest.mark.parametrize(("runs", "period"), [(2000, 32.0), (10_000, 186.0), (65_536, 1312.0)])
def test_a_return_level_close_to_a_threshold_has_an_interval(runs, period):
    requests = QuantityOfInterest(Output("y", "m"), "m", return_periods=(period,))
    found = dict(return_levels(sample_of_values(spread_evenly(runs)), requests))["return_level"]
    value, lower, upper = found.values[0]
    exact = math.exp(0.5 * scipy.special.ndtri(1 - 1 / period))
    assert lower < exact < upper
    assert value == pytest.approx(exact, rel=0.01)


def test_an_end_below_the_threshold_is_a_run_that_the_binomial_distribution_excludes():
    values = spread_evenly(10_000)
    (tail, *_) = fitting_tails(values)
    beyond = len(tail.excesses)
    # The longer a period, the less its level can be the threshold.
    limit = scipy.stats.t.ppf(0.975, beyond - 2) ** 2 / 2
    counts = np.arange(beyond, len(values))
    for period in (10_000 / beyond * 1.01, 10_000 / beyond * 1.1, 10_000 / beyond * 1.2):
        binomial = scipy.stats.binom.logpmf
        ratio = binomial(counts, 10_000, counts / 10_000) - binomial(counts, 10_000, 1 / period)
        lower, upper = tail.interval(period, 0.95)
        assert upper > tail.return_level(period) > tail.threshold
        if ratio[0] <= limit:
            assert lower == values[-counts[ratio > limit][0]] < tail.threshold
        else:
            assert lower > tail.threshold


def test_an_end_does_not_depend_on_the_unit():
    values = np.sort(pareto(0.2, 2000))
    (tail, *_), (small, *_) = fitting_tails(values), fitting_tails(1e-15 * values)
    np.testing.assert_allclose(
        1e15 * np.array(small.interval(1e3, 0.95)), tail.interval(1e3, 0.95), rtol=1e-5
    )


def test_no_period_is_too_long():
    (tail, *_) = fitting_tails(np.sort(pareto(1.5, 2000)))
    lower, upper = tail.interval(1e300, 0.95)
    assert math.isfinite(lower)
    assert upper == math.inf


def test_of_replicates_the_interval_is_called_conservative():
    found = levels(pareto(0.1, 2000), 10)["return_level"]
    assert found["interval_label"].values[1] == "conservative"
    assert "of generalised Pareto tails" in found["interval"].values[1]


def model(a):
    return {"y": np.where(a < 1, np.nan, np.exp(a))}


def study(**requests):
    return uqpen.Study(
        uqpen.PythonModel(model, {"a": "1"}, {"y": "m"}, vectorized=True),
        {"a": uqpen.Normal(3, 1)},
        outputs={"y": uqpen.OutputSpec("cm", **requests)},  # type: ignore[arg-type]
        designs={"mc": uqpen.MonteCarlo(runs=1500), "lhs": uqpen.LatinHypercube(runs=1500)},
        seed=4,
    )


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study(expected_shortfall=[0.95], return_periods=[10_000, 1000]))


def test_archive_tables_json_and_the_long_table_agree(tree):
    assert list(find_faults(tree)) == []
    found = tree["statistics/mc/y"]
    assert found["return_period"].values.tolist() == [1000, 10_000]
    reported = archive_json(tree)["designs"]["mc"]["outputs"]["y"]
    shown = reported["expected_shortfall"]["0.95"]
    assert shown["estimate"] == float(found["expected_shortfall"][0, 0])
    assert reported["return_levels"]["1000.0"]["estimate"] == float(found["return_level"][0, 0])
    assert reported["tail_runs"]["estimate"] == float(found["tail_runs"][0])
    rows = [label for table in output_tables(tree) for label, _ in table.rows]
    assert "mean beyond the 95 % quantile" in rows
    assert "exceeded once in 10000 cases" in rows
    assert "threshold of the tail" in rows
    frame = long_table(tree).query("source == 'mc' and statistic == 'return_level'")
    assert frame["estimate"].tolist() == found["return_level"].values[:, 0].tolist()


def test_what_the_study_asks_for_is_in_the_answer(tree):
    reported = str(list(answer(ArchiveView(tree, "")))).replace("\u00a0", " ").replace("\\xa0", " ")
    assert "Beyond its 95 % quantile, the mean of y is " in reported
    assert "Once in 1000 cases on average, y exceeds " in reported
    assert "Once in 10000 cases on average, y exceeds " in reported


def test_what_has_no_estimate_or_no_room_among_the_sentences_stands_below_them():
    asked = study(
        exceeds=["10 cm", "20 cm", "40 cm"], expected_shortfall=[0.95], return_periods=[10]
    )
    (rows,) = (
        block.entries
        for column in answer(ArchiveView(uqpen.run(asked), ""))
        if isinstance(column, Columns)
        for block in column.blocks
        if isinstance(block, Findings) and not block.is_verdict
    )
    shortfall, level = rows
    assert shortfall.head == "y, mean beyond the 95 % quantile"
    assert shortfall.text.startswith("Beyond its 95")
    assert level.head == "y, exceeded once in 10 cases"
    assert level.text.startswith("No estimate: it lies below the threshold of the fitted tail")


def test_those_of_a_surrogate_say_why_no_run_corrects_them():
    asked = uqpen.Study(
        lambda a: {"y": np.exp(a)},
        {"a": uqpen.Normal(0, 0.5)},
        outputs={"y": uqpen.OutputSpec(expected_shortfall=[0.9], return_periods=[1000])},
        designs={"mc": uqpen.MonteCarlo(runs=200)},
        surrogates={"pce": uqpen.PolynomialChaos("mc", transform={"y": "log"})},
        seed=4,
    )
    tree = uqpen.run(asked)
    found = SourceStatistics(tree).statistics("pce", "y")
    (note,) = found["expected_shortfall"].coords["note"].values
    assert "this is the surrogate's own figure" in str(note)
    assert np.isnan(found["return_level"].values).all()
    (note,) = found["return_level"].coords["note"].values
    assert str(note).startswith("no tail is fitted to draws of a surrogate")
    # The mean of exp(σ z) beyond its 90 % quantile.
    z, spread = scipy.stats.norm, 0.5
    truth = np.exp(spread**2 / 2) * z.sf(z.ppf(0.9) - spread) / 0.1
    assert found["expected_shortfall"].values[0, 0] == pytest.approx(truth, rel=0.01)
    # Of 200 runs, a tail has too few for a return level: this note is counted, too.
    counted = " ".join(archive_notes(tree))
    assert "no tail is fitted to draws of a surrogate" in counted
    assert "this is the surrogate's own figure" in counted
    assert "fewer than 500 runs are too few to fit a tail" in counted


def test_failed_runs_are_named_at_the_tail(tree):
    reported = archive_json(tree)["designs"]["mc"]["outputs"]["y"]["return_levels"]["1000.0"]
    failed = int((tree["runs/mc"]["status"].values != 0).sum())
    assert failed > 0
    assert f"{failed} failed runs may lie in the tail" in reported["note"]


def test_nothing_is_computed_that_is_not_requested():
    found = uqpen.run(study())["statistics/mc/y"]
    assert not {"return_level", "tail_shape", "expected_shortfall"} & set(found.data_vars)


def test_of_many_runs_a_part_is_taken_and_says_so(tree):
    runs = tree["runs/mc"].to_dataset()
    found = analyze(runs, [REQUESTS], in_memory=1000)["y"]
    assert "from 1000 of 1500 runs" in str(found["return_level"]["note"].values[1])
    assert found["expected_shortfall"].attrs["runs"] == 1000


@pytest.mark.parametrize(
    ("requests", "place", "expected"),
    [
        ({"return_periods": [0.5]}, "return_periods[0]", "a number of cases above 1"),
        ({"return_periods": ["ten"]}, "return_periods[0]", "a number of cases above 1"),
        ({"expected_shortfall": [95]}, "expected_shortfall[0]", "between 0 and 1"),
    ],
)
def test_a_mistake_is_reported_with_its_place(requests, place, expected):
    with pytest.raises(uqpen.StudyError) as caught:
        study(**requests)
    assert f"outputs.y.{place}" in str(caught.value)
    assert expected in str(caught.value)
