"""What is drawn is what the archive holds, in the units that stand on the axes."""

import numpy as np
import pytest
from matplotlib.text import Text

import uqpen
from uqpen.figures import FIGURES, OF_BENCHMARKS
from uqpen.figures.page import available, panels
from uqpen.figures.style import figure_style
from uqpen.statistics.intervals import dkw_half_width

pytestmark = pytest.mark.slow


def drawn(tree, name, **asked):
    return uqpen.figure(tree, name, **asked).axes


def line(axes, label):
    (found,) = [each for each in axes.lines if each.get_label() == label]
    return found


def filled(reported):
    """Estimates of an archive with their bounds, as `dots` returns them."""
    bounds = np.asarray(reported)
    return np.where(np.isnan(bounds), bounds[:, :1], bounds)


def dots(axes):
    """Each dot's estimate and bounds; the estimate in place of a bound that is none."""
    found = []
    for container in axes.containers:
        (x,) = container.lines[0].get_xdata()
        bars = container.lines[2]
        lower, upper = bars[0].get_segments()[0][:, 0] if bars else (x, x)
        found.append((float(x), float(lower), float(upper)))
    return found


# Of outputs with dimensions, which these archives do not have.
FIELDS = {"fan", "model-curves", "sensitivity-along", "map"}
# Bounds are of intervals, which they do not have either, nor swept inputs: see
# `test_interval_bounds` and `test_sweep`.
OF_STUDIES = set(FIGURES) - set(OF_BENCHMARKS) - {"bounds", "sweep", "measurements", "posterior"}
# What each has something for.
EXPECTED = {
    "beam": OF_STUDIES
    - FIELDS
    - {"models", "responses", "surrogate", "trajectory", "velocity-profile"},
    "lost": {"scatter", "losses"},
    "rods": OF_STUDIES - FIELDS - {"responses", "surrogate", "losses"},
    "schema_1": OF_STUDIES - FIELDS - {"convergence", "models", "trajectory", "velocity-profile"},
    "schema_1_several": {"cdf", "exceedance", "histogram", "scatter", "methods", "models"},
}


def test_each_archive_has_the_figures_that_it_can_have(archives):
    found = {name: set(available(archives[name])) for name in EXPECTED}
    assert found == EXPECTED


def test_every_figure_of_every_archive_has_named_axes_and_plain_texts(archives):
    for archive in EXPECTED:
        tree = archives[archive]
        for name in available(tree):
            page = uqpen.figure(tree, name)
            for axes in page.axes:
                where = (archive, name, axes.get_title(loc="left"))
                assert axes.get_xlabel(), where
                assert axes.get_ylabel() or len(axes.get_yticks()), where
            with figure_style():  # in which it is written
                assert not any(text.get_parse_math() for text in page.findobj(Text))


def counted(tree):
    """The share of the completed runs of "only", and the half-width of a band over all of them."""
    counts = tree["statistics/only/deflection"]["cdf_band"].attrs
    admissible = counts["runs"] - counts.get("runs_inadmissible", 0)
    return counts["runs_used"] / admissible, dkw_half_width(admissible, 0.95)


