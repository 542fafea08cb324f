"""What a page carries along for its reader: runs, distribution functions, names of its parts."""

import json

import numpy as np
import pytest
from hashed_trees import with_hashes

from uqpen.charts.chart import Axis, Chart, Charts
from uqpen.report.blocks import Heading, find_charts, find_explorers
from uqpen.report.page import block_anchors, page_reference
from uqpen.report.plotly import charts_json
from uqpen.report.sections.outputs import distributions, scatter
from uqpen.results.archive_view import ArchiveView

pytestmark = pytest.mark.slow


def explorer_of(tree, model=""):
    (explorer,) = find_explorers(scatter(ArchiveView(tree, model)))
    return explorer


class TestRunExplorer:
    def test_it_has_all_inputs_and_outputs_of_the_runs(self, archives):
        explorer = explorer_of(archives["beam"])
        runs = archives["beam"]["runs/only"]
        is_ok = runs["status"].values == 0
        assert list(explorer.completed) == np.flatnonzero(is_ok).tolist()
        assert list(explorer.failed) == np.flatnonzero(~is_ok).tolist()
        deflection, *inputs = explorer.columns
        assert deflection.quantity == ("deflection", "mm")
        assert (deflection.is_input, len(deflection.failed)) == (False, 0)
        assert {column.quantity.name for column in inputs} == {"load", "span"}
        (load,) = (column for column in inputs if column.quantity.name == "load")
        np.testing.assert_allclose(load.values, runs["load"].values[is_ok] / 1e3, rtol=1e-4)
        np.testing.assert_allclose(load.failed, runs["load"].values[~is_ok] / 1e3, rtol=1e-4)

    def test_a_categorical_output_has_rows(self, archives):
        explorer = explorer_of(archives["rods"], "original")
        (kind,) = (column for column in explorer.columns if column.rows)
        assert kind.rows == ("v = u", "u = 0", "rigid")
        assert explorer.model == "original"

    def test_a_category_may_be_called_as_failed_runs_are(self, archives):
        tree = archives["rods"].copy(deep=True)
        (design,) = tree["models/original/runs"].children.values()
        (kind,) = (each for each in design.data_vars.values() if "flag_labels" in each.attrs)
        kind.attrs["flag_labels"] = [*kind.attrs["flag_labels"][:-1], "lost"]
        (kind,) = (each for each in explorer_of(tree, "original").columns if each.rows)
        assert kind.rows == ("v = u", "u = 0", "lost")

    def test_its_lists_are_those_of_the_charts(self, archives):
        blocks = list(scatter(ArchiveView(archives["beam"], "")))
        charts, explorers = list(find_charts(blocks)), list(find_explorers(blocks))
        content = json.loads(charts_json(charts, explorers))
        assert [chart["runs"] for chart in content["charts"]] == ["", ""]
        (runs,) = content["runs"]
        assert all("same" in column["values"] for column in runs["traces"])


class TestThresholdsBeyondTheAxis:
    def test_the_function_goes_on_to_the_most_extreme_runs(self, archives):
        chart = next(find_charts(distributions(ArchiveView(archives["beam"], ""))))
        runs = archives["beam"]["runs/only"]
        values = np.sort(1e3 * runs["deflection"].values[runs["status"].values == 0])
        assert chart.reading is not None
        beyond = chart.reading.beyond
        assert beyond is not None
        assert beyond.runs == values.size
        assert (beyond.smallest, beyond.largest) == pytest.approx((values[0], values[-1]), rel=1e-9)
        assert beyond.nothing[:2] == [0.0, 0.0]
        outside = values[values > chart.reading.values[-1]]
        assert [row[0] for row in beyond.above] == pytest.approx(outside.tolist())
        for at, share, *_ in beyond.above:
            assert at is not None
            assert share == pytest.approx(np.mean(values <= at * (1 + 1e-9)))


class TestAnchors:
    def test_each_part_has_a_name_of_its_own_that_says_where_it_is(self):
        charts = tuple(_chart(title) for title in ("against a", "against a", "Γ"))
        blocks = [Heading("Model"), Heading("y (m/s)", 4), Charts(charts), Heading("title")]
        anchors = block_anchors([("scatter", blocks), ("title", [charts[0]])])
        names = [anchors[id(each)] for each in (*blocks[:2], *charts[1:], blocks[3])]
        assert names == [
            "scatter-model",
            "scatter-model-y-m-s",
            "scatter-model-y-m-s-against-a-2",
            "scatter-model-y-m-s-2",
            "scatter-title-2",
        ]


def _chart(title):
    return Chart(title, "Empty.", Axis("x"), Axis("y"), ())


def test_the_reference_names_study_archive_and_version(archives):
    tree = with_hashes(archives["beam"])
    reference = page_reference(tree)
    assert f"uqpen {tree.attrs['version_uqpen']}" in reference
    changed = tree.copy(deep=True)
    changed["runs/only/load"].values[0] += 1.0
    assert page_reference(with_hashes(changed)) != reference
