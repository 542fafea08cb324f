"""What a reader can do with a page: thresholds, selections, and what can be taken out of it."""

import csv
import io
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browsers import IDLE, settle
from hashed_trees import with_hashes
from study_text import study_text

import uqpen

pytestmark = pytest.mark.slow

STUDY = study_text(
    {
        "python": "two.py:two",
        "vectorized": True,
        "inputs": {"a": "m", "b": "m"},
        "outputs": {"y": "m", "z": "kg m-3"},
    },
    title="Two outputs",
    inputs={"a": ("0 m", "1 m"), "b": ("0 m", "1 m")},
    dependence={
        "copula": "gaussian",
        "of": "ranks",
        "pairs": [{"inputs": ["a", "b"], "correlation": 0.8}],
    },
    outputs={"y": {"exceeds": ["0.5 m"]}},
    designs={"some": {"kind": "monte-carlo", "runs": 120}},
)
MODEL = """
import numpy as np
def two(a, b):
    is_lost = a > 0.95
    return {"y": np.where(is_lost, np.nan, a), "z": np.where(is_lost, np.nan, 1 + a + b)}
"""


@pytest.fixture(scope="module")
def two(tmp_path_factory, made_once):
    """A study of two outputs and two dependent inputs, with a few failed runs."""

    def make():
        folder = tmp_path_factory.mktemp("two")
        (folder / "two.py").write_text(MODEL)
        return uqpen.run(uqpen.parse_study(STUDY, folder=folder))

    tree = made_once("two", make).copy(deep=True)
    tree["runs/some/b"].attrs["long_name"] = '=b, "quoted"'
    return with_hashes(tree)


class Values:
    """The completed runs of the study."""

    def __init__(self, tree):
        runs = tree["runs/some"]
        is_ok = runs["status"].values == 0
        self.a, self.b, self.y, self.z = (runs[name].values[is_ok] for name in "abyz")
        self.lost = runs["a"].values[~is_ok]
        kept = self.y.size / is_ok.size
        half = np.sqrt(np.log(2 / 0.05) / (2 * self.y.size))
        # Beyond all runs, the band allows for each failed run.
        self.most_beyond = float(1 - kept + half * np.sqrt(kept))


@pytest.fixture
def values(two):
    return Values(two)


@pytest.fixture
def page(show):
    """The page with the thresholds that it begins with, and without a selection."""
    page = show("two")
    page.emulate_media(reduced_motion="reduce")
    # The charts of all outputs but the first are folded.
    page.evaluate(
        "document.querySelectorAll('details:not(.tools)').forEach((each) => { each.open = true; })"
    )
    page.wait_for_selector("html[data-ready=yes]:not(:has(.plot:not([data-drawn])))")
    free = page.get_by_role("button", name="Select all runs")
    if free.is_enabled():
        free.click()
    _type(page, 0, "0.5")
    return page


def _type(page, form, text):
    """Type a threshold; the answer."""
    box = page.locator(".threshold:not(line)").nth(form)
    box.fill(text)
    box.press("Enter")
    settle(page)
    return page.locator(".readout").nth(form).inner_text()


# The lines at a value that stand in the charts of an output, by what lies along the axis across.
LINES = """([name, at]) => {
  const { charts } = JSON.parse(document.getElementById("data").textContent);
  const found = [];
  for (const plot of document.querySelectorAll(".plot")) {
    const chart = charts[plot.dataset.chart];
    for (const along of ["x", "y"]) {
      if (chart?.[along].of?.[0] !== name) continue;
      const lines = plot.layout.shapes.filter((shape) => shape.type === "line");
      const isAt = (line) => line[`${along}0`] === at && line[`${along}1`] === at;
      found.push([along, lines.some(isAt)]);
    }
  }
  return found;
}"""


# Whether a chart shows the last change, as those do that are near.
HAS_FOLLOWED = """(plot) => {
  const versions = [...document.querySelectorAll(".plot")].map((each) => each.dataset.chosen);
  return Number(plot.dataset.chosen) === Math.max(...versions.map(Number));
}"""


