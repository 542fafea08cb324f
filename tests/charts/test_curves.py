"""Charts of curves: what a page and a figure have of them."""

import numpy as np
import pytest

import uqpen
from uqpen.charts.curves import driver_charts, fan_charts, median_charts, ordered_curves
from uqpen.charts.marks import Band, Line
from uqpen.results.archive_view import ArchiveView

TIMES = np.linspace(0.0, 1.0, 201)


@pytest.fixture(scope="module")
def tree():
    along = {"time": {"unit": "s", "from": 0, "to": 1, "size": TIMES.size}}
    return uqpen.run(
        uqpen.Study(
            model=lambda a, b: {"y": a + b * TIMES},
            inputs={"a": uqpen.Uniform(0.0, 1.0), "b": uqpen.Uniform(0.0, 3.0)},
            outputs={
                "y": uqpen.OutputSpec("1", along=along, quantiles=[0.05, 0.25, 0.5, 0.75, 0.99])
            },
            designs={"mc": uqpen.MonteCarlo(runs=60)},
            seed=2,
        )
    )


def line(chart, name):
    (found,) = [each for each in chart.marks if isinstance(each, Line) and each.name == name]
    return found


def test_a_figure_has_each_place_with_all_digits(tree):
    fan = next(fan_charts(ArchiveView(tree, ""))).charts[0]
    mean = tree["statistics/mc/y"]["mean"].values[:, 0]
    np.testing.assert_array_equal(line(fan, "mean").y, mean)
    assert (fan.of, fan.source) == ("y", "mc")


def test_a_page_has_some_places_with_the_digits_that_are_seen(tree):
    view = ArchiveView(tree, "")
    (chart,) = median_charts(view, ordered_curves(view, 51)).charts
    drawn = np.asarray(line(chart, "median").y)
    assert drawn.size == 51
    np.testing.assert_array_equal(drawn, drawn.round(3))


def test_a_shade_lies_between_quantiles_on_both_sides_of_the_median(tree):
    view = ArchiveView(tree, "")
    found = median_charts(view, ordered_curves(view))
    known = tree["statistics/mc/y"]["quantile"]
    shades = [each for each in found.charts[0].marks if isinstance(each, Band)]
    for shade, (low, high) in zip(shades, ((0.05, 0.99), (0.05, 0.95), (0.25, 0.75)), strict=True):
        for bound, p in ((shade.lower, low), (shade.upper, high)):
            np.testing.assert_array_equal(bound, known.sel(probability=p).values[:, 0])
    assert found.notes == (
        "Shades: between the 5 % and the 99 % quantile, the 5 % and the 95 % quantile and the 25 % "
        "and the 75 % quantile at each place.",
    )


def test_a_selected_source_is_the_only_one(tree):
    assert not list(fan_charts(ArchiveView(tree, "", source="other")))
    assert not list(driver_charts(ArchiveView(tree, "", source="other")))
