"""The report of a benchmark of methods, from archives of real benchmarks."""

import json
import operator
import re

import numpy as np
import pytest
from study_text import study_text

from uqpen.benchmark.compare import compare
from uqpen.benchmark.methods import BenchmarkSettings
from uqpen.charts.chart import Block, Charts
from uqpen.core.errors import ArchiveError
from uqpen.core.lookup import resolve
from uqpen.report import SECTIONS
from uqpen.report.blocks import Heading, Listing, Quote, Remarks, Table, Text, find_charts
from uqpen.report.page import report_page
from uqpen.report.plotly import shapes, traces
from uqpen.results.archive_view import ArchiveView
from uqpen.study.load import parse_study

pytestmark = pytest.mark.slow

STUDY = study_text(
    {
        "python": "model.py:f",
        "vectorized": True,
        "inputs": {"a": "1", "b": "1"},
        "outputs": {"y": "m", "z": "1"},
    },
    title="Two </script><b>methods</b>",
    inputs={"a": (-3, 3), "b": (-3, 3)},
    outputs={"y": {"unit": "cm", "exceeds": ["300 cm"]}},
    designs={
        "monte_carlo": {"kind": "monte-carlo", "runs": 100},
        "latin_hypercube": {"kind": "latin-hypercube", "runs": 100},
    },
)
TERMS = BenchmarkSettings(budgets=(16, 64), repeats=10, reference=512)