def _seen(page):
    """Scroll over the whole page, as charts follow when they come near."""
    for plot in page.locator(".plot").all():
        plot.evaluate("(each) => each.scrollIntoView()")
        page.wait_for_function(HAS_FOLLOWED, arg=plot.element_handle())


class TestThreshold:
    def test_it_moves_in_all_charts_of_the_output(self, page, values):
        _type(page, 0, "0,7")
        _seen(page)
        lines = page.evaluate(LINES, ["y", 0.7])
        # Distribution function, histogram and tail; then the output against each input.
        assert [along for along, _ in lines] == ["x", "x", "x", "y", "y"]
        assert all(is_there for _, is_there in lines)
        assert page.evaluate(LINES, ["z", 0.7]) == [[along, False] for along, _ in lines]
        count = int((values.y > 0.7).sum())
        assert 0 < count < values.y.size
        assert page.locator(".parallel .beyond").count() == count
        reported = page.locator(".told").inner_text()
        assert reported.startswith(
            f"{count} of the {values.y.size} completed runs shown have y above"
        )
        colours = page.evaluate(
            COLOURS, page.locator("#scatter .charts .plot").first.element_handle()
        )
        assert sorted(colours.values()) == sorted([count, values.y.size - count])

    def test_it_stands_in_the_address_and_comes_back_from_it(self, page, browser):
        _type(page, 0, "0.62")
        _type(page, 1, "2.5")
        page.wait_for_function("() => decodeURIComponent(location.hash).includes('z>2.5_kg_m-3')")
        assert "y>0.62_m&" in page.evaluate("decodeURIComponent(location.hash)")
        other = browser.new_page()
        other.add_init_script(IDLE)
        other.goto(page.url)
        read = other.locator(".threshold:not(line)").evaluate_all(
            "(all) => all.map((a) => a.value)"
        )
        assert [float(text) for text in read] == [0.62, 2.5]
        other.close()

    def test_a_place_stands_before_it(self, page):
        page.evaluate("location.hash = '#scatter&y>0.55_m'")
        page.wait_for_function("() => document.querySelector('.threshold').value === '0.55'")
        assert page.evaluate("document.getElementById('scatter').getBoundingClientRect().top") < 200
        # Charts that come near are drawn, and those of the threshold follow, before the click.
        page.wait_for_selector("html[data-ready=yes]")
        settle(page)
        page.locator("nav li a").first.click()
        page.wait_for_function(
            "() => decodeURIComponent(location.hash).startsWith('#answer&y>0.55_m')"
        )

    def test_another_unit_is_refused(self, page):
        page.evaluate("location.hash = '#y>70_cm'")
        readout = page.locator(".readout").first
        page.wait_for_function(
            "() => document.querySelector('.readout').textContent.includes('unit')"
        )
        assert readout.inner_text() == "The address asks for y>70 cm; the unit here is m."
        assert page.locator(".threshold").first.input_value() == "0.5"

    def test_a_value_that_no_run_reached_is_answered(self, page, values):
        found = re.fullmatch(
            r"1.5 m: no run of (\d+) reached it \(largest: 0.9\d* m\). "
            r"P\(more\) is at most (\d+\.\d) %\.",
            _type(page, 0, "1,5 m"),
        )
        assert found
        assert int(found[1]) == values.y.size
        # Rounded up, so that the bound holds.
        assert 0 <= float(found[2]) - 100 * values.most_beyond < 0.1
        below = _type(page, 0, "-1")
        assert below.startswith(f"−1 m: each of the {values.y.size} runs exceeded it")
        assert page.locator(".threshold").first.input_value() == "-1"

    def test_between_two_steps_both_shares_are_given(self, page, values):
        step = 1e-3
        for at in np.quantile(values.y, [0.2, 0.5, 0.8]) + 0.1 * step:
            text = _type(page, 0, f"{at:.6f}")
            shares = re.match(r"P\(at most [\d.]+ m\) = ([\d.]+)(?: to ([\d.]+))? %", text)
            assert shares, text
            exact = 100 * np.mean(values.y <= round(at, 6))
            half = 10.0 ** -len(shares[1].partition(".")[2]) / 2 + 1e-9
            assert float(shares[1]) - half <= exact <= float(shares[2] or shares[1]) + half

    def test_what_is_no_number_is_reported(self, page):
        assert _type(page, 0, "deep") == "“deep” is not understood; type a number in m."
        box = page.locator(".threshold").first
        assert box.get_attribute("aria-invalid") == "true"
        assert page.locator(".parallel line.threshold[visibility=visible]").count() > 0
        _type(page, 0, "0.5")
        assert box.get_attribute("aria-invalid") is None


