"""Figures in sensible digits, tables and JSON that agree with the archive."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

import uqpen
from uqpen.results.digits import estimate_text, estimate_texts, percent_text, tolerance_limit_text
from uqpen.results.failed_runs import failed_runs, has_failed_design
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import identity, shown_estimate


@pytest.mark.parametrize(
    ("estimate", "lower", "upper", "text"),
    [
        (0.49274, 0.49004, 0.49544, "0.4927 ± 0.0027"),
        (71.1, 70.6, 72.9, "71.1 (70.6 … 72.9)"),
        # ± is a half-width, where the sides are equal in the digits that are shown.
        (0.46630, 0.46391, 0.46867, "0.4663 ± 0.0024"),
        (0.46630, 0.46401, 0.46867, "0.4663 (0.4640 … 0.4687)"),
        (324.5, 321.3, 326.9, "324.5 (321.3 … 326.9)"),
        (3.5, 3.5, 3.5, "3.5"),
        # Without an interval, four digits: alike within a column.
        (387.02, math.nan, math.nan, "387.0"),
        (389.5, math.nan, math.nan, "389.5"),
        (27143.0, math.nan, math.nan, "27\u202f140"),
        (9.99996, math.nan, math.nan, "10.00"),
        (2.7143e-8, math.nan, math.nan, "2.714×10⁻⁸"),
        (0.0, math.nan, math.nan, "0"),
        (-0.5176, math.nan, math.nan, "−0.5176"),
        (-0.00004, -0.0011, 0.00102, "0.0000 ± 0.0011"),
        (3.51234567, math.nan, math.nan, "3.512"),
        (math.nan, math.nan, math.nan, "–"),
        (0.0, 0.0, 0.00037, "(0.0, 0.0 … 3.7)×10⁻⁴"),
        (12345.6, 12000.0, 12691.2, "12\u202f346 ± 346"),
        (4.0e8, 3.9e8, 4.1e8, "(4.00 ± 0.10)×10⁸"),
        (1.234e-7, 1.134e-7, 1.334e-7, "(1.23 ± 0.10)×10⁻⁷"),
        (-2.4, -2.6, -2.2, "−2.40 ± 0.20"),
        (5.0, math.nan, 6.0, "5.0 (? … 6.0)"),
        # An end that is the only one is rounded outward.
        (69.0, math.nan, 69.349, "69.00 (? … 69.35)"),
        (69.0, math.nan, 69.3412, "69.00 (? … 69.35)"),
        (69.0, 68.6588, math.nan, "69.00 (68.65 … ?)"),
        (0.0, 0.0, 0.030141, "0.000 (0.000 … 0.031)"),
        (1.0, 0.969859, 1.0, "1.000 (0.969 … 1.000)"),
        (-1.0, math.nan, -0.95012, "−1.000 (? … −0.950)"),
        (-1.0, -1.05012, math.nan, "−1.000 (−1.051 … ?)"),
    ],
)
def test_an_estimate_has_the_digits_its_interval_leaves(estimate, lower, upper, text):
    assert estimate_text(estimate, lower, upper) == text


@given(estimate=st.floats(-1e6, 1e6), below=st.floats(1e-3, 1e6), share=st.floats(0.7, 1.4))
def test_a_shown_estimate_is_right_to_a_twentieth_of_its_interval(estimate, below, share):
    above = below * share
    text = estimate_text(estimate, estimate - below, estimate + above).replace("\u202f", "")
    # With two digits of the half-width the last place is a tenth of it, at most half of that off.
    figures, _, power = text.removeprefix("(").partition(")×10")
    scale = 10.0 ** float(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
    shown = float(figures.split()[0].strip(",").replace("−", "-")) * scale
    half = max(estimate - (estimate - below), estimate + above - estimate)
    assert half == 0 or abs(shown - estimate) <= 0.051 * half


def test_a_bound_that_holds_is_shown_beside_its_estimate():
    assert tolerance_limit_text(13.4812, 13.7612) == "13.48, at most 13.77"
    assert tolerance_limit_text(13.48, 13.77) == "13.48, at most 13.77"
    assert tolerance_limit_text(13.4812, math.nan) == "13.48"
    assert tolerance_limit_text(4.0e8, 4.1e8) == "(4.00, at most 4.10)×10⁸"


@given(estimate=st.floats(-1e6, 1e6), upper=st.floats(1e-3, 1e6).filter(lambda side: side > 0))
def test_the_end_of_a_one_sided_interval_still_bounds_what_it_did(estimate, upper):
    bound = estimate + upper
    _, _, shown = estimate_texts(estimate, math.nan, bound)
    figure, _, power = shown.replace("\u202f", "").partition("×10")
    scale = 10.0 ** float(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
    # To the twelve digits in which it is read.
    assert float(figure.replace("−", "-")) * scale >= bound - 1e-11 * abs(bound)


def test_what_rounding_left_of_an_index_is_0():
    index = xr.DataArray(
        [-3.636e-08, math.nan, math.nan], dims="bound", name="first_order", coords={"input": "x"}
    )
    assert shown_estimate(index, identity) == "0"
    for name in ("response", "contribution", "pearson", "partial_rank", "delta"):
        assert shown_estimate(index.rename(name), identity) == "0"
    assert shown_estimate(index.drop_vars("input"), identity) == "−3.636×10⁻⁸"
    assert shown_estimate(index.rename("mean"), identity) == "−3.636×10⁻⁸"


def test_a_probability_in_per_cent_has_its_own_digits():
    assert [percent_text(p) for p in (0.05, 0.999, 0.9999)] == ["5 %", "99.9 %", "99.99 %"]


@pytest.fixture(scope="module")
def tree():
    rods = (Path(__file__).parents[1] / "data" / "rods.toml").read_text(encoding="utf-8")
    study = f"""
        title = "Rods"
        seed = 4
        {rods}
        [outputs.penetration_depth]
        unit = "cm"
        exceeds = ["60 cm"]
        hold = [0.9, 0.9999]
        [designs.few]
        kind = "monte-carlo"
        runs = 250
        [designs.spread]
        kind = "latin-hypercube"
        runs = 250
        replicates = 1
    """
    return uqpen.run(uqpen.parse_study(study))


@pytest.fixture(scope="module")
def tables(tree):
    return {table.title: table for table in output_tables(tree)}


def cell(table, row, column):
    return dict(table.rows)[row][table.columns.index(column)]


def test_there_is_a_table_for_each_output_in_the_units_of_the_study(tables):
    of_statistics = [title for title in tables if ":" not in title]
    assert of_statistics == [
        "penetration_depth [cm]",
        "projectile_residue [m]",
        "erosion_end_depth [m]",
        "termination",
    ]


def test_first_order_indices_of_a_plain_sample_are_shown_where_nothing_tells_them_better(tables):
    table = tables["penetration_depth: shares of its variance"]
    # Of two samples of one size, the first.
    assert table.columns == ["first order\nfew"]
    assert [label for label, _ in table.rows][-1] == "crater_radius"


def test_all_that_is_reported_of_the_inputs_part_is_shown_when_it_is_asked_for(tree):
    shown = {table.title: table for table in output_tables(tree, everything=True)}
    shares = shown["penetration_depth: shares of its variance"]
    assert shares.columns == ["first order\nfew", "first order\nspread"]
    association = shown["penetration_depth: association with its inputs"]
    assert "Spearman\nfew" in association.columns
    assert "delta\nspread" in association.columns
    exceeding = shown["penetration_depth: shares of the variance of exceeding 60 cm"]
    assert exceeding.columns == ["first order\nfew", "first order\nspread"]
    assert "penetration_depth: shares of its logarithm's variance" in shown


def test_figures_are_shown_in_the_units_of_the_study(tree, tables):
    mean = float(tree["statistics/few/penetration_depth"]["mean"].sel(bound="estimate"))
    shown = cell(tables["penetration_depth [cm]"], "mean", "few")
    assert float(shown.split()[0]) == pytest.approx(100 * mean, abs=1)


def test_a_percentage_scales_the_output_and_not_its_probabilities(tmp_path):
    (tmp_path / "share.py").write_text("def f(x): return {'y': x}")
    study = """
        seed = 1
        [model]
        python = "share.py:f"
        [model.inputs]
        x = "1"
        [model.outputs]
        y = "1"
        [inputs]
        x = { uniform = { lower = 0.4, upper = 0.6 } }
        [outputs.y]
        unit = "%"
        exceeds = ["50 %"]
        [designs.a]
        kind = "monte-carlo"
        runs = 400
    """
    table = next(output_tables(uqpen.run(uqpen.parse_study(study, folder=tmp_path))))
    assert table.title == "y [%]"
    assert 49 < float(cell(table, "mean", "a").split()[0]) < 51
    assert 5 < float(cell(table, "sd", "a").split()[0]) < 7
    assert 0.4 < float(cell(table, "P(> 50 %)", "a").split()[0]) < 0.6
    assert abs(float(cell(table, "skewness", "a").split()[0].replace("−", "-"))) < 1


def test_lost_runs_are_counted_and_their_probability_reported(tables):
    table = tables["penetration_depth [cm]"]
    assert "inadmissible" in cell(table, "lost", "few")
    assert "±" in cell(table, "P(inadmissible)", "few") or "…" in cell(
        table, "P(inadmissible)", "few"
    )
    assert any("conditional on admissible inputs" in note for note in table.notes)


def test_a_figure_without_an_interval_says_why(tables):
    table = tables["penetration_depth [cm]"]
    assert "±" not in cell(table, "sd", "few")
    assert any("heavy tail" in note for note in table.notes)
    assert "half 16–84 % range" in dict(table.rows)


def test_a_bound_that_too_few_runs_give_says_how_many_it_takes(tables):
    table = tables["penetration_depth [cm]"]
    assert "at most" in cell(table, "not exceeded, 90 %", "few")
    assert "at most" not in cell(table, "not exceeded, 99.99 %", "few")
    assert any("at least 29956 runs" in note for note in table.notes)


def test_a_wider_interval_than_need_be_says_so(tables):
    table = tables["penetration_depth [cm]"]
    assert any("conservative" in note for note in table.notes)


def test_kinds_have_shares_and_no_mean(tables):
    labels = [label for label, _ in tables["termination"].rows]
    assert labels[-3:] == ["share v = u", "share u = 0", "share rigid"]
    assert "mean" not in labels


def test_what_was_lost_is_reported_with_its_reasons(tree):
    found = list(failed_runs(tree, "few"))
    counted = archive_json(tree)["designs"]["few"]
    assert sum(loss.runs for loss in found) == counted["status"]["inadmissible"]
    assert {loss.reason for loss in found} == {entry["reason"] for entry in counted["reasons"]}
    assert [loss.runs for loss in found] == sorted((loss.runs for loss in found), reverse=True)
    assert not has_failed_design(tree)


def test_reasons_with_other_numbers_are_one_with_an_example(tree):
    runs = tree["runs/few"].to_dataset(inherit=False)
    numbers = [f"radius {n}.5 is too small" for n in range(runs.sizes["lost_run"])]
    changed = tree.copy()
    reasons = np.array(numbers, dtype=object)
    changed["runs/few"] = xr.DataTree(runs.assign(lost_reason=("lost_run", reasons)))
    (entry,) = archive_json(changed)["designs"]["few"]["reasons"]
    assert entry["reason"] == "radius # is too small"
    assert entry["example"] == "radius 0.5 is too small"
    assert entry["runs"] == len(numbers) > 3


def test_json_holds_every_figure_in_si_units(tree):
    found = json.loads(json.dumps(archive_json(tree), allow_nan=False))
    few = found["designs"]["few"]
    assert few["runs"] == 250
    assert few["status"]["ok"] + few["status"]["inadmissible"] == 250
    depth = few["outputs"]["penetration_depth"]
    for figure in (
        depth["mean"],
        depth["std"],
        depth["quantiles"]["0.95"],
        depth["exceedance"]["60 cm"],
        depth["hold"]["0.9"],
        few["outputs"]["termination"]["shares"]["standstill"],
        few["lost"]["inadmissible"],
    ):
        assert {"estimate", "lower", "upper"} <= set(figure)
    assert 0.3 < depth["mean"]["estimate"] < 1.5, "metres, not centimetres"
    assert depth["std"]["lower"] is None
    assert "heavy tail" in depth["std"]["note"]
    assert depth["hold"]["0.9999"]["runs_needed"] == 29956
    assert "mean" not in few["outputs"]["termination"]
    assert few["conditional_on"] == "admissible inputs"
    assert depth["mean"]["interval_label"] == "nominal"


def test_json_holds_every_measure_that_lies_along_the_inputs(study_of):
    text = """
        [designs.lhs]
        kind = "latin-hypercube"
        runs = 100
        [surrogates.chaos]
        kind = "polynomial-chaos"
        design = "lhs"
        transform = { y = "log" }
        """
    tree = uqpen.run(study_of("np.exp(a + b)", text, a=(0, 1), b=(0, 1)))
    found = archive_json(tree)
    for kind, source in (("designs", "lhs"), ("surrogates", "chaos")):
        held = SourceStatistics(tree).statistics(source, "y")
        names = {name for name, array in held.items() if "input" in array.dims}
        assert set(found[kind][source]["outputs"]["y"]["sensitivity"]["a"]) == names
    assert {"shapley", "log_shapley"} <= names


def test_a_fixed_input_may_be_called_a_coefficient(study_of):
    text = """
        [designs.lhs]
        kind = "latin-hypercube"
        runs = 100
        [surrogates.chaos]
        kind = "polynomial-chaos"
        design = "lhs"
        """
    study = study_of("drag_coefficient * x", text, x=(1, 2), drag_coefficient="3")
    tree = uqpen.run(study)
    (fit,) = [table for table in output_tables(tree) if table.title.startswith("chaos: fit")]
    assert [label for label, _ in fit.rows] == ["y"]
    assert list(archive_json(tree)["surrogates"]["chaos"]["outputs"]) == ["y"]


def test_a_published_number_keeps_its_digits():
    number = xr.DataArray([0.5, math.nan, math.nan], dims="bound", name="mean")
    assert shown_estimate(number, identity) == "0.5"
    assert shown_estimate(number.assign_attrs(runs=10), identity) == "0.5000"
