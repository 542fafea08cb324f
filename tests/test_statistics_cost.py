"""The table of what statistics cost, beside another commit."""

import pytest

costs = pytest.importorskip("statistics_cost", reason="the folder of benchmarks is not here")


def test_a_row_has_medians_and_the_range_of_ratios():
    measured = [
        costs.Measured("million", repeat, commit, seconds, 4e8)
        for repeat, times in enumerate([(10.0, 5.0), (12.0, 9.0), (8.0, 2.0)])
        for commit, seconds in zip(("base", "here"), times, strict=True)
    ]
    lines = list(costs._lines(measured))
    assert lines[2] == "| 4 | 3 | 1_000_000 | 10 | 5 | 0.50 (0.25 to 0.75) | 400 | 400 |"


def test_what_is_not_measured_on_both_sides_is_said():
    alone = [costs.Measured("million", 0, "base", 10.0, 4e8)]
    assert "not measured" in list(costs._lines(alone))[2]
    other = [*alone, costs.Measured("million", 0, "here", 5.0, 4e8)]
    assert "0.50 (one repeat)" in list(costs._lines(other))[2]
    assert sum("not measured" in line for line in costs._lines(other)) == len(costs.CASES) - 1