def compared(folder, y, z, terms=TERMS):
    """A comparison on a model of two lines of NumPy."""
    source = f"import numpy as np\ndef f(a, b):\n    return {{'y': {y}, 'z': {z}}}\n"
    (folder / "model.py").write_text(source)
    return compare(parse_study(STUDY, folder=folder), terms)


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A sum, which Latin hypercubes are made for, and what is always the same."""
    return compared(tmp_path_factory.mktemp("sum"), "a + b + 5", "np.full_like(a, 2)")


def blocks_of(tree, name, kind=Block):
    made = resolve(SECTIONS[name].function)(ArchiveView(tree, ""))
    return [block for block in made if isinstance(block, kind)]


def charts_of(tree, name):
    return list(find_charts(blocks_of(tree, name)))


def traced(chart, name):
    return next(trace for trace in traces(chart.marks) if trace.get("name") == name)


class TestAnswer:
    def test_sentences_to_be_quoted_count_what_the_verdicts_say(self, tree):
        (quote,) = blocks_of(tree, "leaders", Quote)
        levels = [
            level
            for output in ("y", "z")
            for name, said in tree[f"comparison/{output}"].data_vars.items()
            if name.endswith("_level")
            for level in np.ravel(said.values[0, 0])
        ]
        assert len(levels) == 11
        tied = sum("monte_carlo" in level.split() for level in levels)
        ahead = levels.count("latin_hypercube")
        assert (tied, ahead) == (10, 1)
        assert quote.sentences[0] == (
            "At 16 runs, of 11 statistics, latin_hypercube leads all others by more than the "
            "noise in 1 and is level with the best in 10; monte_carlo is level in 10."
        )

    def test_each_verdict_stands_in_words(self, tree):
        words = next(b for b in blocks_of(tree, "leaders", Remarks) if b.head == "In words: y")
        first, second = tree["comparison/y/mean_verdict"].values[0]
        assert re.match(
            r"at 16 runs latin_hypercube leads monte_carlo by a factor of [\d.]+ \(", first
        )
        assert words.lines[0] == f"mean: {first}; {second}."

    def test_a_chart_marks_who_leads_and_who_is_level(self, tree):
        chart = charts_of(tree, "leaders")[0]
        quantiles = ("5 % quantile", "median", "95 % quantile")
        assert chart.y.rows == ("mean", "sd", *quantiles, "P(> 300 cm)")
        assert [text for _, text in chart.x.ticks] == ["16", "64"]
        lead = traced(chart, "latin_hypercube")
        first = lead["y"].index(0)
        assert (lead["x"][first], lead["marker"]["symbol"][first]) == (0, "square")
        level = traced(chart, "monte_carlo")
        assert 0 not in level["y"]
        sides = [each["x"][each["y"].index(1)] for each in (lead, level)]
        assert sides[0] == -sides[1] < 0, "side by side"

    @pytest.mark.parametrize(
        ("most", "said"),
        [(1, ["The first 1 of 2 outputs; the verdicts below cover all."]), (2, [])],
    )
    def test_of_many_outputs_the_first_have_charts(self, tree, monkeypatch, most, said):
        monkeypatch.setattr("uqpen.report.sections.benchmark._MOST_CHARTS", most)
        (block,) = blocks_of(tree, "leaders", Charts)
        assert len(block.charts) == most
        assert list(block.notes[1:]) == said

    def test_what_must_be_known_is_counted(self, tree):
        known = blocks_of(tree, "leaders", Remarks)[0]
        assert known.head == "What to keep in mind"
        assert (
            "For 2 of 22 verdicts: the reference has no interval here, so how far it is off is "
            "not known." in known.lines
        )
        assert known.lines[-1] == (
            "Intervals of errors: none where a few of the repeats decide an error; a tail that "
            "none has met cannot show."
        )


class TestErrors:
    def test_a_line_for_each_method_has_the_archives_errors(self, tree):
        chart = charts_of(tree, "errors")[0]
        error = tree["statistics/monte_carlo/y/mean_error"].values
        line = traced(chart, "monte_carlo")
        assert line["mode"] == "lines+markers"
        assert line["y"] == pytest.approx(100 * error[:, 0], rel=1e-5)
        assert line["error_y"]["array"] == pytest.approx(
            100 * (error[:, 2] - error[:, 0]), rel=1e-5
        )
        guide = traced(chart, "1/√runs")
        assert guide["y"][0] == pytest.approx(2 * guide["y"][1], rel=1e-5)
        assert chart.title == "mean: 499.6 (498.3 … 500.2) cm"
        assert [label for label, _ in chart.tables[0].rows] == ["monte_carlo", "latin_hypercube"]

    def test_what_no_axis_can_show_is_named(self, tree):
        # The second output never changes, so that every error is 0.
        assert [block.text for block in blocks_of(tree, "errors", Heading)] == ["y"]
        (text,) = blocks_of(tree, "errors", Text)
        assert text.text == (
            "Not drawn, as no error is above 0: z, mean; z, sd; z, 5 % quantile; z, median; "
            "z, 95 % quantile."
        )

    def test_replicates_stand_apart_with_their_verdicts(self, tree):
        chart = charts_of(tree, "replicates")[0]
        replicated = traced(chart, "latin_hypercube")
        error = tree["statistics/latin_hypercube_replicated/y/mean_error"].values
        assert replicated["y"] == pytest.approx(100 * error[:, 0], rel=1e-5)
        assert any(note.startswith("Replicated: ") for note in chart.notes)

    def test_an_error_that_few_repeats_decide_is_hollow(self, tree):
        changed = tree.copy(deep=True)
        changed["statistics/monte_carlo/y/mean_error"].values[0, 1:] = np.nan
        chart = charts_of(changed, "errors")[0]
        assert traced(chart, "monte_carlo")["marker"]["symbol"] == ["circle-open", "circle"]
        assert "Hollow: no interval, as few of the repeats decide the error." in chart.notes
        assert chart.tables[0].notes == ["no interval, as few of the repeats decide this error"]

    def test_the_references_own_error_is_shown(self, tree):
        mean = charts_of(tree, "errors")[0]
        _, lower, upper = tree["statistics/reference/y/mean"].values
        own = 100 * (upper - lower) / 2 / tree["comparison/y/mean_scale"].item()
        (shaded,) = (trace for trace in traces(mean.marks) if "fillcolor" in trace)
        assert shaded["y"][0] == pytest.approx(own, rel=1e-5)


class TestRates:
    def test_slopes_have_intervals_and_a_guide(self, tree):
        single, replicated = charts_of(tree, "rates")
        assert single.title == "Slopes of y, as single sets"
        assert replicated.title == "Slopes of y, in replicates"
        assert [shape["x0"] for shape in shapes(single.marks)] == [-0.5]
        slope = traced(single, "monte_carlo")
        assert slope["x"][0] == pytest.approx(
            tree["statistics/monte_carlo/y/mean_slope"].values[0], rel=1e-5
        )

    def test_coverage_is_reported_with_what_chance_does(self, tree):
        (block,) = blocks_of(tree, "coverage", Charts)
        assert block.notes[0] == (
            "Each marker is for one number of runs. Shaded: shares from 80 %, which 10 intervals "
            "with a coverage of 95 % may well have by chance. Estimates without an interval do "
            "not count, so a share may be from fewer than 10."
        )
        shares = tree["statistics/monte_carlo/y/mean_coverage"].values
        label, cells = block.charts[0].tables[0].rows[0]
        assert label == "mean, monte_carlo"
        assert cells == [f"{100 * share:.0f}" for share in shares]


class TestReference:
    def test_cost_counts_runs(self, tree):
        (table,) = blocks_of(tree, "cost", Table)
        assert table.table.rows[2] == ("\u00a0\u00a0\u00a0replicated", ["8 × 2", "8 × 8"])
        (text,) = blocks_of(tree, "cost", Text)
        assert text.text == ("All repeats together cost 2\u202f400 runs, and the reference 512.")

    def test_values_that_errors_are_held_to(self, tree):
        (text,) = blocks_of(tree, "reference", Text)
        assert text.text == "Of its 512 runs, all completed."
        values = blocks_of(tree, "reference", Table)[0].table
        label, (value, own, relative, how) = values.rows[0]
        assert (label, how) == (
            "mean",
            "Student t over replicates, the end of the longer tail moved out",
        )
        assert (value, own) == ("499.6 (498.3 … 500.2) cm ¹", "0.20 %")
        scale = 100 * tree["comparison/y/mean_scale"].item()
        assert relative == f"{scale:.4g} cm"

    def test_tables_are_those_of_the_screen(self, tree):
        tables = blocks_of(tree, "tables", Table)
        assert len(tables) == 11
        assert tables[0].table.title == "y, mean: 499.6 (498.3 … 500.2) cm"
        assert tables[0].table.columns == ["16", "64", "slope"]

    def test_the_study_is_in_it(self, tree):
        assert STUDY in [block.text for block in blocks_of(tree, "archive", Listing)]


class TestPage:
    def test_it_is_the_same_each_time_and_runs_nothing_of_the_study(self, tree):
        text = report_page(tree)
        assert text == report_page(tree)
        title = "Two &lt;/script&gt;&lt;b&gt;methods&lt;/b&gt;: benchmark of methods"
        assert f"<h1>{title}</h1>" in text
        assert re.findall(r'<section id="(\w+)"', text) == [
            name for name, section in SECTIONS.items() if section.of != "study"
        ]
        data = re.search(r'id="data">(.*?)</script>', text, re.DOTALL)
        assert data
        assert json.loads(data[1])["charts"]

    def test_a_reference_that_lost_all_of_its_runs(self, tmp_path):
        lost = compared(tmp_path, "a * np.nan", "b * np.nan")
        (known,) = blocks_of(lost, "leaders")
        assert known.lines == ("All runs of the reference failed, so all errors are unknown.",)
        names = re.findall(r'<section id="(\w+)"', report_page(lost))
        assert names == ["leaders", "cost", "reference", "tables", "archive"]

    def test_losses_are_reported(self, tmp_path):
        terms = BenchmarkSettings(budgets=(16,), repeats=10, reference=512)
        some = compared(tmp_path, "np.where(a < 1, np.nan, b)", "np.exp(4 * b)", terms)
        lines = blocks_of(some, "leaders", Remarks)[0].lines
        used = int(some["statistics/reference/y/mean"].attrs["runs_used"])
        assert 0 < used < 512
        assert lines[0] == (
            f"{512 - used} of 512 runs of the reference failed; its estimates use the others."
        )
        assert not blocks_of(some, "rates")
        assert report_page(some)

    def test_one_method_has_nobody_to_beat(self, tree):
        alone = tree.copy(deep=True)
        for name in ("latin_hypercube", "latin_hypercube_replicated"):
            del alone["statistics"][name]
        for output in ("y", "z"):
            for name, said in alone[f"comparison/{output}"].data_vars.items():
                if name.endswith("_lead"):
                    said.values[...] = np.nan
                elif not name.endswith("_scale"):
                    said.values[...] = ""
        assert blocks_of(alone, "leaders")[0] == Text("No two methods have estimates to compare.")
        assert report_page(alone)

    @pytest.mark.parametrize(
        ("damage", "complaint"),
        [
            (
                lambda tree: operator.delitem(tree["statistics/monte_carlo/y"], "mean_error"),
                "/statistics/monte_carlo/y: no mean_error",
            ),
            (
                lambda tree: operator.delitem(tree, "statistics"),
                "/statistics: no method that was given runs",
            ),
            (
                lambda tree: tree["statistics/monte_carlo/y/mean_error"].attrs.update(
                    interval_level="x"
                ),
                "/statistics/monte_carlo/y/mean_error: interval_level is no probability",
            ),
        ],
    )
    def test_a_damaged_archive_is_refused(self, tree, damage, complaint):
        damaged = tree.copy(deep=True)
        damage(damaged)
        with pytest.raises(ArchiveError, match=f"^the archive is damaged: {complaint}"):
            report_page(damaged)

    def test_numbers_of_runs_that_do_not_ascend_are_refused(self, tree):
        turned = tree.isel(budget=[1, 0], missing_dims="ignore")
        complaint = "/statistics: numbers of runs that do not ascend from 1"
        with pytest.raises(ArchiveError, match=complaint):
            report_page(turned)
