"""Two archives side by side: what changed, and how the answers moved."""

import json
import re

import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.charts.chart import Chart
from uqpen.core.errors import ReportError
from uqpen.core.labels import BENCHMARK, KIND
from uqpen.report.blocks import Listing, Remarks, Table, Text, find_charts
from uqpen.report.plotly import traces
from uqpen.report.revisions.revision_page import (
    ArchivePair,
    cdf_charts,
    estimate_changes,
    revision_page,
    study_changes,
    unpaired,
    write_revision_report,
)


def beam(shift=0.0, runs=400, unit="cm", seed=1, **outputs):
    study = uqpen.Study(
        title="A beam",
        model=uqpen.PythonModel(
            lambda load, width: {"sag": load / width + shift, **dict.fromkeys(outputs, load)},
            {"load": "1", "width": "1"},
            {"sag": "m", **outputs},
            vectorized=True,
        ),
        inputs={"load": uqpen.Normal(2, 0.1), "width": uqpen.Uniform(1, 1.2)},
        outputs={"sag": uqpen.OutputSpec(unit, quantiles=[0.5], exceeds=["2 m"]), **outputs},
        designs={"draws": uqpen.MonteCarlo(runs=runs)},
        seed=seed,
    )
    return uqpen.run(study)


@pytest.fixture(scope="module")
def first():
    return beam()


@pytest.fixture(scope="module")
def second():
    """The same beam, 5 cm further down, with fewer runs."""
    return beam(shift=0.05, runs=300)


def tables(blocks):
    return {each.table.title: dict(each.table.rows) for each in blocks if isinstance(each, Table)}


def test_an_answer_stands_beside_its_other_with_the_difference(first, second):
    (table,) = tables(estimate_changes(ArchivePair(first, second))).values()
    one, other, difference, verdict = table["mean"]
    means = [100 * float(tree["runs/draws"]["sag"].values.mean()) for tree in (first, second)]
    assert float(one.split(" ")[0]) == pytest.approx(means[0], abs=0.05)
    assert float(other.split(" ")[0]) == pytest.approx(means[1], abs=0.05)
    assert float(difference) == pytest.approx(means[1] - means[0], abs=0.05)
    assert difference.startswith("+")
    assert verdict == "apart"
    assert table["sd"][3] == "overlap"


def test_what_moved_is_said_first(first, second):
    head, *_ = estimate_changes(ArchivePair(first, second))
    assert isinstance(head, Remarks)
    assert re.fullmatch(r"The intervals of \d of \d+ estimates are apart:", head.head)
    (line,) = head.lines
    assert line.startswith("sag, by draws: mean, ")
    assert "sd" not in line.split(": ")[1].split(", ")


def test_no_test_is_claimed_where_intervals_overlap(first):
    head, note, *_ = estimate_changes(ArchivePair(first, beam(seed=2)))
    assert isinstance(head, Text)
    assert re.fullmatch(r"The intervals of all \d+ estimates overlap\.", head.text)
    assert isinstance(note, Text)
    assert "do not show that the true values are the same" in note.text


def test_another_unit_is_shown_in_that_of_the_first(first):
    pair = ArchivePair(first, beam(unit="mm"))
    (table,) = tables(estimate_changes(pair)).values()
    assert table["mean"][0] == table["mean"][1], "in cm"
    assert float(table["mean"][2]) == 0
    (chart,) = find_charts(cdf_charts(pair))
    curves = [trace for trace in traces(chart.marks) if trace.get("name") in ("A", "B")]
    medians = [
        float(np.interp(0.5, np.array(c["y"], dtype=float), np.array(c["x"], dtype=float)))
        for c in curves
    ]
    assert medians[0] == pytest.approx(medians[1], rel=0.01)


def test_both_functions_are_on_one_chart(first, second):
    (chart,) = [each for each in cdf_charts(ArchivePair(first, second)) if isinstance(each, Chart)]
    assert [key.text for key in chart.keys] == ["A", "B"]
    assert len({(key.series, key.dash) for key in chart.keys}) == 2
    values = [trace["x"] for trace in traces(chart.marks) if trace.get("name") in ("A", "B")]
    assert values[0] == values[1], "a pointer reads both off"


