"""Posteriors of dear models: exact ones, the likelihood of a surrogate, weights, interruption."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from interrupted_study import check_interruptions_and_workers
from scipy import stats

import uqpen
from tests.test_measurements import LINE, MODEL, measured
from uqpen.archive.structure import find_faults
from uqpen.core.errors import StudyError
from uqpen.core.progress import Progress
from uqpen.core.streams import Stream
from uqpen.designs.posterior import PriorCoordinates
from uqpen.results.calibrations import posterior_statements
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics.weighted_posterior import WeightedPosterior
from uqpen.surrogates.surrogate_posterior import (
    RESULT,
    RowsSurrogate,
    draw_posterior,
    importance_weights,
)

# The likelihood by a surrogate.


def curve(points):
    """Return results that no plane fits, at the four rows of the line."""
    a, b = points.T[:, :, np.newaxis]
    return a + b * np.arange(4.0) + 0.3 * a * b + np.sin(a) * [0, 1, 0, 2]


@pytest.fixture
def surrogate(tmp_path):
    text = LINE.replace("std = 0.2\n", "std = 0.2\nshared = { std = 0.3 }\n")
    points = np.random.default_rng(1).standard_normal((25, 2))
    return fitted(measured(tmp_path, text), points, curve(points))


def fitted(measured, points, results):
    """Return the surrogate of some runs; coordinates stand for the inputs themselves."""
    return RowsSurrogate.fit(PriorCoordinates(None, measured), points, results, Stream(1, "test"))


def test_the_variance_is_added_with_the_covariance_between_rows(surrogate):
    surrogate = replace(surrogate, variance_scale=4.0)
    points = 2 * np.random.default_rng(2).standard_normal((6, 2))
    (part,) = surrogate.parts
    whitened, variances = part.predict(points)
    shapes, root = part.components.components, part.root
    errors = surrogate.measured.errors.covariance(surrogate.measured.values)
    exact = []
    for mean, own in zip(whitened, variances, strict=True):
        added = shapes.T @ np.diag(own) @ shapes + np.diag(part.components.truncated)
        whole = errors + 4.0 * root @ added @ root.T
        exact.append(stats.multivariate_normal(root @ mean, whole).logpdf(np.zeros(4)))
    none = np.empty((6, 0))
    assert surrogate.log_likelihood(points, none) == pytest.approx(exact, rel=1e-9)


def test_an_unknown_size_of_errors_has_the_same_likelihood(surrogate, tmp_path):
    points = np.random.default_rng(2).standard_normal((6, 2))
    text = LINE.replace("std = 0.2\n", "std = { half-normal = 0.2 }\nshared = { std = 0.3 }\n")
    of_size = replace(surrogate, measured=measured(tmp_path, text))
    found = of_size.log_likelihood(points, np.full((6, 1), 0.2))
    assert found == pytest.approx(surrogate.log_likelihood(points, np.empty((6, 0))), rel=1e-9)


class Needle:
    """Likelihood of a narrow peak with 99 % of the posterior, on a plain that is wide."""

    def log_likelihood(self, points, sizes):
        squares = ((points - [0.8, -1.0, -0.7]) ** 2).sum(axis=1) / 0.06**2
        return np.logaddexp(0.0, 14 - squares / 2)


@pytest.mark.parametrize("seed", [1, 5, 6])  # a single replicate has 3, 70 and 7 % there
def test_draws_of_the_result_are_where_a_narrow_peak_is(seed):
    prior = SimpleNamespace(dimension=3, error_stds=lambda points: np.empty((len(points), 0)))
    _, found = draw_posterior(Needle(), prior, RESULT, 60, Stream(seed, "t"))
    assert (found > 1).mean() > 0.85


def test_z_scores_are_errors_in_standard_deviations_whatever_the_factor(surrogate):
    points = np.random.default_rng(3).standard_normal((5, 2))
    (part,) = surrogate.parts
    whitened, variances = part.predict(points)
    off = np.sqrt(variances) @ part.components.components
    left = np.sqrt(part.components.truncated)
    assert left.sum() < 0.1 * np.abs(off).sum()
    results = part.results(whitened + 3 * off)
    results[1, 2] = np.nan  # failed in one experiment
    found = replace(surrogate, variance_scale=7.0).z_scores(points, results)
    assert len(found) == 4
    assert found == pytest.approx(4 * [3.0], rel=0.01)  # but for the components left out


def test_results_that_are_all_alike_have_no_surrogate(surrogate):
    points = np.random.default_rng(1).standard_normal((25, 2))
    assert fitted(surrogate.measured, points, np.ones((25, 4))) is None


VARIES = LINE.replace('unknown = ["a", "b"]', 'unknown = ["a"]\nvaries = ["b"]\nexperiment = "n"')
VARIES = VARIES.replace("x = [0, 1, 2, 3]", "n = [1, 2, 2, 3]\nx = [1, 0, 1, 1]")


def test_experiments_with_inputs_of_their_own_have_errors_of_their_own(tmp_path):
    # All rows have an error in common, so the parts are not independent of each other.
    text = VARIES.replace("std = 0.2\n", "std = 0.2\nshared = { std = 0.3 }\n")
    points = np.random.default_rng(1).standard_normal((60, 4))
    a, b = points[:, :1], points[:, [1, 2, 2, 3]]
    results = np.sin(a) + a * b * [1, 0, 1, 1]
    results[7, 0] = np.nan  # of one experiment; the others of this draw are taken
    surrogate = fitted(measured(tmp_path, text), points, results)
    assert [part.rows.tolist() for part in surrogate.parts] == [[0], [1, 2], [3]]
    assert [part.coordinates.tolist() for part in surrogate.parts] == [[0, 1], [0, 2], [0, 3]]
    assert [len(part.fits[0].points) for part in surrogate.parts] == [59, 60, 60]
    drawn = np.random.default_rng(2).standard_normal((5, 4))
    middle, whole = np.empty((5, 4)), np.empty((5, 4, 4))
    whole[:] = surrogate.measured.errors.covariance(surrogate.measured.values)
    for part in surrogate.parts:
        whitened, variances = part.predict(drawn)
        shapes = part.components.components
        middle[:, part.rows] = part.results(whitened)
        for draw, own in enumerate(variances):
            added = shapes.T @ np.diag(own) @ shapes + np.diag(part.components.truncated)
            whole[draw][np.ix_(part.rows, part.rows)] += part.root @ added @ part.root.T
    both = zip(middle, whole, strict=True)
    exact = [stats.multivariate_normal(*each).logpdf([1.1, 2.9, 5.2, 6.8]) for each in both]
    assert surrogate.log_likelihood(drawn, np.empty((5, 0))) == pytest.approx(exact, rel=1e-9)


# Weighted draws.


def test_failed_runs_have_the_weight_0():
    log_likelihood = np.array([-1.0, np.nan, -3.0])
    found = importance_weights(log_likelihood, np.array([-2.0, 5.0, -3.0]))
    assert found == pytest.approx([np.e / (np.e + 1), 0.0, 1 / (np.e + 1)])
    assert not importance_weights(np.full(2, np.nan), np.zeros(2)).any()


def drawn(values, log_ratio):
    values = np.array(values)[:, np.newaxis]
    return WeightedPosterior(("x",), values, np.array(log_ratio), np.zeros(len(values)))


def test_ends_are_at_ranks_times_n_over_one_more():
    found = drawn(np.arange(1.0, 20.0), np.zeros(19))
    for rank in (1, 10, 19):
        assert found.quantile(rank / 20) == pytest.approx([rank])


def test_weights_by_the_model_are_the_result_where_a_third_is_effective():
    confirmed = drawn([0.0, 1.0, 5.0, 9.0], np.log([1.0, 3.0, 1e-9, 1e-9]))
    assert confirmed.effective_draws == pytest.approx(16 / 10)
    assert confirmed.mean.value == pytest.approx([0.75])
    assert confirmed.note == ""
    refused = drawn([0.0, 1.0, 5.0, 9.0], np.log([1.0, 1e-9, 1e-9, 1e-9]))
    assert refused.mean.value == pytest.approx([3.75])
    assert refused.note == (
        "not confirmed by the model: 1 of 4 weighted draws are effective, so it is the posterior "
        "by the surrogate"
    )
    assert confirmed.of_surrogate().mean.value == pytest.approx([3.75])


# Studies.

SEARCHED = """[designs.fit]
kind = "posterior-by-surrogate"
measured = ["line"]
"""
POSTERIOR = LINE.partition("[designs.fit]")[0] + SEARCHED


def calibrated(folder, text, model=MODEL):
    """Return the archive of a study."""
    (folder / "line.py").write_text(model)
    tree = uqpen.run(uqpen.parse_study(text, folder=folder))
    assert list(find_faults(tree)) == []
    return tree


def note_of(tree):
    """Return the note of the first mean."""
    found = SourceStatistics(tree).of_runs("calibrations", "fit")
    return str(found["posterior_mean"]["note"].values[0])


def test_a_line_has_its_exact_posterior(tmp_path):
    tree = calibrated(tmp_path, POSTERIOR)
    kept = tree["calibrations/fit"]
    exact = np.array([1.0899276173, 1.9399755933]), np.array([0.1673042830, 0.0894310946])
    # Of 60 independent draws: 3 standard errors.
    off = np.abs(kept["posterior_mean"].values[:, 0] - exact[0]) / exact[1]
    assert np.all(off < 3 / np.sqrt(60))
    assert kept["posterior_std"].values[:, 0] == pytest.approx(exact[1], rel=3 / np.sqrt(120))
    assert kept["effective_number"] == pytest.approx(60, abs=0.1)
    assert kept["surrogate_mean"].values == pytest.approx(kept["posterior_mean"].values, abs=1e-3)
    # A plane is known after the first batch.
    assert np.unique(tree["runs/fit"]["search_round"]).tolist() == [-1, 0, 1]
    assert tree["runs/fit"].sizes["run"] == 120
    assert dict(posterior_statements(tree))["fit"].endswith(
        "Runs of the model confirm it: 60 of their weighted draws are effective."
    )
    assert archive_json(tree)["designs"]["fit"]["calibrations"]["confirmed"] == 1.0
    (table,) = [each for each in output_tables(tree) if each.title == "fit: posterior"]
    assert "by the surrogate" in table.columns


# Few draws, so that a search takes a second.
SHORT = "runs = 20\nbatches = 1\nbatch = 5\nconfirm = 30\n"


def test_draws_for_other_programs_have_equal_weights_and_are_distinct(tmp_path):
    model = MODEL.replace("a + b * x", "a + b * x + 0.04 * ((1e6 * a) % 1)")
    kept = calibrated(tmp_path, POSTERIOR + SHORT, model)["calibrations/fit"]
    groups = ["weighted_posterior", "posterior", "posterior_predictive", "log_likelihood", "prior"]
    groups += ["prior_predictive", "log_prior", "observed_data", "constant_data", "sample_stats"]
    assert [*kept.children] == groups
    weighted = kept["weighted_posterior"]
    weights = weighted["importance_weight"].values.ravel()
    assert weights.sum() == pytest.approx(1)
    assert 1 / (weights**2).sum() == pytest.approx(float(kept["effective_number"]))
    for name, mean in zip("ab", kept["posterior_mean"].values[:, 0], strict=True):
        assert weights @ weighted[name].values.ravel() == pytest.approx(mean, rel=1e-12)
    # Fewer than are effective, so that who counts them counts not too many.
    numbers = kept["sample_stats/draw_number"].values.ravel().tolist()
    assert len({*numbers}) == len(numbers) == int(1 / weights.max())
    assert len(numbers) < kept["effective_number"] < 30
    assert {*numbers} <= {*weighted["draw_number"].values.ravel().tolist()}
    rows, whole = kept["log_likelihood/y"], kept["sample_stats/log_likelihood"]
    assert rows.sum("y_row").values == pytest.approx(whole.values)
    assert kept["prior/a"].shape == (1, 20)


def test_what_a_surrogate_cannot_predict_is_not_confirmed(tmp_path):
    model = (
        "def line(a, b):\n    wild = 5 * ((1e6 * a) % 1)\n"
        "    return {'y': [a + b * x + wild for x in (0, 1, 2, 3, 5)]}\n"
    )
    tree = calibrated(tmp_path, POSTERIOR + SHORT, model)
    kept = tree["calibrations/fit"]
    assert kept["confirmed"] == 0.0
    assert np.array_equal(kept["posterior_mean"], kept["surrogate_mean"])
    assert not kept.children  # other programs would not see the note
    assert "not confirmed by the model" in note_of(tree)
    assert "Not confirmed by the model" in dict(posterior_statements(tree))["fit"]


def test_failed_runs_are_left_out_and_their_share_is_said(tmp_path):
    model = MODEL.replace(
        "    return", "    if a > 1.2:\n        raise ValueError('too high')\n    return"
    )
    tree = calibrated(tmp_path, POSTERIOR + SHORT, model)
    kept = tree["calibrations/fit"]
    # The exact posterior up to 1.2, where a is 1.09 ± 0.167: a quarter is cut off.
    assert kept["posterior_failed_share"] == pytest.approx(0.255, abs=3 * np.sqrt(0.19 / 30))
    assert kept["prior_failed_share"] == pytest.approx(0.45, abs=0.15)
    assert kept["posterior_quantile"].values[0, :, 0].max() < 1.2
    note = note_of(tree)
    assert "of the draws around the posterior failed, and are left out of it" in note


def test_too_few_completed_runs_give_no_posterior(tmp_path):
    model = MODEL.replace(
        "    return", "    if a > -8:\n        raise ValueError('no')\n    return"
    )
    tree = calibrated(tmp_path, POSTERIOR + SHORT + "[failures]\nat_most = 1.0\n", model)
    note = note_of(tree)
    assert note == (
        "no posterior: after 20 draws no surrogate could be fitted and sampled; 25% of those of "
        "the prior completed"
    )
    assert {"fit: posterior"} <= {table.title for table in output_tables(tree)}


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("runs = 15", "runs: found 15; expected at least 16, 8 for each of 2 inputs that are"),
        ("confirm = 20", "confirm: found 20; expected a whole number, at least 30"),
        ("at_most = 100", "at_most"),
    ],
)
def test_a_mistake_is_told_before_any_run(tmp_path, setting, message):
    (tmp_path / "line.py").write_text(MODEL)
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(POSTERIOR + setting, folder=tmp_path)
    assert any(message in str(each) for each in caught.value.problems)


@pytest.mark.parametrize(
    ("of_b", "std"),
    [
        ('varies = ["b"]\nexperiment = "n"', 2.0),
        ('conditions = { b = "0.5" }', 0.5),
    ],
    ids=["varies", "condition"],
)
def test_what_is_new_in_each_experiment_is_drawn_with_the_unknown_inputs(tmp_path, of_b, std):
    text = POSTERIOR.replace("[0, 1, 2, 3, 5]", "[0]").replace("std = 0.2", "std = 0.3")
    text = text.replace('unknown = ["a", "b"]', f'unknown = ["a"]\n{of_b}')
    text = text.replace("b = { normal = { mean = 0, std = 10 } }", 'b = "0 ± 2"')
    column = "n = [1, 2, 3, 4]" if "varies" in of_b else "b = [1, 2, 3, 4]"
    text = text.replace("x = [0, 1, 2, 3]", f"{column}\nx = [0, 0, 0, 0]")
    tree = calibrated(tmp_path, text, "def line(a, b):\n    return {'y': [a + b]}\n")
    kept = tree["calibrations/fit"]
    conditions = np.zeros(4) if "varies" in of_b else np.arange(1.0, 5.0)
    # Each measurement has the variance std² + 0.3² about a.
    variance = 1 / (1 / 100 + 4 / (std**2 + 0.09))
    mean = variance * np.sum([1.1, 2.9, 5.2, 6.8] - conditions) / (std**2 + 0.09)
    # Of 60 independent draws: 3 standard errors.
    off = abs(kept["posterior_mean"].values[0, 0] - mean)
    assert off < 3 * np.sqrt(variance / 60)
    assert kept["posterior_std"].values[0, 0] == pytest.approx(np.sqrt(variance), rel=0.28)
    assert kept["effective_number"] == pytest.approx(60, abs=1)
    b = tree["runs/fit"]["b"].values.reshape(-1, 4)
    assert np.unique(b[0]).size == 4


def test_what_a_surrogate_has_too_many_of_or_cannot_have_is_refused(tmp_path):
    def refusal(text):
        (tmp_path / "line.py").write_text(MODEL)
        with pytest.raises(StudyError) as caught:
            uqpen.parse_study(text, folder=tmp_path)
        return [" ".join(str(each).split()) for each in caught.value.problems]

    varies = VARIES.partition("[designs.fit]")[0] + SEARCHED
    few = refusal(varies + "runs = 15\n")
    assert any(
        "at least 16, 8 for each of 2 inputs that are unknown or vary" in each for each in few
    )
    rows = [*range(50)]
    many = varies.replace("n = [1, 2, 2, 3]\nx = [1, 0, 1, 1]", f"n = {rows}\nx = {[1] * 50}")
    many = refusal(many.replace("y = [1.1, 2.9, 5.2, 6.8]", f"y = {rows}"))
    assert any("51 unknowns: inputs, and each value of what varies" in each for each in many)
    single = varies.replace(
        "b = { normal = { mean = 0, std = 10 } }", "b = { poisson = { mean = 3 } }"
    )
    (found,) = refusal(single)
    assert "steps of b, which has single values" in found
    assert 'kind = "posterior"; or a study of each value' in found


def test_a_discrepancy_is_refused(tmp_path):
    prior = "{ half-normal = 1 }"
    discrepancy = f'discrepancy = {{ along = "x", std = {prior}, length = {prior} }}'
    (tmp_path / "line.py").write_text(MODEL)
    with pytest.raises(StudyError, match="a discrepancy, which no surrogate is certified beside"):
        uqpen.parse_study(
            POSTERIOR.replace("std = 0.2", f"std = 0.2\n{discrepancy}"), folder=tmp_path
        )


@pytest.mark.processor
def test_neither_interruptions_nor_workers_change_a_byte(tmp_path):
    design = f"""kind = "posterior-by-surrogate"
measured = ["depths"]
{SHORT}[measured.depths]
unknown = ["a", "b"]
[measured.depths.table]
"depth [m]" = [0.5]
[measured.depths.depth]
std = "0.3 m"
"""
    check_interruptions_and_workers(tmp_path, design, [2, 3])


def test_runs_of_an_earlier_archive_change_no_byte(tmp_path):
    def archive(name, confirm, **options):
        study = uqpen.parse_study(
            POSTERIOR + SHORT.replace("confirm = 30", f"confirm = {confirm}"), folder=tmp_path
        )
        uqpen.make_archive(study, tmp_path / name, **options)
        return (tmp_path / name).read_bytes()

    (tmp_path / "line.py").write_text(MODEL)
    archive("few.nc", 30)
    afresh = archive("many.nc", 40)
    # The search is the same: of its 65 runs the earlier archive has all but those of ten draws.
    counts = Counts()
    assert archive("again.nc", 40, reuse=[tmp_path / "few.nc"], progress=counts) == afresh
    assert counts.reused == 55


class Counts(Progress):
    """Counts the runs that are taken again."""

    reused = 0

    def count_reused(self, runs, place):
        self.reused += runs
