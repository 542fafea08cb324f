"""Diagnostics of fits, as a reader sees them."""

import math

import pytest

from uqpen.surrogates.diagnostics import Diagnostic


@pytest.mark.parametrize(
    ("q2", "text"),
    [
        (0.9997, "0.99970"),
        (0.99949, "0.99949"),
        (0.999998, "> 0.99999"),
        (1.0, "> 0.99999"),
        (0.0, "0.00000"),
        (-0.25, "-0.25000"),
        (math.nan, ""),
    ],
)
def test_a_quality_below_1_is_never_shown_as_1(q2, text):
    for name in ("q2", "check_q2_of_output"):
        assert Diagnostic(name, q2, "Q²").text == text


def test_other_diagnostics_have_five_digits_and_their_unit():
    assert Diagnostic("length_scale", 0.31415926, "length scale", "m").text == "0.31416 m"
    assert Diagnostic("terms", 35, "terms").text == "35"
