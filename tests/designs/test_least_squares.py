"""Least squares: sets of NIST, noise, failed runs, profiles, several minima, what is not taught."""

import math
import zlib

import numpy as np
import pytest
from interrupted_study import check_interruptions_and_workers
from scipy import optimize, stats

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.errors import StudyError
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.designs.least_squares import (
    NO_AXIS,
    NOISE_AXIS,
    LeastSquares,
    ModelNoise,
    SearchSettings,
    difference_quotient,
    noise_line,
)
from uqpen.results.calibrations import combination_text
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.statistics.calibration import FittedUnknowns

nist = pytest.importorskip("nist_regression", reason="the folder of benchmarks is not here")

NAMES = ("Misra1a", "Thurber", "MGH09")
NORMAL_95 = stats.norm.ppf(0.975)


def fitted(residuals, starts, *, lower=None, upper=None, **settings):
    """Return the fit and all runs of a search whose starts are in working coordinates."""
    starts = np.atleast_2d(np.asarray(starts, dtype=float))
    runs, _, flat = nist.searched(residuals, starts, SearchSettings(**settings), lower, upper)
    return FittedUnknowns.of(runs, 0.95), runs, flat


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("name", NAMES)
def test_sets_of_nist_have_their_certified_values(name, start):
    found = nist.fit(name, start)
    assert found.has_converged
    assert found.off < 1e-5  # standard errors
    assert found.errors_off < 1e-5  # five digits
    assert found.sum_of_squares == pytest.approx(1, rel=1e-9)


# From the starts that are further away; MGH09 takes ten times as many runs.
@pytest.mark.parametrize("name", NAMES[:2])
def test_seven_printed_digits_move_no_value_by_a_twentieth_of_its_error(name):
    found = nist.fit(name, 0, digits=7)
    assert found.has_converged
    assert found.off < 0.05


@pytest.mark.parametrize("name", NAMES[:2])
def test_a_tenth_of_failed_runs_loses_no_search(name):
    found = nist.fit(name, 0, failing=10)
    assert found.has_converged
    # Quotients to one side, where a run failed, are of first order.
    assert found.off < 1e-3


def test_a_line_has_the_errors_of_the_normal_equations():
    x, y, std = np.arange(4.0), np.array([1.1, 2.9, 5.2, 6.8]), 0.2
    design = np.column_stack([np.ones(4), x]) / std
    found, runs, _ = fitted(lambda z: (10 * (z[0] + z[1] * x) - y) / std, np.zeros(2))
    exact = np.linalg.inv(design.T @ design)
    assert 10 * found.at.point == pytest.approx(exact @ design.T @ y / std, rel=1e-9)
    assert 10 * found.standard_errors == pytest.approx(np.sqrt(np.diag(exact)), rel=1e-8)
    assert found.correlation[0, 1] == pytest.approx(-3 / math.sqrt(14), abs=1e-8)
    rest = found.at.sum_of_squares
    assert found.p_value == pytest.approx(stats.chi2.sf(rest, 2))
    assert (runs.searched.axis == NOISE_AXIS).sum() == 8


def test_without_stated_errors_they_follow_from_the_residuals_and_student_t():
    x, y = np.arange(4.0), np.array([1.1, 2.9, 5.2, 6.8])
    found, *_ = fitted(lambda z: z[0] + z[1] * x - y, np.zeros(2), errors_are_known=False)
    line = stats.linregress(x, y)
    assert found.standard_errors[1] == pytest.approx(line.stderr, rel=1e-8)
    assert found.quantile == pytest.approx(stats.t.ppf(0.975, 2))
    assert math.isnan(found.p_value)


def decay(z):
    x = np.arange(1.0, 6.0)
    data = np.array([3.1, 1.6, 1.1, 0.45, 0.35])
    return ((5 + 2 * z[0]) * np.exp(-(0.5 + 0.3 * z[1]) * x) - data) / 0.15


