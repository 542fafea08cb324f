"""Statistics over unknowns of distributions, from the runs of one design by weights."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.stats import norm, t

import uqpen
from uqpen.charts.distributions import bound_charts, cdf_charts
from uqpen.charts.marks import Band, Line
from uqpen.core.labels import STATUS, WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.distributions.univariate import Normal
from uqpen.report.sections.findings import alerts
from uqpen.report.sections.summary import summary_lines
from uqpen.results.archive_view import select_view
from uqpen.results.error_statement import error_statements
from uqpen.results.found_bounds import found_bounds
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import estimate_remark
from uqpen.statistics import statistics_over_unknowns as module

SPECIMENS = [9.1, 10.4, 8.7, 10.9, 9.8, 11.3, 10.1, 9.5]
MEASURED = '{ measured = { file = "x.csv", family = "normal", uncertain = true } }'
BOX = "{ normal = { mean = [0, 1], std = [1, 1.5] } }"
ASKED = "[outputs.y]\nexceeds = [3]\nbelow = [0]\nquantiles = [0.9]\n[designs.some]\n"


def stated(tree):
    return SourceStatistics(tree).statistics("some", "y")


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The input of the specimens, from a file that any study finds."""
    file = tmp_path_factory.mktemp("specimens") / "x.csv"
    file.write_text("x\n" + "\n".join(map(str, SPECIMENS)))
    return MEASURED.replace("x.csv", str(file))


@pytest.fixture(scope="module")
def fitted(module_study_of, measured):
    text = "[outputs.y]\nbelow = [8]\nquantiles = [0.05]\n[designs.some]\n"
    design = 'kind = "monte-carlo"\nruns = 4000'
    made = module_study_of("x + 0 * b", text + design, x=measured, b="0 ± 1")
    return made, uqpen.run(made)


def test_a_fitted_input_has_its_predictive_its_plug_in_and_the_interval_over_its_draws(fitted):
    study, tree = fitted
    found = stated(tree)
    (unknown,) = study.joint.fitted.values()
    at = np.array(8.0)
    exact = {
        "below": float(unknown.predictive.cdf(at)),
        "plug_in_below": float(unknown.fitted.cdf(at)),
    }
    for name, value in exact.items():
        _, lower, upper = found[name].values[0]
        assert lower < value < upper
    # The draws are known exactly; runs by weights add little to their interval.
    draws = np.array([float(each.cdf(at)) for each in unknown.draws])
    low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975])
    assert found["fitted_below"].values[0] == pytest.approx([middle, low, high], rel=0.15, abs=2e-3)
    quantiles = np.quantile([each.ppf(np.array(0.05)) for each in unknown.draws], [0.025, 0.975])
    fifth = found["fitted_quantile"].sel(probability=0.05)
    assert fifth.values[1:] == pytest.approx(quantiles, abs=0.25)
    means = np.quantile([each.mean for each in unknown.draws], [0.025, 0.975])
    assert found["fitted_mean"].values[1:] == pytest.approx(means, abs=0.06)
    # The interval over the parameters is wider than that of the sampling.
    width = np.ptp(found["plug_in_below"].values[0, 1:])
    assert np.ptp(found["fitted_below"].values[0, 1:]) > 5 * width
    assert "the family is taken as known" in estimate_remark(found["fitted_below"][0])


def test_a_predictive_probability_is_never_stated_alone(fitted):
    _, tree = fitted
    said = " ".join(summary_lines(tree)).replace("\u00a0", " ")
    assert "of the next one; over all parameters that fit the specimens as well" in said
    assert "x (8). Each answer is of the next one" in said
    assert "No interval includes the uncertainty of these fits" not in said
    *_, scope = alerts(select_view(tree, None, None, None), "some", [])
    assert "and those over parameters that of the fits, too, not that of the" in scope.text


def test_draws_of_which_few_runs_count_are_told(fitted, monkeypatch):
    study, tree = fitted
    monkeypatch.setattr(module, "_FEW_OF_DRAW", 0.5)
    runs = tree["runs/some"].to_dataset()
    asked = runs, study.quantities_of_interest, study.joint
    found = module.statistics_over_unknowns(*asked, only={"exceedance"})
    assert "% of the runs count for" in estimate_remark(found["y"]["fitted_below"][0])