# How many points of a chart have each colour.
COLOURS = """(plot) => {
  const counts = {};
  for (const point of plot.querySelector(".trace").querySelectorAll("path.point")) {
    const { fill } = getComputedStyle(point);
    counts[fill] = (counts[fill] ?? 0) + 1;
  }
  return counts;
}"""

# How many points of a chart stand in front.
IN_FRONT = """(plot) => [...plot.querySelector(".trace").querySelectorAll("path.point")]
  .filter((point) => Number(point.style.opacity) > 0.5).length"""


class TestSelection:
    def test_the_handles_of_an_axis_are_moved_by_keys(self, page, values):
        handle = page.locator(".handle[aria-label='y [m], from']")
        handle.focus()
        page.keyboard.press("ArrowDown")
        page.keyboard.press("ArrowDown")
        focused = "document.activeElement.getAttribute('aria-label')"
        assert page.evaluate(focused).endswith(", from")
        name = page.evaluate(focused)[0]
        for _ in range(5):
            page.keyboard.press("PageDown" if name == "z" else "PageUp")
        settle(page)
        lower = float(page.evaluate("document.activeElement.getAttribute('aria-valuenow')"))
        column = {"a": values.a, "=": values.b}[name]
        count = int((column >= lower).sum())
        assert 0 < count < column.size
        page.wait_for_function("() => document.querySelectorAll('.parallel .chosen').length === 1")
        reported = page.locator(".told").inner_text()
        assert reported.startswith(f"{count} of the {column.size} completed runs shown have")
        assert page.locator(".parallel .in:not(.failed)").count() == count
        chart = page.locator("#scatter .charts .plot").first
        chart.scroll_into_view_if_needed()
        settle(page)
        assert chart.evaluate(IN_FRONT) == count
        handle = page.locator(".handle:focus")
        page.keyboard.press("Escape")
        page.wait_for_function("() => document.querySelectorAll('.parallel .chosen').length === 0")

    def test_a_rectangle_over_runs_selects_them_everywhere(self, page, values):
        chart = page.locator("#scatter .charts .plot").first
        chart.scroll_into_view_if_needed()
        box = chart.locator(".nsewdrag").first.bounding_box()
        page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 2)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + box["height"] - 2, steps=4)
        page.mouse.up()
        page.wait_for_function("() => document.querySelectorAll('.parallel .chosen').length === 1")
        settle(page)
        count = int(page.locator(".told").inner_text().split(" ")[0])
        assert 0 < count < values.y.size
        assert page.locator(".parallel .in:not(.failed)").count() == count
        for other in page.locator("#scatter .charts .plot").all()[:2]:
            other.scroll_into_view_if_needed()
            settle(page)
            assert other.evaluate(IN_FRONT) == count
        page.get_by_role("button", name="Select all runs").click()
        page.wait_for_function("() => document.querySelectorAll('.parallel .chosen').length === 0")

    def test_how_the_inputs_of_these_runs_differ(self, page, values):
        fold = page.locator("details:has(> summary:text('How their inputs differ'))")
        fold.evaluate("(each) => { each.open = true; }")
        rows = page.locator(".told-runs tbody tr").all_inner_texts()
        cells = {row.split("\t")[0][0]: row.split("\t")[1:] for row in rows}
        is_in = values.y > 0.5
        assert cells["a"][3] == "1.00"
        above, below = values.b[is_in][:, None], values.b[~is_in]
        assert float(cells["="][3]) == pytest.approx(np.mean(above > below), abs=0.0051)
        assert float(cells["="][0]) == pytest.approx(np.median(values.b[is_in]), rel=1e-3)
        assert "larger a (median" in page.locator(".told").inner_text()
        page.locator(".handle[aria-label='y [m], to']").focus()
        for _ in range(5):
            page.keyboard.press("PageDown")
        page.wait_for_function("() => document.querySelectorAll('.parallel .chosen').length === 1")
        settle(page)
        first = page.locator(".told-runs tbody tr").first.inner_text().split("\t")
        assert (first[0], first[-1]) == ("a [m]", "0.00")

    def test_inputs_against_each_other_are_the_dependent_ones(self, page, values):
        drawn = page.locator(".pair .plot").evaluate("(plot) => [plot.data[0].x, plot.data[0].y]")
        found = sorted((sorted(each) for each in drawn), key=sum)
        exact = sorted((sorted(each) for each in (values.a, values.b)), key=sum)
        np.testing.assert_allclose(found, exact, rtol=1e-4)
        lost = page.locator(".pair .plot").evaluate("(plot) => plot.data[1].x.length")
        assert lost == values.lost.size > 0
        upward = page.get_by_label("Upward")
        upward.select_option(label="z [kg m⁻³]")
        title = page.locator(".pair .plot").evaluate("(plot) => plot.layout.yaxis.title.text")
        assert title == "z [kg m⁻³]"


