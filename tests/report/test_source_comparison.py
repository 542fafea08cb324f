"""Statistics of all sources side by side, and what their intervals cost."""

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.charts.axes import logarithmic_axis
from uqpen.charts.chart import Charts
from uqpen.report.blocks import Fold, Heading, Table, Text
from uqpen.report.plotly import charts_json, traces
from uqpen.report.sections.comparisons import source_comparison
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number

pytestmark = pytest.mark.slow

SOURCES = [
    "monte_carlo",
    "latin_hypercube",
    "sobol_sequence",
    "sobol_indices",
    "training",
    "polynomial_chaos",
]


@pytest.fixture(scope="module")
def reported(concrete):
    return list(source_comparison(ArchiveView(concrete, "")))


def flat(blocks):
    """All blocks, with those of folded parts in their places."""
    return [
        each
        for block in blocks
        for each in (flat(block.blocks) if isinstance(block, Fold) else [block])
    ]


def groups(blocks):
    return [block for block in flat(blocks) if isinstance(block, Charts)]


def chart(charts, title):
    return next(each for each in charts.charts if each.title == title)


def test_each_statistic_has_a_chart_with_a_row_for_each_source(reported):
    assert reported[0] == Heading("depth of penetration (penetration_depth)")
    assert [type(block) for block in reported] == [Heading, Charts, Fold, Fold]
    side_by_side, others = groups(reported)[:2]
    assert [each.title for each in side_by_side.charts] == ["mean", "median", "P(> 60 cm)"]
    assert [each.title for each in others.charts] == [
        *("sd", "5 % quantile", "95 % quantile", "P(< 40 cm)")
    ]
    for each in (*side_by_side.charts, *others.charts):
        assert each.y.rows == (*SOURCES, "report")
    assert chart(side_by_side, "mean").x.title == "mean [m]"
    assert chart(side_by_side, "P(> 60 cm)").x.title == "P(> 60 cm)"
    assert side_by_side.notes == ("Bars: 95 % intervals.",)
    table = next(block.table for block in flat(reported) if isinstance(block, Table))
    assert table.title == "penetration_depth [m]"
    assert table.rows[0] == ("runs", ["400", "400", "256", "384", "80", "480", "–"])


def test_dots_are_the_archives_figures(concrete, reported):
    main, others = groups(reported)[:2]
    for group, title, name in ((main, "mean", "mean"), (others, "sd", "std")):
        drawn = traces(chart(group, title).marks)
        assert [trace["name"] for trace in drawn][:7] == list(chart(group, title).y.rows)
        for row, trace in enumerate(drawn[:7]):
            estimate, lower, upper = concrete["statistics"][trace["name"]]["penetration_depth"][
                name
            ].values
            assert trace["x"] == [pytest.approx(estimate, rel=1e-8)]
            assert trace["y"] == [row]
            (right,), (left,) = trace["error_x"]["array"], trace["error_x"]["arrayminus"]
            (symbol,) = trace["marker"]["symbol"]
            if np.isfinite(lower):
                assert (left, right) == pytest.approx((estimate - lower, upper - estimate), 1e-5)
            else:
                assert (left, right) == ("none", "none")
            assert symbol.endswith("-open") == bool(np.isnan(lower))
    (shown, *_) = (block.table for block in flat(reported) if isinstance(block, Table))
    table = dict(shown.rows)
    hover = traces(chart(main, "mean").marks)[0]["text"][0]
    assert hover.split(" ¹")[0] == f"monte_carlo {table['mean'][0].split(' ¹')[0]} m"


def test_widths_stand_against_runs(concrete, reported):
    widths = groups(reported)[2]
    assert [each.title for each in widths.charts] == [
        "Width of the interval: mean",
        "Width of the interval: median",
        "Width of the interval: P(> 60 cm)",
    ]
    guide, *dots = traces(widths.charts[0].marks)
    assert [trace["name"] for trace in dots] == SOURCES
    for trace in dots:
        _, lower, upper = concrete["statistics"][trace["name"]]["penetration_depth"]["mean"].values
        assert trace["x"] == [concrete["statistics"][trace["name"]].attrs["runs_spent"]]
        assert trace["y"] == [pytest.approx((upper - lower) / 2, rel=1e-4)]
    # From the training runs to those that the surrogate took, its check runs among them.
    assert guide["x"] == [80, 480]
    (plain,) = dots[0]["y"]
    expected = [plain * np.sqrt(400 / 80), plain * np.sqrt(400 / 480)]
    assert guide["y"] == pytest.approx(expected, rel=1e-4)
    assert widths.keys[-1].text == "as 1/√runs, from monte_carlo"
    assert widths.notes == (
        "Half-width: half of an interval's length, also if its ends are not symmetric.",
        "No interval, so not shown: report.",
    )


