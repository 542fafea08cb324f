"""Reports as a browser shows them: read, moved, printed, without a script, and meant to harm."""

import json
import re

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from browsers import wait_for_charts

pytestmark = pytest.mark.slow

WIDE, MIDDLE, PHONE, NARROW = 1200, 700, 400, 320


class Runs:
    """What the runs of the concrete study's first design say of an output, in SI units."""

    def __init__(self, tree):
        self.values = tree["runs/monte_carlo/penetration_depth"].values
        self.sources = [
            name
            for name, source in tree["statistics"].children.items()
            if "cdf" in source["penetration_depth"]
        ]
        self.half = float(np.sqrt(np.log(2 / 0.05) / (2 * self.values.size)))

    def at_most(self, x):
        """The share of the runs, and the ends of the band by Dvoretzky, Kiefer, Wolfowitz."""
        share = float(np.mean(self.values <= x))
        return share, max(0.0, share - self.half), min(1.0, share + self.half)


NUMBER = r"(-?\d+(?:\.\d+)?)"
READ_OUT = re.compile(
    rf"P\(at most {NUMBER} (c?m)\) = {NUMBER} % \({NUMBER} … {NUMBER} %\); "
    rf"P\(more\) = {NUMBER} % \({NUMBER} … {NUMBER} %\)"
)


def _read(page):
    """The threshold of the first read-out in metres, and the figures in it."""
    text = page.locator(".readout").first.inner_text()
    found = READ_OUT.fullmatch(text)
    assert found, text
    # A limit of the study is said as the study writes it.
    threshold = float(found[1]) / 100 if found[2] == "cm" else float(found[1])
    assert float(page.locator(".reading input.threshold").first.input_value()) == threshold
    return threshold, list(found.groups()[2:])


def _holds(page, runs):
    """The threshold that is read off, once all that is said of it is what the runs say."""
    threshold, figures = _read(page)
    share, lower, upper = runs.at_most(threshold)
    exact = [share, lower, upper, 1 - share, 1 - upper, 1 - lower]
    for figure, each in zip(figures, exact, strict=True):
        last = 10.0 ** -len(figure.partition(".")[2])
        assert abs(float(figure) - 100 * each) <= last / 2 + 1e-7, (figures, exact)
    return threshold


class TestReadingOff:
    """The concrete study's page under pointer and keys."""

    @pytest.fixture
    def page(self, show):
        return show("concrete")

    @pytest.fixture
    def runs(self, concrete):
        return Runs(concrete)

    def test_it_begins_where_the_study_asks_and_follows_keys_and_pointer(self, page, runs):
        slider = page.locator(".reading input[type=range]").first
        slider.focus()
        before = _holds(page, runs)
        assert before == 0.6
        # So does the line that follows the threshold.
        line = "(plot) => plot.layout.shapes.filter((s) => s.line?.width === 2).map((s) => s.x0)"
        assert page.locator(LEADING_CURVE).first.evaluate(line) == [0.6]
        page.keyboard.press("ArrowRight")
        step = _holds(page, runs) - before
        assert step == pytest.approx(0.005)
        page.keyboard.press("End")
        assert _holds(page, runs) > before
        box = slider.bounding_box()
        page.mouse.click(box["x"] + box["width"] / 4, box["y"] + box["height"] / 2)
        assert _holds(page, runs) < before
        number = page.locator(".reading input.threshold").first.input_value()
        assert slider.get_attribute("aria-valuetext") == f"{number} m"

    def test_a_threshold_is_typed(self, page, runs):
        number = page.locator(".reading input.threshold").first
        for typed, read in {"0.45": 0.45, "": 0.45, "0,5": 0.5, "600e-3 m": 0.6}.items():
            number.fill(typed)
            number.press("Enter")
            assert _holds(page, runs) == read

    def test_a_click_on_the_curve_moves_it_there(self, page, runs):
        x = float(np.quantile(runs.values, 0.3))
        page.mouse.click(*_on_curve(page, x, 0.3))
        assert _holds(page, runs) == pytest.approx(x, abs=0.01)

    def test_all_curves_say_their_numbers_under_the_pointer(self, page, runs):
        page.get_by_text("Distribution functions by all methods").first.click()
        wait_for_charts(page)
        for p in (0.1, 0.5, 0.9):
            x = float(np.quantile(runs.values, p))
            page.mouse.move(*_on_curve(page, x, p, ALL_CURVES))
            at, lines = _hovered(page, x)
            reported = {line.rpartition(" ")[2]: line.rpartition(" ")[0] for line in lines}
            assert list(reported)[::-1] == list(runs.sources)
            figures = re.fullmatch(rf"{NUMBER} \({NUMBER} … {NUMBER}\)", reported["monte_carlo"])
            np.testing.assert_allclose(
                [float(figure) for figure in figures.groups()], runs.at_most(at), atol=5.1e-5
            )


