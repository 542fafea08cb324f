"""``scale = "log"`` of an output: what is drawn, read off and said by its logarithm."""

import numpy as np
import pytest

import uqpen
from uqpen.charts.histograms import histogram
from uqpen.core.errors import StudyError
from uqpen.report.blocks import Alerts, Findings, find_charts, find_explorers, flattened
from uqpen.report.plotly import shapes, traces
from uqpen.report.sections.answer import answer
from uqpen.report.sections.outputs import distributions, scatter, sensitivity
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables

pytestmark = pytest.mark.slow

LOG = 'scale = "log"'
DESIGN = '[designs.mc]\nkind = "monte-carlo"\nruns = 200'
# Over seventeen tenfolds; a limit that is written in another unit than the output is shown in.
DELAY = "1e-3 * 10 ** (3 * x) * k"
LAWS = {"x": "(0 ± 1)", "k": (0.95, 1.05)}


def _study(study_of, keys, body=DELAY):
    return study_of(body, f"[outputs.y]\n{keys}\n{DESIGN}", **LAWS)


@pytest.fixture(scope="module")
def tenfolds(module_study_of):
    """The delay on a logarithmic scale."""
    return uqpen.run(_study(module_study_of, f'exceeds = ["1 %"]\n{LOG}'))


@pytest.fixture(scope="module")
def tenfolds_linear(module_study_of):
    """The same on a linear scale."""
    return uqpen.run(_study(module_study_of, 'exceeds = ["1 %"]'))


@pytest.fixture
def view(tenfolds):
    return ArchiveView(tenfolds, "")


def _alerts(view):
    blocks = [each for each in flattened(answer(view)) if isinstance(each, Alerts)]
    return [alert.text for block in blocks for alert in block.alerts if alert.about == "Scale"]


class TestCharts:
    def test_all_of_an_output_are_by_its_logarithm(self, view):
        drawn = [*find_charts(distributions(view)), histogram(view, "y", "mc")]
        across = [chart.x for chart in drawn]
        upward = [chart.y for chart in find_charts(scatter(view))]
        for axis in (*across, *upward):
            assert axis.is_logarithmic
            assert axis.ends is not None
            assert np.isfinite(axis.ends).all()
        assert 10 ** across[0].ends[0] < np.min(view.tree["runs/mc"]["y"].values)

    @pytest.mark.parametrize("name", ["tenfolds", "tenfolds_linear"])
    def test_only_such_an_output_is_so_among_all_inputs_and_outputs(self, name, request):
        view = ArchiveView(request.getfixturevalue(name), "")
        (explorer,) = find_explorers(scatter(view))
        found = [each.quantity.name for each in explorer.columns if each.is_logarithmic]
        assert found == ["y"] * (name == "tenfolds")

    def test_no_run_is_dropped_from_the_bins(self, view):
        (bars,) = traces(histogram(view, "y", "mc").marks)
        assert sum(bars["y"]) == 200
        edges = np.array(bars["x"]) - np.array(bars["width"]) / 2
        assert (edges > 0).all()

    def test_the_figure_has_the_same_axis_as_the_page(self, view):
        page = histogram(view, "y", "mc").x.ends
        (axes,) = uqpen.figure(view.archive, "histogram").axes
        assert axes.get_xscale() == "log"
        assert page is not None
        np.testing.assert_allclose(np.log10(axes.get_xlim()), page)
        assert all("$" not in text.get_text() for text in axes.get_xticklabels())

    @pytest.mark.parametrize("name", ["cdf", "exceedance", "scatter", "sensitivity"])
    def test_every_figure_can_be_drawn(self, view, name):
        title = uqpen.figure(view.archive, name).axes[0].get_title(loc="left")
        assert title.endswith("its logarithm's variance") == (name == "sensitivity")


