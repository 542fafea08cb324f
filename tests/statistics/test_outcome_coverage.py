"""An event that a declared outcome decides: its interval covers, and is narrower than both ways."""

import pytest
from outcome_coverage import ENDINGS, MONTE_CARLO, interval

from uqpen.statistics.intervals import clopper_pearson

SEEDS = 40


@pytest.mark.parametrize("tail", ["beyond", "other tail"])
def test_intervals_of_an_event_with_an_outcome_cover(tail):
    found = [interval(seed, MONTE_CARLO, "20 %", tail, "outcome") for seed in range(SEEDS)]
    truth = ENDINGS[MONTE_CARLO]["20 %"].probability(tail)
    covered = sum(lower <= truth <= upper for _, lower, upper in found)
    # Refuted only where 40 seeds are certain of a coverage below 0.92, at 99.8 %.
    assert clopper_pearson(covered, SEEDS, 0.998)[1] >= 0.92
    for seed, (_, lower, upper) in enumerate(found):
        _, least, most = interval(seed, MONTE_CARLO, "20 %", tail, "failed run")
        assert upper - lower < most - least


def test_importance_sampling_finds_an_ending_in_the_other_tail():
    case = "importance-sampling", "0.05 %", "other tail"
    truth = ENDINGS[case[0]]["0.05 %"].probability("other tail")
    for seed in range(2):
        value, lower, upper = interval(seed, *case, "outcome")
        # The ending is 27 % of the probability, and an estimate scatters by 3 %.
        assert value == pytest.approx(truth, rel=0.15)
        _, least, most = interval(seed, *case, "failed run")
        assert upper - lower < most - least