class TestDistributions:
    def test_the_function_and_its_band_are_those_of_the_archive(self, archives):
        runs = archives["beam"]["runs/only"]
        values = 1e3 * runs["deflection"].values[runs["status"].values == 0]
        (axes,) = drawn(archives["beam"], "cdf")
        at, share = line(axes, "_only").get_data()
        first, last = axes.get_xlim()
        assert 0 < at[0] - first < 0.01 * (last - first)
        assert 0 < last - at[-1] < 0.01 * (last - first)
        np.testing.assert_allclose(share, [np.mean(values <= each) for each in at], rtol=1e-12)
        (band,) = axes.collections
        corners = band.get_paths()[0].vertices[:, 1]
        kept, half = counted(archives["beam"])
        for end in (kept * share - half, kept * share + 1 - kept + half):
            assert set(np.clip(end, 0, 1).round(12)) <= set(corners.round(12))
        assert axes.get_xlabel() == "deflection [mm]"
        legend = [each.get_text() for each in axes.figure.legends[0].get_texts()]
        assert legend == ["simultaneous 95 % band of only", "only", "limit 2 mm"]

    def test_beyond_the_last_run_the_band_is_as_wide_as_before(self, archives):
        (axes,) = drawn(archives["beam"], "cdf")
        kept, half = counted(archives["beam"])
        (band,) = axes.collections
        right = band.get_paths()[0].vertices
        at_end = right[np.isclose(right[:, 0], right[:, 0].max()), 1]
        assert (at_end.min(), at_end.max()) == pytest.approx((kept - half, 1))

    def test_limits_are_where_they_were_written(self, archives):
        (axes,) = drawn(archives["rods"], "exceedance", output="penetration_depth")
        dotted = [each for each in axes.lines if each.is_dashed()]
        marked = [each.get_xdata()[0] for each in dotted if len(each.get_xdata())]
        assert marked == pytest.approx([60, 90])
        assert [each.get_text() for each in axes.texts] == ["60 cm", "90 cm"]

    def test_one_far_away_is_reported_and_does_not_stretch_the_axis(self, study_of):
        text = "[outputs.y]\nexceeds = [0.5, 0.501, 1000]"
        page = uqpen.figure(uqpen.run(study_of("x", text, x=(0, 1))), "exceedance")
        assert page.axes[0].get_xlim()[1] < 2
        assert [each.get_text() for each in page.axes[0].texts] == ["0.5"], "no room for 0.501"
        *_, requested, beyond = page.legends[0].get_title().get_text().splitlines()
        assert "P(> 1000): 0.00 (0.00 … 0.31)." in requested
        assert beyond == "Limits of the study beyond the axis: 1000."
        legend = [each.get_text() for each in page.legends[0].get_texts()]
        assert legend[-1] == "limits 0.5, 0.501"

    def test_what_is_asked_for_has_its_interval(self, archives):
        (axes,) = drawn(archives["beam"], "exceedance")
        asked = archives["beam"]["statistics/only/deflection"]["exceedance"].values[0]
        (point,) = axes.containers
        low, high = point.lines[2][0].get_segments()[0][:, 1]
        assert (point.lines[0].get_ydata()[0], low, high) == pytest.approx(tuple(asked))

    def test_a_surrogate_says_why_it_has_no_band(self, archives):
        (panel,) = panels(archives["schema_1"], "cdf", source="chaos")
        from matplotlib.figure import Figure

        notes = panel.draw_on_axes(Figure().add_subplot())
        assert notes[0].startswith("no band of chaos: ")

    def test_the_tail_of_a_surrogate_is_that_of_its_function(self, archives):
        tree = archives["schema_1"]
        (axes,) = drawn(tree, "exceedance", source="chaos")
        at, share = line(axes, "_chaos").get_data()
        reported = tree["statistics/chaos/y/cdf_value"].values
        expected = [np.mean(reported > each) for each in at[:-1]]
        np.testing.assert_allclose(share[:-1], expected, atol=2e-3)
        assert at[-1] == pytest.approx(reported.max())
        notes = axes.figure.legends[0].get_title().get_text()
        assert notes.startswith("no band of chaos: ")
        assert "run" not in notes, "a surrogate has none"


class TestEstimates:
    def test_methods_are_the_moments_of_all_sources(self, archives):
        tree = archives["schema_1"]
        axes = drawn(tree, "methods")[0]
        rows = [each.get_text() for each in axes.get_yticklabels()]
        reported = [tree[f"statistics/{name}/y"]["mean"].values for name in rows]
        np.testing.assert_allclose(dots(axes), filled(reported))

    def test_a_dot_without_an_interval_is_hollow_and_said_to_be(self, archives):
        page = uqpen.figure(archives["schema_1"], "methods")
        rows = [each.get_text() for each in page.axes[0].get_yticklabels()]
        (dot,) = page.axes[0].containers[rows.index("report")].lines[:1]
        assert dot.get_markerfacecolor() == "white"
        legend = page.legends[0]
        assert legend.get_title().get_text() == "Bars: 95 % intervals."
        assert [each.get_text() for each in legend.get_texts()] == ["no interval"]

    def test_the_last_estimate_of_a_convergence_is_that_of_all_runs(self, archives):
        page = uqpen.figure(archives["rods"], "convergence", output="penetration_depth")
        axes = page.axes[0]
        assert axes.get_title(loc="left").startswith("original: penetration_depth: mean")
        reported = (
            100 * archives["rods"]["models/original/statistics/latin/penetration_depth"]["mean"]
        )
        last = axes.containers[-1]
        low, high = last.lines[2][0].get_segments()[0][:, 1]
        assert (last.lines[0].get_ydata()[0], low, high) == pytest.approx(tuple(reported.values))
        assert line(axes, "by all runs").is_dashed()
        notes = page.legends[0].get_title().get_text()
        assert notes.startswith("By latin, the design of the main results")
        assert "points are not independent of each" in notes

    def test_losses_have_their_probabilities(self, archives):
        first, inputs = drawn(archives["beam"], "losses")
        reported = archives["beam"]["failures/only"].to_dataset()
        np.testing.assert_allclose(dots(first), [reported["probability"].sel(status="failed")])
        reported_larger = reported["larger"].values[:, 0]
        assert [dot[0] for dot in dots(inputs)][:2] == pytest.approx(reported_larger)

    def test_a_figure_says_nothing_of_a_table(self, archives):
        (page, *_) = drawn(archives["beam"], "losses")
        notes = page.figure.legends[0].get_title().get_text().splitlines()
        assert "Hollow: no interval." in notes
        assert not any("table" in note for note in notes)


