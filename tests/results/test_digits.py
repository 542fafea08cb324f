"""Numbers with as many digits as they have."""

import pytest

from uqpen.results.digits import (
    estimate_text,
    estimate_texts,
    number_text,
    tolerance_interval_texts,
    tolerance_limit_text,
)


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
    assert (
        estimate_text(2.2e-4, 9e-5, 1.2e-3, is_logarithmic=True) == "2.2×10⁻⁴ (9.0×10⁻⁵ … 0.0012)"
    )
    assert estimate_texts(436.2, 33.7, 41_529.0, is_logarithmic=True) == (
        "440",
        "34",
        "42\u202f000",
    )
    # Within a tenfold the interval gives the digits, as on a linear scale.
    assert estimate_text(0.32, 0.256, 0.389, is_logarithmic=True) == estimate_text(
        0.32, 0.256, 0.389
    )
    assert estimate_text(1.0, -1.0, 20.0, is_logarithmic=True) == estimate_text(1.0, -1.0, 20.0)


def test_more_than_four_digits_stand_in_groups():
    assert tolerance_limit_text(86_300.0, 106_854.2) == "86\u202f300, at most 106\u202f855"
    assert estimate_text(-36_688.0, -40_000.0, 134_140.0).startswith("−36\u202f688 (−40\u202f000")
    assert estimate_text(9_999.0, 9_000.0, 9_999.5).startswith("9999 (9000")