def test_a_table_says_how_many_draws_give_as_narrow_an_interval(concrete, reported):
    _, table, *_ = (block.table for block in flat(reported) if isinstance(block, Table))
    assert (
        table.title
        == "Cost of an interval: its half-width, and the independent draws needed for it"
    )
    assert table.columns[:4] == ["runs", "mean, half-width [m]", "draws", "median, half-width [m]"]
    rows = dict(table.rows)
    assert list(rows) == SOURCES
    assert rows["monte_carlo"][0] == rows["monte_carlo"][2] == "400"
    bounds = [
        concrete["statistics"][name]["penetration_depth"]["mean"].values for name in SOURCES[:2]
    ]
    plain, other = (upper - lower for _, lower, upper in bounds)
    draws = grouped_number(int(float(f"{400 * (plain / other) ** 2:.2g}")))
    mark = rows["latin_hypercube"][2].split()[-1]
    assert rows["latin_hypercube"][2] == f"≈ {draws} {mark}"
    assert table.notes["¹²³⁴⁵".index(mark)] == (
        "independent draws needed for as narrow an interval: a rough estimate, the square of the "
        "ratio of two widths, without an interval"
    )
    assert "128 of them are a sample; the others are for its indices" in table.notes


def test_one_source_has_a_table(archives):
    heading, text, table = source_comparison(ArchiveView(archives["beam"], ""))
    assert heading == Heading("deflection")
    assert text == Text("Only only has estimates, so there is nothing to compare.")
    assert isinstance(table, Table)
    assert table.table.columns == ["only"]


def test_nothing_is_reported_where_all_runs_were_lost(archives):
    assert list(source_comparison(ArchiveView(archives["lost"], ""))) == []


def test_widths_need_no_independent_draws_but_their_costs_do(archives):
    without = xr.DataTree.from_dict(
        {
            path: dataset
            for path, dataset in archives["schema_1"].to_dict().items()
            if "/monte_carlo" not in path
        }
    )
    blocks = list(source_comparison(ArchiveView(without, "")))
    assert [type(block) for block in blocks] == [Heading, Charts, Fold]
    assert [trace["name"] for trace in traces(groups(blocks)[2].charts[0].marks)] == [
        "latin_hypercube",
        "blocks",
        "chaos",
    ]


def test_of_many_outputs_the_last_have_tables_only():
    names = [f"y{number}" for number in range(8)]
    study = uqpen.Study(
        model=lambda x: {name: x + number for number, name in enumerate(names)},
        inputs={"x": uqpen.Normal(1, 0.1)},
        outputs=dict.fromkeys(names, "m"),
        designs={"one": uqpen.MonteCarlo(runs=30), "two": uqpen.MonteCarlo(runs=60)},
        seed=1,
    )
    tree = uqpen.run(study)
    blocks = flat(source_comparison(ArchiveView(tree, "")))
    assert sum(isinstance(block, Heading) for block in blocks) == 6
    *_, text, one, other = blocks
    assert text == Text("Without charts, as there are many outputs: y6, y7.")
    assert isinstance(one, Table)
    assert isinstance(other, Table)
    assert [one.table.title, other.table.title] == ["y6 [m]", "y7 [m]"]
    assert one.is_folded
    assert other.is_folded


def test_what_is_drawn_stays_small(reported):
    charts = [each for charts in groups(reported) for each in charts.charts]
    assert len(charts_json(charts)) < 70_000


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([500, 10_000], ["500", "1\u202f000", "2\u202f000", "5\u202f000", "10\u202f000"]),
        ([500, 50_000], ["1\u202f000", "3\u202f000", "10\u202f000", "30\u202f000"]),
        ([0.0005, 0.01], ["0.0005", "0.001", "0.002", "0.005", "0.01"]),
        ([7], ["5", "10"]),
        ([1e-9, 2e-7], ["10⁻⁹", "3×10⁻⁹", "10⁻⁸", "3×10⁻⁸", "10⁻⁷", "3×10⁻⁷"]),
        ([1, 1e12], ["1", "1\u202f000", "10⁶", "10⁹", "10¹²"]),
    ],
)
def test_logarithmic_axes_have_round_numbers(values, texts):
    axis = logarithmic_axis("x", values)
    assert [text for _, text in axis.ticks] == texts
    assert axis.ends is not None
    assert axis.ends[0] < np.log10(min(values)) <= np.log10(max(values)) < axis.ends[1]