class TestRuns:
    def test_points_are_runs_and_lost_ones_stand_at_the_foot(self, archives):
        runs = archives["beam"]["runs/only"]
        axes = drawn(archives["beam"], "scatter")[0]
        points, lost, *keys = axes.lines
        is_ok = runs["status"].values == 0
        np.testing.assert_allclose(points.get_xdata(), runs["load"].values[is_ok] / 1e3)
        np.testing.assert_allclose(points.get_ydata(), 1e3 * runs["deflection"].values[is_ok])
        np.testing.assert_allclose(lost.get_xdata(), runs["load"].values[~is_ok] / 1e3)
        foot = axes.transAxes.inverted().transform(axes.transData.transform(lost.get_xydata()))
        assert 0 < foot[:, 1].max() < 0.05
        assert [each.get_label() for each in keys] == ["run", "failed run, at the foot"]
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("load [kN]", "deflection [mm]")

    def test_where_no_run_completed_the_failed_ones_are_drawn(self, archives):
        axes = drawn(archives["lost"], "scatter")[0]
        assert [each.get_text() for each in axes.get_yticklabels()] == ["no run completed"]
        assert len(axes.lines[0].get_xdata()) == 100

    def test_a_histogram_counts_all_runs_that_came_back(self, archives):
        (axes,) = drawn(archives["beam"], "histogram")
        counted = axes.patches[0].get_data().values.sum()
        assert counted == (archives["beam"]["runs/only"]["status"].values == 0).sum()
        reported = archives["beam"]["statistics/only/deflection"]
        upright = [each.get_xdata()[0] for each in axes.lines if len(each.get_xdata())]
        marked = [reported["mean"].values[0], *reported["quantile"].values[:, 0]]
        np.testing.assert_allclose(upright[:4], 1e3 * np.array(marked), rtol=1e-12)
        legend = [each.get_text() for each in axes.figure.legends[0].get_texts()]
        assert legend[0] == "runs"
        assert legend[3] == "median 3.66 (3.52 … 3.91) mm"
        assert axes.get_title(loc="left") == "deflection: 98 runs of only"


class TestSeveralModels:
    def test_each_has_its_function_and_band(self, archives):
        tree = archives["rods"]
        (axes,) = drawn(tree, "models", output="penetration_depth")
        assert len(axes.collections) == 3
        for name in ("original", "smoothed", "rigid"):
            runs = 100 * tree[f"models/{name}/runs/latin"]["penetration_depth"].values
            at, share = line(axes, f"_{name}").get_data()
            np.testing.assert_allclose(share, [np.mean(runs <= each) for each in at], atol=0.01)
        title = axes.get_title(loc="left").replace("\n", " ")
        assert title.endswith("depth of penetration is at most x, by latin")
        assert not title.startswith("original"), "it is of all models"

    def test_their_courses_stand_together(self, archives):
        tree = archives["rods"]
        axes = {each.get_ylabel(): each for each in drawn(tree, "trajectory")}
        assert set(axes) == {"time since impact [ms]", "u, v [m s⁻¹]", "L [m]", "s [mm]"}
        for name in ("original", "smoothed", "rigid"):
            reported = tree[f"models/{name}/trajectory"]
            shown = line(axes["s [mm]"], f"_{name} plastic_extent")
            np.testing.assert_allclose(shown.get_ydata(), 1e3 * reported["plastic_extent"])
            np.testing.assert_allclose(shown.get_xdata(), 100 * reported["penetration_depth"])
        titles = {each.get_title(loc="left") for each in axes.values()}
        assert "Length of the projectile, L" in titles, "of all models, so it names none"


def test_a_tail_reaches_the_largest_run(study_of):
    text = '[outputs.y]\nexceeds = [12]\n[designs.some]\nkind = "monte-carlo"\nruns = 1000'
    tree = uqpen.run(study_of("np.exp(5 * x)", text, x="(0 ± 0.2)"))
    values = np.sort(tree["runs/some"]["y"].values)
    (axes,) = drawn(tree, "exceedance")
    shown = line(axes, "_some")
    # No run exceeds the largest, so the function is that of the run before it up to there.
    np.testing.assert_allclose(shown.get_xdata()[-2:], values[-2:], rtol=1e-12)
    np.testing.assert_allclose(shown.get_ydata()[-2:], 1 / 1000)
    (end,) = [each for each in axes.lines if each.get_marker() == "|" and len(each.get_xdata())]
    assert (end.get_xdata()[0], end.get_ydata()[0]) == pytest.approx((values[-1], 1 / 1000))
    legend = [each.get_text() for each in axes.figure.legends[0].get_texts()]
    assert f"largest of 1 000 runs: {values[-1]:.4g}" in legend
    assert axes.get_yscale() == "log"
    assert axes.get_xlim()[1] > values[-1]
    assert axes.get_ylim()[0] < 1 / 1000
