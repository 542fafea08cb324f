"""Measurements: covariance and likelihood against exact answers, places, repeats, rows by value."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate, optimize, stats

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.charts.marks import Line
from uqpen.charts.measured_values import measurement_charts
from uqpen.designs.least_squares import usable_residuals
from uqpen.measurements.experiments import Experiments
from uqpen.report.page import report_page
from uqpen.report.sections.summary import summary_lines
from uqpen.results.archive_view import select_view
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.study.load import parse_study

STUDIES = Path(__file__).parents[1] / "studies"

LINE = """seed = 1
[model]
python = "line.py:line"
[model.dimensions.x]
values = [0, 1, 2, 3, 5]
unit = "1"
[model.inputs]
a = "1"
b = "1"
[model.outputs.y]
unit = "1"
along = ["x"]
[inputs]
a = { normal = { mean = 0, std = 10 } }
b = { normal = { mean = 0, std = 10 } }
[measured.line]
unknown = ["a", "b"]
[measured.line.table]
x = [0, 1, 2, 3]
y = [1.1, 2.9, 5.2, 6.8]
[measured.line.y]
std = 0.2
correlation = "none"
[designs.fit]
kind = "least-squares"
measured = ["line"]
"""
MODEL = "def line(a, b):\n    return {'y': [a + b * x for x in (0, 1, 2, 3, 5)]}\n"


def measured(tmp_path, text=LINE, **files):
    """Return the measurements of a study with one section."""
    (tmp_path / "line.py").write_text(MODEL)
    for name, content in files.items():
        (tmp_path / f"{name}.csv").write_text(content)
    return Experiments(tuple(parse_study(text, folder=tmp_path).measured.values()))


def posterior_of_line(found):
    """Return the exact posterior of a line with wide normal priors, and the log evidence."""
    x, y = np.arange(4.0), found.values
    covariance = found.errors.covariance(y)
    design = np.column_stack([np.ones(4), x])
    weights = np.linalg.inv(covariance)
    inverse = np.linalg.inv(design.T @ weights @ design + np.eye(2) / 100)
    whole = covariance + 100 * design @ design.T
    evidence = stats.multivariate_normal(np.zeros(4), whole).logpdf(y)
    return inverse @ design.T @ weights @ y, np.sqrt(np.diag(inverse)), evidence


def test_an_unknown_size_beside_other_errors_is_the_likeliest_for_the_unknowns_fitted(tmp_path):
    (tmp_path / "line.py").write_text(MODEL)
    errors = "std = { half-normal = 50 }\nshared = { std = 0.1 }"
    tree = uqpen.run(parse_study(LINE.replace("std = 0.2", errors), folder=tmp_path))
    x, y = np.arange(4.0), np.array([1.1, 2.9, 5.2, 6.8])
    rest = ((y - np.polyval(np.polyfit(x, y, 1), x)) ** 2).sum()
    # The residuals of a line have the sum 0, so the shared part is in the determinant alone.
    found = optimize.minimize_scalar(
        lambda s: rest / s**2 + 6 * np.log(s) + np.log(s**2 + 0.04),
        bounds=(0.01, 1),
        method="bounded",
    )
    std = np.sqrt(found.x**2 * 4 / 2 + 0.1**2)  # four rows, two unknowns
    assert tree["calibrations/fit/measured_std"].values == pytest.approx(np.full(4, std), rel=1e-3)


def test_residuals_too_large_to_square_are_those_of_a_failed_run(tmp_path):
    found = measured(tmp_path)
    likelihood = found.likelihood.at(found.errors.covariance(found.values))
    residuals = usable_residuals(likelihood, np.stack([found.values + 1e200, found.values + 0.2]))
    assert np.isnan(residuals[0]).all()
    assert residuals[1] == pytest.approx(np.ones(4))


def test_the_line_with_independent_errors_has_its_exact_posterior(tmp_path):
    mean, std, evidence = posterior_of_line(measured(tmp_path))
    assert mean == pytest.approx([1.0899276173, 1.9399755933], abs=1e-9)
    assert std == pytest.approx([0.1673042830, 0.0894310946], abs=1e-9)
    assert evidence == pytest.approx(-7.6098524711, abs=1e-9)


def test_an_error_that_all_rows_share_widens_the_offset_alone(tmp_path):
    text = LINE.replace("std = 0.2\n", "std = 0.2\nshared = { std = 0.3 }\n")
    mean, std, evidence = posterior_of_line(measured(tmp_path, text))
    assert mean == pytest.approx([1.0889478386, 1.9399754757], abs=1e-9)
    assert std == pytest.approx([0.3433066961, 0.0894311019], abs=1e-9)
    assert evidence == pytest.approx(-7.6102968019, abs=1e-9)


def bounds(tmp_path, std="0.5"):
    text = LINE.replace('unknown = ["a", "b"]', 'unknown = ["a"]\nfixed = ["b"]')
    text = text.replace(
        "x = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]", "x = [0, 0]\ny = [0.8, 1.0]\nabove = [0, 1]"
    )
    return measured(tmp_path, text.replace("std = 0.2", f'std = {std}\nat_least = "above"'))


def test_a_bound_counts_by_the_probability_beyond_it(tmp_path):
    found = bounds(tmp_path)

    def density(theta):
        inside = found.likelihood.log_density(np.full((1, 2), theta))[0]
        return np.exp(inside) * stats.norm.pdf(theta)

    evidence, _ = integrate.quad(density, -8, 8, epsabs=1e-13)
    mean, _ = integrate.quad(lambda theta: theta * density(theta) / evidence, -8, 8)
    assert np.log(evidence) == pytest.approx(-2.50474257, abs=1e-8)
    assert mean == pytest.approx(0.98823061, abs=1e-8)
    # The squares of residuals are the same, but for a constant.
    likelihood = found.likelihood.at(found.errors.covariance(found.values))
    (residuals,) = likelihood.residuals(np.full((1, 2), 0.4))
    tail = stats.norm.sf((1 - 0.4) / 0.5)
    assert residuals == pytest.approx([(0.4 - 0.8) / 0.5, np.sqrt(-2 * np.log(tail))])


def test_a_bound_counts_by_the_error_that_is_a_share_of_the_result(tmp_path):
    found = bounds(tmp_path, '"50 %"')
    at = np.array([2.0, np.nan, 0.4])
    exact = stats.norm.logpdf(0.8, at, at / 2) + stats.norm.logsf(1.0, at, at / 2)
    density = found.likelihood.log_density(np.repeat(at[:, np.newaxis], 2, axis=1))
    assert density == pytest.approx(exact, nan_ok=True)


def test_an_error_of_unknown_size_has_its_exact_evidence(tmp_path):
    text = LINE.replace('unknown = ["a", "b"]', 'unknown = ["a"]\nfixed = ["b"]')
    text = text.replace(
        "x = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]",
        "x = [0, 0, 0, 0, 0]\ny = [4.1, 5.0, 3.7, 4.6, 5.3]",
    )
    found = measured(tmp_path, text.replace("std = 0.2", "std = { half-normal = 1 }"))
    assert [each.scale for each in found.errors.sizes] == [1.0]
    sigma = np.linspace(1e-3, 6, 1001)[1:]
    theta = np.linspace(0, 9, 401)
    grid = np.array(np.meshgrid(sigma, theta, indexing="ij")).reshape(2, -1)
    # The likelihood in closed form of sums, checked against the one of uqpen at three points.
    y = found.values
    squares = ((y[:, np.newaxis] - grid[1]) ** 2).sum(axis=0)
    log_likelihood = -2.5 * np.log(2 * np.pi) - 5 * np.log(grid[0]) - squares / (2 * grid[0] ** 2)
    chosen = [10_000, 70_000, 200_000]
    own = found.likelihood.log_density(
        np.repeat(grid[1][chosen][:, np.newaxis], 5, axis=1), grid[0][chosen][:, np.newaxis]
    )
    assert own == pytest.approx(log_likelihood[chosen], rel=1e-12)
    prior = stats.halfnorm.pdf(grid[0]) * stats.norm.pdf(grid[1], 0, 10)
    step = (sigma[1] - sigma[0]) * (theta[1] - theta[0])
    assert np.log((np.exp(log_likelihood) * prior).sum() * step) == pytest.approx(
        -9.06203033, abs=2e-4
    )


def test_shares_are_of_the_value_of_the_model(tmp_path):
    found = measured(tmp_path, LINE.replace("std = 0.2", 'std = [0.3, "10 %"]'))
    at = np.array([4.0, 0.0, 2.0, 1.0])
    assert found.errors.covariance(at) == pytest.approx(np.diag([0.25, 0.09, 0.13, 0.1]))
    (value,) = found.likelihood.log_density(at[np.newaxis])
    exact = stats.norm.logpdf(found.values, at, np.sqrt([0.25, 0.09, 0.13, 0.1])).sum()
    assert value == pytest.approx(exact)
    assert np.isnan(found.likelihood.log_density(np.array([[1.0, np.nan, 1, 1]]))).all()
    # Many draws at once are as each by itself.
    many = np.random.default_rng(1).normal(3, 2, (50, 4))
    each = [found.likelihood.log_density(draw[np.newaxis])[0] for draw in many]
    assert found.likelihood.log_density(many).tolist() == each


def test_a_share_of_a_result_that_is_0_allows_no_other_value(tmp_path):
    found = measured(tmp_path, LINE.replace("std = 0.2", 'std = "10 %"'))
    values = found.likelihood.log_density(np.array([[1.0, 3, 5, 7], [0.0, 3, 5, 7]]))
    assert np.isfinite(values).tolist() == [True, False]


def test_places_between_coordinates_are_linear(tmp_path):
    text = LINE.replace(
        "x = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]", "x = [4.5, 5, 0]\ny = [1, 1, 1]"
    )
    ((output, _),) = measured(tmp_path, text).rows
    curve = np.array([[[7.0, 1, 2, 4, 8]]])
    assert output.predicted(curve) == pytest.approx(np.array([[7.0, 8.0, 7.0]]))


def test_errors_along_a_curve_are_correlated_by_their_distance(tmp_path):
    found = measured(tmp_path, LINE.replace('"none"', "{ x = 2 }"))
    exact = np.exp([0, -0.5, -1, -1.5])
    assert found.errors.covariance(found.values)[0] / 0.04 == pytest.approx(exact)
    text = LINE.replace('"none"', "{ x = 2 }").replace("x = [0,", "rig = [1, 1, 2, 2]\nx = [0,")
    found = measured(
        tmp_path, text.replace("[measured.line]", '[measured.line]\nexperiment = "rig"')
    )
    exact = [1, math.exp(-0.5), 0, 0]  # not with those of another experiment
    assert found.errors.covariance(found.values)[0] / 0.04 == pytest.approx(exact)


ROWS = "x,y,above,rig,sd\n0,1.1,0,left,0.1\n1,,0,left,0.1\n1,2.9,0,right,0.2\n1,3.1,0,right,0.2\n"


def from_file(tmp_path, rows, *, std='"sd"', key=""):
    text = LINE.replace("[measured.line.table]\nx = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]\n", "")
    text = text.replace('unknown = ["a", "b"]', f'file = "rows.csv"\nunknown = ["a", "b"]\n{key}')
    return measured(tmp_path, text.replace("std = 0.2", f"std = {std}"), rows=rows)


def test_blank_entries_were_not_measured_and_groups_may_be_words(tmp_path):
    found = from_file(tmp_path, ROWS, std='"sd"\nshared = { std = 0.5, group = "rig" }')
    assert found.values.tolist() == [1.1, 2.9, 3.1]
    exact = [[0.26, 0, 0], [0, 0.29, 0.25], [0, 0.25, 0.29]]
    assert found.errors.covariance(found.values) == pytest.approx(np.array(exact))
    ((output, _),) = found.rows
    assert output.lines.tolist() == [1, 3, 4]


def test_an_experiment_of_which_nothing_was_measured_has_no_runs(tmp_path):
    rows = "x,b,y,sd\n0,1,1.1,0.1\n1,2,,0.1\n2,3,2.9,0.2\n"
    text = LINE.replace("[measured.line.table]\nx = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]\n", "")
    key = 'file = "rows.csv"\nconditions = ["b"]\nunknown = ["a"]'
    found = measured(tmp_path, text.replace('unknown = ["a", "b"]', key), rows=rows)
    assert found.count == 2
    assert found.experiment.tolist() == [0, 1]
    (section,) = found.sections
    assert section.conditions["b"].tolist() == [1.0, 3.0]


def test_rows_are_known_by_value_in_another_order(tmp_path):
    (one,) = from_file(tmp_path, ROWS).sections
    head, *rows = ROWS.splitlines()
    changed = "\n".join([head, *reversed(rows)]).replace("2.9", "2.9000001").replace("3.1", "3.2")
    (other,) = from_file(tmp_path, changed + "\n").sections
    assert len({*one.row_hashes} & {*other.row_hashes}) == 2


def test_repeats_give_the_size_of_an_error(tmp_path):
    lines = [
        f"{x},{y},0,a,1"
        for x, y in zip([0] * 3 + [1] * 3 + [2] * 2, [1, 2, 3, 4, 6, 8, 5, 7], strict=True)
    ]
    found = from_file(tmp_path, "\n".join(["x,y,above,rig,sd", *lines]) + "\n", std='"repeats"')
    assert found.errors.freedom == 5
    variances = np.diag(found.errors.covariance(found.values))
    assert variances == pytest.approx(np.full(8, (2 + 8 + 2) / 5))
    # A bound is no repeat.
    lines.append("2,99,1,a,1")
    text = "\n".join(["x,y,above,rig,sd", *lines]) + "\n"
    bounded = from_file(tmp_path, text, std='"repeats"\nat_least = "above"')
    assert bounded.errors.freedom == 5
    assert bounded.errors.covariance(bounded.values)[8, 8] == pytest.approx((2 + 8 + 2) / 5)


def test_a_covariance_comes_from_a_file(tmp_path):
    matrix = "1,2,3\n0.26,0,0\n0,0.29,0.25\n0,0.25,0.29\n"
    text = 'covariance = "matrix.csv"'
    (tmp_path / "matrix.csv").write_text(matrix)
    found = from_file(tmp_path, ROWS, std="0.2").sections  # the file is read whole
    assert len(found[0].outputs[0].values) == 3
    own = LINE.replace("[measured.line.table]\nx = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]\n", "")
    own = own.replace('unknown = ["a", "b"]', 'file = "rows.csv"\nunknown = ["a", "b"]')
    found = measured(tmp_path, own.replace("std = 0.2", text), rows=ROWS)
    assert found.errors.covariance(found.values)[1, 2] == 0.25


@pytest.mark.parametrize(("key", "count"), [("", 2), ('experiment = "shot"\n', 3)])
def test_rows_of_equal_conditions_are_one_experiment_unless_a_column_tells_them_apart(
    tmp_path, key, count
):
    text = LINE.replace('unknown = ["a", "b"]', f'conditions = ["b"]\nunknown = ["a"]\n{key}')
    text = text.replace(
        "x = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]",
        "b = [1, 1, 2]\nshot = [1, 2, 3]\nx = [0, 1, 2]\ny = [1, 2, 3]",
    )
    found = measured(tmp_path, text)
    assert found.count == count
    inputs = found.inputs({"a": np.array([5.0, 6.0])}, {"a": 0.0, "b": 0.0})
    assert inputs["a"].tolist() == [5.0] * count + [6.0] * count
    assert inputs["b"].tolist() == [1.0, 2.0] * 2 if count == 2 else [1.0, 1.0, 2.0] * 2


@pytest.fixture(scope="module")
def rods():
    return uqpen.run(uqpen.load_study(STUDIES / "rod_measurements.toml"))


def test_shots_teach_one_combination_of_a_target_alone(rods):
    found = rods["calibrations/fit"]
    best, *rest = found["combination_error"].values
    assert best < 0.2
    assert min(rest) > 1  # standard deviations of the priors: nothing beyond these
    # Steady flow has the ratio of the radii alone: a larger one of the two is as good as a smaller
    # other one.
    plasticity, crater, density = found["combination_weight"].values[0]
    assert plasticity * crater < 0
    assert abs(density) < 0.3
    text = " ".join(summary_lines(rods)).replace("\N{NO-BREAK SPACE}", " ")
    assert "fits 12 measured values of shots" in text
    assert "Nothing speaks against the model in 12 measured values together" in text
    assert "nothing on plasticity_radius, crater_radius, target_density alone" in text
    assert "The combination 0.85 plasticity_radius - 0.52 crater_radius, each in" in text
    (table,) = (each for each in output_tables(rods) if "what the data teach" in each.title)
    assert [cells[1][:3] for _, cells in table.rows] == ["yes", "no:", "no:"]
    assert not list(find_faults(rods))


def test_targets_that_vary_are_drawn_anew_in_each_experiment(rods):
    runs = rods["runs/prior"].to_dataset()
    strength = runs["target_yield_limit"].values.reshape(400, 12)
    radius = runs["crater_radius"].values.reshape(400, 12)
    assert (np.ptp(radius, axis=1) == 0).all()
    assert np.abs(np.corrcoef(strength.T) - np.eye(12)).max() < 0.25  # 5 standard errors
    assert strength.std() == pytest.approx(40e6, rel=0.05)
    velocity = runs["impact_velocity"].values.reshape(400, 12)
    assert velocity.std(axis=0) == pytest.approx(np.full(12, 5.0), rel=0.2)


def test_a_validation_has_a_row_for_each_measured_value(rods):
    found = rods["validation/prior/penetration_depth"]
    assert found["bound_side"].values.tolist() == [0] * 11 + [1]
    assert found["measured"].values[0] == 0.479
    assert found["condition"].values[:, 0].tolist()[:2] == [1050.0, 1120.0]
    assert 0.05 < found["joint_p_value"].values[0] < 1
    assert found["verdict"].item() == "not decided"
    tables = {each.title: each for each in output_tables(rods)}
    rows = dict(tables["penetration_depth at the experiments of prior [mm]"].rows)
    label = "1, impact_velocity 1050 m/s, projectile_length 16 cm"
    assert rows[label][0] == "479 ± 13"
    assert rows[label][-1] == "not decided"
    (*_, bound) = rows.values()
    assert bound[0] == "≥ 483 ± 15"
    json = archive_json(rods)["designs"]["prior"]["validation"]["penetration_depth"]
    assert json["units"] == "m"


def run_line(tmp_path, text, **more):
    (tmp_path / "line.py").write_text(MODEL)
    return uqpen.run(parse_study(text, folder=tmp_path), **more)


SHOTS = LINE
for old, new in (
    ('unknown = ["a", "b"]', 'conditions = ["b"]\nunknown = ["a"]'),
    ("x = [0, 1, 2, 3]", "b = [1, 2, 3]\nx = [1, 2, 3]"),
    ("y = [1.1, 2.9, 5.2, 6.8]", "y = [2.1, 4.9, 10.2]"),
    ('kind = "least-squares"', 'kind = "monte-carlo"\nruns = 40'),
    ('measured = ["line"]', 'at = "line"'),
):
    SHOTS = SHOTS.replace(old, new)


def test_rows_that_inputs_were_fitted_to_are_known_by_value_and_decide_nothing(tmp_path):
    text = f"{SHOTS}[validation.line]\naccept = {{ y = 1000 }}\n"
    whole = run_line(tmp_path, text)["validation/fit/y"]
    assert whole["verdict"].item() == "met"
    # A copy in another order, with another row.
    (tmp_path / "copy.csv").write_text("y,x,b\n4.9,2,2\n7,7,7\n2.1,1,1\n".replace("7,7", "7,5"))
    found = run_line(tmp_path, f'{text}fitted = "copy.csv"\nfitted_inputs = 1\n')[
        "validation/fit/y"
    ]
    assert found["used_before"].values.tolist() == [1, 1, 0]
    assert found["row_verdict"].values.tolist() == ["not decided", "not decided", "met"]
    assert found["residual_chi_squared"].size == 1


def test_a_further_experiment_makes_its_own_runs_alone(tmp_path, command_line):
    (tmp_path / "line.py").write_text(MODEL)
    study = tmp_path / "line.toml"
    study.write_text(SHOTS)
    assert command_line("study", str(study)).code == 0
    more = SHOTS.replace("b = [1, 2, 3]", "b = [1, 2, 3, 4]").replace(
        "x = [1, 2, 3]", "x = [1, 2, 3, 2]"
    )
    study.write_text(more.replace("y = [2.1, 4.9, 10.2]", "y = [2.1, 4.9, 10.2, 9]"))
    outcome = command_line("study", str(study))
    assert outcome.code == 0
    assert "120 of 160 runs already done" in outcome.err


HALVES = LINE.replace(
    "x = [0, 1, 2, 3]\ny = [1.1, 2.9, 5.2, 6.8]", "x = [0, 1]\ny = [1.1, 2.9]"
).replace(
    "[designs.fit]",
    """[measured.rest]