class TestSaving:
    def test_a_table_as_csv(self, page, tmp_path):
        table = page.locator(".table:has(> .tools):visible").first
        with page.expect_download() as saved:
            table.get_by_role("button", name="Save as CSV").click()
        assert saved.value.suggested_filename.endswith(".csv")
        rows = _csv(saved.value, tmp_path)
        shown = table.locator("tbody tr").evaluate_all(
            "(all) => all.map((row) => [...row.cells].map((cell) => cell.textContent.trim()))"
        )
        assert rows[1:] == [[cell.replace("\u202f", " ") for cell in row] for row in shown]
        assert len({len(row) for row in rows}) == 1

    def test_the_runs_as_csv_which_no_spreadsheet_takes_for_formulas(self, page, values, tmp_path):
        with page.expect_download() as saved:
            page.get_by_role("button", name="CSV of these runs").click()
        head, *rows = _csv(saved.value, tmp_path)
        assert head[:3] == ["run", "y [m]", "z [kg m⁻³]"]
        assert '\'=b, "quoted" [m]' in head
        kept = values.y > 0.5
        np.testing.assert_allclose([float(row[1]) for row in rows], values.y[kept], rtol=1e-4)
        np.testing.assert_allclose([float(row[2]) for row in rows], values.z[kept], rtol=1e-4)

    @pytest.mark.parametrize("figure", ["#distributions figure", ".explorer figure"])
    def test_a_chart_as_svg_tells_where_it_comes_from(self, page, figure, tmp_path):
        saved = _save(page, figure, "SVG")
        svg = ElementTree.fromstring(Path(saved.path()).read_text("utf-8"))
        assert svg.tag == "{http://www.w3.org/2000/svg}svg"
        words = " ".join("".join(each.itertext()) for each in svg.iter(f"{svg.tag[:-3]}text"))
        title = page.locator(figure).first.locator("figcaption").inner_text()
        assert title.split(" ")[-1] in words
        assert "archive sha256" in words
        assert len(list(svg.iter(f"{svg.tag[:-3]}path"))) > 3
        for key in page.locator(figure).first.locator(".legend li").all_inner_texts():
            assert key.split(" ")[0] in words

    def test_a_chart_as_png(self, page):
        content = Path(_save(page, "#distributions figure", "PNG").path()).read_bytes()
        assert content[:8] == b"\x89PNG\r\n\x1a\n"
        width, height = (int.from_bytes(content[at : at + 4], "big") for at in (16, 20))
        assert width > 1000
        assert height > 700

    def test_a_sentence_is_copied_with_its_reference(self, page, two):
        page.evaluate(CLIPBOARD)
        button = page.get_by_role("button", name="Copy this sentence with its reference").first
        button.click()
        copied = page.evaluate("window.copied")
        sentence, _, reference = copied.partition(" [")
        assert sentence.endswith(".")
        assert re.fullmatch(
            r"Two outputs; (study \w+; )?archive sha256 [0-9a-f]{16}; uqpen [\w.]+\]", reference
        )
        assert "Copied" in page.locator("main").text_content()

    def test_the_link_to_a_chart_has_the_threshold(self, page):
        page.evaluate(CLIPBOARD)
        _type(page, 0, "0.6")
        figure = page.locator("#scatter .charts figure").first
        figure.get_by_text("Save or link").click()
        figure.get_by_role("button", name="Copy the link").click()
        place, _, reading = page.evaluate("window.copied").partition("#")[2].partition("&")
        assert place == figure.get_attribute("id") == "scatter-y-y-against-a"
        assert "y>0.6_m" in reading


