"""Posteriors: exact ones, two modes, failed runs, interruption, and what the replicates say."""

import functools
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from interrupted_study import check_interruptions_and_workers
from scipy import stats

import uqpen
from tests.test_measurements import LINE, MODEL
from uqpen.archive.structure import find_faults
from uqpen.charts.measured_values import measurement_charts
from uqpen.core.errors import StudyError
from uqpen.core.streams import Stream
from uqpen.core.variables import Output
from uqpen.designs.posterior import (
    UNRELATED_AT_LAST,
    Cloud,
    Particles,
    half_normal,
    largest_correlation,
    sample_posterior,
)
from uqpen.measurements.errors import Discrepancy, MeasuredOutput, MeasurementErrors, UnknownSize
from uqpen.measurements.experiments import Experiments, MeasuredOutputs
from uqpen.report.blocks import Heading
from uqpen.report.sections.comparisons import measurements
from uqpen.results.archive_view import select_view
from uqpen.results.calibrations import posterior_statements
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.validations import validation_tables
from uqpen.statistics.posterior import (
    PosteriorSample,
    conditional_log_densities,
    rank_normalised_rhat,
)

calibration = pytest.importorskip(
    "posterior_calibration", reason="the folder of benchmarks is not here"
)
discrepancy = pytest.importorskip("discrepancy", reason="the folder of benchmarks is not here")

# With so many replicates one mean in 100 is further off than 3 of its standard errors (Student t).
REPLICATES = 16


@functools.cache
def sampled(name, seed=2, **settings):
    problem = calibration.KNOWN[name].problem
    return calibration.posterior_sample(problem, Stream(seed, "test"), **settings)


@pytest.mark.parametrize("name", calibration.KNOWN)
def test_known_posteriors_are_within_their_errors(name):
    known, found = calibration.KNOWN[name], sampled(name, replicates=REPLICATES)
    for estimate, exact in ((found.mean, known.mean), (found.log_evidence, known.log_evidence)):
        # Half-widths are 2.13 standard errors with 15 degrees of freedom.
        error = (estimate.upper - estimate.lower) / 2 / stats.t.ppf(0.975, REPLICATES - 1)
        assert np.all(np.abs(estimate.value - exact) < 3 * error)
    assert found.std.value == pytest.approx(known.std, rel=0.05)
    assert not any(found.faults)


def test_a_line_has_its_correlation_and_its_prediction():
    draws = sampled("line", replicates=REPLICATES).draws.reshape(-1, 2)
    # Of 8 000 draws at least 3 000 are effective, so these are known to about 2 %.
    assert np.corrcoef(draws.T)[0, 1] == pytest.approx(-0.8017321863, abs=0.02)
    at_5 = draws @ [1.0, 5.0]
    assert at_5.mean() == pytest.approx(10.7898055837, abs=3 * 0.3286060341 / math.sqrt(3000))
    assert at_5.std() == pytest.approx(0.3286060341, rel=0.05)


def test_each_replicate_sees_both_modes():
    draws = sampled("θ², two modes", replicates=REPLICATES).draws
    share = (draws[..., 0] > 0).mean(axis=1)
    # The standard deviation of a share over 500 draws, half of them effective, is 0.03.
    assert np.all(np.abs(share - 0.66708397) < 0.12)


def test_quantiles_are_those_of_the_normal_distribution():
    found = sampled("line", replicates=REPLICATES)
    known = calibration.KNOWN["line"]
    for probability in (0.05, 0.5, 0.975):
        exact = stats.norm.ppf(probability, known.mean, known.std)
        assert found.quantile(probability).value == pytest.approx(exact, abs=0.02)


def interrupted(asked_of, rounds, **settings):
    """Return the points of some rounds, and the logarithms of their likelihoods."""
    sampler = sample_posterior(stream=Stream(3, "test"), **settings)
    made, found = [next(sampler)], []
    for _ in range(rounds):
        found.append(asked_of(made[-1].points))
        try:
            made.append(sampler.send(found[-1]))
        except StopIteration:
            break
    return made, found


def test_a_round_has_all_replicates_and_no_replicate_depends_on_another():
    def asked(z):
        return -50 * ((z - 0.4) ** 2).sum(axis=1)

    settings = {"dimension": 2, "particles": 100, "at_most": 10**6}
    four, _ = interrupted(asked, 5, replicates=4, **settings)
    five, _ = interrupted(asked, 5, replicates=5, **settings)
    for few, many in zip(four, five, strict=True):
        assert np.unique(few.replicate).tolist() == [0, 1, 2, 3]
        kept = many.replicate < 4
        assert np.array_equal(few.points, many.points[kept])


def test_failed_runs_are_refused_and_counted():
    known = calibration.KNOWN["a value and a bound"].problem

    def fails_below_1(values):
        return np.where(values[:, 0] < 1, np.nan, known.log_likelihood(values))

    problem = known._replace(log_likelihood=fails_below_1)
    found = calibration.posterior_sample(problem, Stream(1, "test"), replicates=REPLICATES)
    assert found.draws.min() > 1
    assert found.failed_share(prior=True) == pytest.approx(stats.norm.cdf(1.0), abs=0.01)
    x = np.linspace(1, 6, 20_001)
    weight = np.exp(known.log_likelihood(x[:, np.newaxis])) * stats.norm.pdf(x)
    evidence = np.trapezoid(weight, x)
    assert found.mean.value[0] == pytest.approx(np.trapezoid(x * weight, x) / evidence, abs=0.02)
    assert found.log_evidence.value == pytest.approx(math.log(evidence), abs=0.05)
    assert "of the draws around the posterior failed" in found.failure_note


