"""Numbers with as many digits as they have, in tables and in sentences."""

import math
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uqpen.results.digits import (
    count_text,
    estimate_text,
    estimate_texts,
    number_text,
    percent_text,
    percent_texts,
    tolerance_interval_texts,
    tolerance_limit_text,
)


@pytest.mark.parametrize(
    ("estimate", "lower", "upper", "text"),
    [
        (0.49274, 0.49004, 0.49544, "0.4927 ± 0.0027"),
        (71.1, 70.6, 72.9, "71.1 (70.6 … 72.9)"),
        # ± is a half-width, where the sides are equal in the digits that are shown.
        (0.46630, 0.46391, 0.46867, "0.4663 ± 0.0024"),
        (0.46630, 0.46401, 0.46867, "0.4663 (0.4640 … 0.4687)"),
        (324.5, 321.3, 326.9, "324.5 (321.3 … 326.9)"),
        (3.5, 3.5, 3.5, "3.5"),
        # Without an interval, four digits: alike within a column.
        (387.02, math.nan, math.nan, "387.0"),
        (389.5, math.nan, math.nan, "389.5"),
        (27143.0, math.nan, math.nan, "27\u202f140"),
        (9.99996, math.nan, math.nan, "10.00"),
        (2.7143e-8, math.nan, math.nan, "2.714×10⁻⁸"),
        (0.0, math.nan, math.nan, "0"),
        (-0.5176, math.nan, math.nan, "−0.5176"),
        (-0.00004, -0.0011, 0.00102, "0.0000 ± 0.0011"),
        (3.51234567, math.nan, math.nan, "3.512"),
        (math.nan, math.nan, math.nan, "–"),
        (0.0, 0.0, 0.00037, "(0.0, 0.0 … 3.7)×10⁻⁴"),
        (12345.6, 12000.0, 12691.2, "12\u202f346 ± 346"),
        (4.0e8, 3.9e8, 4.1e8, "(4.00 ± 0.10)×10⁸"),
        (1.234e-7, 1.134e-7, 1.334e-7, "(1.23 ± 0.10)×10⁻⁷"),
        (-2.4, -2.6, -2.2, "−2.40 ± 0.20"),
        (5.0, math.nan, 6.0, "5.0 (? … 6.0)"),
        # An end that is the only one is rounded outward.
        (69.0, math.nan, 69.349, "69.00 (? … 69.35)"),
        (69.0, math.nan, 69.3412, "69.00 (? … 69.35)"),
        (69.0, 68.6588, math.nan, "69.00 (68.65 … ?)"),
        (0.0, 0.0, 0.030141, "0.000 (0.000 … 0.031)"),
        (1.0, 0.969859, 1.0, "1.000 (0.969 … 1.000)"),
        (-1.0, math.nan, -0.95012, "−1.000 (? … −0.950)"),
        (-1.0, -1.05012, math.nan, "−1.000 (−1.051 … ?)"),
    ],
)
def test_an_estimate_has_the_digits_its_interval_leaves(estimate, lower, upper, text):
    assert estimate_text(estimate, lower, upper) == text


