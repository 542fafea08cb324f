"""Indices of dependent inputs: they overlap, and estimates with intervals are shown."""

import numpy as np
import pytest

import uqpen
from uqpen.figures.page import panels
from uqpen.report.blocks import find_charts
from uqpen.report.plotly import traces
from uqpen.report.sections.outputs import sensitivity
from uqpen.results.archive_view import ArchiveView
from uqpen.results.output_tables import output_tables

DEPENDENT = """
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [{ inputs = ["a", "b"], correlation = 0.8 }]
"""
DESIGNS = """
[designs.small]
kind = "monte-carlo"
runs = 200
[designs.large]
kind = "monte-carlo"
runs = 400
[surrogates.chaos]
kind = "polynomial-chaos"
design = "small"
check = "large"
"""


@pytest.fixture(scope="module")
def tree(module_study_of):
    return uqpen.run(
        module_study_of("a + b + 0.6 * c", DEPENDENT + DESIGNS, a=(0, 1), b=(0, 1), c=(0, 1))
    )


def test_dependent_inputs_have_no_shares(tree):
    first = tree["statistics/chaos/y/first_order"].values[:, 0]
    assert first.sum() > 1.5
    (table,) = [each for each in output_tables(tree) if "its variance" in each.title]
    assert table.title == "y: its variance explained by inputs that depend on each other ¹"
    assert "can add up to more than 1" in table.notes[0]
    assert table.columns[0] == "Shapley effect\nchaos"
    (chart,) = find_charts(sensitivity(ArchiveView(tree, "")))
    assert chart.title == "Its variance explained by inputs that depend on each other"
    assert chart.x.title == "explained part of the variance"
    assert any("can add up to more than 1" in note for note in chart.notes)
    (panel,) = panels(tree, "sensitivity")
    assert "shares" not in panel.title


def test_indices_of_a_surrogate_with_intervals_stand_alone(tree):
    (chart,) = find_charts(sensitivity(ArchiveView(tree, "")))
    assert _drawn(chart) == ["Shapley effect by chaos", "first order by chaos"]
    assert "First-order indices by plain samples are in the table only." in chart.notes


def test_estimates_with_intervals_are_drawn_beside_those_of_a_surrogate_without(tree):
    without = tree.copy(deep=True)
    without["statistics/chaos/y/first_order"][:, 1:] = np.nan
    (chart,) = find_charts(sensitivity(ArchiveView(without, "")))
    # Of the plain samples the largest is drawn.
    assert _drawn(chart) == [
        "Shapley effect by chaos",
        "first order by large",
        "first order by chaos",
    ]
    (drawn,) = [trace for trace in traces(chart.marks) if trace["name"] == "first order by large"]
    assert set(drawn["marker"]["symbol"]) == {"circle"}
    reported = tree["statistics/large/y/first_order"].values
    assert np.isfinite(reported).all()
    assert "First-order indices by other plain samples are in the table only." in chart.notes
    (table,) = [each for each in output_tables(without) if "its variance" in each.title]
    assert "first order\nlarge" in table.columns


def _drawn(chart):
    return [trace["name"] for trace in traces(chart.marks) if not trace["name"].endswith("refused")]


def test_shapley_effects_decide_the_order_of_the_inputs_and_which_are_shown(study_of, monkeypatch):
    # All of what b does it shares with a; so its first-order index is large, its part is not.
    body = "3 * a + 0 * b + 2 * c"
    tree = uqpen.run(study_of(body, DEPENDENT + DESIGNS, a=(0, 1), b=(0, 1), c=(0, 1)))
    (chart,) = find_charts(sensitivity(ArchiveView(tree, "")))
    shapley = tree["statistics/chaos/y/shapley"].values[:, 0]
    ranked = [name for _, name in sorted(zip(-shapley, "abc", strict=True))]
    assert list(chart.y.rows) == ranked
    monkeypatch.setattr("uqpen.charts.measures._MOST_INPUTS", 2)
    (chart,) = find_charts(sensitivity(ArchiveView(tree, "")))
    assert list(chart.y.rows) == ["a", "c"]


def test_independent_inputs_have_shares(study_of):
    tree = uqpen.run(study_of("a + b + 0.6 * c", DESIGNS, a=(0, 1), b=(0, 1), c=(0, 1)))
    (chart,) = find_charts(sensitivity(ArchiveView(tree, "")))
    assert chart.title == "Shares of its variance"
    assert not any("add up" in note for note in chart.notes)
    assert "y: shares of its variance" in [each.title for each in output_tables(tree)]
