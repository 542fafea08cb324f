"""The section on outputs along a dimension, as blocks and in a browser."""

import base64
import io
import json

import numpy as np
import pytest
import xarray as xr
from axe_playwright_python.sync_playwright import Axe
from browsers import settle
from hashed_trees import with_hashes
from matplotlib.image import imread
from study_text import study_text

import uqpen
from uqpen.archive.estimates import UnpackedStatistics, estimate_array, pack
from uqpen.report.blocks import Fold, Heading, find_charts
from uqpen.report.page import report_page
from uqpen.report.plotly import charts_json, traces
from uqpen.report.sections.fields import curves, field_sentences
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text, number_text

# Every figure at a place is that of x times the number of days.
MODEL = """\
import numpy as np
def simulate(x, z):
    days = np.arange(41.0)
    curve = x * days
    ending = np.where(days < 20 + 12 * x, curve, np.nan)
    return {"curve": curve, "ending": ending, "third": curve, "x_again": x}
"""
DAYS = {"time": {"unit": "day", "from": 0, "to": 40, "size": 41}}
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "inputs": {"x": "m", "z": "m"},
        "outputs": {
            "curve": {"unit": "cm", "along": DAYS},
            "third": {"unit": "cm", "along": DAYS},
            "x_again": "cm",
            "ending": {"unit": "cm", "along": DAYS, "may_end": True},
        },
    },
    title="Curves",
    seed=11,
    inputs={"x": ("0 m", "1 m"), "z": ("0 m", "1 m")},
    outputs={"curve": {"exceeds": ["9 m"]}},
    designs={"mc": {"kind": "monte-carlo", "runs": 90}},
)


@pytest.fixture(scope="module")
def moving(tmp_path_factory, made_once):
    def make():
        folder = tmp_path_factory.mktemp("moving")
        (folder / "model.py").write_text(MODEL)
        return uqpen.run(uqpen.parse_study(STUDY, folder=folder))

    return made_once("moving", make)


@pytest.fixture(scope="module")
def driven(moving):
    """The same with indices along the curve: 0.6 falling to 0.2, and 0.3."""
    group = moving["statistics/mc/curve"].to_dataset()
    arrays = dict(UnpackedStatistics(group))
    shares = np.stack([np.linspace(0.6, 0.2, 41), np.full(41, 0.3)], axis=-1)
    arrays["first_order"] = estimate_array(
        np.stack([shares, shares - 0.1, shares + 0.1], axis=-1),
        {"time": 41, "input": 2},
        {"interval": "known", "interval_label": "nominal", "note": ""},
        units="1",
        long_name="first-order Sobol' index",
        attributes={"interval_level": 0.95, "runs": 90, "estimator": "known"},
        coordinates={"time": group["time"].variable, "input": ["x", "z"]},
    )
    tree = moving.copy()
    tree["statistics/mc/curve"] = xr.DataTree(pack(arrays))
    return with_hashes(tree)


def blocks(tree):
    return list(curves(ArchiveView(tree, "")))


def chart(tree, title, number=0):
    return [each for each in find_charts(blocks(tree)) if each.title.startswith(title)][number]


def test_the_first_fields_are_open_and_the_others_folded(moving):
    found = blocks(moving)
    assert [each.text for each in found if isinstance(each, Heading)] == ["curve", "third"]
    assert isinstance(found[-1], Fold)
    assert found[-1].title == "Other curves: ending"


def test_the_readout_has_the_estimates_of_the_archive(moving):
    fan = chart(moving, "Curve along time [day]")
    read = fan.place
    assert read is not None
    assert list(read.values) == list(range(41))
    assert read.start == 40
    at = list(read.values).index(30.0)
    estimates = moving["statistics/mc/curve"].to_dataset().isel(time=30)
    mean = estimate_text(*(100 * estimates["mean"].values).tolist())
    chance = estimate_text(*estimates["exceedance"].values[0].tolist())
    assert read.text(at).startswith(f"At 30 day: mean {mean} cm; sd ")
    assert read.text(at).endswith(f"; P(> 9 m) = {chance}.")
    # An estimate without an interval says why.
    assert "sd " in read.text(at)
    assert "(no interval: " in read.text(at)


def test_the_chart_says_which_places_have_no_band_and_why(moving):
    left_out = "1 of 41 places: the output does not vary, time 0 day"
    fan, quantiles, tolerance = (
        chart(moving, title) for title in ("Curve along", "Quantiles with", "Tolerance band")
    )
    assert f"Without bounds (mean, simultaneous bounds): {left_out}." in fan.notes
    assert quantiles.notes == (
        "Darker: pointwise 95 % intervals.",
        f"Without bounds (quantile, simultaneous bounds): {left_out}.",
    )
    assert tolerance.notes == (f"Without bounds (tolerance band): {left_out}.",)


