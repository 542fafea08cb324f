"""Figures of all archives: their texts, what is missing, and the files that they become."""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from functools import partialmethod
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.text import Text

import uqpen
from uqpen.charts.chart import Axis, Chart
from uqpen.core.errors import ArchiveError, FigureError, UnknownNameError
from uqpen.core.labels import BENCHMARK, KIND
from uqpen.core.lookup import resolve
from uqpen.figures import FIGURES
from uqpen.figures.page import available, figure, panels
from uqpen.figures.painter import chart_panel
from uqpen.figures.panel import Panel
from uqpen.figures.style import FORMATS, figure_bytes
from uqpen.results.digits import number_text, typeset_unit
from uqpen.results.texts import plain_text

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"

BEAM = {"cdf", "exceedance", "histogram", "scatter", "methods", "sensitivity", "losses"}
BEAM |= {"convergence"}


def test_what_is_in_the_family_says_what_it_shows():
    table = re.findall(r"^\| `([\w-]+)` \|", (DOCS / "figures.md").read_text(), re.MULTILINE)
    assert table == [*FIGURES]
    for reference in FIGURES.values():
        assert len(resolve(reference).__doc__.splitlines()[0]) <= 62, reference


def test_the_pictures_of_the_docs_are_there_and_small():
    text = (DOCS / "figures.md").read_text()
    shown = re.findall(r"\]\((\w+\.svg)\)", text)
    assert len(shown) == 4
    for name in (*shown, "concrete.svg"):
        assert (DOCS / name).stat().st_size < 150_000


class TestTexts:
    def test_a_hostile_title_is_only_text(self, archives):
        page = figure(archives["beam"], "histogram")
        title = page.get_suptitle()
        assert title.startswith("$5 and $6: \\frac{1}{0} \\x1b[31m --> <script>")
        content = figure_bytes(page, "svg")
        ET.fromstring(content)
        assert b"<script" not in content

    def test_control_characters_are_spelled_out_and_length_is_bounded(self):
        assert plain_text("a\nb\x1b\u202ec") == "a\\nb\\x1b\\u202ec"
        assert plain_text("x" * 100, 10) == "xxxxxxxxx…"

    def test_axes_of_a_caller_have_the_ticks_of_a_chart_and_plain_texts(self):
        bolts = Axis("bolt $d$", (-0.5, 1.5), ticks=((0.0, "M8"), (1.0, "$M$ 10")))
        tail = Axis("P(more than x)", (-2.0, 0.0), is_logarithmic=True)
        axes = Figure().add_subplot()
        chart_panel(Chart("$5 and $6", "", bolts, tail, ()), str).draw_on_axes(axes)
        assert [each.get_text() for each in axes.get_xticklabels()] == ["M8", "$M$ 10"]
        marked = {each.get_text() for each in axes.get_yticklabels()}
        assert {"0.01", "0.1", "1"} <= marked
        assert not any(each.get_parse_math() for each in axes.findobj(Text))

    def test_beside_names_there_is_room_for_few_numbers(self):
        axes = Figure().add_subplot()
        chart = Chart("", "", Axis("x", (0.0, 1.0)), Axis("", rows=("a", "b")), ())
        chart_panel(chart, str).draw_on_axes(axes)
        assert axes.get_xticks().tolist() == [0, 0.25, 0.5, 0.75, 1]

    def test_powers_of_units_are_raised(self):
        assert typeset_unit("W m-2 K-1") == "W m⁻² K⁻¹"
        assert typeset_unit("g/cm^3") == "g/cm³"
        assert typeset_unit("1000 m") == "1000 m"