def test_where_the_runs_are_too_few_there_is_no_posterior():
    found = sampled("line", at_most=9_000)
    assert found.startswith("no posterior: with 8000 points, the likelihood counts by the power 0.")
    assert "at_most leaves no run" in sampled("line", at_most=2_500)
    nothing = calibration.Problem(("x",), lambda z: z, lambda x: np.full(len(x), np.nan))
    found = calibration.posterior_sample(nothing, Stream(1, "test"))
    assert found.startswith("no posterior: 0% of the runs of the prior completed")


def test_no_more_runs_are_asked_for_than_allowed():
    for at_most in (3_000, 4_000, 10_000, 30_000):
        made, _ = interrupted(
            lambda z: -5000 * ((z - 0.4) ** 2).sum(axis=1),
            999,
            dimension=2,
            particles=500,
            replicates=4,
            at_most=at_most,
        )
        assert at_most - 2000 < sum(len(each.points) for each in made) <= at_most


def test_replicates_that_differ_are_named():
    found = sampled("line")
    values = found.values.copy()
    values[found.sampled.replicate == 2] += [0.1, 0.0]
    faults = replace(found, values=values).faults
    assert faults[0].startswith("the replicates differ: R-hat is 1.")
    assert "; the mean is known to " in faults[0]
    assert faults[1] == ""


def test_draws_that_do_not_vary_are_not_sampled_well():
    found = sampled("line")
    faults = replace(found, values=np.where([True, False], 0.1, found.values)).faults
    assert faults == ["R-hat is not defined, as the draws hardly vary", ""]


def test_a_last_level_that_was_cut_short_says_so():
    (fault,) = sampled("θ², two modes", at_most=20_000).faults
    assert fault.startswith("the last level ended at at_most: draws correlate by 0.")


def test_moves_keep_the_distribution_of_their_level():
    # Without a likelihood that is the prior, whatever cloud the moves follow.
    rng = np.random.default_rng(5)
    cloud = Cloud.of(rng.normal([1.0, -0.5], [0.5, 1.5], (400, 2)), rng.random(400))
    for move in (cloud.crank_nicolson, cloud.difference):
        points = rng.standard_normal((20_000, 2))
        for _ in range(5):
            moved = move(points, 0.7, rng)
            accepted = np.log(rng.random(len(points))) < moved.log_ratio
            points = np.where(accepted[:, np.newaxis], moved.points, points)
        assert 0.1 < accepted.mean() < 0.9
        for column in points.T:
            assert stats.kstest(column, "norm").pvalue > 0.01


def test_the_next_power_of_the_likelihood_leaves_half_of_the_particles_effective():
    rng = np.random.default_rng(1)
    for scale in (1e-8, 3.0, 1e8):
        particles = Particles(np.arange(500), -scale * rng.chisquare(3, 500))
        exponent = particles.next_exponent(0.0)
        weights = particles.weights(exponent)
        share = weights.sum() ** 2 / (weights**2).sum() / 500
        assert share == pytest.approx(0.5, abs=1e-6) if exponent < 1 else share > 0.5


def test_numbers_for_unknown_errors_are_half_normal():
    z = np.array([-20.0, -8.0, -1.0, 0.0, 1.0, 8.0, 30.0])
    found = half_normal(z, 2.0)
    assert np.all(np.diff(found) > 0)
    assert half_normal(np.array([-1e3]), 1e-9)[0] ** 2 > 0
    exact = stats.halfnorm.ppf(stats.norm.cdf([-8.0, -1.0, 0.0, 1.0]), scale=2.0)
    assert found[1:5] == pytest.approx(exact, rel=1e-12)
    assert found[5] == pytest.approx(stats.halfnorm.isf(stats.norm.sf(8.0), scale=2.0), rel=1e-9)


def test_rank_normalised_rhat_of_shifted_and_of_wider_replicates():
    # arviz-stats 0.8 has these for the same draws; a shift is seen by ranks, a spread by distances.
    draws = np.sin(np.arange(1.0, 41.0) ** 2).reshape(4, 10)
    shifted = draws + np.array([0.0, 0.0, 0.0, 1.0])[:, np.newaxis]
    wider = draws * np.array([1.0, 1.0, 1.0, 5.0])[:, np.newaxis]
    for values, exact, of_exponentials in (
        (draws, 1.048467053496547, 1.0565281208073805),
        (shifted, 1.1078315844494524, 1.1078315844494524),
        (wider, 1.172060700306733, 1.0136243846915576),
    ):
        assert rank_normalised_rhat(values) == pytest.approx(exact, rel=1e-10)
        assert rank_normalised_rhat(np.exp(values)) == pytest.approx(of_exponentials, rel=1e-10)


def test_no_particle_is_near_its_start_at_the_end():
    found = sampled("line")
    assert found.related < UNRELATED_AT_LAST + 0.05  # by ranks
    start, now = (found.values[each] for each in (found.replicates[0].start, found.runs[0]))
    assert largest_correlation(start, now) < UNRELATED_AT_LAST
    assert math.isnan(largest_correlation(0 * start, now)), "without a warning to the user"