def test_numbers_do_not_depend_on_the_draws_that_are_in_memory_together(fitted, monkeypatch):
    study, tree = fitted
    runs = tree["runs/some"].to_dataset()
    asked = runs, study.quantities_of_interest, study.joint
    before = module.statistics_over_unknowns(*asked, only={"exceedance"})["y"]["fitted_below"]
    monkeypatch.setattr(module, "_TOGETHER", 250)
    after = module.statistics_over_unknowns(*asked, only={"exceedance"})["y"]["fitted_below"]
    assert after.values == pytest.approx(before.values, rel=1e-12)


def test_runs_of_another_distribution_count_by_their_weights_as_well(fitted):
    study, tree = fitted
    (unknown,) = study.joint.fitted.values()
    drawn = Normal(9.5, 2.0)
    x = drawn.ppf(np.random.default_rng(3).random(8000))
    weight = np.exp(study.joint.random[0].distribution.log_density(x) - drawn.log_density(x))
    points = {"x": ("run", x), "y": ("run", x), "b": ("run", np.zeros(8000))}
    runs = xr.Dataset(points | {STATUS: ("run", np.zeros(8000, np.int8))})
    runs = runs.assign_coords({WEIGHT: ("run", weight)})
    runs = runs.assign_attrs(sampling=str(Sampling.INDEPENDENT))
    asked = runs, study.quantities_of_interest, study.joint
    found = module.statistics_over_unknowns(*asked, only={"exceedance"})["y"]
    of_draws = stated(tree)["fitted_below"].values[0]
    assert found["fitted_below"].values[0] == pytest.approx(of_draws, rel=0.15, abs=2e-3)
    plug_in = float(unknown.fitted.cdf(np.array(8.0)))
    assert found["plug_in_below"].values[0, 0] == pytest.approx(plug_in, abs=4e-3)


@pytest.fixture(scope="module")
def box(module_study_of):
    study = module_study_of(
        "x + 0 * b", ASKED + 'kind = "monte-carlo"\nruns = 2000', x=BOX, b="0 ± 1"
    )
    return study, uqpen.run(study)


def test_bounds_over_a_box_contain_the_true_ones(box):
    _, tree = box
    found = stated(tree)
    exact = {
        "exceedance": norm.sf([3, 4 / 3]),
        "below": norm.cdf([-1, 0]),
        "quantile": [norm.ppf(0.9), 1 + 1.5 * norm.ppf(0.9)],
        "mean": [0, 1],
    }
    for name, (least, largest) in exact.items():
        lower, upper = (found[f"{end}_{name}"] for end in ("lower", "upper"))
        if name == "quantile":
            lower, upper = (each.sel(probability=0.9) for each in (lower, upper))
        lower, upper = np.ravel(lower.values), np.ravel(upper.values)
        assert lower[1] <= least <= lower[0] + 3 * (lower[0] - lower[1])
        assert upper[0] - 3 * (upper[2] - upper[0]) <= largest <= upper[2]
        assert lower[0] < (least + largest) / 2 < upper[0]
    note = estimate_remark(found["upper_exceedance"][0])
    assert "largest, with x of mean 1, std 1.5" in note


def test_a_box_has_no_one_distribution(box):
    study, tree = box
    assert tree["runs/some"].attrs["sampling"] == Sampling.OVER_BOX
    assert not {"mean", "exceedance", "cdf", "first_order"} & {*tree["statistics/some/y"].data_vars}
    assert study.joint.at({"x": Normal(0.0, 1.0)}).boxes == {}
    lines = " ".join(summary_lines(tree)).replace("\u00a0", " ")
    assert "over all values of mean and std of x; both bounds lie between" in lines
    bounds = {each.title for each in found_bounds(SourceStatistics(tree), "some")}
    assert bounds >= {"P(> 3) of y", "mean of y"}


