"""Numbers in sentences."""

import math

import pytest

from uqpen.results.digits import count_text, estimate_texts, percent_texts


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
