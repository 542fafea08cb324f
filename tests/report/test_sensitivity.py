"""Charts of the inputs' part in an output, and what is said of them."""

import numpy as np
import pytest

import uqpen
from uqpen.report.blocks import Fold, Table, find_charts
from uqpen.report.plotly import traces
from uqpen.report.sections.outputs import sensitivity
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text
from uqpen.results.input_measures import input_ranking
from uqpen.results.source_statistics import SourceStatistics

pytestmark = pytest.mark.slow


def blocks(tree, model=""):
    return list(sensitivity(ArchiveView(tree, model)))


def charts(tree, model=""):
    return list(find_charts(blocks(tree, model)))


def test_estimates_and_bars_are_those_of_the_archive(archives):
    (chart,) = charts(archives["beam"])
    (trace,) = traces(chart.marks)
    reported = archives["beam"]["statistics/only/deflection"]["first_order"].values
    np.testing.assert_allclose(trace["x"], reported[:, 0], rtol=1e-5)
    right, left = (trace["error_x"][side] for side in ("array", "arrayminus"))
    np.testing.assert_allclose(right, reported[:, 2] - reported[:, 0], rtol=1e-5)
    np.testing.assert_allclose(left, reported[:, 0] - reported[:, 1], rtol=1e-5)
    assert trace["y"] == [0, 1]
    assert chart.y.rows == ("load", "span")
    assert [key.text for key in chart.keys] == ["first order by only"]
    assert trace["text"][0] == (
        f"load, first order by only: {estimate_text(*reported[0])} "
        "(only 98 runs: the coverage may be below nominal)"
    )


def test_the_largest_is_named_with_its_interval(archives):
    (chart,) = charts(archives["beam"])
    first = archives["beam"]["statistics/only/deflection"]["first_order"].values
    assert chart.summary == (
        f"By only, load has the largest first order: {estimate_text(*first[0])}; span comes next: "
        f"{estimate_text(*first[1])}. Its interval overlaps with no other's. "
        "Note on this interval: only 98 runs: the coverage may be below nominal."
    )
    assert chart.notes == (
        "Bars: 95 % intervals, for each estimate by itself.",
        "Note on first order by only: only 98 runs: the coverage may be below nominal.",
    )


def test_intervals_that_overlap_leave_the_order_open(study_of):
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 200'
    (chart,) = charts(uqpen.run(study_of("a + b", text, a=(0, 1), b=(0, 1.01))))
    assert "Its interval overlaps with that of" in chart.summary
    assert ", so this order is uncertain." in chart.summary


def test_a_measure_that_runs_cannot_correct_is_hollow_and_says_why(study_of):
    text = """[designs.blocks]
kind = "saltelli"
base = 256
[designs.few]
kind = "latin-hypercube"
runs = 30
[surrogates.flat]
kind = "polynomial-chaos"
design = "few"
order = 3
"""
    tree = uqpen.run(study_of("np.exp(3 * a) * (b - 0.4)", text, a=(0, 1), b=(0, 1)))
    (chart, *_) = charts(tree)
    keys = {key.text: key.mark for key in chart.keys}
    assert keys["total order by blocks"] == "square"
    assert keys["total order by flat"] == "square-open"
    reported = SourceStatistics(tree).statistics("flat", "y")["total_order"]
    (reason,) = {*reported.coords["note"].values.tolist()}
    (hollow,) = [note for note in chart.notes if "total order by flat" in note]
    assert hollow.startswith("Hollow, no interval: ")
    assert reason in hollow
    assert "By blocks, b has the largest total order" in chart.summary


def test_plain_samples_are_left_to_the_table_where_blocks_tell_more(archives):
    (chart, *_) = charts(archives["schema_1"])
    assert [key.text for key in chart.keys][:2] == [
        "first order by blocks",
        "total order by blocks",
    ]
    assert "first order\nlatin_hypercube" in chart.tables[0].columns
    assert chart.summary.endswith("None has an interval, so this order is uncertain.")
    assert chart.notes[0] == (
        "Hollow, no interval: first order by blocks, total order by blocks "
        "(fewer than ten blocks contribute to it)."
    )


def test_the_driver_that_is_quoted_is_in_the_chart(study_of):
    designs = (
        '[designs.sample]\nkind = "monte-carlo"\nruns = 4000\n'
        '[designs.blocks]\nkind = "saltelli"\nbase = 64'
    )
    tree = uqpen.run(study_of("a + 2 * b", designs, a=(0.0, 1.0), b=(0.0, 1.0)))
    ranking = input_ranking(ArchiveView(tree, ""), "y")
    assert ranking is not None
    # The plain sample is known best, so that the main results quote it.
    assert ranking.source == "sample"
    (chart, *_) = charts(tree)
    assert "first order by sample" in [key.text for key in chart.keys]


def test_what_is_published_is_written_alike_in_table_and_pointer(study_of):
    asked = (
        '[published.report]\nsource = "a report"\n[published.report.y]\nresponse = { a = 0.423 }\n'
        '[designs.some]\nkind = "one-at-a-time"'
    )
    tree = uqpen.run(study_of("a + b", asked, a=(1.0, 2.0), b=(1.0, 2.0)))
    (chart,) = [each for each in charts(tree) if each.title.startswith("Response, near")]
    (trace,) = [each for each in traces(chart.marks) if each["name"] == "report"]
    assert trace["text"] == ["a, report: 42.3 &#37; (published in a report)"]


def test_responses_are_magnitudes_in_per_cent(archives):
    tree = archives["schema_1"]
    (chart,) = [each for each in charts(tree) if each.title == "Response, near the nominal point"]
    (trace,) = [each for each in traces(chart.marks) if each["name"] == "steps"]
    reported = tree["statistics/steps/y"]["response"].values[:, 0]
    # The inputs stand in their order of importance for the output, in all charts of it.
    order = [list(tree["statistics/steps/y"]["input"].values).index(row) for row in chart.y.rows]
    np.testing.assert_allclose(trace["x"], (100 * np.abs(reported))[order], rtol=1e-5)
    assert chart.x.title == "|response| [%]"
    assert set(trace["marker"]["symbol"]) == {"pentagon-open"}


def test_kinds_of_which_the_same_is_reported_share_a_chart(archives):
    found = [each for each in charts(archives["rods"], "original") if "whether it is" in each.title]
    assert [each.title for each in found] == [
        "Shares of the variance of whether it is v = u or u = 0"
    ]


def test_what_has_no_chart_is_folded_and_nothing_is_reported_without_runs(archives):
    *_, fold = blocks(archives["beam"])
    assert isinstance(fold, Fold)
    tables = [block for block in fold.blocks if isinstance(block, Table)]
    assert [table.table.title for table in tables] == [
        "deflection: shares of its logarithm's variance",
        "deflection: association with its inputs",
    ], "as all runs exceed 2 mm, nothing is reported of what makes them"
    assert all(table.is_folded for table in tables)
    assert blocks(archives["lost"]) == []


def test_of_many_inputs_those_with_the_largest_estimates_are_shown(study_of):
    inputs = {f"x{number:02}": (0, 1) for number in range(18)}
    body = " + ".join(f"{2**number} * {name}" for number, name in enumerate(inputs))
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 300'
    (chart,) = charts(uqpen.run(study_of(body, text, **inputs)))
    assert len(chart.y.rows) == 15
    assert chart.y.rows[:3] == ("x17", "x16", "x15"), "the largest first"
    assert "Shown are the 15 inputs with the largest estimates, of 18; the table has all." in (
        chart.notes
    )
    assert len(chart.tables[0].rows) == 18
