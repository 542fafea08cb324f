"""The trajectory at the nominal inputs, of one model or of several."""

import numpy as np
import pytest

from uqpen.charts.chart import Charts
from uqpen.report import SECTIONS
from uqpen.report.page import report_page
from uqpen.report.plotly import traces
from uqpen.report.sections.comparisons import trajectory
from uqpen.results.archive_view import ArchiveView


@pytest.mark.slow
def test_all_models_share_the_charts(archives):
    (group,) = trajectory(ArchiveView(archives["rods"], "original"))
    assert isinstance(group, Charts)
    reported = {
        name: model["trajectory"]
        for name, model in archives["rods"]["models"].children.items()
        if "trajectory" in model.children
    }
    assert [key.text for key in group.keys] == list(reported)
    first = group.charts[0]
    assert {trace["name"].split()[0] for trace in traces(first.marks)} == set(reported)
    for trace in traces(first.marks):
        model, quantity = trace["name"].split()
        array = reported[model][quantity]
        scale = 1e3 if first.y.title.endswith("[ms]") else 1
        ends = scale * array.values[[0, -1]]
        np.testing.assert_allclose([trace["y"][0], trace["y"][-1]], ends, rtol=1e-5)
        assert len(trace["x"]) <= 300
    assert [table.title for table in group.tables] == [
        f"Trajectory of {name}, by depth of the projectile's nose, z [cm]" for name in reported
    ]
    assert all(len(table.rows) == 11 for table in group.tables)
    assert group.notes[0] == (
        "One run at the nominal inputs: it has no scatter, so there are no intervals."
    )


def test_it_is_reported_once_and_below_no_model(archives, monkeypatch):
    monkeypatch.setattr("uqpen.report.page.SECTIONS", {"course": SECTIONS["course"]})
    text = report_page(archives["rods"])
    assert text.count("<figcaption>Time since impact</figcaption>") == 1
    assert "<h3>" not in text


def test_a_model_without_a_course_has_none(archives):
    assert not list(trajectory(ArchiveView(archives["beam"], "")))
