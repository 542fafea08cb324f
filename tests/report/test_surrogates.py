"""Surrogates against their model, run by run and figure by figure."""

import numpy as np
import pytest

import uqpen
from uqpen.charts.chart import Charts
from uqpen.report.blocks import Table
from uqpen.report.plotly import traces
from uqpen.report.sections.comparisons import surrogates
from uqpen.results.archive_view import ArchiveView
from uqpen.results.surrogate_tables import correction_tables

pytestmark = pytest.mark.slow

FLAT = """[designs.many]
kind = "monte-carlo"
runs = 2000
[designs.few]
kind = "latin-hypercube"
runs = 30
[surrogates.flat]
kind = "polynomial-chaos"
design = "few"
check = "many"
order = 1
method = "least-squares"
"""


@pytest.fixture(scope="module")
def tree(module_study_of):
    return uqpen.run(module_study_of("np.exp(3 * a) + b", FLAT, a=(0, 1), b=(0, 1)))


def blocks(tree):
    return list(surrogates(ArchiveView(tree, "")))


def one(tree, kind):
    (found,) = [block for block in blocks(tree) if isinstance(block, kind)]
    return found


def line_of(tree):
    """The surrogate y = c + a * slope + b * slope, out of its coefficients."""
    inputs = tree["runs/few"]
    columns = np.column_stack([np.ones(30), inputs["a"].values, inputs["b"].values])
    found, *_ = np.linalg.lstsq(columns, inputs["y"].values, rcond=None)
    return tuple(found.tolist())


def test_points_are_the_model_and_its_surrogate(tree):
    charts = one(tree, Charts)
    (chart,) = charts.charts
    diagonal, cloud, worst = traces(chart.marks)
    assert diagonal["x"] == diagonal["y"]
    runs = tree["runs/many"]
    at = cloud["customdata"]
    assert len(at) == 400
    c, a, b = line_of(tree)
    guess = c + a * runs["a"].values + b * runs["b"].values
    np.testing.assert_allclose(cloud["x"], runs["y"].values[at], rtol=1e-4)
    np.testing.assert_allclose(cloud["y"], guess[at], rtol=1e-3, atol=1e-3)
    off = np.abs(guess - runs["y"].values)
    assert worst["customdata"] == np.sort(np.argsort(-off)[:10]).tolist()
    assert charts.notes == (
        "Shown are 400 of 2\u202f000 runs of many, and the 10 with the largest differences "
        "(not training runs).",
    )
    q2 = float(tree["surrogates/flat/y"].attrs["check_q2_of_output"])
    assert chart.title == f"y: Q² {q2:.5f} (check runs)"
    assert chart.summary.startswith(
        f"Half of the 2\u202f000 runs differ by at most {np.median(off):.3g}, 95 % by at most "
        f"{np.quantile(off, 0.95):.3g}, and the largest difference is {off.max():.3g}."
    )


def test_differences_are_of_all_runs(tree):
    (table,) = one(tree, Charts).tables
    assert table.title == "Surrogate minus model, in 2\u202f000 runs of many"
    c, a, b = line_of(tree)
    runs = tree["runs/many"]
    off = c + a * runs["a"].values + b * runs["b"].values - runs["y"].values
    ((label, cells),) = table.rows
    assert label == "y"
    assert cells[1] == f"{np.sqrt(np.mean(off**2)):.3g} ¹"
    assert cells[3] == f"{np.abs(off).max():.3g} ¹"


def test_the_fit_and_the_corrected_estimates_stand_below_each_other(tree):
    fit, corrected = (block.table for block in blocks(tree) if isinstance(block, Table))
    assert fit.title == "flat: fit to 30 runs, check by many"
    assert [corrected] == list(correction_tables(tree, "flat"))


def test_without_others_it_is_held_against_the_runs_it_was_fitted_to(study_of):
    text = FLAT[FLAT.index("[designs.few]") :].replace('check = "many"\n', "")
    tree = uqpen.run(study_of("a + b", text, a=(0, 1), b=(0, 1)))
    assert one(tree, Charts).notes == ("Shown are 30 of 30 runs of few (its training runs).",)


def test_an_archive_without_surrogates_has_none(archives):
    assert not blocks(archives["beam"])