def test_what_the_measurements_say_nothing_of_is_not_learnt():
    problem = calibration.Problem(("a", "b"), lambda z: 3 * z, lambda x: -50 * (x[:, 0] - 1) ** 2)
    found = calibration.posterior_sample(problem, Stream(1, "test"))
    assert isinstance(found, PosteriorSample)
    assert found.learnt == pytest.approx([1 - 0.1 / math.sqrt(1 + 0.01 / 9) / 3, 0.0], abs=0.03)
    assert np.all(found.effective_draws <= 2000)
    means = found.draws.mean(axis=1)
    interval = stats.t.interval(0.95, len(means) - 1, means.mean(axis=0), stats.sem(means))
    assert found.mean.bounds.T[1:] == pytest.approx(np.array(interval))


# Studies with measurements.

SAMPLED = """[designs.fit]
kind = "posterior"
measured = ["line"]
particles = 200
"""
POSTERIOR = LINE.partition("[designs.fit]")[0] + SAMPLED


def calibrated(folder, text, model=MODEL):
    """Return the archive of a study."""
    (folder / "line.py").write_text(model)
    tree = uqpen.run(uqpen.parse_study(text, folder=folder))
    assert list(find_faults(tree)) == []
    return tree


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    """The archive of the posterior of a line."""
    return calibrated(tmp_path_factory.mktemp("line"), POSTERIOR)


def test_a_study_keeps_the_posterior_of_a_line(line):
    kept = line["calibrations/fit"]
    mean, std = kept["posterior_mean"].values[:, 0], kept["posterior_std"].values[:, 0]
    # Of 800 draws at least 400 are effective.
    assert mean == pytest.approx([1.0899, 1.9400], abs=3 * 0.17 / math.sqrt(400))
    assert std == pytest.approx([0.1673, 0.0894], rel=0.12)
    assert kept["log_evidence"].values[0] == pytest.approx(-7.6099, abs=0.3)
    design = np.column_stack([np.ones(4), np.arange(4)])
    covariance = np.linalg.inv(design.T @ design / 0.2**2 + np.eye(2) / 10**2)
    spread = np.sqrt(np.diag(design @ covariance @ design.T))
    assert kept["predicted_std"].values == pytest.approx(spread, rel=0.12)
    assert kept["measured_std"].values == pytest.approx(np.full(4, 0.2))
    assert kept["prior_std"].values == pytest.approx([10.0, 10.0], rel=0.05)
    assert kept["posterior_mean"].attrs["interval_level"] == 0.95
    draws = line["runs/fit/draw"].values.tolist()
    assert draws == [*range(len(draws))]
    names = [kept[each].attrs["long_name"] for each in ("posterior_mean", "log_evidence")]
    assert names == ["unknowns, each in its SI unit", "logarithm of the evidence"]
    names = [table.title for table in output_tables(line)]
    assert {"fit: posterior", "fit: fit"} <= {*names}
    assert archive_json(line)["designs"]["fit"]["calibrations"]["sampled_well"] in (0.0, 1.0)


def test_groups_are_those_that_arviz_reads(line):
    kept = line["calibrations/fit"]
    groups = ["posterior", "posterior_predictive", "log_likelihood", "prior", "prior_predictive"]
    others = ["log_prior", "observed_data", "constant_data", "sample_stats"]
    assert [*kept.children] == [*groups, *others]
    for name in "ab":
        exact = stats.norm.logpdf(kept[f"posterior/{name}"], 0, 10)
        assert kept[f"log_prior/{name}"].values == pytest.approx(exact, rel=1e-12)
    assert kept["constant_data/y_x"].values.tolist() == [0, 1, 2, 3]
    assert kept["constant_data/y_experiment"].values.tolist() == [1, 1, 1, 1]
    # Errors are independent, so the rows' parts add up to the whole.
    rows, whole = kept["log_likelihood/y"], kept["sample_stats/log_likelihood"]
    assert rows.sum("y_row").values == pytest.approx(whole.values)
    assert kept["posterior/a"].dims == ("chain", "draw")
    assert kept["posterior/a"].mean() == pytest.approx(kept["posterior_mean"].values[0, 0])
    assert kept["observed_data/y"].values.tolist() == [1.1, 2.9, 5.2, 6.8]
    drawn = kept["posterior_predictive/y"]
    assert drawn.dims == ("chain", "draw", "y_row")
    at_0 = drawn.values[..., 0]
    assert at_0.std() == pytest.approx(math.hypot(0.1673, 0.2), rel=0.12)


def test_the_density_of_an_error_is_that_given_the_others():
    covariance = np.array([[2.0, 0.8, 0.3], [0.8, 1.0, -0.2], [0.3, -0.2, 0.5]])
    errors, whole = np.array([0.4, -1.0, 0.3]), stats.multivariate_normal(cov=covariance)
    for row, found in enumerate(conditional_log_densities(errors, covariance)):
        others = [each for each in range(3) if each != row]
        rest = stats.multivariate_normal(cov=covariance[np.ix_(others, others)])
        assert found == pytest.approx(whole.logpdf(errors) - rest.logpdf(errors[others]))