def test_profile_intervals_are_those_of_nested_fits():
    found, *_ = fitted(decay, np.zeros(2), level=0.95)

    def profile(axis, value):
        other = optimize.least_squares(
            lambda rest: decay(np.insert(rest, axis, value)),
            np.delete(found.at.point, axis),
            xtol=1e-12,
        )
        return 2 * other.cost - found.at.sum_of_squares - NORMAL_95**2

    for axis in (0, 1):
        at, error = found.at.point[axis], found.standard_errors[axis]
        bounds = found.profile_bounds(axis)
        for side, bound in zip((-1, 1), bounds, strict=True):
            exact = optimize.brentq(
                lambda value, axis=axis: profile(axis, value), at, at + side * 4 * error
            )
            assert bound == pytest.approx(exact, abs=1e-3 * error)
        # The model is not linear: the upper end is further away.
        assert abs(sum(bounds) / 2 - at) > 0.02 * error


def test_a_profile_comes_to_its_end_where_a_step_first_leads_into_failed_runs():
    def residuals(z):
        return np.where(np.abs(z) < 1.6, np.sinh(z), np.nan)

    # The first step, of the straight line, is 1.96 long.
    found, *_ = fitted(residuals, [[0.3]], level=0.95)
    end = math.asinh(NORMAL_95)
    assert found.profile_bounds(0) == pytest.approx((-end, end), rel=1e-3)


def test_an_interval_over_which_the_model_bends_says_so():
    found, *_ = fitted(lambda z: np.array([np.exp(2 * z[0]) - 1.3]) / 0.6, [[0.0]], level=0.95)
    assert "not linear" in str(found.estimate(0).note)
    found, *_ = fitted(lambda z: np.array([2 * z[0] - 1.3]) / 0.6, [[0.0]], level=0.95)
    assert found.estimate(0).note == ""
    assert found.profile_bounds(0) == pytest.approx((0.65 - 0.588, 0.65 + 0.588), abs=1e-3)


def test_a_step_that_is_lost_in_rounding_is_no_quotient():
    moved, offsets = np.array([[1.0], [3.0]]), np.array([0.0, 1.0])
    assert difference_quotient(np.array([1.0]), moved, offsets) == pytest.approx([2.0])


def test_two_minima_that_are_as_low_are_both_named():
    found, *_ = fitted(lambda z: (z**2 - 1.44) / 0.3, [[0.3], [-1.0], [2.0]])
    (other,) = found.other_minima
    assert sorted([found.at.point.item(), other.point.item()]) == pytest.approx([-1.2, 1.2])


def test_an_unknown_without_effect_is_named_by_its_number():
    found, _, flat = fitted(lambda z: np.array([z[0] - 1, 2 * z[0]]), [[0.0, 0.0], [1.0, 1.0]])
    assert flat == {1}
    assert found is not None


def test_what_the_data_do_not_teach_is_a_combination():
    x = np.arange(1.0, 6.0)
    found, *_ = fitted(
        lambda z: (np.exp(0.6 * z[0] + 0.8 * z[1]) + 1e-3 * z[1] - 1.5 + 0 * x) / 0.1, np.zeros(2)
    )
    weights, errors = found.combinations
    taught, unknown = (combination_text(each, ["rate", "limit"]) for each in weights)
    assert taught == "0.80 limit + 0.60 rate"
    assert errors[0] == pytest.approx(0.1 / math.sqrt(5) / 1.5, rel=1e-2)
    assert unknown == "0.80 rate - 0.60 limit"
    assert errors[1] > 10


def test_a_minimum_beyond_the_support_is_held_at_its_end():
    lower, upper = np.array([-1.0, -np.inf]), np.array([0.5, np.inf])
    found, runs, _ = fitted(
        lambda z: np.array([z[0] - 2, z[1] - 1, z[0] + z[1] - 3]),
        np.zeros(2),
        lower=lower,
        upper=upper,
    )
    assert found.has_converged
    assert (runs.searched.points >= lower).all()
    assert (runs.searched.points <= upper).all()
    assert "the data would go further" in str(found.estimate(0).note)
    assert found.estimate(1).note == ""
    # With the first at 0.5, the second is the mean of 1 and 2.5.
    assert found.at.point == pytest.approx([0.5, 1.75], abs=2e-3)


