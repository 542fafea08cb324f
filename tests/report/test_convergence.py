"""How estimates settle, as the page has it."""

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.charts.chart import Charts
from uqpen.report.blocks import Heading, Remarks, Text
from uqpen.report.plotly import shapes, traces
from uqpen.report.sections.comparisons import convergence
from uqpen.results.archive_view import ArchiveView

pytestmark = pytest.mark.slow

LINE = study_text("ishigami", seed=3, inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1})


def reported(tree, model=""):
    return list(convergence(ArchiveView(tree, model)))


def charts(blocks):
    return [block for block in blocks if isinstance(block, Charts)]


def bounds(chart):
    """Estimates with their bounds, as they are drawn."""
    (trace,) = traces(chart.marks)
    y = np.array(trace["y"], dtype=float)
    below, above = (np.array(trace["error_y"][side], float) for side in ("arrayminus", "array"))
    return np.column_stack([y, y - below, y + above])


def of(design):
    return uqpen.run(uqpen.parse_study(f"{LINE}\n[designs.some]\n{design}"))


def test_which_design_it_is_of_and_how_to_read_it(concrete):
    text, remarks, heading, *_ = reported(concrete)
    assert text == Text(
        "By monte_carlo, the design of the main results, the first of the study that is a sample "
        "of the inputs. Its 400 runs are independent draws. Each part has the first few of these."
    )
    assert isinstance(remarks, Remarks)
    assert remarks.lines == (
        "The runs of each point are among those of the next. So points are not independent of "
        "each other, and vary less than separate samples would.",
        "An interval has its nominal coverage for a number of runs that is fixed beforehand. If "
        "you make runs until it looks good, its coverage is lower.",
    )
    assert heading == Heading("depth of penetration (penetration_depth)")


def test_the_last_dots_are_the_archives_figures(concrete):
    depth, residue, end, kinds = charts(reported(concrete))
    assert [each.title for each in depth.charts] == ["mean", "median", "P(> 60 cm)"]
    assert [each.title for each in residue.charts] == ["mean", "median"]
    assert [each.title for each in end.charts] == ["mean", "median"]
    assert [each.title for each in kinds.charts] == ["share v = u", "share u = 0", "share rigid"]
    mean, median, exceeding = depth.charts
    assert traces(mean.marks)[0]["x"] == [20, 30, 50, 100, 200, 300, 400]
    expected = [
        concrete["statistics/monte_carlo/penetration_depth"]["mean"],
        concrete["statistics/monte_carlo/penetration_depth"]["quantile"][1],
        concrete["statistics/monte_carlo/penetration_depth"]["exceedance"][0],
    ]
    for chart, array in zip((mean, median, exceeding), expected, strict=True):
        assert bounds(chart)[-1] == pytest.approx(array.values, rel=1e-5)
        (guide,) = shapes(chart.marks)
        assert guide["y0"] == guide["y1"] == array.values[0]
    assert [each.y.title for each in depth.charts] == ["mean [m]", "median [m]", "P(> 60 cm)"]
    assert [key.text for key in depth.keys] == ["with its 95 % interval", "by all runs"]


def test_the_table_has_the_same_figures(concrete, archives):
    depth = charts(reported(concrete))[0]
    (table,) = depth.tables
    assert table.title == "depth of penetration by monte_carlo, by its runs so far"
    assert table.columns == ["mean [m]", "median [m]", "P(> 60 cm)"]
    labels, cells = zip(*table.rows, strict=True)
    assert labels == ("20", "30", "50", "100", "200", "300", "400")
    hovers = traces(depth.charts[0].marks)[0]["text"]
    for label, (cell, *_), hover in zip(labels, cells, hovers, strict=True):
        assert hover == f"{label} runs: {cell.rstrip(' ¹²³⁴⁵⁶⁷⁸⁹⁰')} m"


def test_replicates_are_not_divided(archives):
    text, *_ = blocks = reported(archives["rods"], "smoothed")
    assert text == Text(
        "By latin, the design of the main results, the first of the study that is a sample of the "
        "inputs. Its 100 runs are 10 independent replicates. Each part has the first few of these: "
        "less than a whole replicate would not be a sample of the same type."
    )
    depth = charts(blocks)[0].charts[0]
    assert traces(depth.marks)[0]["x"] == [20, 30, 40, 50, 70, 100]
    archived = archives["rods"]["models/smoothed/statistics/latin/penetration_depth"]["mean"]
    assert bounds(depth)[-1] == pytest.approx(archived.values * 100, rel=1e-5)


def test_an_axis_cuts_off_what_is_far_too_wide():
    tree = of('kind = "latin-hypercube"\nruns = 4000\nreplicates = 200')
    mean = charts(reported(tree))[0].charts[0]
    drawn = bounds(mean)
    assert mean.y.ends is not None
    lower, upper = mean.y.ends
    assert lower < drawn[:, 0].min()
    assert drawn[:, 0].max() < upper
    assert drawn[0, 2] > upper
    # Twelve half-widths on either side of the last one at the most, and a margin.
    half = np.abs(drawn[-1, 1:] - drawn[-1, 0]).max()
    assert upper - lower < 1.101 * 24 * half
    assert mean.notes == ("The widest intervals extend beyond the axis; the table has their ends.",)


@pytest.mark.parametrize(
    ("design", "reason"),
    [
        (
            'kind = "latin-hypercube"\nruns = 60\nreplicates = 1',
            "its points are one stratified set, of which no part is a stratified set.",
        ),
        ('kind = "monte-carlo"\nruns = 20', "it has only 20 runs."),
    ],
)
def test_what_cannot_be_divided_says_why(design, reason):
    assert reported(of(design)) == [
        Text("Convergence cannot be shown for some, the design of the main results: " + reason)
    ]


def test_an_archive_without_convergence_says_so():
    tree = of('kind = "monte-carlo"\nruns = 40')
    group = tree["statistics/some/y"]
    group.dataset = group.to_dataset().drop_dims("runs_so_far")
    assert reported(tree) == [
        Text(
            "Convergence cannot be shown for some, the design of the main results: the archive "
            "has no estimates from parts of its runs."
        )
    ]


def test_pick_freeze_blocks_are_reported_where_there_is_no_other_sample():
    text, *_ = reported(of('kind = "saltelli"\nbase = 64'))
    assert text == Text(
        "By some, the design of the main results, as no other design is a sample of the inputs. "
        "Its 128 runs that are a sample are 16 independent replicates. Each part has the first few "
        "of these: less than a whole replicate would not be a sample of the same type."
    )


def test_nothing_is_reported_where_all_runs_were_lost(archives):
    assert reported(archives["lost"]) == []
