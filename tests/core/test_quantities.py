"""Quantities are read strictly, and messages show what was found."""

import math
import re
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uqpen.core.errors import QuantityError
from uqpen.core.quantities import parse_quantity, parse_spread
from uqpen.core.units import NUMBER, are_convertible, describe, scale, si_unit


@pytest.mark.parametrize(
    ("text", "like", "value"),
    [
        ("17.5 g/cm^3", "kg m-3", 17500.0),
        ("1.65 GPa", "Pa", 1.65e9),
        ("16 cm", "m", 0.16),
        ("17 mm", "m", 0.017),
        ("25 degC", "K", 298.15),
        ("5 %", "1", 0.05),
        (" +1e3  m/s ", "m s-1", 1000.0),
        ("10_000 m", "m", 10000.0),
        (".5 m", "m", 0.5),
        ("−5 mm", "m", -0.005),  # with the minus of typesetting
        ("2e−3 m", "m", 0.002),
        (3, "1", 3.0),
        (0.25, "1", 0.25),
    ],
)
def test_a_quantity_becomes_its_correctly_rounded_si_value(text, like, value):
    # Exactly: a scale that is a short decimal must not add a rounding error of its own.
    assert parse_quantity(text, like).value == value


@pytest.mark.parametrize(
    ("text", "like", "found", "expected"),
    [
        ("5 kg", "m", '"5 kg"', 'a length, such as "16 cm"'),
        ("17,5 g/cm^3", "kg m-3", "decimal comma", '"17.5 g/cm^3"'),
        ("5", "m", "without a unit", "a length"),
        (5, "m", "without a unit", "a length"),
        ("5 frob", "m", '"frob", which is not a known unit', "a unit"),
        ("5 KN/m", "N/m", '"KN/m", which is not a known unit', 'did you mean "kN/m"?'),
        ("5 Gpa", "Pa", '"Gpa", which is not a known unit', 'did you mean "GPa"?'),
        ("5 kNm2", "N m2", '"kNm2", which is not a known unit', 'did you mean "kN m2"?'),
        ("5 mPa/frob", "Pa", "not a known unit", "with whole powers"),
        ("5 kN", "N/m", '"5 kN"', 'a force per length, or a surface tension, such as "5 kN/m"'),
        ("five m", "m", '"five m"', "a length"),
        ("nan m", "m", '"nan m"', "a length"),
        ("inf m", "m", '"inf m"', "a length"),
        ("1e999 m", "m", "not finite", "a length"),
        ("5 5 m", "m", '"5 m", which is not a known unit', "a unit"),
        ("(2 ± 1) m", "m", '"(2 ± 1) m"', "a length"),
        ("2 m ± 1", "m", "with a ±", "without a spread"),
        (True, "1", "true", "a plain number"),
        ([1], "m", "[1]", "a length"),
        ({}, "m", "a table", "a length"),
        ("3 lg(re 1 mW)", "W", "not a known unit", "a unit"),
        ("3 days since 2000-01-01", "s", "not a known unit", "a unit"),
        ("", "m", '""', "a length"),
        ("5 -3 m", "m", "not a known unit", "a unit"),
        ("5 (3 m)", "m", "not a known unit", "a unit"),
        ("1 MPa m^0.5", "Pa", "not a known unit", "with whole powers"),
        ("3 m^1.5", "m", "not a known unit", "with whole powers"),
        ("1 m)", "m", "not a known unit", "a unit"),
        ("1 nmi", "m", "not a known unit", "a unit"),
        ("60 mph", "m s-1", "not a known unit", "a unit"),
        ("1 m @ 5", "m", "not a known unit", "a unit"),
        ("٣ m", "m", "٣ m", "a length"),
    ],
)
def test_what_is_no_quantity_is_refused_in_words(text, like, found, expected):
    with pytest.raises(QuantityError) as caught:
        parse_quantity(text, like)
    assert found in caught.value.found
    assert expected in caught.value.expected


def test_a_difference_of_temperatures_has_no_offset():
    assert parse_quantity("5 degC", "K", difference=True).value == 5.0


@pytest.mark.parametrize(
    ("text", "like", "read"),
    [
        ("(2.5 ± 0.05) g/cm^3", "kg m-3", (2500.0, 50.0, "g/cm^3")),
        ("(2.5 +/- 0.05) g/cm^3", "kg m-3", (2500.0, 50.0, "g/cm^3")),
        ("(2.5 +- 0.05) g/cm^3", "kg m-3", (2500.0, 50.0, "g/cm^3")),
        ("(−2 ± 1) m", "m", (-2.0, 1.0, "m")),  # with the minus of typesetting
        ("(20 ± 5) degC", "K", (293.15, 5.0, "degC")),  # the deviation is a difference
        ("2 ± 0.1", "1", (2.0, 0.1, "1")),  # without a unit, no brackets are needed
    ],
)
def test_a_spread_is_a_mean_and_a_standard_deviation(text, like, read):
    spread = parse_spread(text, like)
    assert spread is not None
    assert (spread.mean, spread.std, spread.unit) == read


def test_text_without_a_plus_minus_is_no_spread():
    assert parse_spread("2.5 g/cm^3", "kg m-3") is None


