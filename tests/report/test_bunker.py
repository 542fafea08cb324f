"""The study of the wall with few runs: its verdict, its caveat, its tables, and its page."""

import re
from pathlib import Path

import numpy as np
import pytest

import uqpen
from uqpen.charts.distributions import model_chart
from uqpen.report.plotly import shapes
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables

pytestmark = pytest.mark.slow

STUDY = Path(__file__).parents[2] / "studies" / "bunker.toml"
MODELS = [
    "walker_anderson", "smoothed", "alekseevskii_tate", "hydrodynamic", "drucker_prager", "rigid",
]  # fmt: skip
CAVEAT = "These are depths in a target without a rear face: a wall of that thickness fails earlier."


@pytest.fixture(scope="session")
def bunker():
    """The archive of the study, with 400 runs."""
    text = STUDY.read_text(encoding="utf-8").replace("runs = 10_000", "runs = 400")
    return uqpen.run(uqpen.parse_study(f"convergence = false\n{text}", name="bunker"))


def test_all_models_answer_the_same_questions(bunker):
    reported = archive_json(bunker)
    assert list(reported["models"]) == MODELS
    for model in MODELS:
        depth = reported["models"][model]["designs"]["monte_carlo"]["outputs"]["penetration_depth"]
        assert depth["caveat"] == CAVEAT
        thresholds = [54, 60, 80, 100, 150, 200, 300]
        assert list(depth["exceedance"]) == [f"{each} cm" for each in thresholds]
        assert list(depth["hold"]) == ["0.95", "0.99", "0.999", "0.9999", "0.99999"]
        # Too few runs for a bound, and how many it takes.
        assert depth["hold"]["0.9999"]["upper"] is None
        assert depth["hold"]["0.9999"]["runs_needed"] == 29_956
    shares = reported["model_form"]["monte_carlo"]["penetration_depth"]
    parts = [shares[name]["estimate"] for name in ("model_form_share", "parameter_share")]
    # Rods that never erode go twice as deep as all others.
    assert parts[0] > 0.5 > parts[1] > 0


def test_the_caveat_stands_below_each_table_of_depths(bunker):
    tables = [each for each in output_tables(bunker) if ": penetration_depth [cm]" in each.title]
    of_models = [each for each in tables if " minus " not in each.title]
    assert len(of_models) == len(MODELS)
    assert all(each.notes[0] == CAVEAT for each in of_models)


@pytest.fixture
def page(show):
    return show("bunker", charts=False)


def test_the_page_begins_with_the_verdict(page):
    verdict = page.locator(".verdicts").first.inner_text()
    assert verdict.startswith("Depth of penetration above 60\u00a0cm")
    text = " ".join(verdict.split())
    assert "The limit of the study, at most 5 % of cases, is not met by" in text
    assert "met by 1 of 6 models (hydrodynamic at most" in text
    assert page.get_by_text(CAVEAT).first.is_visible()
    assert page.get_by_text("How much is model form?").first.is_visible()
    table = page.locator("table", has_text="Depth of penetration by model").first
    assert table.locator("thead th").all_inner_texts()[0].startswith("walker_anderson")
    assert "an upper bound needs at least 29956 runs" in page.content()


def test_the_limit_of_the_verdict_is_the_first_threshold_and_all_limits_are_drawn(bunker, page):
    view = ArchiveView(bunker, "walker_anderson")
    chart = model_chart(view, "penetration_depth", "monte_carlo")
    assert chart is not None
    places = [shape["x0"] for shape in shapes(chart.marks)]
    np.testing.assert_allclose(places, [60, 54, 80, 100, 150, 200, 300][: len(places)])
    assert len(places) >= 6
    labels = [shape["label"]["text"] for shape in shapes(chart.marks) if "label" in shape]
    assert labels[0] == "60 cm"
    keys = [key.text for key in chart.keys if key.text.startswith("limit")]
    assert keys[0] == "limit 60 cm, at most 5 % of cases"
    assert keys[1].startswith("limits 54 cm, 80 cm, 100 cm")
    readout = page.locator(".readout").first.text_content()
    assert readout.startswith("P(at most 60 cm) = ")


def test_the_thickness_stands_beside_the_verdict(bunker, page):
    found = {
        finding.locator("dt").inner_text(): " ".join(finding.locator("dd").inner_text().split())
        for finding in page.locator("#answer .findings > div").all()
        if finding.is_visible()
    }
    head = "Depth of penetration, limit for 95 % of cases".replace("for ", "for ")
    text = found[head]
    assert all(f" by {model}" in text for model in MODELS)
    depths = (bunker[f"models/{m}/statistics/monte_carlo/penetration_depth"] for m in MODELS)
    bounds = [100 * each["tolerance_limit"].values[0, 2] for each in depths]
    reported = [float(each) for each in re.findall(r"([\d.]+) cm by", text)]
    # Rounded up to the digits that are shown, so that each remains a bound.
    np.testing.assert_allclose(reported, sorted(bounds), rtol=0.02)
    assert (np.array(reported) >= np.sort(bounds) * (1 - 1e-12)).all()


def test_nothing_on_the_page_is_wider_than_it(page):
    for width in (390, 1280):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
