"""Tolerance limits: upper, lower and two-sided, by Wilks' rule and over replicates."""

import math

import numpy as np
import pytest
from drawn_samples import runs_of_values
from scipy import special, stats

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.model import Output
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import lower_tolerance_limit_text, tolerance_interval_texts
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.statistics.distribution_function.tolerance import (
    lower_tolerance_limits,
    tolerance_intervals,
    tolerance_limits,
)
from uqpen.statistics.intervals import runs_needed_for_both
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import sample_of

LENGTH = Output("y", "m")
STATISTICS = ("tolerance_limit", "lower_tolerance_limit", "tolerance_interval")


def limits(values, content, *, sampling="independent", replicates=0):
    """Tolerance limits of all kinds for one content; a failed run is NaN."""
    runs = runs_of_values(values, sampling, replicates=replicates)
    quantity = QuantityOfInterest(
        LENGTH,
        "m",
        tolerance_contents=(content,),
        lower_tolerance_contents=(content,),
        tolerance_interval_contents=(content,),
    )
    sample = sample_of(runs, "y")
    analyses = (tolerance_limits, lower_tolerance_limits, tolerance_intervals)
    return {name: array for each in analyses for name, array in each(sample, quantity)}


def ends(found, name):
    return found[name].values[0].tolist()


class TestWilks:
    # Wilks, S. S. (1942). Ann. Math. Statist. 13, 400-409, and the tables of safety analysis.
    @pytest.mark.parametrize(
        ("content", "confidence", "runs"),
        [(0.95, 0.95, 93), (0.9, 0.95, 46), (0.99, 0.95, 473), (0.9, 0.9, 38), (0.99, 0.99, 662)],
    )
    def test_the_fewest_runs_are_those_of_the_tables(self, content, confidence, runs):
        assert runs_needed_for_both(content, confidence) == runs
        assert 1 - stats.beta.cdf(content, runs - 1, 2) >= confidence
        assert 1 - stats.beta.cdf(content, runs - 2, 2) < confidence

    def test_at_the_fewest_runs_the_ends_are_the_smallest_and_the_largest(self):
        values = np.random.default_rng(1).permutation(np.arange(93.0))
        found = limits(values, 0.95)["tolerance_interval"]
        np.testing.assert_array_equal(found.values, [[np.nan, 0.0, 92.0]])
        assert str(found["interval"].values[0]) == "two-sided, order statistics (binomial)"
        assert str(found["interval_label"].values[0]) == "discrete"
        assert found["interval_content_runs_needed"].values.tolist() == [93]

    def test_one_run_less_has_no_interval_and_says_how_many_it_needs(self):
        found = limits(np.arange(92.0), 0.95)["tolerance_interval"]
        assert np.isnan(found.values).all()
        assert str(found["note"].values[0]) == "a tolerance interval needs at least 93 runs"

    @pytest.mark.parametrize("runs", [60, 93, 94, 150, 181, 500])
    @pytest.mark.parametrize("content", [0.5, 0.9, 0.95])
    def test_the_interval_is_the_tightest_symmetric_one_with_the_confidence(self, runs, content):
        found = limits(np.arange(1.0, runs + 1), content)
        _, lower, upper = ends(found, "tolerance_interval")
        if runs < runs_needed_for_both(content, 0.95):
            assert math.isnan(lower)
            return
        assert lower - 1 == runs - upper, "as many runs below as above"
        # The content of Y(r) to Y(s) is of the law Beta(s - r, n - s + r + 1).
        confidence = [
            1 - stats.beta.cdf(content, blocks, runs - blocks + 1)
            for blocks in (upper - lower, upper - lower - 2)
        ]
        assert confidence[0] >= 0.95 > confidence[1]

    def test_the_lower_limit_is_that_of_the_binomial_law(self):
        values = np.random.default_rng(2).permutation(np.arange(1.0, 101.0))
        _, lower, upper = ends(limits(values, 0.9), "lower_tolerance_limit")
        rank = int(lower)
        assert math.isnan(upper)
        # At most rank - 1 of 100 lie below the 10 % quantile, with no more than 5 %.
        assert special.bdtr(rank - 1, 100, 0.1) <= 0.05 < special.bdtr(rank, 100, 0.1)

    def test_too_few_runs_for_a_lower_bound(self):
        found = limits(np.arange(58.0), 0.95)["lower_tolerance_limit"]
        assert np.isfinite(found.values[0, 0])
        assert np.isnan(found.values[0, 1:]).all()
        assert str(found["note"].values[0]) == "a lower bound needs at least 59 runs"
        assert ends(limits(np.arange(59.0), 0.95), "lower_tolerance_limit")[1] == 0.0


