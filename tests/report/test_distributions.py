"""Distribution functions on the page: what is drawn, and what a threshold reads off."""

import math

import numpy as np
import pytest

import uqpen
from uqpen.charts.chart import Charts
from uqpen.charts.distributions import model_chart
from uqpen.charts.histograms import histogram
from uqpen.core.status import Status
from uqpen.report.blocks import Fold, Heading, Table, find_charts
from uqpen.report.plotly import traces
from uqpen.report.sections.comparisons import model_comparison
from uqpen.report.sections.outputs import distributions
from uqpen.results.archive_view import ArchiveView
from uqpen.statistics.intervals import dkw_half_width

pytestmark = pytest.mark.slow


@pytest.fixture
def beam(archives):
    return list(distributions(ArchiveView(archives["beam"], "")))


def deflections(tree):
    """Of the runs that came back, in mm."""
    runs = tree["runs/only"]
    return 1000 * runs["deflection"].values[runs["status"].values == 0]


class TestTheThreshold:
    def test_it_reads_off_the_share_of_the_runs(self, archives, beam):
        reading = next(find_charts(beam)).reading
        assert reading is not None
        values = deflections(archives["beam"])
        status = archives["beam"]["runs/only"]["status"].values
        admissible = int((status != Status.INADMISSIBLE).sum())
        kept, half = values.size / admissible, dkw_half_width(admissible, 0.95)
        assert kept < 1
        for at, (estimate, lower, upper) in zip(reading.values, reading.bounds, strict=True):
            share = np.mean(values <= at)
            assert estimate == pytest.approx(share, abs=1e-9)
            assert lower == pytest.approx(max(kept * share - half, 0), abs=1e-9)
            assert upper == pytest.approx(min(kept * share + 1 - kept + half, 1), abs=1e-9)

    def test_its_band_contains_the_interval_of_the_same_threshold(self, archives, beam):
        reading = next(find_charts(beam)).reading
        assert reading is not None
        _, least, most = archives["beam"]["statistics/only/deflection/exceedance"].values[0]
        _, lower, upper = reading.bounds[reading.values.index(reading.start)]
        assert lower is not None
        assert upper is not None
        assert lower <= 1 - most < 1 - least <= upper

    def test_it_moves_by_round_numbers_over_the_whole_axis(self, beam):
        chart = next(find_charts(beam))
        reading, ends = chart.reading, chart.x.ends
        assert reading is not None
        assert ends is not None
        steps = np.unique(np.diff(reading.values).round(9))
        assert steps.size == 1
        step = steps.item()
        assert f"{step:g}"[-1] in "125"
        assert reading.values[0] / step == pytest.approx(round(reading.values[0] / step))
        assert ends[0] <= reading.values[0] < ends[0] + step
        assert ends[1] - step < reading.values[-1] <= ends[1]
        assert 250 <= len(reading.bounds) <= 700

    def test_it_begins_where_the_study_asks(self, beam):
        reading = next(find_charts(beam)).reading
        assert reading is not None
        assert reading.start == pytest.approx(2.0)
        assert reading.limits == ((pytest.approx(2.0), "2 mm"),)
        assert (reading.unit, reading.source, reading.level) == ("mm", "only", 0.95)

    def test_points_of_unknown_origin_have_no_band(self, archives):
        tree = archives["beam"].copy(deep=True)
        band = tree["statistics/only/deflection/cdf_band"]
        band[:, 1:] = np.nan
        band.attrs = {"interval": "none", "interval_label": "none", "note": "not independent"}
        reading = next(find_charts(distributions(ArchiveView(tree, "")))).reading
        assert reading is not None
        assert math.isnan(reading.level)
        assert "independent" in reading.note
        assert all(bounds[1:] == [None, None] for bounds in reading.bounds)


def test_the_tail_is_drawn_run_by_run(archives, beam):
    _, tail = find_charts(beam)
    assert tail.title == "Probability that deflection is more than x"
    values = deflections(archives["beam"])
    drawn = next(trace for trace in traces(tail.marks) if trace.get("name") == "only")
    # No run exceeds the largest, so the step before it reaches up to it.
    share = 1 - np.arange(1, values.size) / values.size
    np.testing.assert_allclose(drawn["x"], np.sort(values), rtol=1e-5)
    np.testing.assert_allclose(drawn["y"], [*share, share[-1]], rtol=1e-5)


def test_the_largest_run_is_marked_and_reported(archives, beam):
    values = deflections(archives["beam"])
    name = f"largest of {values.size} runs"
    _, tail = find_charts(beam)
    assert f"{name}: {values.max():.4g} mm" in [key.text for key in tail.keys]
    (end,) = (trace for trace in traces(tail.marks) if trace.get("name", "").startswith("largest"))
    assert end["x"] == [pytest.approx(values.max(), rel=1e-4)]
    assert end["y"] == [pytest.approx(1 / values.size, rel=1e-4)]
    assert tail.notes[1].startswith("Larger values may")
    (table,) = (block.table for block in beam if isinstance(block, Table))
    assert table.rows[-1] == (name, [f"{values.max():.4g}"])


def test_an_axis_that_cuts_the_tail_off_says_how_far_it_goes(study_of):
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 400'
    tree = uqpen.run(study_of("np.exp(5 * x)", text, x="(0 ± 0.4)"))
    largest = tree["runs/some"]["y"].values.max()
    cdf = next(find_charts(distributions(ArchiveView(tree, ""))))
    assert cdf.x.ends is not None
    assert cdf.x.ends[1] < largest
    assert cdf.notes[-1].endswith(f"The largest of 400 runs is {largest:.4g}.")