CLIPBOARD = """Object.defineProperty(navigator, "clipboard", {
  configurable: true, value: { writeText: async (text) => { window.copied = text; } },
})"""


def _save(page, figure, label):
    """The file that a button of a figure saves."""
    tools = page.locator(figure).first.locator("details.tools").last
    if not tools.evaluate("(each) => each.open"):
        tools.locator("summary").click()
    with page.expect_download() as saved:
        tools.get_by_role("button", name=f"{label} of this chart").click()
    return saved.value


def _csv(saved, folder):
    path = folder / "saved.csv"
    saved.save_as(path)
    return list(csv.reader(io.StringIO(path.read_text("utf-8-sig"), newline="")))


def test_a_table_is_sorted_by_its_numbers(page):
    table = page.locator("#distributions .table:visible table").first
    column = (
        "(table) => [...table.tBodies[0].rows].map((row) => parseFloat(row.cells[2].textContent))"
    )
    before = table.evaluate(column)
    button = table.locator("button.sort").nth(1)
    button.focus()
    page.keyboard.press("Enter")
    head = table.locator("th:has(button.sort)").nth(1)
    assert head.get_attribute("aria-sort") == "ascending"
    assert table.evaluate(column) == sorted(before)
    page.keyboard.press("Space")
    assert head.get_attribute("aria-sort") == "descending"
    assert table.evaluate(column) == sorted(before, reverse=True)
    page.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") is None
    assert table.evaluate(column) == before


def test_the_contents_stay_in_view_and_lead_back_up(page):
    page.evaluate("document.getElementById('scatter').scrollIntoView()")
    page.wait_for_selector("nav a[href='#scatter'][aria-current=true]")
    assert page.evaluate("document.querySelector('nav').getBoundingClientRect().top") == 0
    page.get_by_role("link", name="Top").click()
    page.wait_for_function("() => scrollY === 0")


@pytest.mark.parametrize("width", [1280, 390])
def test_the_contents_are_whole_and_stay_under_the_pointer(show, width):
    page = show("two")
    page.set_viewport_size({"width": width, "height": 900})
    page.evaluate("scrollTo(0, 0)")
    clipped = """() => [...document.querySelectorAll('nav a')].filter((link) => {
      const { left, right } = link.getBoundingClientRect();
      return left < 0 || right > innerWidth;
    }).length"""
    assert page.evaluate(clipped) == 0
    first = page.locator("nav li a").first
    before = first.bounding_box()
    page.mouse.move(before["x"] + 5, before["y"] + 5)
    page.mouse.down()
    if width == 1280:  # where the contents stay in view, another section becomes the current one
        page.evaluate("document.getElementById('scatter').scrollIntoView()")
        page.wait_for_selector("nav a[href='#scatter'][aria-current=true]")
        at = first.bounding_box()
        assert at["x"] == before["x"]
        page.mouse.move(at["x"] + 5, at["y"] + 5)
    page.mouse.up()
    page.wait_for_function("() => location.hash.startsWith('#answer')")
    page.set_viewport_size({"width": 1200, "height": 900})


def test_it_has_no_faults_with_a_selection(page):
    page.locator(".handle").first.focus()
    page.keyboard.press("PageUp")
    page.wait_for_function("() => document.querySelectorAll('.parallel .chosen').length === 1")
    found = Axe().run(page, context=".explorer").response["violations"]
    assert [each["id"] for each in found] == []
