"""Numbers of a run from its field: exact answers, properties, curves that end."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from uqpen.core.lookup import resolve
from uqpen.core.model import Dimension, Output
from uqpen.core.variables import Reduction
from uqpen.reductions import REDUCTIONS
from uqpen.reductions.derived import derived_outputs

DAY = 86_400.0
TIME = tuple(np.linspace(0.0, 4.0, 41))
CURVE = Output("infected", "K", dims=(Dimension("time", "s", values=TIME),), may_end=True)
PLATE = Output(
    "pressure",
    "Pa",
    dims=(Dimension("x", "m", values=(0, 1, 3)), Dimension("y", "m", values=(0, 2))),
)
# Runs of a curve, each up to its own end.
VALUES = arrays(np.float64, (6, 41), elements=st.floats(-1e6, 1e6))
ENDS = arrays(np.int64, 6, elements=st.integers(1, 41))


def reduction(name, **settings):
    made = resolve(REDUCTIONS[name])(**settings)
    assert isinstance(made, Reduction)
    return made


def at(**places):
    return reduction("at", places=tuple(places.items()))


def every_member():
    settings = {
        "at": {"places": (("time", 1.23),)},
        "first_above": {"threshold": 0.0},
        "first_below": {"threshold": 0.0},
    }
    return {name: reduction(name, **settings.get(name, {})) for name in REDUCTIONS}


def ended(values, ends):
    return np.where(np.arange(values.shape[1]) < ends[:, None], values, np.nan)


class TestExactAnswers:
    """Of the parabola t (4 - t) from 0 to 4, whose largest value is 4 at 2."""

    values = (np.array(TIME) * (4 - np.array(TIME)))[None, :]

    @pytest.mark.parametrize(
        ("name", "expected"),
        [
            ("max", 4.0),
            ("min", 0.0),
            ("idxmax", 2.0),
            ("idxmin", 0.0),
            ("idxlast", 4.0),
            ("first", 0.0),
            ("last", 0.0),
            ("total_variation", 8.0),
        ],
    )
    def test_values_and_places(self, name, expected):
        assert reduction(name).reduce(self.values, CURVE) == pytest.approx(expected, abs=1e-12)

    def test_the_integral_is_that_of_the_chords(self):
        # The trapezoidal rule lacks h²/12 of the change of the slope, here from 4 to -4.
        expected = 32 / 3 - 0.1**2 / 12 * 8
        assert reduction("integral").reduce(self.values, CURVE) == pytest.approx(expected)
        assert reduction("mean").reduce(self.values, CURVE) == pytest.approx(expected / 4)

    def test_a_crossing_lies_on_the_chord(self):
        # Between 1.9 and 2.0 the parabola rises from 3.99 to 4.
        found = reduction("first_above", threshold=3.995).reduce(self.values, CURVE)
        assert found == pytest.approx(1.95)
        found = reduction("first_below", threshold=1.0).reduce(self.values[:, 20:], _from(20))
        assert found == pytest.approx(3.7 + 0.1 * (1.11 - 1.0) / (1.11 - 0.76))

    def test_a_value_between_coordinates_lies_on_the_chord(self):
        assert at(time=1.95).reduce(self.values, CURVE) == pytest.approx(3.995)
        assert at(time=TIME[7]).reduce(self.values, CURVE) == self.values[:, 7]

    def test_a_field_of_two_dimensions(self):
        x, y = np.meshgrid([0.0, 1.0, 3.0], [0.0, 2.0], indexing="ij")
        plane = (1 + 2 * x + 5 * y)[None]
        assert reduction("integral").reduce(plane, PLATE) == pytest.approx(6 * (1 + 3 + 5))
        assert reduction("mean").reduce(plane, PLATE) == pytest.approx(1 + 3 + 5)
        assert at(x=2.5, y=0.5).reduce(plane, PLATE) == pytest.approx(1 + 5 + 2.5)
        assert reduction("max").reduce(plane, PLATE) == 17.0
        assert reduction("min").reduce(plane, PLATE) == 1.0


def _from(place):
    """Return the curve from a place on."""
    return Output("infected", "K", dims=(Dimension("time", "s", values=TIME[place:]),))


class TestProperties:
    @given(VALUES, ENDS)
    def test_of_curves_that_end(self, values, ends):
        curves = ended(values, ends)
        found = {name: each.reduce(curves, CURVE) for name, each in every_member().items()}
        rounding = 1e-9 * np.abs(values).max() + 1e-300
        assert (found["max"] + rounding >= found["mean"]).all()
        assert (found["mean"] + rounding >= found["min"]).all()
        change = np.abs(found["last"] - found["first"])
        assert (found["total_variation"] + rounding >= change).all()
        length = np.array(TIME)[ends - 1]
        assert np.array_equal(found["idxlast"], length)
        assert found["integral"] == pytest.approx(found["mean"] * length, abs=4 * rounding)
        for name in ("idxmax", "idxmin", "first_above", "first_below"):
            assert (np.isnan(found[name]) | (found[name] <= length)).all()
        assert (np.isnan(found["first_above"]) == (found["max"] <= 0)).all()
        assert (np.isnan(found["first_below"]) == (found["min"] >= 0)).all()
        assert (np.isnan(found["at"]) == (ends <= 13)).all()  # the curve ends before 1.3

    @given(VALUES, ENDS)
    def test_a_run_has_the_same_bits_alone(self, values, ends):
        curves = ended(values, ends)
        for name, each in every_member().items():
            together = each.reduce(np.asfortranarray(curves), CURVE)
            alone = np.concatenate([each.reduce(curve[None], CURVE) for curve in curves])
            assert np.array_equal(together, alone, equal_nan=True), name

    @pytest.mark.parametrize("value", [0.1, -3.3, 1e17])
    def test_the_mean_of_a_constant_is_exact(self, value):
        assert reduction("mean").reduce(np.full((1, 41), value), CURVE) == value

    def test_a_single_place(self):
        curve = ended(np.full((1, 41), 5.0), np.array([1]))
        assert reduction("mean").reduce(curve, CURVE) == 5.0
        assert reduction("integral").reduce(curve, CURVE) == 0.0
        assert reduction("total_variation").reduce(curve, CURVE) == 0.0


class TestUnits:
    def output(self, name, field, **settings):
        return derived_outputs("found", field, reduction(name, **settings))[0].output

    def test_values_have_the_unit_of_the_output_and_places_that_of_the_dimension(self):
        time = Dimension("time", "s", "", "day", (0.0, DAY))
        curve = Output("speed", "m s-1", display_unit="km/h", dims=(time,))
        found = self.output("max", curve)
        assert (found.unit, found.display_unit) == ("m s-1", "km/h")
        found = self.output("idxmax", curve)
        assert (found.unit, found.display_unit) == ("s", "day")
        found = self.output("integral", curve)
        assert (found.unit, found.display_unit) == ("m", "(km/h) day")

    def test_a_difference_is_not_shown_in_a_unit_with_a_zero(self):
        curve = Output("T", "K", display_unit="degC", dims=CURVE.dims)
        assert self.output("mean", curve).display_unit == "degC"
        assert self.output("total_variation", curve).display_unit == "K"
        integral = self.output("integral", curve)
        assert integral.display_unit == integral.unit


class TestAbsentNumbers:
    def test_a_companion_counts_the_runs_without_one(self):
        number, companion = derived_outputs(
            "crossing", CURVE, reduction("first_above", threshold=2.0)
        )
        assert number.output.absent == "infected never exceeds 2 K"
        assert companion.output.name == "crossing_occurs"
        flags = [category.flag for category in companion.output.categories]
        assert flags == ["occurs", "absent"]
        curves = np.zeros((2, 41))
        curves[1, 3:] = 4.0
        is_ok = np.array([True, True])
        assert companion.values({CURVE.name: curves}, is_ok).tolist() == [1.0, 0.0]
        assert number.values({CURVE.name: curves}, is_ok) == pytest.approx(
            [np.nan, 0.25], nan_ok=True
        )

    def test_a_place_beyond_the_end_of_a_curve(self):
        found = derived_outputs("late", CURVE, at(time=2.0))
        assert [each.output.absent for each in found] == ["infected ends before time = 2 s", ""]
        assert len(derived_outputs("late", _from(0), at(time=2.0))) == 1

    def test_a_failed_run_has_no_number(self):
        (peak,) = derived_outputs("peak", CURVE, reduction("max"))
        curves = np.array([np.full(41, np.nan), np.ones(41), np.full(41, 3.0)])
        found = peak.values({CURVE.name: curves}, np.array([False, True, False]))
        assert found == pytest.approx([np.nan, 1.0, np.nan], nan_ok=True)