def read(text):
    """The number that a text shows, and the power of ten that stands behind it."""
    figure, _, power = text.replace("\u202f", "").removeprefix("(").partition("×10")
    scale = 10.0 ** float(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")) or 0)
    return float(figure.split()[0].strip(",)").replace("−", "-")) * scale


@given(estimate=st.floats(-1e6, 1e6), below=st.floats(1e-3, 1e6), share=st.floats(0.7, 1.4))
def test_a_shown_estimate_is_right_to_a_twentieth_of_its_interval(estimate, below, share):
    lower, upper = estimate - below, estimate + below * share
    shown = read(estimate_text(estimate, lower, upper))
    # With two digits of the half-width the last place is a tenth of it, at most half of that off.
    half = max(estimate - lower, upper - estimate)
    assert half == 0 or abs(shown - estimate) <= 0.051 * half


@given(estimate=st.floats(-1e6, 1e6), side=st.floats(1e-3, 1e6))
def test_the_end_of_a_one_sided_interval_still_bounds_what_it_did(estimate, side):
    bound = estimate + side
    _, _, shown = estimate_texts(estimate, math.nan, bound)
    # To the twelve digits in which it is read.
    assert read(shown) >= bound - 1e-11 * abs(bound)


def test_a_bound_that_holds_is_shown_beside_its_estimate():
    assert tolerance_limit_text(13.4812, 13.7612) == "13.48, at most 13.77"
    assert tolerance_limit_text(13.48, 13.77) == "13.48, at most 13.77"
    assert tolerance_limit_text(13.4812, math.nan) == "13.48"
    assert tolerance_limit_text(4.0e8, 4.1e8) == "(4.00, at most 4.10)×10⁸"


@pytest.mark.parametrize(
    ("bounds", "texts"),
    [
        ((0.49274, 0.49004, 0.49544, 0.5), ("0.4927", "0.4900", "0.4954", "0.5000")),
        ((0.0, 0.0, 0.0369), ("0", "0", "0.037")),
        ((3.51234567, float("nan"), float("nan")), ("3.512", "–", "–")),
        ((1.234e-7, 1.134e-7, 1.334e-7), ("1.23×10⁻⁷", "1.13×10⁻⁷", "1.33×10⁻⁷")),
    ],
)
def test_figures_in_a_sentence_have_sensible_digits(bounds, texts):
    assert estimate_texts(*bounds) == texts


def test_no_digit_lies_below_rounding_errors():
    near = 5.0 + 4e-15
    assert estimate_text(5.0, 5.0 - 1e-16, near) == "5"
    assert estimate_texts(5.0, 5.0, near) == ("5", "5", "5")
    assert tolerance_limit_text(5.0, near) == "5"
    assert tolerance_interval_texts(5.0, near) == ("5", "5")
    assert estimate_text(5.0, 5.0 - 1e-9, 5.0 + 1e-9) == "5.0000000000 ± 0.0000000010"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (889_200.0, "889\u202f200"),
        (6_559_000.0, "6.559×10⁶"),
        (106_855.0, "106\u202f900"),
        (1.876e-11, "1.876×10⁻¹¹"),
        (-2.5731, "−2.573"),
        (0.5, "0.5"),
        (-0.0, "0"),
        (float("nan"), "–"),
    ],
)
def test_a_number_alone_has_one_form(value, text):
    assert number_text(value) == text


def test_over_tenfolds_each_number_has_two_digits_of_its_own():
    by_tenfolds = partial(estimate_text, is_logarithmic=True)
    assert by_tenfolds(2.2e-4, 9e-5, 1.2e-3) == "2.2×10⁻⁴ (9.0×10⁻⁵ … 0.0012)"
    texts = estimate_texts(436.2, 33.7, 41_529.0, is_logarithmic=True)
    assert texts == ("440", "34", "42\u202f000")
    # Within a tenfold the interval gives the digits, as on a linear scale.
    for bounds in ((0.32, 0.256, 0.389), (1.0, -1.0, 20.0)):
        assert by_tenfolds(*bounds) == estimate_text(*bounds)


def test_more_than_four_digits_stand_in_groups():
    assert tolerance_limit_text(86_300.0, 106_854.2) == "86\u202f300, at most 106\u202f855"
    assert estimate_text(-36_688.0, -40_000.0, 134_140.0).startswith("−36\u202f688 (−40\u202f000")
    assert estimate_text(9_999.0, 9_000.0, 9_999.5).startswith("9999 (9000")


def test_a_probability_in_per_cent_has_its_own_digits():
    assert [percent_text(p) for p in (0.05, 0.999, 0.9999)] == ["5 %", "99.9 %", "99.99 %"]


@pytest.mark.parametrize(
    ("number", "said"), [(0, "0 runs"), (1, "1 run"), (2, "2 runs"), (1000, "1\u202f000 runs")]
)
def test_one_thing_is_in_the_singular(number, said):
    assert count_text(number, "run") == said


@pytest.mark.parametrize(
    ("probabilities", "said"),
    [
        ((0.1389, 0.1321, 0.1458), ("13.89 %", "13.21 %", "14.58 %")),
        ((0.0, 0.0, 0.000369), ("0 %", "0 %", "0.037 %")),
        ((1.0, 0.9963, 1.0), ("100.00 %", "99.63 %", "100.00 %")),
        ((4.0e-4, 1.1e-4, 10.2e-4), ("0.040 %", "0.011 %", "0.102 %")),
        ((4.0e-9, 1.1e-9, 10.2e-9), ("4.0×10⁻⁷ %", "1.1×10⁻⁷ %", "10.2×10⁻⁷ %")),
        ((0.35, math.nan, math.nan), ("35 %", "– %", "– %")),
    ],
)
def test_probabilities_are_reported_in_per_cent(probabilities, said):
    assert percent_texts(*probabilities) == said


def test_they_have_the_digits_of_the_tables():
    # 0.2075 ends in a five, which 20.75 is rounded otherwise from.
    bounds = (0.2075, 0.1825, 0.2325)
    assert estimate_texts(*bounds) == ("0.207", "0.182", "0.233")
    assert percent_texts(*bounds) == ("20.7 %", "18.2 %", "23.3 %")
