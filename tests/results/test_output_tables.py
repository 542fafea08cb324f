"""Tables and JSON that agree with the archive."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.results.failed_runs import failed_runs, has_failed_design
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import identity, shown_estimate


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


def test_a_percentage_scales_the_output_and_not_its_probabilities(study_of):
    asked = '[outputs.y]\nunit = "%"\nexceeds = ["50 %"]'
    design = '[designs.a]\nkind = "monte-carlo"\nruns = 400'
    table = next(output_tables(uqpen.run(study_of("x", f"{asked}\n{design}", x=(0.4, 0.6)))))
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


def test_notes_say_what_an_interval_lacks(tables):
    table = tables["penetration_depth [cm]"]
    assert "±" not in cell(table, "sd", "few")
    assert "half 16–84 % range" in dict(table.rows)
    assert "at most" in cell(table, "not exceeded, 90 %", "few")
    assert "at most" not in cell(table, "not exceeded, 99.99 %", "few")
    for words in ("heavy tail", "at least 29956 runs", "conservative"):
        assert any(words in note for note in table.notes), words


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


# A surrogate, which is fitted to the design before it.
FITTED = """
[designs.lhs]
kind = "latin-hypercube"
runs = 100
[surrogates.chaos]
kind = "polynomial-chaos"
design = "lhs"
"""


def test_json_holds_every_measure_that_lies_along_the_inputs(study_of):
    text = f'{FITTED}transform = {{ y = "log" }}'
    tree = uqpen.run(study_of("np.exp(a + b)", text, a=(0, 1), b=(0, 1)))
    found = archive_json(tree)
    for kind, source in (("designs", "lhs"), ("surrogates", "chaos")):
        held = SourceStatistics(tree).statistics(source, "y")
        names = {name for name, array in held.items() if "input" in array.dims}
        assert set(found[kind][source]["outputs"]["y"]["sensitivity"]["a"]) == names
    assert {"shapley", "log_shapley"} <= names


def test_a_fixed_input_may_be_called_a_coefficient(study_of):
    tree = uqpen.run(study_of("drag_coefficient * x", FITTED, x=(1, 2), drag_coefficient="3"))
    (fit,) = [table for table in output_tables(tree) if table.title.startswith("chaos: fit")]
    assert [label for label, _ in fit.rows] == ["y"]
    assert list(archive_json(tree)["surrogates"]["chaos"]["outputs"]) == ["y"]


def test_a_published_number_keeps_its_digits():
    number = xr.DataArray([0.5, math.nan, math.nan], dims="bound", name="mean")
    assert shown_estimate(number, identity) == "0.5"
    assert shown_estimate(number.assign_attrs(runs=10), identity) == "0.5000"


def test_what_rounding_left_of_an_index_is_0():
    index = xr.DataArray(
        [-3.636e-08, math.nan, math.nan], dims="bound", name="first_order", coords={"input": "x"}
    )
    assert shown_estimate(index, identity) == "0"
    for name in ("response", "contribution", "pearson", "partial_rank", "delta"):
        assert shown_estimate(index.rename(name), identity) == "0"
    assert shown_estimate(index.drop_vars("input"), identity) == "−3.636×10⁻⁸"
    assert shown_estimate(index.rename("mean"), identity) == "−3.636×10⁻⁸"