def test_an_input_that_varies_is_new_in_each_experiment(tmp_path):
    text = POSTERIOR.replace("[0, 1, 2, 3, 5]", "[0]").replace("std = 0.2", "std = 0.1")
    text = text.replace('unknown = ["a", "b"]', 'unknown = ["a"]\nvaries = ["b"]\nexperiment = "n"')
    text = text.replace("x = [0, 1, 2, 3]", "n = [1, 2, 3, 4]\nx = [0, 0, 0, 0]")
    text = text.replace(
        "b = { normal = { mean = 0, std = 10 } }", "b = { normal = { mean = 0, std = 2 } }"
    )
    model = "def line(a, b):\n    return {'y': [a + b]}\n"
    tree = calibrated(tmp_path, text, model)
    kept = tree["calibrations/fit"]
    # Each measurement has the variance 2² + 0.1² about a.
    variance = 1 / (1 / 100 + 4 / 4.01)
    mean = variance * np.sum([1.1, 2.9, 5.2, 6.8]) / 4.01
    assert kept["posterior_mean"].values[0, 0] == pytest.approx(mean, abs=0.2)  # 4 of 1/sqrt(400)
    assert kept["posterior_std"].values[0, 0] == pytest.approx(math.sqrt(variance), rel=0.15)
    b = tree["runs/fit"]["b"].values.reshape(-1, 4)
    assert np.unique(b[0]).size == 4


def test_sizes_of_errors_are_drawn_beside_the_inputs(tmp_path):
    text = POSTERIOR.replace("std = 0.2", "std = { half-normal = 0.5 }")
    tree = calibrated(tmp_path, text)
    kept = tree["calibrations/fit"]
    assert kept["unknown_input"].values.tolist() == ["a", "b", "std of y"]
    assert kept["prior_std"].values[2] == pytest.approx(0.5 * math.sqrt(1 - 2 / math.pi), rel=0.05)
    sizes = kept["posterior/std of y"]
    assert sizes.min() > 0
    exact = stats.halfnorm.logpdf(sizes, scale=0.5)
    assert kept["log_prior/std of y"].values == pytest.approx(exact, rel=1e-12)
    # No run is spent on them alone: the likelihood is integrated over them.
    runs = tree["runs/fit"]
    assert "error_share_1" in runs.coords
    assert runs.sizes["run"] < 30_000


def exactly_measured(errors):
    """Return five values of a number, with some errors."""
    values, rows = np.array([4.1, 5.0, 3.7, 4.6, 5.3]), np.arange(5)
    made = MeasuredOutput(Output("y", "1"), rows, {}, values, rows * 0, rows + 1, errors)
    return Experiments((MeasuredOutputs("m", ("theta",), (), (), {}, {}, (made,), 5),))


def test_a_size_that_is_integrated_over_has_its_exact_posterior():
    size = UnknownSize("std", 1.0, "1", "y")
    measured = exactly_measured(MeasurementErrors(np.zeros(5), np.zeros(5), size))
    theta = np.linspace(0.0, 9.0, 1001)
    predicted, none = np.repeat(theta[:, np.newaxis], 5, axis=1), np.full((1001, 1), np.nan)
    likelihood = np.exp(measured.likelihood.log_density(predicted, none))
    weights = likelihood * stats.norm.pdf(theta, 0, 10) * (theta[1] - theta[0])
    evidence = weights.sum()
    assert math.log(evidence) == pytest.approx(-9.06203033, abs=1e-6)
    mean = weights @ theta / evidence
    assert mean == pytest.approx(4.53334277, abs=1e-6)
    assert math.sqrt(weights @ (theta - mean) ** 2 / evidence) == pytest.approx(0.38297, abs=1e-5)
    shares = (np.arange(50) + 0.5) / 50
    drawn = measured.likelihood.integrated_sizes
    sizes = np.stack([drawn(predicted, none, np.full(none.shape, p)) for p in shares])
    mean = weights @ sizes.mean(axis=0)[:, 0] / evidence
    # A step between sizes and one between shares leave 0.003 of the standard deviation.
    assert mean == pytest.approx(0.80163810, abs=0.001)
    square = weights @ (sizes**2).mean(axis=0)[:, 0] / evidence
    assert math.sqrt(square - mean**2) == pytest.approx(0.30406205, rel=0.02)


def test_errors_that_repeats_give_are_those_of_student_t():
    # Pairs and a triple at three places: four degrees of freedom.
    place = np.array([0, 0, 1, 1, 2, 2, 2])
    values = np.array([1.0, 1.4, 2.3, 1.9, 3.3, 2.8, 3.1])
    count, rows = np.bincount(place), np.arange(7)
    mean = np.bincount(place, values) / count
    freedom = 7 - 3
    std = math.sqrt(((values - mean[place]) ** 2).sum() / freedom)
    errors = MeasurementErrors(np.full(7, std), np.zeros(7), freedom=float(freedom))
    made = MeasuredOutput(Output("y", "1"), rows, {}, values, rows * 0, rows + 1, errors)
    measured = Experiments((MeasuredOutputs("m", ("a",), (), (), {}, {}, (made,), 7),))
    results = np.array([[1.2, 2.1, 3.0], [0.5, 2.5, 3.0], [3.0, -3.0, 9.0]])
    found = measured.likelihood.log_density(results[:, place])
    # The means of repeats have a multivariate t distribution, beside the density of the repeats.
    exact = stats.multivariate_t(mean, std**2 * np.diag(1 / count), df=freedom).logpdf(results)
    assert np.diff(found) == pytest.approx(np.diff(exact), abs=1e-6)
    whole = stats.norm.logpdf(values, mean[place], std).sum()
    about = stats.norm.logpdf(mean, mean, std / np.sqrt(count)).sum()
    assert found == pytest.approx(exact + whole - about, abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.05])
