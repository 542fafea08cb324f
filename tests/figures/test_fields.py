"""Figures of curves and fields: what is drawn is what the archive holds."""

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.estimates import UnpackedStatistics, estimate_array, pack
from uqpen.core.errors import FigureError
from uqpen.core.labels import INTERVAL_LEVEL

MODEL = """
import numpy as np
t = np.linspace(0, 10, 11)
def f(a, b):
    ending = np.where(t <= 5 * b, a + b * t, np.nan)
    return {"ending": ending, "whole": np.outer(t, [a, b])}
def steady(a, b):
    return {"ending": np.full(11, a), "whole": np.outer(t, [b, b])}
"""

STUDY = """
title = "Fields"
seed = 1
MODELS
[inputs]
a = "(1 ± 0.2) m"
b = "1.5 ± 0.3"
[outputs.ending]
unit = "cm"
[designs.mc]
kind = "monte-carlo"
runs = 60
"""

OUTPUTS = """
inputs = { a = "m", b = "1" }
[TABLE.outputs.ending]
unit = "m"
may_end = true
along = { t = { unit = "ms", from = 0, to = 10, size = 11 } }
[TABLE.outputs.whole]
unit = "m"
along = { t = { unit = "ms", from = 0, to = 10, size = 11 }, x = { unit = "1", values = [1, 2] } }
"""


def study(folder, models):
    (folder / "model.py").write_text(MODEL, encoding="utf-8")
    return uqpen.run(uqpen.parse_study(STUDY.replace("MODELS", models), folder=folder))


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    return study(folder, '[model]\npython = "model.py:f"' + OUTPUTS.replace("TABLE", "model"))


def drawn(tree, name, **asked):
    return uqpen.figure(tree, name, **asked).axes


def line(axes, name):
    (found,) = [each for each in axes.lines if each.get_label() == f"_{name}"]
    return np.asarray(found.get_ydata())


def panel(tree, name, title, **asked):
    """The panel whose title ends with a text."""
    (found,) = [
        each
        for each in drawn(tree, name, **asked)
        if each.get_title(loc="left").replace("\n", " ").endswith(title)
    ]
    return found


def notes(tree, name, **asked):
    (legend,) = uqpen.figure(tree, name, **asked).legends
    return legend.get_title().get_text().replace("\n", " ")


def labels(axes):
    return axes.get_legend_handles_labels()[1]


def with_statistics(tree, added):
    """The archive with further statistics of the curve."""
    path = "statistics/mc/ending"
    group = tree[path].to_dataset()
    known = UnpackedStatistics(group)
    changed = tree.copy()
    changed[path] = xr.DataTree(pack({**known, **added}).assign_attrs(group.attrs))
    return changed


def along(tree, bounds, **own):
    """An estimate array along the curve and one dimension more."""
    times = tree["statistics/mc/ending"]["t"].variable
    return estimate_array(
        bounds,
        {"t": 11, **{name: len(values) for name, values in own.items()}},
        {"interval": "made", "interval_label": "nominal", "note": ""},
        units="m",
        long_name="made up",
        attributes={INTERVAL_LEVEL: 0.95},
        coordinates={"t": times, **{name: (name, values) for name, values in own.items()}},
    )


def test_a_fan_has_the_median_and_the_mean_in_the_unit_of_the_axis(tree):
    axes = drawn(tree, "fan", output="ending")[0]
    statistics = tree["statistics/mc/ending"]
    median = 100 * statistics["quantile"].sel(probability=0.5).values[:, 0]
    np.testing.assert_allclose(line(axes, "median"), median, rtol=1e-12)
    np.testing.assert_allclose(line(axes, "mean"), 100 * statistics["mean"].values[:, 0])
    assert axes.get_ylabel() == "ending [cm]"
    assert axes.get_xlabel() == "t [ms]"
    assert {"5 % quantile", "95 % quantile", "20 of 60 runs of mc"} <= set(labels(axes))
    assert axes.get_title(loc="left") == "(a) mc: Ending along t [ms]"


def test_a_label_of_two_colours_says_which_panel_it_is_of(tree):
    page = uqpen.figure(tree, "fan", output="ending")
    named = [each.get_text() for each in page.legends[0].get_texts()]
    assert {"median (a)", "median (b)", "mean"} <= set(named)
    titles = [each.get_title(loc="left")[:4] for each in page.axes]
    assert titles == ["(a) ", "endi", "(b) "]


def test_a_curve_of_one_place_has_a_fan():
    made = uqpen.Study(
        model=lambda a: {"y": [a]},
        inputs={"a": uqpen.Uniform(1.0, 2.0)},
        outputs={"y": uqpen.OutputSpec("1", along={"time": {"unit": "s", "values": [3]}})},
        designs={"d": uqpen.MonteCarlo(runs=20)},
        seed=1,
    )
    lower, upper = drawn(uqpen.run(made), "fan")[0].get_xlim()
    assert lower < 3.0 < upper