@pytest.mark.parametrize(
    ("sampling", "replicates"), [("independent", 0), ("stratified", 10), ("stratified", 0)]
)
@pytest.mark.parametrize("content", [0.6, 0.95])
def test_limits_of_the_mirrored_output_are_mirrored(sampling, replicates, content):
    values = np.random.default_rng(3).gumbel(size=500)
    values[::50] = np.nan
    one, other = (
        limits(each, content, sampling=sampling, replicates=replicates)
        for each in (values, -values)
    )
    value, lower, _ = ends(one, "lower_tolerance_limit")
    mirrored = ends(other, "tolerance_limit")
    assert (value, lower) == pytest.approx((-mirrored[0], -mirrored[2]), rel=1e-12)
    _, low, high = ends(one, "tolerance_interval")
    _, other_low, other_high = ends(other, "tolerance_interval")
    assert (low, high) == (-other_high, -other_low)
    assert one["lower_tolerance_limit"]["interval"] == other["tolerance_limit"]["interval"]


def test_failed_runs_are_left_out():
    values = np.arange(200.0)
    with_failed = np.concatenate([values, np.full(50, np.nan)])
    for name in STATISTICS:
        one, other = (ends(limits(each, 0.9), name) for each in (values, with_failed))
        assert one == pytest.approx(other, nan_ok=True)


def test_a_constant_output_lies_within_its_only_value():
    assert ends(limits(np.ones(200), 0.9), "tolerance_interval")[1:] == [1.0, 1.0]


class TestCoverage:
    SEEDS = 80
    # An interval that contains its content in 93 % of all seeds has fewer once in 100 000 times.
    FEWEST = int(stats.binom.ppf(1e-5, SEEDS, 0.93))

    def contents(self, values, **of_runs):
        """Content of each kind of limit for 0.9 of uniform values, whose law is known."""
        found = limits(values, 0.9, **of_runs)  # type: ignore[arg-type]
        _, low, high = ends(found, "tolerance_interval")
        return {
            "tolerance_limit": ends(found, "tolerance_limit")[2],
            "lower_tolerance_limit": 1 - ends(found, "lower_tolerance_limit")[1],
            "tolerance_interval": high - low,
        }

    @pytest.mark.parametrize("additive", [1.0, 0.3])
    def test_replicates(self, additive):
        # The output is uniform: a sum of uniform inputs, taken modulo 1 or by one stratum alone.
        counts = dict.fromkeys(STATISTICS, 0)
        for seed in range(self.SEEDS):
            generator = np.random.default_rng(seed)
            strata = np.array([generator.permutation(40) for _ in range(10)]).T
            values = (strata + generator.random((40, 10))) / 40
            noise = generator.random((40, 10)) * (1 - additive)
            runs = (values + noise).ravel() % 1.0
            of_runs = {"sampling": "stratified", "replicates": 10}
            for name, content in self.contents(runs, **of_runs).items():
                counts[name] += content >= 0.9
        assert min(counts.values()) >= self.FEWEST, counts