# Whether the pointer reads off near a value.
IS_READ_OFF = """(x) => {
  const title = document.querySelector(".hoverlayer .legendtitletext");
  return title && Math.abs(title.textContent.split(": ").at(-1) - x) < 0.02 * Math.abs(x);
}"""


def _hovered(page, x):
    """Where the pointer reads off, and what it says of each curve there."""
    page.wait_for_function(IS_READ_OFF, arg=x)
    title = page.locator(".hoverlayer .legendtitletext").first.text_content()
    lines = page.locator(".hoverlayer .legendtext").all_text_contents()
    return float(title.rpartition(": ")[2]), lines


LEADING_CURVE = ".plot:has(~ .reading)"
ALL_CURVES = "details:has(> summary:text('Distribution functions by all methods')) .plot"


def _on_curve(page, x, p, which=LEADING_CURVE):
    """Where a point of a distribution function lies on the screen."""
    plot = page.locator(which).first
    plot.scroll_into_view_if_needed()
    charts = json.loads(page.locator("#data").text_content())["charts"]
    lower, upper = charts[int(plot.get_attribute("data-chart"))]["x"]["range"]
    box = plot.locator(".nsewdrag").first.bounding_box()
    return (
        box["x"] + box["width"] * (x - lower) / (upper - lower),
        box["y"] + box["height"] * (1 - p),
    )


@pytest.mark.parametrize("name", ["concrete", "beam", "lost", "wide", "schema_1_several"])
def test_it_fits_and_is_accessible_in_both_themes(show, name):
    # Charts are images to the guidelines, and have the width of what is around them.
    page = show(name, charts=False)
    faults = []
    # Colours do not depend on the width, and pages with charts have nearly all parts there are.
    for width, theme in [(PHONE, "dark"), (WIDE, "light")][: 1 + (name in ("concrete", "beam"))]:
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(color_scheme=theme)
        faults += [f"{width} {theme}: {fault}" for fault in _inaccessible(page)]
    page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    for width in (WIDE, MIDDLE, PHONE, NARROW):
        page.set_viewport_size({"width": width, "height": 900})
        faults += _overflowing(page)
    assert faults == []


def _inaccessible(page):
    """What axe finds against the guidelines."""
    for violation in Axe().run(page).response["violations"]:
        for node in violation["nodes"]:
            yield f"{violation['id']}: {node['html'][:120]} {node['failureSummary']}"


# What reaches beyond the page's right edge, other than in what scrolls by itself.
WIDER = """() => [...document.querySelectorAll("body *")]
  .filter((each) => each.getBoundingClientRect().right > innerWidth + 1)
  .filter((each) => !each.closest(".scroll, pre, .plot svg, .skip"))
  .map((each) => `${each.tagName}.${each.getAttribute("class")} ${each.textContent.slice(0, 9)}`)"""


def _overflowing(page):
    room, taken = page.evaluate(
        "[document.documentElement.clientWidth, document.documentElement.scrollWidth]"
    )
    if taken > room:
        yield f"{taken} px in {room} px: {page.evaluate(WIDER)[:3]}"


# The colours of lines that are seen, and of texts, and how these stand out from the paper.
COLOURS = """() => {
  const all = (selector) =>
    [...document.querySelectorAll(`.plot svg ${selector}`)].map((each) => getComputedStyle(each));
  const each = (colours) => [...new Set(colours)].sort();
  return {
    paper: [getComputedStyle(document.body).backgroundColor],
    lines: each(all(".js-line").filter((a) => a.strokeWidth !== "0px").map((a) => a.stroke)),
    texts: each(all("text").map((a) => a.fill)),
  };
}"""