class TestMessages:
    def test_what_there_is_stands_in_place_of_what_is_missing(self, archives):
        with pytest.raises(FigureError) as error:
            figure(archives["lost"], "cdf")
        assert str(error.value) == (
            'the archive has nothing for the figure "cdf", as no run completed; '
            "it has: scatter, losses"
        )

    def test_of_what_it_has_nothing(self, archives):
        with pytest.raises(FigureError, match='figure "scatter" of "trajectories"; it has: cdf'):
            figure(archives["schema_1"], "scatter", source="trajectories")

    @pytest.mark.parametrize(
        ("name", "asked", "message"),
        [
            ("cdff", {}, 'no figure "cdff"; did you mean "cdf"? known: cdf, '),
            ("cdf", {"output": "z"}, 'the archive has no output "z"; known: y'),
            ("cdf", {"source": "report_"}, 'no source "report_"; did you mean "report"? known: '),
            ("cdf", {"model": "one"}, 'the archive has no model "one"; none is known'),
        ],
    )
    def test_an_unknown_name(self, archives, name, asked, message):
        with pytest.raises(UnknownNameError, match=re.escape(message)):
            figure(archives["schema_1"], name, **asked)

    def test_a_damaged_benchmark(self):
        with pytest.raises(ArchiveError, match="the archive is damaged"):
            available(xr.DataTree(xr.Dataset(attrs={KIND: BENCHMARK})))

    def test_without_matplotlib(self, archives, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib.style", None)
        assert "cdf" in available(archives["beam"]), "to list them takes no package"
        with pytest.raises(FigureError, match='"pip install matplotlib" does it'):
            figure(archives["beam"], "cdf")


class TestMany:
    def test_of_many_runs_few_are_drawn_and_all_are_counted(self, study_of):
        distribution = '[designs.some]\nkind = "monte-carlo"\nruns = 20_000'
        tree = uqpen.run(study_of("a * b", distribution, a=(0, 1), b=(0, 1)))
        page = figure(tree, "scatter", "histogram", "cdf")
        first, *_, histogram, _ = page.axes
        assert len(first.lines[0].get_xdata()) == 400
        assert histogram.patches[0].get_data().values.sum() == 20_000
        notes = page.legends[0].get_title().get_text()
        assert "Runs of some in the charts: 400 of 20 000 completed." in notes
        assert len(figure_bytes(page, "svg")) < 800_000

    def test_of_many_panels_a_page_shows_some(self, study_of):
        inputs = {f"x{number}": (0, 1) for number in range(30)}
        design = '[designs.some]\nkind = "monte-carlo"\nruns = 300'
        tree = uqpen.run(study_of(" + ".join(inputs), design, **inputs))
        assert len(panels(tree, "scatter")) == 24
        page = figure(tree, "scatter", "histogram")
        assert len(page.axes) == 24
        notes = page.legends[0].get_title().get_text()
        assert "Shown are the 24 of 30 inputs with the largest first order by some." in notes
        assert "the first 24 of 25 panels" in notes
        (indices,) = figure(tree, "sensitivity").axes
        assert len(indices.get_yticklabels()) == 15, "those with the largest estimates"


def _three(x):
    return {"y": float(np.exp(5 * x)), "z": float(np.exp(6 * x)), "w": x}


class TestSeveralOutputs:
    @pytest.fixture
    def tree(self):
        study = uqpen.Study(
            seed=1,
            model=uqpen.PythonModel(
                _three, inputs={"x": "1"}, outputs={"y": "1", "z": "1", "w": "1"}
            ),
            inputs={"x": "0 ± 0.4"},
            designs={"some": uqpen.MonteCarlo(runs=400)},
        )
        return uqpen.run(study)

    def test_the_largest_run_is_said_of_each_by_its_name(self, tree):
        notes = figure(tree, "cdf").legends[0].get_title().get_text()
        for name in "yz":
            largest = number_text(float(tree[f"runs/some/{name}"].values.max()))
            assert f"{name}: Axes end where all but 1 % lies inside." in notes
            assert f"The largest of 400 runs is {largest}." in notes

    def test_a_legend_names_that_of_which_a_text_is(self, tree):
        page = figure(tree, "histogram")
        labels = [each.get_text() for each in page.legends[0].get_texts()]
        assert labels[0] == "runs", "of all"
        assert [each.split()[:2] for each in labels[1:]] == [
            [f"{name}:", word] for name in "yzw" for word in ("mean", "5", "median", "95")
        ]
        alone = figure(tree, "histogram", output="z").legends[0].get_texts()
        assert alone[1].get_text().startswith("mean ")

    def test_panels_of_one_output_each_fill_the_rows(self, tree):
        first, second, third = (each.get_position() for each in figure(tree, "cdf").axes)
        assert first.y0 == second.y0 > third.y0


class TestFiles:
    @pytest.fixture
    def beam(self, archives, tmp_path):
        path = tmp_path / "beam.nc"
        uqpen.write(archives["beam"], path)
        return path

    def test_the_same_bytes_each_time_wherever_it_is_made(self, archives, beam, tmp_path):
        here = {}
        for kind in FORMATS:
            path = tmp_path / f"here.{kind}"
            figure(archives["beam"], "cdf").save(path)
            here[kind] = path.read_bytes()
            reported = rb"CreationDate|dc:date|atplotlib v|Software"
            assert not re.search(reported, here[kind]), "no time and no version"
        settings = tmp_path / "matplotlibrc"
        settings.write_text("font.size: 20\nlines.linewidth: 9\nsvg.fonttype: none\n")
        code = (
            "import sys; from uqpen.cli.main import uqpen\n"
            "for kind in sys.argv[2:]:\n"
            "    command = ['figure', sys.argv[1], 'cdf', '-o', f'there.{kind}']\n"
            "    uqpen(command, standalone_mode=False)\n"
            "assert 'matplotlib.pyplot' not in sys.modules\n"
        )
        elsewhere = {**os.environ, "MATPLOTLIBRC": str(settings), "PYTHONHASHSEED": "7"}
        command = [sys.executable, "-c", code, str(beam), *FORMATS]
        subprocess.run(command, check=True, cwd=tmp_path, env=elsewhere, capture_output=True)
        for kind, content in here.items():
            assert (tmp_path / f"there.{kind}").read_bytes() == content, kind

    def test_the_bytes_do_not_depend_on_the_last_digits_of_a_layout(self, archives, monkeypatch):
        lay_out = ConstrainedLayoutEngine.execute

        def shifted(engine, fig, by):
            lay_out(engine, fig)
            for axes in fig.axes:
                place = axes.get_position(original=True)
                axes.set_position(place.translated(by, by))
                axes.set_in_layout(True)

        contents = set()
        for by in (0.0, -1e-14):
            monkeypatch.setattr(ConstrainedLayoutEngine, "execute", partialmethod(shifted, by=by))
            contents.add(figure_bytes(figure(archives["beam"], "methods"), "svg"))
        assert len(contents) == 1

    def test_they_are_listed_and_drawn(self, beam, command_line):
        listed = command_line("figure", str(beam), "--list")
        assert listed.code == 0
        assert [row.split()[0] for row in listed.out.splitlines()] == [
            name for name in FIGURES if name in BEAM
        ]
        assert command_line("figure", str(beam)).out == listed.out
        assert max(map(len, listed.out.splitlines())) <= 80
        done = command_line("figure", str(beam), "methods")
        assert (done.code, done.out) == (0, "figure: methods.svg\n")
        assert Path("methods.svg").is_file()

    def test_a_file_is_replaced_or_left_alone(self, beam, command_line):
        Path("mine.png").write_text("earlier")
        refused = command_line("figure", str(beam), "surrogate", "-o", "mine.png")
        assert refused.code == 2
        assert "nothing for the figure" in refused.err
        assert Path("mine.png").read_text() == "earlier"
        assert command_line("figure", str(beam), "losses", "-o", "mine.png").code == 0
        assert Path("mine.png").read_bytes().startswith(b"\x89PNG")
        assert sorted(path.name for path in Path().iterdir()) == ["beam.nc", "mine.png"]

    @pytest.mark.parametrize(
        ("file", "message"),
        [
            ("a.gif", "a.gif: found the ending .gif; expected .svg, .pdf, .png\n"),
            ("a", "a: found the ending none; expected .svg, .pdf, .png\n"),
            ("beam.nc/a.svg", "beam.nc/a.svg: cannot be written: beam.nc is no folder\n"),
        ],
    )
    def test_a_file_that_cannot_be(self, beam, command_line, file, message):
        done = command_line("figure", str(beam), "losses", "-o", file)
        assert (done.code, done.out, done.err) == (2, "", message)
        assert [path.name for path in Path().iterdir()] == ["beam.nc"]

    def test_a_notebook_shows_them(self, archives):
        assert figure(archives["beam"], "losses")._repr_svg_().startswith("<?xml")


def test_a_constant_output_is_drawn(study_of):
    tree = uqpen.run(study_of("2 + 0 * x", x=(0, 1)))
    for name in available(tree):
        assert all(np.isfinite(axes.get_xlim()).all() for axes in figure(tree, name).axes)


def test_panels_of_one_output_each_share_a_row(study_of):
    tree = uqpen.run(study_of("a", '[designs.mc]\nkind = "monte-carlo"\nruns = 20', a=(0, 1)))

    def rows(*groups):
        def drawn(_):
            """Empty panels."""
            yield from (Panel(each, lambda _: (), group=each) for each in groups)

        return [each.get_subplotspec().rowspan.start for each in figure(tree, drawn).axes]

    assert rows("y", "z") == [0, 0]
    assert rows("y", "y", "z") == [0, 0, 1]