def test_the_integral_over_a_size_beside_other_errors_is_that_of_the_likelihood(share):
    nothing, group = np.zeros(5), np.array([0, 0, 0, 1, 1])
    size = UnknownSize("std", 1.0, "1", "y")
    errors = MeasurementErrors(nothing + 0.2, nothing + share, size, nothing + 0.4, nothing, group)
    measured = exactly_measured(errors)
    predicted = np.array([[4.0, 4.5, 4.2, 4.1, 5.0], [np.nan] * 5, [4.5, 4.4, 4.3, 4.2, 4.1]])
    found = measured.likelihood.log_density(predicted, np.full((3, 1), np.nan))
    assert np.isnan(found).tolist() == [False, True, False]
    sizes = np.geomspace(1e-8, 10, 4001)
    for draw in (0, 2):
        along = np.repeat(predicted[draw : draw + 1], len(sizes), axis=0)
        of_sizes = np.exp(measured.likelihood.log_density(along, sizes[:, np.newaxis]))
        exact = np.trapezoid(of_sizes * stats.halfnorm.pdf(sizes), sizes)
        assert found[draw] == pytest.approx(math.log(exact), abs=1e-5)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "particles = 100\nreplicates = 2",
            "replicates: found 2; expected a whole number, at least 4",
        ),
        ("at_most = 1_000", "at_most: found 1_000; expected at least 1_600: 4 replicates of 200"),
        ('measured = ["lime"]', 'measured: found "lime"; expected a [measured.<name>]'),
        (
            "measured = []",
            'measured: found an empty list; expected different sections, as ["name"]: '
            "[measured.name]",
        ),
        (
            'measured = ["line", "line"]',
            'measured: found ["line", "line"]; expected different sections, as ["name"]: '
            "[measured.name]",
        ),
    ],
)
def test_a_mistake_is_told_before_any_run(tmp_path, setting, message):
    key = setting.partition(" =")[0]
    kept = [each for each in SAMPLED.splitlines() if not each.startswith(key)]
    text = "\n".join([POSTERIOR.removesuffix(SAMPLED), *kept, setting, ""])
    (tmp_path / "line.py").write_text(MODEL)
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(text, folder=tmp_path)
    assert any(message in str(each) for each in caught.value.problems)


def test_too_few_particles_for_what_varies_are_refused(tmp_path):
    text = POSTERIOR.replace(
        'unknown = ["a", "b"]', 'unknown = ["a"]\nvaries = ["b"]\nexperiment = "n"'
    )
    text = text.replace("particles = 200", "particles = 100")
    rows = [*range(6)]
    text = text.replace("x = [0, 1, 2, 3]", f"n = {rows}\nx = {[0] * 6}")
    text = text.replace("y = [1.1, 2.9, 5.2, 6.8]", f"y = {rows}")
    (tmp_path / "line.py").write_text(MODEL)
    with pytest.raises(StudyError, match="at least 140, 20 for each of 7 unknowns"):
        uqpen.parse_study(text, folder=tmp_path)


def test_the_page_says_what_a_posterior_says(line, tmp_path):
    ((_, text),) = posterior_statements(line)
    assert re.search(r"^The measurements of line leave a = 1\.\d+ .*, b = 1\.\d+ ", text)
    assert " sampled well" in text
    model = "def line(a, b):\n    return {'y': [float('nan') if b % 1 > 0.9 else a] * 5}\n"
    ((_, text),) = posterior_statements(calibrated(tmp_path, POSTERIOR, model))
    assert re.search(r"^\d+% of the draws around the posterior failed, and are left out", text)
    assert "They say nothing on b." in text


def test_experiments_whose_runs_fail_are_named(tmp_path):
    text = POSTERIOR.replace('unknown = ["a", "b"]', 'conditions = ["b"]\nunknown = ["a"]')
    text = text.replace("x = [0, 1, 2, 3]", "b = [1, 2, 3, 4]\nx = [0, 0, 0, 0]")
    fails = "float('nan') if b == 3 and a % 0.1 < 0.03 else a"
    model = f"def line(a, b):\n    return {{'y': [{fails}] * 5}}\n"
    tree = calibrated(tmp_path, text.replace("std = 0.2", "std = 2"), model)
    shares = tree["calibrations/fit/experiment_failed_share"].values
    assert shares == pytest.approx([0, 0, 0.3, 0], abs=0.05)
    ((_, text),) = posterior_statements(tree)
    assert re.search(r"Failed runs are mostly of experiments 3 \(\d\d%\)\.", text)