class TestTheLimit:
    @pytest.mark.parametrize("name", ["tenfolds", "tenfolds_linear"])
    def test_it_is_the_first_threshold_and_its_probability_that_of_the_head(self, name, request):
        tree = request.getfixturevalue(name)
        chart = next(find_charts(distributions(ArchiveView(tree, ""))))
        reading = chart.reading
        assert reading is not None
        assert (reading.start, reading.limits) == (0.01, ((0.01, "1 %"),))
        share, _, _ = reading.bounds[reading.values.index(0.01)]
        exceeded = tree["statistics/mc/y/exceedance"].values[0, 0]
        assert share == pytest.approx(1 - exceeded, abs=1e-9)
        (line,) = (shape for shape in shapes(chart.marks) if "label" in shape)
        assert (line["x0"], line["label"]["text"]) == (0.01, "1 &#37;")

    @pytest.mark.parametrize("name", ["tenfolds", "tenfolds_linear"])
    def test_the_browser_says_the_same(self, name, show):
        page = show(name, charts=False)
        head = page.locator(".verdicts dd").first.inner_text()
        readout = page.locator(".readout").first.inner_text()
        share = head.split("\u00a0%")[0].removeprefix("In ")
        assert readout.startswith("P(at most 1 %) = ")
        assert f"P(more) = {share} %" in readout
        assert page.locator(".told").inner_text().split(".")[0].endswith("have y above 1 %")
        slider = page.locator(".reading input[type=range]").first
        slider.focus()
        before = readout
        for _ in range(3):
            page.keyboard.press("ArrowRight")
            after = page.locator(".readout").first.inner_text()
            assert "each of the" not in after
            assert "no run of" not in after
        assert after != before


class TestTexts:
    def test_indices_of_the_logarithm_come_first(self, view):
        titles = [table.title for table in output_tables(view.archive)]
        assert titles[1:] == ["y: shares of its logarithm's variance", "y: shares of its variance"]
        charts = list(find_charts(sensitivity(view)))
        assert charts[0].title == "Shares of its logarithm's variance"
        found = {
            finding.head: finding.text
            for block in flattened(answer(view))
            if isinstance(block, Findings)
            for finding in block.entries
        }
        drivers = found["What drives it?"]
        assert drivers.startswith("x causes about all of the variance of the logarithm of y by")

    def test_quantiles_stand_before_moments_with_digits_of_their_own(self, view):
        table = next(iter(output_tables(view.archive)))
        labels = [label for label, _ in table.rows]
        assert labels.index("95 % quantile") < labels.index("mean")
        median = dict(table.rows)["median"][0]
        assert "×10⁻⁴" in median
        assert "0.0001 …" not in median

    def test_scripts_know_it(self, view):
        reported = archive_json(view.archive)["designs"]["mc"]["outputs"]["y"]
        assert reported["scale"] == "log"

    def test_a_linear_page_of_tenfolds_names_the_key(self, view, tenfolds_linear):
        assert _alerts(view) == []
        (text,) = _alerts(ArchiveView(tenfolds_linear, ""))
        assert text.startswith("Nine tenths of the runs span more than 3 tenfolds of y.")


@pytest.fixture(scope="module")
def some(module_study_of):
    """A study of which some runs are 0."""
    body = "np.where(x < -1.5, 0.0, 10 ** x * k)"
    return ArchiveView(uqpen.run(_study(module_study_of, LOG, body)), "")


class TestValuesWithoutALogarithm:
    def test_they_are_reported_in_words_and_all_runs_are_drawn(self, some):
        zeros = int((some.tree["runs/mc"]["y"].values == 0).sum())
        assert 0 < zeros < 100
        said = (
            f'the scale is linear, though the study asks for scale = "log": values at or below 0 '
            f"have no logarithm, and these are {zeros / 2:g} % of the completed runs of mc (the "
            "smallest is 0)"
        )
        (table, *_) = output_tables(some.archive)
        assert said in table.notes
        (alert,) = _alerts(some)
        assert alert == f"y: {said}."
        chart = histogram(some, "y", "mc")
        assert not chart.x.is_logarithmic
        assert any(said[1:] in note for note in chart.notes)
        (axes,) = uqpen.figure(some.archive, "histogram").axes
        assert axes.get_xscale() == "linear"

    def test_indices_of_the_output_come_first(self, some):
        assert next(find_charts(sensitivity(some))).title == "Shares of its variance"


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (f'{LOG}\nexceeds = ["0"]', "a value above 0"),
        (f'{LOG}\nbelow = ["-1", "2"]', "a value above 0"),
        ('scale = "logarithmic"', "log"),
    ],
)
def test_a_mistake_is_met_before_any_run(study_of, keys, said):
    with pytest.raises(StudyError, match=said):
        _study(study_of, keys)


def test_a_unit_with_a_zero_of_its_own_is_refused(study_of):
    text = (
        '[model]\npython = "line.py:f"\ninputs = { x = "1" }\noutputs = { y = "K" }\n'
        f'[inputs]\nx = "0 ± 1"\n[outputs.y]\nunit = "degC"\n{LOG}\n{DESIGN}'
    )
    folder = study_of("x", x=(0.0, 1.0)).folder
    with pytest.raises(StudyError, match="a unit whose zero is no value"):
        uqpen.parse_study(text, folder=folder)