def test_changes_are_rows_of_settings(first, second):
    found = list(study_changes(ArchivePair(first, second)))
    rows = tables(found)
    assert rows["Settings of the study"]["designs.draws.runs"] == ["400", "300"]
    assert rows["Runs"] == {"draws": ["400 runs", "300 runs"]}
    assert "Versions and platform" not in rows
    listing = next(each for each in found if isinstance(each, Listing))
    assert "-runs = 400" in listing.text
    assert "+runs = 300" in listing.text


def test_the_same_study_says_so(first):
    (text,) = study_changes(ArchivePair(first, first.copy()))
    assert isinstance(text, Text)
    assert "are the same" in text.text


def test_versions_and_models_that_differ_are_named(first):
    other = first.copy()
    other.attrs |= {"version_numpy": "1.0", "model_source_sha256": "f" * 64}
    rows = tables(study_changes(ArchivePair(first, other)))
    assert rows["Versions and platform"]["numpy"][1] == "1.0"
    assert rows["Models"]["source sha256"][1] == "f" * 64


def test_a_study_text_that_is_damaged_is_compared_as_text(first):
    other = first.copy()
    other.attrs["study_text"] = "[[[ no study\n"
    found = list(study_changes(ArchivePair(first, other)))
    assert "Settings of the study" not in tables(found)
    assert any(isinstance(each, Listing) and "no study" in each.text for each in found)


def test_what_only_one_has_is_named(first):
    (remarks,) = unpaired(ArchivePair(first, beam(weight="kg")))
    assert isinstance(remarks, Remarks)
    assert remarks.lines == ("output weight: in B only",)
    assert not list(unpaired(ArchivePair(first, first)))


def test_an_output_of_another_dimension_is_not_compared(first):
    other = first.copy()
    dataset = other["runs/draws"].to_dataset()
    dataset["sag"].attrs |= {"units": "kg", "display_units": "kg"}
    other["runs/draws"].dataset = dataset
    pair = ArchivePair(first, other)
    assert not list(estimate_changes(pair))
    (remarks,) = unpaired(pair)
    assert isinstance(remarks, Remarks)
    assert remarks.lines == ("output sag: in another unit, cm and kg",)


def test_the_page_is_complete_and_the_same_each_time(first, second, tmp_path):
    write_revision_report(first, second, tmp_path / "two.html", names=("a.nc", "<b>.nc"))
    page = (tmp_path / "two.html").read_text("utf-8")
    assert page == revision_page(first, second, names=("a.nc", "<b>.nc"))
    assert "<h1>A beam: A and B</h1>" in page
    assert "B: &lt;b&gt;.nc, " in page, "text, not HTML"
    titles = re.findall(r'<h2 id="[\w-]+">([^<]*)</h2>', page)
    assert titles == [
        "How the answers moved",
        "Distribution functions",
        "What changed in the study",
    ]
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert data is not None
    assert len(json.loads(data[1])["charts"]) == 1


def test_a_benchmark_is_refused(first):
    benchmark = xr.DataTree(xr.Dataset(attrs={KIND: BENCHMARK}))
    with pytest.raises(ReportError, match="only archives of studies are shown side by side"):
        revision_page(first, benchmark)


@pytest.mark.slow
def test_the_command_takes_two_archives(command_line, tmp_path):
    for name, runs in (("a", 50), ("b", 60)):
        design = {"some": {"kind": "monte-carlo", "runs": runs}}
        text = study_text("ishigami", inputs={"x1": (0, 1), "x2": 1.0, "x3": 1.0}, designs=design)
        (tmp_path / f"{name}.toml").write_text(text)
        command_line("study", f"{name}.toml", "-o", f"{name}.nc")
    done = command_line("report", "a.nc", "b.nc")
    assert (done.code, done.out, done.err) == (0, "report: a_b.html\n", "")
    assert "designs.some.runs" in (tmp_path / "a_b.html").read_text("utf-8")
    done = command_line("report", "a.nc", "b.nc", "-o", "there.txt")
    assert done.code == 2
    assert "expected .html or .htm" in done.err
    done = command_line("report", "a.nc", "b.nc", "--section", "x.py:f")
    assert done.code == 2
    assert "--section is for the page of one archive" in done.err


@pytest.mark.slow
def test_a_browser_draws_both_functions(first, second, browser, tmp_path):
    write_revision_report(first, second, tmp_path / "two.html")
    page = browser.new_page(viewport={"width": 390, "height": 800})
    said = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto((tmp_path / "two.html").as_uri())
    page.wait_for_selector(".plot .main-svg", timeout=120_000)
    assert page.locator(".legend >> text=A").count() >= 1
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert said == []