def test_priors_may_depend_on_each_other(tmp_path):
    text = POSTERIOR.replace("[0, 1, 2, 3, 5]", "[0]").replace("x = [0, 1, 2, 3]", "x = [0]")
    text = text.replace("y = [1.1, 2.9, 5.2, 6.8]", "y = [10]").replace("std = 0.2", "std = 1")
    pair = 'pairs = [{ inputs = ["a", "b"], correlation = 0.8 }]'
    head = f'[dependence]\ncopula = "gaussian"\nof = "normal-scores"\n{pair}\n'
    model = "def line(a, b):\n    return {'y': [a]}\n"
    kept = calibrated(tmp_path, text.replace("[measured.line]", f"{head}[measured.line]", 1), model)
    kept = kept["calibrations/fit"]
    assert "log_prior" not in kept.children  # none has a density of its own beside the other's
    # Of two normal inputs, what is measured of one teaches the other by their correlation.
    weight = 100 / 101
    std = 10 * np.sqrt(1 - np.array([1, 0.64]) * weight)
    # Of 800 draws at least 400 are effective.
    off = kept["posterior_mean"].values[:, 0] - np.array([10, 8]) * weight
    assert np.all(np.abs(off) < 0.15 * std)
    assert kept["posterior_std"].values[:, 0] == pytest.approx(std, rel=0.12)


def test_measurements_of_nothing_unknown_are_refused(tmp_path):
    text = POSTERIOR.replace('unknown = ["a", "b"]', 'fixed = ["a", "b"]')
    (tmp_path / "line.py").write_text(MODEL)
    with pytest.raises(StudyError, match=r"found +nothing that is unknown"):
        uqpen.parse_study(text, folder=tmp_path)


def test_why_there_is_no_posterior_stands_in_its_place(tmp_path):
    tree = calibrated(tmp_path, POSTERIOR + "at_most = 3_000\n")
    ((_, text),) = posterior_statements(tree)
    assert text.startswith("No posterior: ")
    (table,) = [each for each in output_tables(tree) if each.title == "fit: posterior"]
    assert "raise at_most" in "".join(table.notes)


@pytest.mark.processor
def test_neither_interruptions_nor_workers_change_a_byte(tmp_path):
    design = """kind = "posterior"
measured = ["depths"]
particles = 100
[measured.depths]
unknown = ["a", "b"]
experiment = "shot"
[measured.depths.table]
shot = [1, 2, 3]
"depth [m]" = [0.5, 0.7, ""]
[measured.depths.depth]
std = { half-normal = "0.3 m" }
"""
    check_interruptions_and_workers(tmp_path, design, [2, 4])


MACHINE = """seed = 1
[model]
python = "machine.py:machine"
vectorized = true
inputs = { x = "1", theta = "1" }
outputs = { work = "1" }
[inputs]
x = 1
theta = "0.6 ± 0.3"
[measured.rows]
file = "rows.csv"
conditions = ["x"]
unknown = ["theta"]
[measured.rows.work]
std = 0.01
[measured.rows.work.discrepancy]
along = "x"
std = { half-normal = 0.3 }
length = { half-normal = 3 }
[designs.with]
kind = "posterior"
measured = ["rows"]
particles = 150
[designs.without]
kind = "posterior"
measured = ["rows"]
particles = 100
discrepancy = false
"""


@pytest.fixture(scope="module")
def machine(tmp_path_factory):
    """A model that lacks a term, and what was measured."""
    folder = tmp_path_factory.mktemp("machine")
    (folder / "machine.py").write_text("def machine(x, theta):\n    return {'work': theta * x}\n")
    effort = discrepancy.EFFORT
    noise = 0.01 * np.random.default_rng(0).standard_normal(len(effort))
    measured = discrepancy.truth(effort) + noise
    rows = "".join(
        f"{x!r},{y!r}\n" for x, y in zip(effort.tolist(), measured.tolist(), strict=True)
    )
    blanks = "".join(f"{x},\n" for x in discrepancy.WHERE)
    (folder / "rows.csv").write_text(f"x,work\n{rows}{blanks}")
    return measured, uqpen.run(uqpen.parse_study(MACHINE, folder=folder))


def test_an_error_of_the_model_itself_has_its_exact_posterior(machine):
    measured, tree = machine
    weights, means, deviations = discrepancy.posterior(measured, discrepancy.SITUATIONS["process"])
    mean = weights @ means[:, 0]
    std = np.sqrt(weights @ (deviations[:, 0] ** 2 + means[:, 0] ** 2) - mean**2)
    found = tree["calibrations/with"]
    assert found["unknown_input"].values.tolist() == [
        *("theta", "discrepancy of work"),
        "length of the discrepancy of work",
    ]
    # Four replicates of 150 draws; the grid is off by less.
    assert found["posterior_mean"].values[0, 0] == pytest.approx(mean, abs=0.2 * std)
    assert found["posterior_std"].values[0, 0] == pytest.approx(std, rel=0.2)
    # The model alone is sure of a wrong value, and predictions with its error are right.
    alone = tree["calibrations/without"]
    assert alone["posterior_std"].values[0, 0] < 0.1 * std
    predicted = tree["calibrations/with/posterior_predictive"]["work"].values.reshape(-1, 11)
    assert np.abs(predicted.mean(axis=0) - discrepancy.truth(discrepancy.EFFORT)).max() < 0.02
    assert predicted.std(axis=0) == pytest.approx(np.full(11, 0.013), rel=0.3)