def test_the_noise_of_a_model_decides_the_step():
    rng = np.random.default_rng(5)
    line = noise_line(2, 1e-4)
    assert not line[4].any()
    smooth = np.stack([3 * line[:, 0], line[:, 1] ** 2, np.sin(line[:, 0])], axis=1)
    noise = ModelNoise.of(smooth + 1e-6 * rng.standard_normal((9, 3)), 1e-4)
    assert noise.size == pytest.approx(1e-6, rel=0.5)
    assert noise.step == pytest.approx((3e-6 / noise.slope) ** (1 / 3), rel=0.3)
    assert ModelNoise.of(smooth, 1e-4).step == 1e-4
    # Differences of third order of numbers ± e are ± 8 e, and those of a straight line are 0.
    number = np.arange(9.0)[:, np.newaxis]
    noise = ModelNoise.of(0.005 * number + 1e-3 * (-1) ** number, 1e-2)
    assert noise.size == pytest.approx(8e-3 / math.sqrt(20))
    assert noise.slope == pytest.approx(0.5)
    assert noise.is_clear
    assert not ModelNoise.of(0.0005 * number + 1e-3 * (-1) ** number, 1e-2).is_clear


def test_noise_is_measured_again_where_a_search_ends():
    known = nist.nist_set("MGH09")
    median = known.starts[0]

    def residuals(point):
        rng = np.random.default_rng(zlib.crc32(point.tobytes()))
        outputs = known.outputs(median + np.abs(median) * point)
        return outputs * (1 + 1e-6 * rng.standard_normal(11)) - known.observed

    found, *_ = fitted(residuals, np.zeros(4), errors_are_known=False)
    values = median + np.abs(median) * found.at.point
    assert found.has_converged
    assert np.abs((values - known.certified) / known.standard_errors).max() < 0.05


def test_no_more_runs_are_made_than_allowed():
    _, runs, _ = fitted(decay, np.zeros(2), level=0.95, at_most=30)
    assert len(runs.residuals) <= 30
    assert (runs.searched.axis == NO_AXIS).any()


def test_a_start_whose_run_fails_leaves_the_others():
    def residuals(z):
        return np.full(5, np.nan) if (np.abs(z) < 1e-3).all() else decay(z)

    found, *_ = fitted(residuals, [[0.0, 0.0], [0.5, 0.5]])
    assert found.has_converged


def test_residuals_along_a_curve_show_their_correlation():
    x = np.linspace(0, 1, 40)
    wave = 0.3 * np.sin(12 * x)
    found, *_ = fitted(lambda z: (z[0] + z[1] * x - 2 - wave) / 0.1, np.zeros(2))
    assert abs(found.lag_1_correlation) > 2 / math.sqrt(40)
    alone = np.where(np.arange(40) == 17, 0.9, 0.0)
    found, *_ = fitted(lambda z: (z[0] + z[1] * x - 2 - alone) / 0.1, np.zeros(2))
    assert abs(found.lag_1_correlation) < 2 / math.sqrt(40)
    assert np.abs(found.standardised_residuals).argmax() == 17


# The design in a study.

DATA = np.array([3.1, 1.6, 1.1, 0.45, 0.35])
TIMES = np.arange(1.0, 6.0)
INPUTS = {
    "amount": uqpen.Normal("5 kg", "2 kg"),
    "rate": uqpen.Lognormal("0.5 1/s", "0.2 1/s"),
    "idle": uqpen.Normal(0.0, 1.0),
}
DECAY = {
    "table": {"time [s]": TIMES.tolist(), "left [kg]": DATA.tolist()},
    "unknown": ["amount", "rate"],
    "fixed": ["idle"],
    "left": {"std": "0.15 kg", "correlation": "none"},
}


def decayed(amount, rate, idle):
    left = amount[:, np.newaxis] * np.exp(-rate[:, np.newaxis] * TIMES)
    return {"left": np.where(amount[:, np.newaxis] > 9, np.nan, left)}