def test_charts_follow_the_theme(show):
    page = show("beam")
    light = page.evaluate(COLOURS)
    page.emulate_media(color_scheme="dark")
    wait_for_charts(page, "dark")
    dark = page.evaluate(COLOURS)
    for part, colours in light.items():
        assert colours
        assert not {*colours} & {*dark[part]}
    for colours in (light, dark):
        (paper,) = colours["paper"]
        assert all(_contrast(text, paper) >= 4.5 for text in colours["texts"])
        assert all(_contrast(line, paper) >= 3 for line in colours["lines"])
    for theme, colours in (("light", light), ("dark", dark), ("light", light)):
        page.get_by_role("button", name=theme.capitalize()).click()
        wait_for_charts(page, theme)
        assert page.evaluate(COLOURS) == colours


def _contrast(one, other):
    """Of two colours, as the guidelines have it."""
    low, high = sorted(map(_luminance, (one, other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour):
    parts = np.array([int(part) for part in re.findall(r"\d+", colour)[:3]]) / 255
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


FOCUSED = """() => {
  const at = document.activeElement;
  const { outlineStyle, outlineWidth } = getComputedStyle(at);
  const box = at.getBoundingClientRect();
  return {
    what: at.className || at.getAttribute("href") || at.type || at.localName,
    isSeen: outlineStyle !== "none" && parseFloat(outlineWidth) >= 2 && box.right > 0,
  };
}"""


def test_keys_reach_everything_in_the_order_of_the_page(show):
    page = show("beam")
    page.reload()
    wait_for_charts(page)
    links = page.locator("nav a").evaluate_all("(all) => all.map((a) => a.getAttribute('href'))")
    reached = []
    for _ in range(100):
        page.keyboard.press("Tab")
        at = page.evaluate(FOCUSED)
        if at["what"] == "body":
            break
        assert at["isSeen"], at
        reached.append(at["what"])
    assert reached[: 2 + len(links)] == ["skip", "button", *links]
    rest = reached[2 + len(links) :]
    assert rest.index("copy") < rest.index("threshold") < rest.index("range")
    assert "scroll" not in rest, "no table is wider than the screen"
    page.locator(".skip").press("Enter")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.closest('main') !== null")


def test_what_scrolls_is_reached_by_keys(show):
    page = show("wide", charts=False)
    page.set_viewport_size({"width": 320, "height": 900})
    # Most tables are folded.
    page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    page.wait_for_selector(".scroll[tabindex]", state="attached")
    wider = ".scroll:not(details:not([open]) *)"
    stops = page.locator(wider).evaluate_all(
        "(all) => all.map((each) => [each.scrollWidth > each.clientWidth, each.tabIndex === 0])"
    )
    assert stops
    assert all(scrolls == is_stop for scrolls, is_stop in stops)
    assert any(scrolls for scrolls, _ in stops)


def test_charts_have_the_width_that_there_is(show):
    page = show("beam")
    page.set_viewport_size({"width": NARROW, "height": 900})
    page.wait_for_function(FITTING)


# Charts that are as wide as their room, to a pixel.
FITTING = """() => [...document.querySelectorAll(".plot[data-drawn]")].every(
  (plot) => Math.abs(plot.querySelector(".main-svg").clientWidth - plot.clientWidth) <= 1)"""


def test_on_paper_it_is_light_and_fits(show):
    page = show("beam")
    light = page.evaluate(COLOURS)
    page.emulate_media(color_scheme="dark")
    wait_for_charts(page, "dark")
    dark = page.evaluate(COLOURS)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.evaluate(COLOURS) == light
    for kind in ("nav", "button:not(.sort)", "input[type=range]", "details:not([open])", ".screen"):
        assert page.locator(f"{kind}:visible").count() == 0, kind
    assert page.locator(".paper").is_visible()
    # 18 cm, of the 21 cm of a page.
    assert page.evaluate("document.body.clientWidth") <= 681
    assert page.evaluate(FITTING)
    page.emulate_media(media="screen")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(COLOURS) == dark
    page.wait_for_function(FITTING)


# The words that are seen, without those in charts. A number with groups of digits is one.
WORDS = """() => {
  const plots = [...document.querySelectorAll(".plot")];
  plots.forEach((plot) => { plot.style.visibility = "hidden"; });
  const words = document.body.innerText.split(/[^\\S\\u2009\\u202f]+/).filter(Boolean).length;
  plots.forEach((plot) => { plot.style.visibility = ""; });
  return words;
}"""


def test_a_decision_maker_reads_it_to_its_end(show):
    page = show("concrete", charts=False)
    page.set_viewport_size({"width": 1280, "height": 900})
    page.reload()
    assert page.evaluate(WORDS) <= 1_500
    assert page.evaluate("document.documentElement.scrollHeight") <= 8 * 900
    # The verdict, what drives it and the failed runs are on the first screen.
    for text in ("Depth of penetration above", "What drives it?", "Did all runs succeed?"):
        assert page.get_by_text(text).first.bounding_box()["y"] < 900, text
    page.emulate_media(media="print")
    side = "15mm"
    margin = {"top": side, "bottom": side, "left": side, "right": side}
    pages = re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4", margin=margin))
    assert 1 < len(pages) <= 4
    page.emulate_media(media="screen")


def test_a_link_opens_a_folded_part(show):
    page = show("concrete")
    part = page.locator("#surrogates details.part")
    assert part.get_attribute("open") is None
    page.get_by_role("link", name="Surrogates", exact=True).click()
    assert part.get_attribute("open") is not None
    wait_for_charts(page)
    drawn = page.locator("#surrogates .plot")
    assert drawn.count() > 0
    assert drawn.first.locator(".main-svg").first.bounding_box()["width"] > 200
    part.evaluate("(each) => { each.open = false; }")
    page.evaluate("history.replaceState(null, '', location.pathname)")
    opened = show("concrete", charts=False)
    opened.evaluate("location.hash = '#surrogates'")
    opened.reload()
    opened.wait_for_selector("#surrogates details.part[open]", state="attached")


def test_without_a_script_texts_and_tables_are_there(browser, reports):
    page = browser.new_page(java_script_enabled=False)
    page.goto(reports.path("beam").as_uri())
    assert page.locator("noscript p").is_visible()
    for kind in (".plot", ".legend", ".reading", "button"):
        assert page.locator(f"{kind}:visible").count() == 0, kind
    assert page.locator("section h2:visible").count() == page.locator("nav a").count() > 1
    assert page.locator("table:visible").count() > 0
    summary = page.get_by_text("The numbers behind it").first
    before = page.locator("table:visible").count()
    summary.click()
    assert page.locator("table:visible").count() > before
    page.close()


class TestHarm:
    """A page of an archive every text of which means harm."""

    @pytest.fixture
    def page(self, show):
        return show("hostile")

    def test_nothing_of_it_is_run_or_loaded(self, page):
        assert page.evaluate("typeof hacked") == "undefined"
        assert (
            page.locator("main :is(img, script, b, i, [onerror], [href^=javascript])").count() == 0
        )

    def test_texts_are_seen_as_they_stand(self, page):
        harm = (
            "</script><script>hacked=1</script><img src=x onerror=hacked=1>"
            '<a href="javascript:hacked=1">a</a> %{y} &lt; $\\frac{1}{0}$ \\x00\\x1b\\u202e'
        )
        assert page.title().endswith(harm)
        assert page.locator("h1").inner_text().endswith(harm)

    def test_charts_show_them_as_they_stand(self, page):
        seen = page.locator(".plot svg text").evaluate_all("(all) => all.map((a) => a.textContent)")
        assert "<b>%{x}&amp;<i></script><script>hacked=1</script>… [mm]" in seen
        assert any(text.startswith("<img src=x") for text in seen)
        page.mouse.move(*_on_curve(page, 3.75, 0.5))
        assert _hovered(page, 3.75)[1][0].endswith(" <u onclick=hacked=1>%{z}")

    def test_policy(self, page):
        policy = page.locator("meta[http-equiv=Content-Security-Policy]").get_attribute("content")
        rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
        assert rules["default-src"] == "'none'"
        assert re.fullmatch(r"('sha256-[\w+/=]+' ?)+", rules["script-src"])