def test_too_few_runs_of_a_distribution_give_no_bounds(study_of):
    wide = "{ normal = { mean = [0, 20], std = 1 } }"
    study = study_of(
        "x", '[outputs.y]\nexceeds = [3]\n[designs.some]\nkind = "monte-carlo"\nruns = 900', x=wide
    )
    found = stated(uqpen.run(study))["upper_exceedance"]
    assert np.isnan(found.values[0, 1:]).all()
    assert "no bounds:" in estimate_remark(found[0])
    reason = estimate_remark(found[0])
    assert "effective runs (" in reason
    assert "count for a distribution of the box (at least 30, and 10 %): take more runs" in reason


def test_without_the_event_there_are_no_bounds(study_of):
    study = study_of(
        "x", '[outputs.y]\nexceeds = [99]\n[designs.some]\nkind = "monte-carlo"\nruns = 500', x=BOX
    )
    found = stated(uqpen.run(study))["upper_exceedance"]
    assert np.isnan(found.values[0, 1:]).all()
    assert "the event occurs in all runs or in none" in estimate_remark(found[0])


def test_failed_runs_widen_bounds_for_any_outcome(box):
    study, tree = box
    runs = tree["runs/some"].to_dataset()
    lost = runs.assign({STATUS: runs[STATUS].where(np.arange(2000) >= 40, 2)})
    lost["y"] = lost["y"].where(lost[STATUS] == 0)
    asked = lost, study.quantities_of_interest, study.joint
    found = module.statistics_over_unknowns(*asked, only={"exceedance"})["y"]
    before = stated(tree)["upper_exceedance"].values[0, 2]
    assert found["upper_exceedance"].values[0, 2] > before + 0.01


def test_the_concrete_wall_of_eight_specimens():
    path = Path(__file__).parents[2] / "studies" / "concrete_specimens.toml"
    text = path.read_text(encoding="utf-8").replace("runs = 8_000", "runs = 3_000")
    tree = uqpen.run(uqpen.parse_study(text, folder=path.parent))
    found = SourceStatistics(tree).statistics("monte_carlo", "penetration_depth")
    # By exact draws of the posterior and 8 000 runs: 0.155; 0.140 with a deviation of 40 MPa;
    # 0.092 to 0.276, whose upper end is that of 25 draws.
    assert found["exceedance"].values[0, 0] == pytest.approx(0.155, abs=0.02)
    assert found["plug_in_exceedance"].values[0, 0] == pytest.approx(0.138, abs=0.02)
    _, lower, upper = found["fitted_exceedance"].values[0]
    assert lower == pytest.approx(0.092, abs=0.015)
    assert upper == pytest.approx(0.276, abs=0.05)


def test_a_box_has_two_curves_and_a_fitted_input_one_in_a_band(box, fitted):
    _, tree = box
    (chart,) = bound_charts(select_view(tree, None, None, None))
    least, largest = (mark for mark in chart.marks if isinstance(mark, Line))
    assert (least.name, largest.name) == ("least probability", "largest probability")
    inner = slice(100, 900)
    x = np.asarray(least.x)[inner]
    corners = [norm.cdf(x, mean, std) for mean in (0, 1) for std in (1, 1.5)]
    assert np.asarray(least.y)[inner] == pytest.approx(np.min(corners, axis=0), abs=0.05)
    assert np.asarray(largest.y)[inner] == pytest.approx(np.max(corners, axis=0), abs=0.05)
    study, tree = fitted
    (chart,) = cdf_charts(select_view(tree, None, None, None))
    (band,) = (mark for mark in chart.marks if isinstance(mark, Band))
    draws = [each.cdf(np.asarray(band.x)) for each in study.joint.fitted["x"].draws]
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    assert np.asarray(band.lower)[inner] == pytest.approx(low[inner], abs=0.05)
    assert np.asarray(band.upper)[inner] == pytest.approx(high[inner], abs=0.05)
    assert "95 % of all parameters that fit as well" in {key.text for key in chart.keys}