def test_where_all_curves_have_ended_only_their_share_is_reported(moving):
    read = chart(moving, "Ending along time").place
    assert read is not None
    assert read.text(40).startswith("At 40 day: share of runs that get this far 0")


def test_the_lines_behind_are_runs(moving):
    drawn = traces(chart(moving, "Curve along time").marks)
    (thin,) = [each["y"] for each in drawn if each["line"]["width"] == 0.6]
    lines = np.array(thin, dtype=np.float64).reshape(20, 42)
    ends = 100 * moving["runs/mc/curve"].values[:, -1]
    assert np.isnan(lines[:, -1]).all()  # a gap before the next run
    assert all(np.isclose(ends, run[-2], atol=ends.max() / 1_000).any() for run in lines)
    assert len({run[-2] for run in lines}) == 20


def test_each_place_has_its_runs_in_bins(moving):
    drawn = chart(moving, "Runs at the chosen place", 2)
    assert drawn.slices is not None
    known = np.isfinite(moving["runs/mc/ending"].values).sum(axis=0)
    counts = [sum(traces(bars)[0]["y"]) for bars in drawn.slices.marks]
    assert counts == [known[int(place)] for place in drawn.slices.values]


def test_shares_of_the_variance_are_stacked(driven):
    areas = chart(driven, "Shares of the variance, first order by mc")
    tops = [trace["y"][0] for trace in traces(areas.marks) if "fill" in trace]
    assert tops == pytest.approx([0.6, 0.9, 1.0])
    assert [key.text for key in areas.keys] == ["x", "z", "interactions"]
    (drawn,) = json.loads(
        charts_json([chart(driven, "Shares of the variance at the chosen place")])
    )["charts"]
    first, last = (drawn["slices"]["traces"][place][0] for place in (0, -1))
    assert first["x"] == pytest.approx([0.6, 0.3])
    assert set(first) == {"x", "text"}  # what differs from the place that is shown first
    assert last == {}


def test_the_main_results_say_where_the_mean_is_largest(moving):
    first, *_ = field_sentences(ArchiveView(moving, ""), "mc")
    assert first.startswith("The mean of curve is largest at time\u00a0=\u00a040\u00a0day: ")
    assert first.endswith("95\u00a0% band, valid at all places at once).")
    assert first in report_page(moving)


def test_the_main_results_say_why_a_mean_has_no_band_where_it_is_largest():
    study = uqpen.Study(
        model=lambda a: {"y": [0.0, np.exp(30 * a), 0.0]},
        inputs={"a": uqpen.Uniform(0.0, 1.0)},
        outputs={"y": uqpen.OutputSpec("1", along={"time": {"unit": "s", "values": [1, 2, 3]}})},
        designs={"d": uqpen.MonteCarlo(runs=50)},
        seed=1,
    )
    (sentence,) = field_sentences(ArchiveView(uqpen.run(study), ""), "d")
    assert sentence.endswith(
        "(without a band: fewer than 10 effective runs decide the mean at this place)."
    )


