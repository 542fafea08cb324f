"""Surrogates of a model with noise whose points are run several times."""

import numpy as np
import pytest
from corrected_surrogates import corrected_by, made
from scipy.optimize import check_grad

import uqpen
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.errors import StudyError
from uqpen.core.labels import RUN, STATUS
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.repeated import RepeatedDesign
from uqpen.distributions.univariate import Uniform
from uqpen.execution import first_repeats, mean_repeats, repeats_of
from uqpen.results.source_statistics import SourceStatistics
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.fitting import cross_fit
from uqpen.surrogates.gaussian_process import GaussianProcess
from uqpen.surrogates.gaussian_process_fit import (
    GaussianProcessFit,
    Parameters,
    ProcessData,
    RepeatedProcessFit,
    StandardisedInputs,
    negative_log_likelihood,
)

UNIFORM = [Uniform(0.0, 1.0)] * 2


def mean(points):
    return np.sin(5 * points[:, 0]) + points[:, 1] ** 2


def growing(points):
    return 0.1 + 0.9 * points[:, 0]


def even(points):
    return np.full(len(points), 0.5)


def process(deviation, points, repeats, *, seed, of_logarithm=False, **settings):
    """Return a fit to the runs of a model, and the generator of further ones."""
    rng = np.random.default_rng(seed)
    x = rng.random((points, 2))
    y = mean(x)[:, None] + deviation(x)[:, None] * rng.normal(size=(points, repeats))
    inputs = StandardisedInputs.of_runs(UNIFORM, x)
    values = np.exp(y) if of_logarithm else y
    fit = GaussianProcess(design="mc", **settings).fit_values(
        inputs, x, values, rng, is_logarithm=of_logarithm
    )
    assert isinstance(fit, RepeatedProcessFit)
    return fit, rng


def shares_held(deviation, points, repeats, *, seeds=6, **settings):
    """Return how often ± 1.96 deviations hold the mean, and runs in each third of an input."""
    found = []
    for seed in range(seeds):
        fit, rng = process(deviation, points, repeats, seed=seed, **settings)
        x = rng.random((2000, 2))
        predicted, runs = fit.predict(x), mean(x) + deviation(x) * rng.normal(size=2000)
        holds = np.abs(runs - predicted.mean) <= 1.96 * predicted.std
        thirds = [holds[np.floor(3 * x[:, 0]) == third].mean() for third in range(3)]
        of_mean = np.abs(mean(x) - predicted.mean) <= 1.96 * predicted.mean_std
        found.append([of_mean.mean(), *thirds])
    return np.mean(found, axis=0)


def test_of_noise_that_is_the_same_everywhere_both_deviations_hold_what_they_say():
    of_mean, *thirds = shares_held(even, 60, 4)
    # Over these seeds the standard error is 0.03 for the mean, and 0.007 for runs.
    assert 0.90 <= of_mean <= 0.98
    assert 0.93 <= min(thirds) <= max(thirds) <= 0.97


def test_varying_noise_holds_runs_at_each_place_where_one_variance_does_on_average():
    _, *thirds = shares_held(growing, 60, 4, noise="varying")
    assert 0.92 <= min(thirds) <= max(thirds) <= 0.97
    _, low, middle, high = shares_held(growing, 60, 4)
    assert low > 0.99
    assert high < 0.91
    assert 0.93 <= (low + middle + high) / 3 <= 0.97


def test_the_noise_of_a_run_is_that_of_its_repeats():
    fit, rng = process(even, 200, 4, seed=1)
    assert np.sqrt(fit.noise_variances(fit.points)) == pytest.approx(0.5, rel=0.1)
    # What a nugget means: the variance of the noise over that of the process.
    own = fit.scale * fit.std / fit.std_factor * np.sqrt(fit.nugget)
    assert own == pytest.approx(np.sqrt(fit.noise_variances(fit.points)[0]))
    assert fit.noise_of_means == pytest.approx(fit.nugget / 4)
    named = {each.name: each for each in fit.noise_diagnostics("m")}
    assert (named["noise_std"].value, named["noise_std"].units) == (pytest.approx(own), "m")
    # Of a run, whose variance has more noise in it than that of a mean.
    whole = fit.scale**2 + own**2 * 3 / 4
    assert named["noise_share"].value == pytest.approx(own**2 / whole)
    predicted = fit.predict(rng.random((100, 2)))
    variance = predicted.mean_std**2 + own**2
    assert predicted.std == pytest.approx(fit.std_factor * np.sqrt(variance))