def test_the_total_over_both_is_computed_and_no_narrower_than_a_part(study_of, measured):
    box = "{ normal = { mean = [0, 1], std = 1 } }"
    text = '[outputs.y]\nexceeds = [12]\n[designs.some]\nkind = "monte-carlo"\nruns = 4000'
    study = study_of("x + z", text, x=measured, z=box)
    tree = uqpen.run(study)
    found = stated(tree)
    _, lower, upper = found["total_exceedance"].values[0]
    assert lower <= found["lower_exceedance"].values[0, 1]
    assert upper >= found["upper_exceedance"].values[0, 2]
    draws = study.joint.fitted["x"].draws
    exact = [
        [norm.sf(12, each.mean + mean, np.hypot(each.std, 1)) for each in draws] for mean in (0, 1)
    ]
    assert lower == pytest.approx(np.quantile(exact[0], 0.025), abs=0.01)
    assert upper == pytest.approx(np.quantile(exact[1], 0.975), abs=0.05)
    lines = " ".join(summary_lines(tree)).replace("\u00a0", " ")
    assert "the total, which is no sum of both; fewer than 5 % of the runs" in lines
    (table,) = (each for each in output_tables(tree) if "bounds over" in each.title)
    assert table.columns[-1] == "range, with uncertain parameters"
    assert dict(table.rows)["P(> 12) of y"][-1] == "2 % … 43 % ³ ⁴"
    assert table.notes[3] == "the family is taken as known"
    statement = next(iter(error_statements(tree)))
    parts = {part.name: part for part in statement.parts}
    assert statement.total.lower <= parts["intervals"].lower
    assert statement.total.upper >= parts["limits of these"].upper
    assert "the parameters, the intervals and the runs together" in statement.total.definition


def test_an_event_has_bounds_over_a_box(study_of):
    text = (
        '[joint_probabilities]\nhigh = ["y > 3"]\n[designs.some]\nkind = "monte-carlo"\nruns = 2000'
    )
    tree = uqpen.run(study_of("x", text, x=BOX))
    high, *_ = found_bounds(SourceStatistics(tree), "some")
    assert high.title == "P(y > 3)"
    least, largest = high.range
    assert least <= norm.sf(3) <= float(high.lower[2])
    assert float(high.upper[1]) <= norm.sf(4 / 3) <= largest
    assert estimate_remark(high.upper) == "largest, with x of mean 1, std 1.5"


def test_one_statement_has_all_parts_of_an_error(fitted):
    _, tree = fitted
    below, *others = error_statements(tree)
    labels = ["mean", "5 % quantile", "median", "95 % quantile"]
    assert [below.label, *(each.label for each in others)] == ["P(< 8)", *labels]
    parts = {part.name: part for part in (*below.parts, below.total, *below.bought)}
    more = [f"fitted, {count} specimens of x" for count in (16, 32)]
    assert [*parts] == ["sampling", "fitted", "total", "sampling, 4 times the runs", *more]
    found = stated(tree)
    assert parts["sampling"][1:3] == tuple(found["plug_in_below"].values[0, 1:])
    assert parts["fitted"][1:3] == parts["total"][1:3] == tuple(found["fitted_below"].values[0, 1:])
    # No total is narrower than a part, and more runs make no other part narrower.
    for part in parts.values():
        assert parts["total"].lower <= part.lower <= part.upper <= parts["total"].upper
    four = parts["sampling, 4 times the runs"]
    assert 2 * (four.upper - four.lower) == pytest.approx(
        parts["sampling"].upper - parts["sampling"].lower
    )
    tables = {table.title: table for table in output_tables(tree)}
    shown = dict(tables["y: what the errors are made of, some"].rows)
    assert [*shown] == [*parts]
    assert (
        "the parameters and the runs together"
        in tables["y: what the errors are made of, some"].notes[2]
    )
    # The curve is a band, and no row of a table.
    assert all(label for label, _ in tables["y"].rows)
    errors = archive_json(tree)["errors"]["y, P(< 8)"]
    assert errors["total"]["upper"] == parts["total"].upper