def test_only_the_leading_curve_is_drawn_and_the_others_on_demand(concrete):
    _, first, _, fold, _ = distributions(ArchiveView(concrete, ""))
    assert isinstance(first, Charts)
    lines = [trace["name"] for trace in traces(first.charts[0].marks) if trace.get("name")]
    assert lines == ["monte_carlo"]
    assert isinstance(fold, Fold)
    (every,) = find_charts(fold.blocks)
    assert every.reading is None
    assert [trace["name"] for trace in traces(every.marks) if trace.get("name")] == [
        "monte_carlo",
        "latin_hypercube",
        "sobol_sequence",
        "sobol_indices",
        "training",
        "polynomial_chaos",
    ]


def test_what_is_lost_is_reported_with_the_curves(beam):
    cdf, tail = find_charts(beam)
    note = (
        "The curve uses the completed runs; 18.3 % of the admissible runs failed. A band includes "
        "every result that they could have had."
    )
    assert note in cdf.notes
    assert note in tail.notes


class TestThresholdsFarAway:
    @pytest.fixture
    def reported(self, study_of):
        asked = '[outputs.y]\nexceeds = ["1e9", "1.5", "-1e9"]'
        text = f'{asked}\n[designs.some]\nkind = "monte-carlo"\nruns = 40'
        tree = uqpen.run(study_of("a + b", text, a=(0.0, 1.0), b=(0.0, 1.0)))
        return list(find_charts(distributions(ArchiveView(tree, ""))))

    def test_the_tail_can_be_seen_all_the_same(self, reported):
        (asked,) = (
            trace for trace in traces(reported[1].marks) if trace.get("name") == "requested"
        )
        assert asked["x"] == [1.5]
        assert reported[1].notes[-1] == "In the table only: P(> 1e9), P(> -1e9)."
        assert [label for label, _ in reported[1].tables[0].rows] == [
            "P(> 1e9)",
            "P(> 1.5)",
            "P(> -1e9)",
        ]

    def test_the_threshold_begins_at_the_first_on_the_axis(self, reported):
        reading = reported[0].reading
        assert reading is not None
        assert reading.start == pytest.approx(1.5)


def test_of_whole_numbers_the_function_reaches_whole_numbers(study_of):
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 40'
    tree = uqpen.run(study_of("(3 * a) // 1 + 0 * b", text, a=(0.0, 1.0), b=(0.0, 1.0)))
    cdf, _ = find_charts(distributions(ArchiveView(tree, "")))
    assert "rises from 5 % at 0 through one half at 1 to 95 % at 2." in cdf.summary


def test_quantiles_have_the_intervals_that_the_archive_gives_them(archives, beam):
    (table,) = (block.table for block in beam if isinstance(block, Table))
    rows = dict(table.rows)
    assert rows["median"] == ["3.66 (3.52 … 3.91)"]
    reported = 1000 * archives["beam"]["statistics/only/deflection"]["quantile"].values[1]
    np.testing.assert_allclose(reported, [3.66, 3.52, 3.91], atol=0.006)
    assert rows["99 % quantile"] == ["5.87 (5.16 … ?) ²"]
    assert table.notes[1] == "98 runs are too few for an upper bound"


def test_a_study_that_lost_all_has_no_distributions(archives):
    assert list(distributions(ArchiveView(archives["lost"], ""))) == []


def test_an_output_that_is_the_same_in_all_runs_has_no_tail(study_of):
    blocks = list(distributions(ArchiveView(uqpen.run(study_of("0 * a + 2", a=(0, 1))), "")))
    assert [chart.title for chart in find_charts(blocks)] == ["Probability that y is at most x"]


class TestSeveralModels:
    def test_their_functions_and_differences_stand_together(self, archives):
        view = ArchiveView(archives["rods"], "original")
        blocks = list(model_comparison(view))
        headings = [block.text for block in blocks if isinstance(block, Heading)]
        # The depth stands with the main results.
        assert headings[0] == "length of projectile left (projectile_residue)"
        depth = model_chart(view, "penetration_depth", "latin")
        assert depth is not None
        assert [key.text for key in depth.keys] == [
            "original",
            "smoothed",
            "rigid",
            "limits 60 cm, 90 cm",
        ]
        assert "By rigid, the median is 102.5 cm." in depth.summary
        depths = archives["rods"]["models/rigid/runs/latin"]["penetration_depth"].values
        assert np.mean(depths <= 1.0225) >= 0.5 > np.mean(depths <= 1.0215)
        titles = [block.table.title for block in blocks if isinstance(block, Table)]
        assert titles[0] == "smoothed minus original: penetration_depth [cm]"

    def test_one_model_has_nothing_to_differ_from(self, archives):
        assert list(model_comparison(ArchiveView(archives["beam"], ""))) == []


def test_a_legend_has_units_and_no_two_quantiles_have_the_same_line(archives):
    bins = histogram(ArchiveView(archives["beam"], ""), "deflection", "only")
    marked = [key for key in bins.keys if key.mark == "line"]
    assert [key.text.split()[0] for key in marked] == ["mean", "5", "median", "95"]
    assert all(key.text.rpartition(")")[2] == " mm" or key.text.endswith(" mm") for key in marked)
    assert len({(key.series, key.dash) for key in marked}) == len(marked)
