"""The table of what statistics cost, beside another commit."""

import pytest

costs = pytest.importorskip("statistics_cost", reason="the folder of benchmarks is not here")


def row(case, first, commit, seconds):
    return {"case": case, "first": first, "commit": commit, "seconds": seconds, "memory": 4e8}


def test_a_row_has_medians_and_the_range_of_ratios():
    measured = [
        row("million", repeat, commit, seconds)
        for repeat, times in enumerate([(10.0, 5.0), (12.0, 9.0), (8.0, 2.0)])
        for commit, seconds in zip(("base", "here"), times, strict=True)
    ]
    lines = list(costs.page(measured))
    assert lines[2] == "| 4 | 3 | 1_000_000 | 10 | 5 | 0.50 (0.25 to 0.75) | 400 | 400 |"


def test_what_is_not_measured_on_both_sides_is_said():
    alone = [row("million", 0, "base", 10.0)]
    assert "not measured" in list(costs.page(alone))[2]
    other = [*alone, row("million", 0, "here", 5.0)]
    assert "0.50 (one repeat)" in list(costs.page(other))[2]
    assert sum("not measured" in line for line in costs.page(other)) == len(costs.CASES) - 1