@pytest.fixture(scope="module")
def tree():
    study = uqpen.Study(
        uqpen.PythonModel(
            lambda a, b: {"y": a + 2 * b}, {"a": "m", "b": "m"}, {"y": "m"}, vectorized=True
        ),
        {"a": uqpen.Uniform("0 m", "1 m"), "b": uqpen.Uniform("0 m", "1 m")},
        {
            "y": uqpen.OutputSpec(
                "cm", hold=[0.9], hold_above=[0.95, 0.999], hold_between=[0.9, 0.999]
            )
        },
        {"mc": uqpen.MonteCarlo(runs=300), "sobol": SobolSequence(runs=512)},
        seed=1,
    )
    return uqpen.run(study)


def test_tables_show_the_bounds_rounded_outward(tree):
    table = next(each for each in output_tables(tree) if each.title.startswith("y ["))
    rows = dict(table.rows)
    lower = tree["statistics/mc/y"]["lower_tolerance_limit"].values[0] * 100
    low, high = tree["statistics/mc/y"]["tolerance_interval"].values[0, 1:] * 100
    assert rows["not below, 95 %"][0].startswith(lower_tolerance_limit_text(lower[0], lower[1]))
    shown = rows["tolerance interval, 90 %"][0].split(" … ")
    assert float(shown[0]) <= low
    assert float(shown[1].split()[0]) >= high
    assert rows["tolerance interval, 99.9 %"][0].startswith("– ")
    assert "a tolerance interval needs at least 4742 runs" in table.notes
    assert "at least: one-sided tolerance bound, 95 % confidence" in table.notes


def test_json_has_the_bounds_and_the_runs_needed(tree):
    assert list(find_faults(tree)) == []
    reported = archive_json(tree)["designs"]["mc"]["outputs"]["y"]
    between = reported["hold_between"]["0.9"]
    _, low, high = tree["statistics/mc/y"]["tolerance_interval"].values[0].tolist()
    assert (between["estimate"], between["lower"], between["upper"]) == (None, low, high)
    assert (between["runs_needed"], reported["hold_above"]["0.999"]["runs_needed"]) == (46, 2995)


def test_the_page_has_a_sentence_of_each(tree):
    page = str(list(answer(ArchiveView(tree, "")))).replace("\\xa0", " ").replace("\u00a0", " ")
    low, high = tolerance_interval_texts(
        *(tree["statistics/mc/y"]["tolerance_interval"].values[0, 1:] * 100).tolist()
    )
    assert "y is at most " in page
    assert "y is at least " in page
    assert f"y is from {low} cm to {high} cm in 90 of 100 cases (95 % confidence)." in page


def test_the_study_states_them_in_its_text():
    study = uqpen.Study(
        lambda a: {"y": a},
        {"a": uqpen.Uniform(0, 1)},
        {"y": uqpen.OutputSpec("1", hold_above=[0.95], hold_between=[0.9])},
        {"lhs": LatinHypercube(runs=20)},
        seed=1,
    )
    assert "hold_above = [\n    0.95,\n]\nhold_between = [\n    0.9,\n]" in study.to_toml()
    assert study.quantities_of_interest[0].tolerance_interval_contents == (0.9,)


def test_a_wrong_content_is_refused_with_its_place():
    with pytest.raises(uqpen.StudyError) as caught:
        uqpen.Study(
            lambda a: {"y": a},
            {"a": uqpen.Uniform(0, 1)},
            {"y": uqpen.OutputSpec("1", hold_between=[0.9, 95])},
            {"mc": uqpen.MonteCarlo(runs=20)},
            seed=1,
        )
    assert "outputs.y.hold_between[1]" in str(caught.value)
    assert "a probability between 0 and 1" in str(caught.value)


def test_bounds_are_rounded_away_from_the_cases():
    assert lower_tolerance_limit_text(13.4812, 13.2087) == "13.48, at least 13.20"
    assert lower_tolerance_limit_text(-1.0, -1.21) == "−1.00, at least −1.21"
    assert tolerance_interval_texts(-0.0104, 0.0101) == ("−0.0104", "0.0101")
    assert tolerance_interval_texts(9.8134e8, 14.2187e8) == ("0.981×10⁹", "1.422×10⁹")
    assert tolerance_interval_texts(2.0, 2.0) == ("2", "2")