def study(measured=DECAY, designs=None, confidence_level=0.95, **settings):
    units = {"amount": "kg", "rate": "1/s", "idle": "1"}
    left = uqpen.OutputSpec(unit="kg", along={"time": {"values": TIMES.tolist(), "unit": "s"}})
    model = uqpen.PythonModel(decayed, units, {"left": left}, vectorized=True)
    designs = designs or {"fit": LeastSquares(measured=("decay",), **settings)}
    return uqpen.Study(
        model,
        INPUTS,
        designs=designs,
        measured={"decay": measured},
        confidence_level=confidence_level,
        seed=1,
    )


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study(starts=3))


def test_an_archive_has_the_fit(tree):
    group = tree["calibrations/fit"]
    exact = optimize.curve_fit(
        lambda time, amount, rate: amount * np.exp(-rate * time),
        TIMES, DATA, (5, 0.5), sigma=np.full(5, 0.15), absolute_sigma=True, xtol=1e-14, ftol=1e-14,
    )  # fmt: skip
    assert group["unknown_value"].values[:, 0] == pytest.approx(exact[0], rel=1e-6)
    errors = np.sqrt(np.diag(exact[1]))
    assert group["standard_error"].values == pytest.approx(errors, rel=1e-5)
    assert group["degrees_of_freedom"] == 3
    assert not list(find_faults(tree))
    runs = tree["runs/fit"]
    assert (runs["idle"] == 0).all()
    assert (runs["rate"] > 0).all()
    assert {runs[f"search_{each}"].dtype for each in ("start", "origin")} == {np.dtype(np.int64)}


def test_intervals_have_the_level_of_the_study_and_profiles_their_own():
    group = uqpen.run(study(confidence_level=0.8))["calibrations/fit"]
    levels = [group[f"{of}_value"].attrs[INTERVAL_LEVEL] for of in ("unknown", "profile")]
    assert levels == [0.8, 0.95]
    value, lower, _ = group["unknown_value"].values.T
    assert value - lower == pytest.approx(stats.norm.ppf(0.9) * group["standard_error"].values)


def test_tables_and_json_have_the_fit(tree):
    tables = {each.title: each for each in output_tables(tree)}
    rows = dict(tables["fit: unknowns"].rows)
    assert rows["amount [kg]"][0] == "5.50 ± 0.93"
    taught = [label for label, _ in tables["fit: what the data teach"].rows]
    assert all("amount" in each and "rate" in each for each in taught)
    found = archive_json(tree)["designs"]["fit"]["calibrations"]
    value, profile = found["unknown_value"]["rate"], found["profile_value"]["rate"]
    assert value["interval"].startswith("normal")
    assert profile["interval"] == "profile likelihood"
    assert profile["upper"] - profile["estimate"] > profile["estimate"] - profile["lower"]


def test_profiles_that_are_too_dear_say_so():
    found = uqpen.run(study(at_most=60))["calibrations/fit"]["profile_value"]
    assert np.isnan(found.values[:, 1:]).all()
    assert "at_most = 60" in str(found.attrs)


def test_an_input_that_no_measurement_teaches_is_an_error_with_its_name():
    measured = {**DECAY, "unknown": ["amount", "idle"], "fixed": ["rate"]}
    with pytest.raises(StudyError, match="no measured output changes with idle"):
        uqpen.run(study(measured, starts=2))


@pytest.mark.processor
def test_neither_interruptions_nor_workers_change_a_byte(tmp_path):
    check_interruptions_and_workers(
        tmp_path,
        """kind = "least-squares"
measured = ["rows"]
starts = 2
at_most = 400
[designs.draws]
kind = "latin-hypercube"
runs = 20
at = "rows"
[measured.rows]
unknown = ["a"]
varies = ["b"]
experiment = "shot"
table = { shot = [1, 2, 3], "depth [m]" = [1.3, 1.1, 1.6] }
[measured.rows.depth]
std = "5 %"
""",
        stops=(2, 6, 9),
        depth="(1 + a + a**2) * (1 + 0.1 * b)",
    )


def test_each_of_two_searches_has_its_own_settings():
    designs = {
        name: LeastSquares(measured=("decay",), profile=name == "whole")
        for name in ("whole", "short")
    }
    found = uqpen.run(study(designs=designs))["calibrations"]
    assert np.isfinite(found["whole/profile_value"].values).all()
    assert "no profile was asked for" in str(found["short/profile_value"].attrs)