def test_failed_runs_leave_points_of_unequal_noise():
    rng = np.random.default_rng(2)
    x = rng.random((80, 2))
    y = mean(x)[:, None] + 0.5 * rng.normal(size=(80, 4))
    y[::2, 2:] = np.nan
    fit = GaussianProcess(design="mc").fit_values(StandardisedInputs.of_runs(UNIFORM, x), x, y, rng)
    assert fit.noise_of_means[::2] == pytest.approx(2 * fit.noise_of_means[1::2])


@pytest.mark.parametrize("settings", [{}, {"noise": "varying"}, {"of_logarithm": True}])
def test_an_archive_keeps_the_noise(settings):
    fit, rng = process(growing, 40, 4, seed=3, **settings)
    again = GaussianProcessFit.from_dataset(fit.to_dataset())
    assert type(again) is RepeatedProcessFit
    x = rng.random((10, 2))
    for one, other in zip(*(vars(each.predict(x)).values() for each in (fit, again)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_noise_of_a_logarithm_is_a_factor():
    fit, rng = process(even, 100, 4, seed=4, of_logarithm=True)
    predicted = fit.predict(rng.random((50, 2)))
    spread = 0.5**2 * fit.std_factor**2
    relative = np.sqrt(np.expm1(spread) * np.exp(spread))
    assert predicted.std / predicted.mean == pytest.approx(relative, rel=0.2)
    assert (predicted.mean_std < 0.5 * predicted.std).all()


def test_runs_that_agree_have_no_logarithm_of_their_noise():
    rng = np.random.default_rng(5)
    x = rng.random((30, 2))
    y = np.round(mean(x)[:, None] + 0.2 * rng.normal(size=(30, 4)))
    inputs = StandardisedInputs.of_runs(UNIFORM, x)
    reason = GaussianProcess(design="mc", noise="varying").fit_values(inputs, x, y, rng)
    assert 'all runs agree, and noise = "varying" takes the logarithm' in reason


def test_the_likelihood_of_known_noise_has_its_gradient():
    rng = np.random.default_rng(6)
    data = ProcessData(
        points=rng.random((20, 2)),
        values=rng.normal(size=20),
        trend=np.ones((20, 1)),
        smoothness=2.5,
        noise=2 * rng.random(20),
        noise_level=0.3,
    )

    def of(logarithms):
        return negative_log_likelihood(
            data, Parameters(np.exp(logarithms[:2]), np.exp(logarithms[2]))
        )

    error = check_grad(lambda at: of(at)[0], lambda at: of(at)[1], np.array([-0.5, 0.3, -1.0]))
    assert error < 1e-4


# Points of a study: the light toy, whose shares are 0.25 and 0.5, and 0.25 of the noise.

TOY = "2 * np.sqrt(3) * a + 2 * np.sqrt(22.5) * (b - 0.5) ** 2 * 2"
WHOLE, OF_MEAN = np.array([0.25, 0.5, 0.0]), np.array([1 / 3, 2 / 3, 0.0])
CHAOS = PolynomialChaos(design="mc", order=3)


@pytest.fixture
def toy(study_of):
    return study_of(TOY, a=(0, 1), b=(0, 1), c=(0, 1))


def noisy_runs(study, points, repeats, seed=0):
    runs = made(study, RepeatedDesign(MonteCarlo(runs=points), repeats))
    noise = np.random.default_rng(seed).normal(size=points * repeats)
    return runs.assign(y=runs.y + noise)


def test_a_point_is_the_mean_of_its_completed_runs(toy):
    runs = noisy_runs(toy, 6, 3)
    status = runs[STATUS].values.copy()
    status[[1, 3, 4, 17]] = Status.CRASHED
    points = mean_repeats(runs.assign({STATUS: (RUN, status)}))
    y = runs.y.values.reshape(6, 3)
    assert points[STATUS].values.tolist() == [0, Status.CRASHED, 0, 0, 0, 0]
    assert points.y.values[2] == pytest.approx(y[2].mean())
    assert points.y.values[0] == pytest.approx(y[0, [0, 2]].mean())
    assert points.y.values[5] == pytest.approx(y[5, :2].mean())
    assert np.isnan(repeats_of(points, "y")).sum() == 4
    assert np.array_equal(points.a, runs.a[::3])
    once = first_repeats(runs).drop_vars(["point", "repeat"])
    assert mean_repeats(once) is once
    assert repeats_of(once, "y") is None


def test_all_repeats_of_a_point_are_in_one_fold(toy):
    runs = noisy_runs(toy, 40, 3)
    folds = cross_fit(CHAOS, "pce", runs, toy.models[""].model, toy.joint, Stream(1, "s"))
    assert folds.fold.size == 40
    assert {each.training.counts[Status.OK] for each in folds.models} == {32}


def test_corrected_indices_lose_the_slack_of_the_noise(toy):
    narrow, wide = [], []
    for seed in range(2):
        runs = noisy_runs(toy, 150, 4, seed)
        found = corrected_by(toy, CHAOS, runs)
        once = corrected_by(toy, CHAOS, first_repeats(runs).drop_vars(["point", "repeat"]))
        for order in ("first_order", "total_order"):
            narrow.append([found[order].values, WHOLE])
            narrow.append([found[f"mean_{order}"].values, OF_MEAN])
        wide.append(found["total_order"].values[:, 2] - once["total_order"].values[:, 2])
        assert "mean_first_order" not in once
        assert found["mean"].values[1] <= np.sqrt(3) + np.sqrt(22.5) / 3 <= found["mean"].values[2]
        assert found["std"].values[1] <= 2 <= found["std"].values[2]
    for name in ("mean", "std", "first_order", "mean_total_order"):
        (method,) = {*np.ravel(found[name].interval.values).tolist()}
        assert method.endswith("; a point with its repeats counts as one")
    holds = [(e[:, 1] <= truth) & (truth <= e[:, 2]) for e, truth in narrow]
    assert np.mean(holds) >= 0.95
    widths = [np.ptp(e[:, 1:], axis=1).mean() for e, _ in narrow]
    assert max(widths) < 0.2
    # The square of a run's error has the noise in it: a quarter of the variance.
    assert np.mean(wide) < -0.25


def test_check_runs_correct_besides_where_their_noise_is_known_as_well(toy):
    runs, check = noisy_runs(toy, 60, 2), noisy_runs(toy, 40, 3, seed=1)
    once = first_repeats(check).drop_vars(["point", "repeat"])
    first = first_repeats(runs).drop_vars(["point", "repeat"])

    def used(training, check):
        found = corrected_by(toy, CHAOS, training, check)
        return found["mean"].attrs["estimator"].rpartition("corrected by ")[2]

    assert used(runs, check) == "100 runs"
    assert used(runs, once) == "60 runs"
    assert used(first, check) == used(first, once) == "100 runs"


MODEL = """
import numpy as np
def f(a, b, k):
    return {"y": a + b**2 + 0.1 * np.random.default_rng(k).normal()}
"""
STUDY = """
seed = 5
[model]
python = "noisy.py:f"
seed = "k"
inputs = { a = "1", b = "1", k = "1" }
outputs = { y = "mm" }
[inputs]
a = { uniform = { lower = 0, upper = 2 } }
b = { uniform = { lower = 0, upper = 1 } }
[designs.mc]
kind = "monte-carlo"
runs = 30
repeats = 4
[surrogates.gp]
kind = "gaussian-process"
design = "mc"
noise = "varying"
"""


def study(folder, text=STUDY):
    (folder / "noisy.py").write_text(MODEL)
    return uqpen.parse_study(text, folder=folder, name="noise")


def test_an_archive_predicts_the_mean_and_a_run(tmp_path):
    uqpen.make_archive(study(tmp_path), tmp_path / "noise.nc")
    tree = uqpen.open_archive(tmp_path / "noise.nc")
    assert tree["surrogates/gp"].attrs["runs_used"] == 30
    assert tree["statistics/gp"].attrs["runs_spent"] == 120
    predicted = tree.surrogate("gp")(a=1.0, b="0.5")
    assert 0.07e-3 < float(predicted.y_std) < 0.14e-3
    assert float(predicted.y_mean_std) < 0.05e-3
    assert predicted.y_mean_std.attrs["units"] == "m"
    assert predicted.y_mean_std.attrs["long_name"] == (
        "standard deviation of the mean of y given the inputs"
    )
    found = {name: SourceStatistics(tree).get("gp", "y", name) for name in CATALOGUE}
    notes = {name: str(found[name][0].note.values) for name in ("first_order", "shapley")}
    assert notes["first_order"].startswith("of the whole output, noise of the model included")
    assert notes["shapley"].startswith("of the mean given the inputs: the noise of the model")
    assert "of the" not in str(found["mean_first_order"][0].note.values)


@pytest.mark.parametrize(
    ("replaced", "found"),
    [
        (("repeats = 4", "repeats = 3"), r"surrogates\.gp\.noise\n.*\n +expected +repeats = 4"),
        (("repeats = 4", ""), "beside mc with repeats = 1"),
        (('noise = "varying"', "nugget = 0.1"), "no nugget: repeats say how large the noise is"),
        (('"varying"', '"steady"'), 'one of "constant", "varying"'),
    ],
)
def test_noise_that_repeats_cannot_show_is_refused(tmp_path, replaced, found):
    with pytest.raises(StudyError, match=found):
        study(tmp_path, STUDY.replace(*replaced))
