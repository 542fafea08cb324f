"""An event that a declared outcome decides: its interval covers, and is narrower than both ways."""

import pytest
from outcome_coverage import interval

from uqpen.statistics.intervals import clopper_pearson

SEEDS = 40


@pytest.mark.parametrize("tail", ["beyond", "other tail"])
def test_intervals_of_an_event_with_an_outcome_cover(tail):
    found = [interval(seed, 0.2, tail, "outcome") for seed in range(SEEDS)]
    covered = sum(lower <= truth <= upper for lower, upper, truth in found)
    # Refuted only where 40 seeds are certain of a coverage below 0.92, at 99.8 %.
    assert clopper_pearson(covered, SEEDS, 0.998)[1] >= 0.92
    for seed, (lower, upper, _) in enumerate(found):
        least, most, _ = interval(seed, 0.2, tail, "failed run")
        assert upper - lower < most - least