@pytest.mark.parametrize("text", ["2 m ± 1", "(2 ± 1 ± 1) m", "(2,5 ± 1) m", "(a ± 1) m"])
def test_a_spread_that_cannot_be_read_is_refused(text):
    with pytest.raises(QuantityError):
        parse_spread(text, "m")


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("MPa", "Pa"),
        ("g/cm^3", "kg m-3"),
        ("degC", "K"),
        ("%", "1"),
        ("Hz", "s-1"),
        ("m^4", "m4"),
        ("degree", "rad"),
        ("W m⁻² K⁻¹", "W m-2 K-1"),
        ("kN·m", "J"),
        ("lbf/in^2", "Pa"),
        ("m⁴", "m4"),
        ("", "1"),
    ],
)
def test_every_unit_has_its_coherent_si_unit(unit, si):
    assert si_unit(unit) == si


@given(
    value=st.floats(-1e12, 1e12),
    unit=st.sampled_from(["mm", "GPa", "g/cm^3", "degC", "degF", "psi", "inch", "degree", "%"]),
)
def test_showing_a_value_undoes_reading_it(value, unit):
    measure = scale(unit)
    # Two roundings in the conversions, and an offset of at most 500 taken off again.
    assert math.isclose(measure.from_si(measure.to_si(value)), value, rel_tol=1e-15, abs_tol=1e-12)


_SHOWN = ["mm", "um", "km", "GPa", "g/cm^3", "kN", "inch", "degree", "psi", "hour", "%", "eV"]


@pytest.mark.parametrize("unit", [*_SHOWN, "degC", "degF", "m", "kg"])
def test_written_numbers_reach_a_model_in_their_unit_to_the_last_bit(unit):
    measure = scale(unit)
    written = [*map(float, range(-300, 301)), *(number / 100 for number in range(-3000, 3000))]
    arrived = measure.from_si(np.array([measure.to_si(number) for number in written]))
    assert arrived.tolist() == written


@given(
    number=st.integers(-(10**12) + 1, 10**12 - 1),
    power=st.integers(-20, 8),
    unit=st.sampled_from(_SHOWN),
)
def test_twelve_digits_survive_the_way_to_si_units_and_back(number, power, unit):
    written, measure = float(f"{number}e{power}"), scale(unit)
    assert measure.from_si(measure.to_si(written)) == written


def test_what_is_no_number_and_what_is_beyond_all_decimals_stay_what_they_are():
    values = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, 1e308])
    assert np.array_equal(scale("km").from_si(values), values / 1000, equal_nan=True)


@given(value=st.decimals(-1000, 1000, places=4))
def test_a_short_decimal_in_a_decimal_unit_is_exact(value):
    assert parse_quantity(f"{value} mm", "m").value == float(f"{value}e-3")


def test_a_message_says_what_a_unit_measures():
    assert describe("kg m-3") == 'a density, such as "17.5 g/cm^3"'
    assert "m4" in describe("kg m4")


def test_units_are_alike_when_they_measure_the_same():
    assert are_convertible("psi", "GPa")
    assert not are_convertible("psi", "GPa m")


MILLION = 1_000_000


@pytest.mark.parametrize("tail", ["x", "_", ".x", "e", "e+"])
def test_a_number_is_read_in_linear_time(tail):
    # With a square of the length, no answer would come within hours.
    assert re.fullmatch(NUMBER, f"{'1' * MILLION}{tail}") is None
    assert re.fullmatch(NUMBER, f"{'1_' * MILLION}{tail}") is None
    assert re.fullmatch(NUMBER, "1" * MILLION)


@pytest.mark.parametrize(
    "text",
    [
        "1" * MILLION,
        f"{'1' * MILLION}x",
        f"1 a{' ' * MILLION}x",
        f"{' ' * MILLION}x",
        f"({' ' * MILLION}1 ± 1",
        f"(1 ± 1){' ' * MILLION}m{' ' * MILLION}x",
        "±" * MILLION,
    ],
)
def test_a_text_that_is_far_too_long_for_a_quantity_is_refused(text):
    reported = (
        f"found a text of {len(text)} characters; expected a quantity of at most 2000 characters"
    )
    for parse in (parse_quantity, parse_spread):
        with pytest.raises(QuantityError) as refused:
            parse(text, "m")
        assert str(refused.value) == reported


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (f"1 {'m ' * 750}m", "found a unit of 1501 characters; expected one of at"),
        (16**5000, "found a whole number of over 4000 digits"),
    ],
    ids=["unit", "integer"],
)
def test_what_is_far_too_long_to_be_read_is_refused(text, found):
    with pytest.raises(QuantityError, match=found):
        parse_quantity(text, "m")


def test_units_are_known_whatever_the_locale_of_the_program():
    """A program of graphs or documents takes the user's locale before it imports uqpen."""
    program = (
        "import locale; locale.setlocale(locale.LC_ALL, 'C.UTF-8')\n"
        "from uqpen.core.units import si_unit; assert si_unit('g cm-3') == 'kg m-3'\n"
        "assert locale.setlocale(locale.LC_NUMERIC) == 'C.UTF-8'"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    if "unsupported locale" in done.stderr and "cf_units" not in done.stderr:
        pytest.skip("C.UTF-8 is no locale of this machine")
    assert done.returncode == 0, done.stderr