def test_blank_rows_are_predicted_with_the_error_of_the_model(machine):
    measured, tree = machine
    weights, means, _ = discrepancy.posterior(measured, discrepancy.SITUATIONS["process"])
    found = tree["calibrations/with"]["prediction"]
    assert tree["calibrations/with"]["prediction_row"].values.tolist() == [12, 13, 14, 15]
    # In standard deviations of 600 draws; the grid is off by less.
    assert found.values[:, 0] == pytest.approx(weights @ means[:, 1:], abs=0.05)
    assert found.values[0] == pytest.approx([1.744, 1.733, 1.755], abs=0.002)
    # Outside of 0.2 to 4, nothing is known of the model's own error.
    assert np.isnan(found.values[1:, 1:]).all()
    # The model alone is sure there, and wrong.
    alone = tree["calibrations/without"]["prediction"].values
    assert (alone[1:, 1] > discrepancy.truth(np.array(discrepancy.WHERE))[1:]).all()
    (table,) = (each for each in output_tables(tree) if each.title == "with: predictions")
    assert [title for title, _ in table.rows][:2] == ["work, row 12, x 3.1", "work, row 13, x 5"]
    reason = "outside of the measured range of x nothing is known of the model's own error"
    assert table.notes == [reason]
    # Their runs are those of draws of the posterior, and of no others.
    runs = tree["runs/with"]
    blank = runs["experiment"].values >= 11
    assert 0.8 * 600 * 4 < blank.sum() <= 600 * 4
    kept = tree["calibrations/with/sample_stats"]["draw_number"].values
    assert set(runs["draw"].values[blank]).isdisjoint(runs["draw"].values[~blank])
    assert set(runs["parent_draw"].values[blank]) == set(kept.ravel())
    assert (runs["least_log_likelihood"].values[blank] == -np.inf).all()  # each is kept


REPEATS = """seed = 1
[model]
python = "same.py:same"
vectorized = true
inputs = { a = "1" }
outputs = { y = "1" }
[inputs]
a = { uniform = { lower = 0, upper = 10 } }
[measured.rows]
unknown = ["a"]
[measured.rows.table]
y = [4.1, 5.0, 3.7, 4.6, 5.3, 4.4, 4.9]
[measured.rows.y]
std = "repeats"
[designs.fit]
kind = "posterior"
measured = ["rows"]
particles = 200
"""


def test_with_a_size_by_repeats_other_programs_see_students_t(tmp_path):
    (tmp_path / "same.py").write_text("def same(a):\n    return {'y': a + 0}\n")
    kept = uqpen.run(uqpen.parse_study(REPEATS, folder=tmp_path))["calibrations/fit"]
    y, rows = np.array([4.1, 5.0, 3.7, 4.6, 5.3, 4.4, 4.9]), 7
    # Given a draw, and with a flat prior of the logarithm of the size, it is t by the residuals.
    off = y - kept["posterior"]["a"].values[..., np.newaxis]
    scale = np.sqrt((off**2).mean(axis=-1, keepdims=True))
    simulated = kept["posterior_predictive"]["y"].values
    t = (simulated - kept["posterior"]["a"].values[..., np.newaxis]) / scale
    # One value of each of 800 draws is independent of the others.
    assert stats.kstest(t[..., 0].ravel(), stats.t(rows).cdf).pvalue > 0.01
    # Three standard errors; it is 1 for normal errors.
    assert (t[..., 0] ** 2).mean() == pytest.approx(rows / (rows - 2), abs=0.3)
    # Each row, given all others, is t about their mean.
    density = -np.log(np.exp(-kept["log_likelihood"]["y"].values).mean(axis=(0, 1)))
    for row in range(rows):
        others = np.delete(y, row)
        width = others.std(ddof=1) * np.sqrt(1 + 1 / (rows - 1))
        exact = stats.t(rows - 2, others.mean(), width).logpdf(y[row])
        # The weights of 800 draws scatter by less.
        assert density[row] == pytest.approx(exact, abs=0.15)
    # Before any data, the size is what the repeats say of it: six degrees of freedom.
    simulated = kept["prior_predictive"]["y"].values - kept["prior"]["a"].values[..., np.newaxis]
    t = simulated[..., 0].ravel() / y.std(ddof=1)
    assert stats.kstest(t, stats.t(6).cdf).pvalue > 0.01


HELD_OUT = """seed = 1
[model]
python = "line.py:line"
vectorized = true
inputs = { x = "1", a = "1", b = "1" }
outputs = { y = "1" }
[inputs]
x = 0
a = { normal = { mean = 0, std = 10 } }
b = { normal = { mean = 0, std = 10 } }
[measured.line]
conditions = ["x"]
unknown = ["a", "b"]
hold_out = [2, 6]
[measured.line.table]
x = [0, 1.5, 1, 2, 3, 5, 6]
y = [1.1, 4.0, 2.9, 5.2, 6.8, 15.7, ""]
[measured.line.y]
std = { half-normal = 0.3 }
[validation.line]
accept = { y = 1 }
[designs.fit]
kind = "posterior"
measured = ["line"]
particles = 100
[designs.whole]
kind = "monte-carlo"
runs = 20
at = "line"
"""


