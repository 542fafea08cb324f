"""Samples of very many replicates."""

import numpy as np
from drawn_samples import sample_of_values


def test_counts_of_many_replicates_come_some_at_a_time_and_are_those_of_each():
    rng = np.random.default_rng(3)
    replicates = np.sort(rng.integers(0, 2_000, 9_000))  # of any size, some of them empty
    sample = sample_of_values(rng.integers(0, 50, 9_000).astype(float), replicates=replicates)
    values = np.array([-1.0, 10.0, 10.5, 50.0])
    parts = [*sample.counts_by_replicate(values)]
    assert max(map(len, parts)) <= 1_024
    below = sample.values[:, np.newaxis] <= values
    expected = [below[replicates == each].sum(axis=0) for each in np.unique(replicates)]
    np.testing.assert_array_equal(np.concatenate(parts), expected)
    np.testing.assert_array_equal(sample.count_up_to(values), below.sum(axis=0))