def test_more_specimens_make_the_part_of_the_parameters_narrower_as_computed(fitted):
    _, tree = fitted
    _, mean, *_ = error_statements(tree)
    parts, scatter = {part.name: part for part in mean.bought}, np.std(SPECIMENS)
    for count in (16, 32):
        part = parts[f"fitted, {count} specimens of x"]
        # Student's interval of a mean, whose sum of squares is that of copies of the specimens; the
        # ends lie on 10 of 400 draws, and the runs add little.
        half = t.ppf(0.975, count - 1) * scatter / np.sqrt(count - 1)
        assert part.upper - part.lower == pytest.approx(2 * half, rel=0.15)
        assert (part.lower + part.upper) / 2 == pytest.approx(np.mean(SPECIMENS), abs=0.1)
    found = stated(tree)["more_specimens_below"]
    assert found["specimens"].values.tolist() == ["16 specimens of x", "32 specimens of x"]
    widths = np.ptp(found.values[:, 0, 1:], axis=1)
    assert widths[1] < widths[0] < np.ptp(stated(tree)["fitted_below"].values[0, 1:])


def test_failed_runs_widen_the_total_of_a_probability_and_of_no_mean(study_of, measured):
    body = "np.where(b > 1.6, np.nan, x + b)"
    text = "[outputs.y]\nbelow = [8]\n[designs.some]\n" + 'kind = "monte-carlo"\nruns = 1000'
    tree = uqpen.run(study_of(body, text, x=measured, b="0 ± 1"))
    below, mean, *_ = error_statements(tree)
    share = 1 - tree["runs/some"]["y"].notnull().values.mean()
    over = dict(zip(("lower", "upper"), stated(tree)["fitted_below"].values[0, 1:], strict=True))
    assert below.total.lower == pytest.approx((1 - share) * over["lower"])
    assert below.total.upper == pytest.approx((1 - share) * over["upper"] + share)
    assert mean.total[1:3] == tuple(stated(tree)["fitted_mean"].values[1:])


def test_each_input_has_more_specimens_of_its_own(study_of, measured):
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 1000'
    tree = uqpen.run(study_of("x + 0.1 * z", text, x=measured, z=measured))
    parts = {part.name: part for part in next(iter(error_statements(tree))).bought}
    of = {
        name: parts[f"fitted, 32 specimens of {name}"].upper
        - parts[f"fitted, 32 specimens of {name}"].lower
        for name in "xz"
    }
    # The width is nearly all due to x.
    assert of["x"] < 0.6 * of["z"]


def test_a_statement_is_by_the_design_that_has_the_interval_and_names_its_surrogates(
    study_of, measured
):
    text = (
        '[designs.blocks]\nkind = "saltelli"\nbase = 32\n'
        '[designs.some]\nkind = "monte-carlo"\nruns = 60\n'
        '[surrogates.one]\nkind = "polynomial-chaos"\ndesign = "some"\norder = 1\n'
        '[surrogates.two]\nkind = "polynomial-chaos"\ndesign = "some"\norder = 2\n'
    )
    tree = uqpen.run(study_of("x + b", text, x=measured, b="0 ± 1"))
    mean, *_ = error_statements(tree)
    assert mean.design == "some"
    assert [part.name for part in mean.parts] == [
        *("sampling", "surrogate one", "surrogate two", "fitted"),
    ]
    assert mean.total.definition.endswith("; without surrogate one and surrogate two")


def test_events_of_several_outputs_have_the_interval_over_the_draws(study_of, measured):
    text = '[joint_probabilities]\nlow = ["y < 8"]\n[outputs.y]\nbelow = [8]\n[designs.some]\n'
    tree = uqpen.run(study_of("x", text + 'kind = "monte-carlo"\nruns = 1000', x=measured))
    joint = SourceStatistics(tree).joint_statistics("some")["fitted_joint_probability"]
    assert joint.values[0] == pytest.approx(stated(tree)["fitted_below"].values[0])
    said = " ".join(summary_lines(tree)).replace("\u00a0", " ")
    assert said.count("over all parameters that fit the specimens as well") >= 2
    (table,) = (each for each in output_tables(tree) if each.title == "joint probabilities")
    assert [label for label, _ in table.rows] == ["P(low) ¹", "P(low), over parameters"]
    assert archive_json(tree)["designs"]["some"]["joint_probabilities"]["low"]["fitted"]["upper"]
