"""Runs as points, and what is said of which are shown."""

import numpy as np
import pytest

import uqpen
from uqpen.charts.chart import Charts
from uqpen.report.blocks import Fold
from uqpen.report.plotly import charts_json, traces
from uqpen.report.sections.outputs import scatter
from uqpen.results.archive_view import ArchiveView
from uqpen.results.input_measures import input_order

pytestmark = pytest.mark.slow


def groups(tree, model=""):
    found = [
        each
        for block in scatter(ArchiveView(tree, model))
        for each in (block.blocks if isinstance(block, Fold) else [block])
    ]
    return [block for block in found if isinstance(block, Charts)]


def test_runs_stand_where_the_archive_has_them(archives):
    (group,) = groups(archives["beam"])
    runs = archives["beam"]["runs/only"]
    is_ok = runs["status"].values == 0
    first, second = group.charts
    assert [first.title, second.title] == ["deflection against load", "deflection against span"]
    came_back, lost = traces(first.marks)
    np.testing.assert_allclose(came_back["x"], runs["load"].values[is_ok] / 1e3, rtol=1e-4)
    np.testing.assert_allclose(came_back["y"], 1e3 * runs["deflection"].values[is_ok], rtol=1e-4)
    assert came_back["customdata"] == np.flatnonzero(is_ok).tolist()
    assert lost["customdata"] == np.flatnonzero(~is_ok).tolist()
    assert set(lost["text"]) == {"failed"}
    (foot,) = set(lost["y"])
    assert first.y.ends is not None
    assert first.y.ends[0] < foot < min(came_back["y"])
    assert came_back["hovertemplate"] == (
        "run %{customdata}<br>load %{x:.4~g} kN<br>deflection %{y:.4~g} mm<extra></extra>"
    )
    assert group.notes == ("Runs of only in the charts: all 98 completed, all 22 failed.",)
    assert [key.text for key in group.keys] == [
        "run",
        "failed run, at the foot",
        "run beyond the threshold",
    ]


def test_the_numbers_behind_are_measures_of_association(archives):
    (group,) = groups(archives["beam"])
    (table,) = group.tables
    assert table.title == "deflection and its inputs, by only"
    assert table.columns == ["Spearman", "Pearson", "first order"]
    reported = archives["beam"]["statistics/only/deflection"]["spearman"][0]
    assert table.rows[0] == ("load", [*table.rows[0][1]])
    assert table.rows[0][1][0].startswith(table.cell(reported, lambda values: values).split(" ")[0])


def test_a_list_that_charts_share_is_written_once(archives):
    (group,) = groups(archives["beam"])
    together = charts_json(group.charts)
    assert '"y":{"same":[0,0,"y"]},' in together
    assert '"customdata":{"same":[0,0,"customdata"]}' in together
    alone = charts_json(group.charts[1:])
    assert "same" not in alone


def test_many_runs_are_thinned_and_many_inputs_chosen(study_of):
    inputs = {f"x{number:02}": (0, 1) for number in range(30)}
    body = " + ".join(f"{number} * {name}" for number, name in enumerate(inputs))
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 1000'
    tree = uqpen.run(study_of(body, text, **inputs))
    (group,) = groups(tree)
    assert len(group.charts) == 24
    # The most important inputs first.
    ranked = input_order(ArchiveView(tree, ""), "y").names
    titles = [chart.title for chart in group.charts]
    assert titles == [f"y against {name}" for name in ranked if f"y against {name}" in titles]
    assert "y against x29" in titles
    assert len(traces(group.charts[0].marks)[0]["x"]) == 400
    assert group.notes == (
        "Runs of some in the charts: 400 of 1\u202f000 completed.",
        "Shown are the 24 of 30 inputs with the largest first order by some.",
    )
    assert len(group.tables[0].rows) == 30


def test_kinds_are_rows_and_have_the_ranges_of_inputs(archives):
    group = groups(archives["rods"], "original")[-1]
    runs = archives["rods"]["models/original/runs/latin"]
    rows = group.charts[0].y.rows
    assert rows == ("v = u", "u = 0", "rigid")
    trace = traces(group.charts[0].marks)[0]
    at = {label: row for row, label in enumerate(rows)}
    assert all(abs(y - at[text]) <= 0.25 for y, text in zip(trace["y"], trace["text"], strict=True))
    (table,) = group.tables
    kind = (runs["status"].values == 0) & (runs["termination"].values == 0)
    assert table.columns[1] == f"v = u\n{kind.sum()} runs"
    name = "crater_radius"
    values = 1e3 * runs[name].values[kind]
    (cells,) = [cells for label, cells in table.rows if label == "crater radius [mm]"]
    assert cells[1] == f"{values.min():.4g} … {values.max():.4g} ¹"
    assert table.notes == ["ranges of these runs, not estimates; so they have no intervals"]


def test_where_no_run_came_back_there_are_no_points(archives):
    assert not groups(archives["lost"])
