"""Curves at a glance, which a reader sees first: as blocks and in a browser."""

import numpy as np
import pytest

import uqpen
from uqpen.report.blocks import find_charts
from uqpen.report.plotly import traces
from uqpen.report.sections.answer import answer
from uqpen.report.sections.comparisons import model_comparison
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text

MODEL = """\
import numpy as np
t = np.linspace(0, 10, 11)
def first(a):
    ending = np.where(t <= 5 * a, a * t, np.nan)
    return {"once": a + t, "ending": ending, **{f"c{k}": k * t * a for k in range(4)}}
def second(a):
    return {"ending": t * a / 2, **{f"c{k}": k * t for k in range(4)}}
"""
CURVE = """
[models.MODEL.outputs.NAME]
unit = "cm"
may_end = ENDS
along = { t = { unit = "ms", from = 0, to = 10, size = 11 } }
"""
HEAD = '[models.MODEL]\npython = "model.py:MODEL"\ninputs = { a = "1" }\n'
REST = '[inputs]\na = "1 ± 0.2"\n[designs.mc]\nkind = "monte-carlo"\nruns = 60\n'


def model_text(model, *curves):
    made = (
        CURVE.replace("NAME", name).replace("ENDS", str(name == "ending").lower())
        for name in curves
    )
    return (HEAD + "".join(made)).replace("MODEL", model)


@pytest.fixture(scope="module")
def pair(tmp_path_factory, made_once):
    """Five curves by two models, and one more by the first alone."""

    def make():
        folder = tmp_path_factory.mktemp("pair")
        (folder / "model.py").write_text(MODEL)
        shared = ("ending", "c0", "c1", "c2", "c3")
        models = model_text("first", "once", *shared) + model_text("second", *shared)
        return uqpen.run(uqpen.parse_study(f"seed = 3\n{models}{REST}", folder=folder))

    return made_once("curve_pair", make)


def charts(tree, section):
    return list(find_charts(section(ArchiveView(tree, "first"))))


def test_curves_of_several_models_come_first(pair):
    first = charts(pair, answer)[:4]
    further = charts(pair, model_comparison)[:2]
    titles = [each.title for each in (*first, *further)]
    assert titles == [f"{name} [cm]" for name in ("Ending", "c0", "c1", "c2", "c3", "Once")]
    assert [each.notes for each in further] == [(), ("By first alone.",)]


def test_a_line_is_the_median_and_a_shade_ends_at_the_outer_quantiles(pair):
    (drawn,) = [each for each in charts(pair, answer) if each.title == "c2 [cm]"]
    lower, upper = traces(drawn.marks)[:2]
    line = next(each for each in traces(drawn.marks) if each.get("name") == "first")
    found = pair["models/first/statistics/mc/c2"].to_dataset()["quantile"].values[:, :, 0] * 100
    np.testing.assert_allclose(line["y"], found[:, 1], rtol=1e-3, atol=0.02)
    np.testing.assert_allclose(lower["y"], found[:, 0], rtol=1e-3, atol=0.02)
    np.testing.assert_allclose(upper["y"], found[:, 2], rtol=1e-3, atol=0.02)


def test_a_pointer_reads_the_interval_of_a_median(pair):
    (drawn,) = [each for each in charts(pair, answer) if each.title == "c2 [cm]"]
    line = next(each for each in traces(drawn.marks) if each.get("name") == "first")
    bounds = pair["models/first/statistics/mc/c2"].to_dataset()["quantile"].values[-1, 1] * 100
    assert line["text"][-1].startswith(estimate_text(*bounds.tolist()))


def test_a_study_without_curves_has_none(archives):
    found = find_charts(answer(ArchiveView(archives["beam"], "")))
    assert [each.title for each in found if "[" in each.title] == []


@pytest.mark.slow
def test_bands_are_drawn_and_fit(show):
    page = show("pair")
    page.wait_for_selector("html[data-ready=yes]:not(:has(#answer .plot:not([data-drawn])))")
    for width in (1280, 390):
        page.set_viewport_size({"width": width, "height": 900})
        bands = page.locator("#answer > div > .charts .plot .fills path")
        assert bands.count() == 8
        assert page.evaluate("document.documentElement.scrollWidth") == width