def test_lines_stand_where_fewer_curves_go_on(tree):
    axes = drawn(tree, "fan", output="ending")[0]
    shares = tree["statistics/mc/ending"]["reached"].values[:, 0]
    marks = {text.get_text(): text.xy[0] for text in axes.texts}
    expected = {
        f"{100 * share:g} %": float(np.argmax(shares < share))
        for share in (0.95, 0.5, 0.05)
        if (shares < share).any()
    }
    assert len(expected) >= 2
    assert marks == pytest.approx(expected)
    reported = notes(tree, "fan", output="ending")
    assert "Where curves end: estimates at a place are of the curves that get there." in reported
    assert "Upright lines: shares of the curves that get there." in reported


def test_the_share_of_the_curves_that_go_on_is_a_panel(tree):
    axes = panel(tree, "fan", "Runs that get this far", output="ending")
    reached = tree["statistics/mc/ending"]["reached"].values[:, 0]
    np.testing.assert_allclose(line(axes, "reached"), reached)
    assert axes.get_ylabel() == "probability"
    assert "Shade: pointwise 95 % intervals." in notes(tree, "fan", output="ending")


def test_models_are_drawn_together(tmp_path):
    models = "".join(
        f'[models.{name}]\npython = "model.py:{function}"'
        + OUTPUTS.replace("TABLE", f"models.{name}")
        for name, function in (("one", "f"), ("other", "steady"))
    )
    several = study(tmp_path, models)
    (axes,) = drawn(several, "model-curves")
    for name in ("one", "other"):
        quantile = several[f"models/{name}/statistics/mc/ending"]["quantile"]
        median = 100 * quantile.sel(probability=0.5).values[:, 0]
        np.testing.assert_allclose(line(axes, name), median, rtol=1e-12)
    assert labels(axes) == ["median by one", "median by other"]
    assert axes.get_title(loc="left") == "mc: Ending [cm]", "of all models, so it names none"
    assert notes(several, "model-curves").startswith(
        "Shades: between the 5 % and the 95 % quantile"
    )


def test_indices_are_stacked_the_largest_first(tree):
    shares = np.tile([0.2, 0.7], (11, 1))
    bounds = np.stack([shares, shares - 0.05, shares + 0.05], axis=-1)
    made = with_statistics(tree, {"first_order": along(tree, bounds, input=["a", "b"])})
    stacked, lines = drawn(made, "sensitivity-along", output="ending")
    assert labels(stacked) == ["b", "a", "interactions"]
    tops = [each.get_paths()[0].vertices[:, 1].max() for each in stacked.collections]
    assert tops == pytest.approx([0.7, 0.9, 1.0])
    np.testing.assert_allclose([line(lines, name)[0] for name in ("b", "a")], [0.7, 0.2])
    title = lines.get_title(loc="left").replace("\n", " ")
    assert title == "ending: First order by mc, pointwise 95 % intervals"


def test_indices_without_intervals_say_why(tree):
    bounds = np.full((11, 2, 3), np.nan)
    bounds[..., 0] = [-0.1, 0.7]
    indices = along(tree, bounds, input=["a", "b"])
    indices["note"] = indices["note"].copy(data=np.full(indices["note"].shape, "too few runs"))
    made = with_statistics(tree, {"first_order": indices})
    lines = drawn(made, "sensitivity-along", output="ending")[1]
    assert lines.get_title(loc="left") == "ending: First order by mc"
    reported = notes(made, "sensitivity-along", output="ending")
    assert "No interval of the first order: too few runs." in reported
    assert "An index below 0, by its error, is stacked as 0." in reported
    assert "What remains (interactions) also has the errors of the indices." in reported


def test_a_map_has_the_values_of_the_field(tree):
    axes = drawn(tree, "map", output="whole")
    mesh = axes[0].collections[0]
    known = tree["statistics/mc/whole"]["mean"].values[..., 0]
    np.testing.assert_allclose(np.asarray(mesh.get_array()).reshape(known.shape), known)
    assert axes[0].get_xlabel() == "x"
    assert axes[0].get_ylabel() == "t [ms]"
    assert axes[0].get_title(loc="left") == "mc: Whole: mean [m]"
    assert "Mean of whole: half-widths of 95 % intervals up to " in notes(tree, "map")


def test_a_study_of_numbers_has_none_of_them(tree):
    with pytest.raises(FigureError, match="has nothing for the figure"):
        uqpen.figure(tree, "map", output="ending")


def test_bands_are_distinguished_from_intervals_at_each_place(tree):
    mean = tree["statistics/mc/ending"]["mean"].values
    wide = mean + np.array([0.0, -0.5, 0.5])
    content = {"band_content": [0.9]}
    made = with_statistics(
        tree,
        {
            "mean_band": along(tree, wide),
            "tolerance_band": along(tree, wide[:, np.newaxis], **content),
        },
    )
    fan, *_ = drawn(made, "fan", output="ending")
    assert "simultaneous 95 % band of the mean" in labels(fan)
    assert "Darker: pointwise 95 % intervals." in notes(made, "fan")
    held = panel(made, "fan", "Tolerance band", output="ending")
    assert "holds a new curve in 90 % of cases, with 95 % confidence" in labels(held)
    shades = [*fan.collections, *held.collections]
    for bounds, shade in zip((wide, mean, mean, wide), shades, strict=True):
        known = 100 * bounds[np.isfinite(bounds).all(axis=1), 1:]
        corners = shade.get_paths()[0].vertices[:, 1]
        assert set(known.ravel().round(9)) <= set(corners.round(9))