unknown = ["a", "b"]
table = { x = [2, 3], y = [5.2, 6.8] }
y = { std = 0.2, correlation = "none" }
[designs.fit]""",
).replace('measured = ["line"]', 'measured = ["line", "rest"]')  # fmt: skip


def test_two_sections_teach_as_much_as_one_of_all_rows(tmp_path):
    whole, halves = (run_line(tmp_path, text)["calibrations/fit"] for text in (LINE, HALVES))
    for name in ("unknown_value", "standard_error", "sum_of_squares"):
        assert halves[name].values == pytest.approx(whole[name].values, rel=1e-6)
    assert halves["experiment_number"].values.tolist() == [1, 1, 2, 2]


def test_a_worse_model_has_the_larger_score_at_the_same_draws(tmp_path):
    single = SHOTS[SHOTS.index("[model]") : SHOTS.index("[inputs]")]
    worse = single.replace("[model", "[models.worse").replace(":line", ":shifted")
    shifted = MODEL.replace("line", "shifted").replace("a + b", "20 + a + b")
    (tmp_path / "line.py").write_text(MODEL + shifted)
    text = SHOTS.replace(single, single.replace("[model", "[models.right") + worse)
    tree = uqpen.run(parse_study(text.replace("std = 10", "std = 2"), folder=tmp_path))
    found = tree["models/worse/validation/fit/y"]["score_difference"].values
    assert found[2] < 0  # the score of the first is smaller
    assert "score_difference" not in tree["models/right/validation/fit/y"]
    right, wrong, *_ = summary_lines(tree)
    assert right.startswith("right: y: Nothing speaks against the model")
    assert wrong.startswith("worse: y: The model disagrees")


def test_the_page_has_measured_values_and_curves_beside_the_model(tmp_path):
    tree = run_line(tmp_path, LINE)
    (charts,) = measurement_charts(select_view(tree, None, None, None))
    against, curve, errors = charts.charts
    assert [each.title for each in charts.charts] == [
        *("measured against predicted", "curve"),
        "error against x",
    ]
    measured = against.marks[1]
    assert measured.bounds[0] == pytest.approx([1.1, 0.7, 1.5])  # two standard deviations
    fitted = tree["calibrations/fit/fitted"].values
    assert np.asarray(measured.places) == pytest.approx(fitted)
    line = next(mark for mark in curve.marks if isinstance(mark, Line))
    assert np.asarray(line.y) == pytest.approx(fitted)
    z = errors.marks[-1]
    assert np.asarray(z.y) == pytest.approx((fitted - [1.1, 2.9, 5.2, 6.8]) / 0.2)
    page = report_page(tree)
    assert "The model and the measurements" in page
    assert "The model fits 4 measured values of line" in page