def finer(tree, size):
    """Return the same with more places, each of which is repeated."""
    nodes = {}
    for node in tree.subtree:
        group = node.to_dataset(inherit=False)
        if "time" in group.dims:
            attributes = group["time"].attrs
            group = group.isel(time=np.arange(size) * 41 // size)
            group = group.assign_coords(time=np.linspace(0.0, 40 * 86_400.0, size))
            group["time"].attrs = attributes
        nodes[node.path] = group
    return with_hashes(xr.DataTree.from_dict(nodes))


def test_of_many_places_some_are_shown(moving):
    tree = finer(moving, 321)
    fan = chart(tree, "Curve along time")
    assert fan.notes[0] == "161 of 321 places are shown."
    assert all(len(set(trace["x"])) == 161 for trace in traces(fan.marks))
    assert chart(tree, "Runs at").notes == ("At the nearest of 21 of 321 places.",)
    assert len(report_page(tree).encode()) < 2_000_000


SHEET = study_text(
    {
        "python": "sheet.py:simulate",
        "inputs": {"x": "m"},
        "outputs": {
            "sheet": {
                "unit": "cm",
                "along": {
                    "layer": {"values": [1, 2]},
                    "depth": {"unit": "cm", "values": [0, 1]},
                    "time": {"unit": "s", "values": [0, 1, 3]},
                },
            }
        },
    },
    title="Sheet",
    inputs={"x": "(1 ± 0.1) m"},
    designs={"mc": {"kind": "monte-carlo", "runs": 30}},
)


def test_a_field_of_more_dimensions_has_maps(tmp_path):
    (tmp_path / "sheet.py").write_text(
        "def simulate(x):\n    first = [[0, x, 2 * x], [0, 0, 0]]\n"
        "    return {'sheet': [first, [[2 * v for v in row] for row in first]]}\n"
    )
    tree = uqpen.run(uqpen.parse_study(SHEET, folder=tmp_path))
    found = list(find_charts(blocks(tree)))
    assert [each.title for each in found[:2]] == [
        "Sheet: mean [cm]",
        "Sheet: standard deviation [cm]",
    ]
    mean = found[0]
    bounds = 100 * tree["statistics/mc/sheet"]["mean"].values[1]
    widest = number_text(np.nanmax(bounds[..., 2] - bounds[..., 1]) / 2, 3)
    assert mean.notes == (
        "At layer = 2, the place of the largest mean.",
        f"Mean of sheet: half-widths of 95 % intervals up to {widest} cm.",
    )
    assert (mean.x.ends, mean.y.ends) == ((0.0, 3.0), (0.0, 1.0))
    points = traces(mean.marks)[0]
    middle = float(tree["runs/mc/x"].mean())
    assert points["marker"]["color"] == pytest.approx(
        [0, 2 * middle, 4 * middle, 0, 0, 0], rel=1e-4
    )
    assert (points["x"], points["y"]) == ([0, 1, 3, 0, 1, 3], [0, 0, 0, 1, 1, 1])
    (image,) = json.loads(charts_json([mean]))["charts"][0]["images"]
    pixels = imread(io.BytesIO(base64.b64decode(image["source"].partition(",")[2])))
    # The brightest cell is the last one of the lowest row, from half-way to the one before.
    bright = pixels[..., 0] > 0.9
    assert bright[-1].sum() == pytest.approx(pixels.shape[1] / 3, abs=1)
    assert not bright[0].any()


@pytest.fixture
def page(show):
    return show("driven")


# Whether all charts that are seen have their marker at a place.
ARE_AT = """(place) => {
  const seen = [...document.querySelectorAll("#curves .plot")].filter((plot) => {
    const { top, bottom } = plot.getBoundingClientRect();
    return top < window.innerHeight && bottom > 0 && plot.layout.xaxis.title.text === "time [day]";
  });
  const isAt = ({ layout }) => layout.shapes.some(({ x0, x1 }) => x0 === place && x1 === place);
  return seen.length > 1 && seen.every(isAt);
}"""


def data(page, title, member):
    figure = page.locator("#curves figure", has=page.get_by_text(title, exact=True)).first
    return figure.locator(".plot").evaluate(f"(plot) => [...plot.data[0].{member}]")


@pytest.mark.slow
def test_the_slider_moves_all_charts_by_keys(page):
    page.set_viewport_size({"width": 1200, "height": 1800})
    slider = page.locator("#curves .place input").first
    slider.focus()
    page.keyboard.press("Home")
    settle(page)
    first = data(page, "Shares of the variance at the chosen place", "x")
    page.wait_for_function(ARE_AT, arg=0)
    for _ in range(8):
        page.keyboard.press("ArrowRight")
    settle(page)
    page.wait_for_function(ARE_AT, arg=8)
    assert first == pytest.approx([0.6, 0.3])
    assert data(page, "Shares of the variance at the chosen place", "x")[0] < 0.59
    assert sum(data(page, "Runs at the chosen place", "y")) == 90
    # All fields along the dimension are at the same place.
    texts = page.locator("#curves .place .readout:visible").all_inner_texts()
    assert len(texts) == 2
    assert all(text.startswith("At 8 day: ") for text in texts)
    assert slider.get_attribute("aria-valuetext") == texts[0]


@pytest.mark.slow
def test_the_address_has_the_place(page):
    page.locator("#curves .place input").first.focus()
    page.keyboard.press("End")
    page.wait_for_url("**#time=40_day")
    for address, text in (("9_day", "At 9 day: mean"), ("9_s", "the unit here is day")):
        page.evaluate("(place) => { location.hash = `#time=${place}`; }", address)
        page.locator(".place .readout", has_text=text).first.wait_for()


@pytest.mark.slow
def test_it_fits_and_is_accessible(show):
    # Charts are images to the guidelines, and have the width of what is around them.
    page = show("driven", charts=False)
    page.evaluate("document.querySelectorAll('#curves details').forEach((e) => { e.open = true; })")
    page.emulate_media(color_scheme="dark")
    page.set_viewport_size({"width": 390, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    found = Axe().run(page, context="#curves").response["violations"]
    assert [each["id"] for each in found] == []