def test_rows_that_are_held_out_teach_nothing_and_are_judged_as_fresh_ones(tmp_path, monkeypatch):
    (tmp_path / "line.py").write_text("def line(x, a, b):\n    return {'y': a + b * x}\n")
    tree = uqpen.run(uqpen.parse_study(HELD_OUT, folder=tmp_path))
    blank = HELD_OUT.replace("hold_out = [2, 6]\n", "").replace("4.0,", '"",').replace("15.7", '""')
    alone = uqpen.run(uqpen.parse_study(blank, folder=tmp_path))
    for name in ("posterior_mean", "prediction", "row_hash"):
        found = tree["calibrations/fit"][name]
        assert (found.values == alone["calibrations/fit"][name].values).all()
    assert "fit" not in alone["validation"]
    judged, draws = tree["validation/fit/y"], tree["calibrations/fit/posterior"]
    assert judged["file_row"].values.tolist() == [2, 6]
    assert judged["experiment_number"].values.tolist() == [5, 6]  # behind those that are fitted
    assert not judged["used_before"].values.any()
    means = tree["calibrations/fit"]["prediction"].values[:2, 0]
    assert judged["comparison_error"].values[:, 0] == pytest.approx(means - [4.0, 15.7])
    # Their errors have the size that the posterior knows.
    size = np.sqrt((draws["std of y"].values ** 2).mean())
    assert judged["measured_std"].values == pytest.approx([size, size])
    assert judged["row_verdict"].values.tolist() == ["met", "not met"]
    assert tree["validation/whole/y"].sizes["measured_row"] == 6
    view = select_view(tree, None, None, None)
    titles = [charts.charts[0].title for charts in measurement_charts(view)]
    compared = "measured against predicted"
    assert titles == [f"held out: {compared}", compared, compared]
    first, *_ = validation_tables(tree)
    assert first.title == "y at values held out of fit"
    assert [label for label, _ in first.rows] == ["row 2, x 1.5", "row 6, x 5"]
    monkeypatch.setattr("uqpen.results.validations._MOST_ROWS", 1)
    first, *_ = validation_tables(tree)
    assert (first.title[-2:], len(first.rows)) == (" ³", 1)
    assert first.notes[2] == "the archive and JSON have 1 more row"
    headings = [each.text for each in measurements(view) if isinstance(each, Heading)]
    assert len({*headings}) == len(headings)


def test_predictions_stand_beside_what_was_measured(machine):
    _, tree = machine
    of_with, _ = measurement_charts(select_view(tree, None, None, None))
    (chart,) = (each for each in of_with.charts if each.title == "predictions against x")
    measured, predicted = chart.marks
    assert (len(measured.bounds), measured.marker) == (11, "circle")
    assert (predicted.bounds.shape, predicted.marker) == ((4, 3), "square")
    assert predicted.places.tolist() == list(discrepancy.WHERE)
    assert predicted.hovers[0].startswith("row 12, x 3.1: predicted 1.7")
    names = ["measured", "predicted", "predicted, no interval"]  # outside of what was measured
    assert [each.text for each in chart.keys] == names


def test_a_process_that_grows_from_0_is_predicted_outside_of_the_measurements():
    known = UnknownSize("", 1.0, "1", "")
    places, beyond = np.array([1.0, 2.0, 3.0]), np.array([0.0, 2.5, 9.0])
    of = Discrepancy("x", places, known, known, zero_at=0.0)
    nothing, rows = np.zeros(3), np.arange(3)

    def section(x, std, blank=None):
        errors = MeasurementErrors(nothing + std, nothing, discrepancy=replace(of, places=x))
        made = MeasuredOutput(Output("y", "1"), rows, {}, nothing, rows * 0, rows + 1, errors)
        return MeasuredOutputs("m", (), (), (), {"x": x}, {}, (made,), 3, blank=blank)

    measured = Experiments((section(places, 0.1, section(beyond, 0.0)),))
    off, sizes = np.array([0.3, 0.7, 0.8]), np.array([0.5, 2.0])
    covariance = measured.errors.covariance(nothing, sizes)
    mean, variance = measured.errors.discrepancies(measured.blank.errors, off, covariance, sizes)
    # The process by x / 2 has the standard deviation 0.5 everywhere, and is seen as 2 off / x.
    both = np.concatenate([places, beyond])
    whole = 0.25 * np.exp(-0.125 * np.subtract.outer(both, both) ** 2)
    weights = whole[3:, :3] @ np.linalg.inv(whole[:3, :3] + np.diag((0.2 / places) ** 2))
    assert mean == pytest.approx(weights @ (2 * off / places) * beyond / 2)
    exact = np.diag(whole[3:, 3:] - weights @ whole[:3, 3:])
    assert variance == pytest.approx(exact * (beyond / 2) ** 2)


def test_the_answer_says_what_hangs_on_an_error_of_the_model(machine):
    _, tree = machine
    statements = dict(posterior_statements(tree))
    assert (
        "Without it (without), theta would be elsewhere by more than a standard deviation: these "
        "values make this model fit; they are no material data." in statements["with"]
    )
    assert "error of its own" not in statements["without"]
    rows = dict(next(t for t in output_tables(tree) if t.title == "with: posterior").rows)
    assert "length of the discrepancy of work" in rows


@given(
    st.floats(0.1, 10), st.floats(0.1, 10), st.none() | st.floats(-3, 3), st.integers(0, 2**32 - 1)
)
def test_the_covariance_of_an_error_of_the_model_is_one(std, length, zero_at, seed):
    places = np.random.default_rng(seed).uniform(-3, 3, 6)
    number = UnknownSize("", 1.0, "1", "")
    of = Discrepancy("x", places, number, number, zero_at)
    kernel = of.kernel(places, places, np.array(std), np.array(length))
    assert kernel == pytest.approx(kernel.T)
    assert np.linalg.eigvalsh(kernel).min() > -1e-9 * np.diag(kernel).max()
    lengths = 1.0 if zero_at is None else np.abs(places - zero_at) / length
    assert np.sqrt(np.diag(kernel)) == pytest.approx(std * lengths)
