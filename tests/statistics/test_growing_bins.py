"""Bins of an input grow with the number of runs, so that a small index has a narrower interval."""

import numpy as np
import pytest
from drawn_samples import sample_of_values

from uqpen.core.model import Output
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.given_data import first_order
from uqpen.statistics.sensitivity.local_regression import RegressionBins


def sample_of(size, replicates=1):
    points = np.random.default_rng(size).random((size, 2))
    values = np.sin(6 * points[:, 0])
    return sample_of_values(values, points, ("acts", "idle"), replicates=replicates)


@pytest.mark.parametrize(
    ("size", "replicates", "in_a_bin"),
    [
        (16_384, 1, 16),
        (65_536, 1, 32),
        (262_144, 1, 64),
        (65_536, 16, 16),  # strata, which stay apart
    ],
)
def test_runs_in_a_bin(size, replicates, in_a_bin):
    whole = RegressionBins.from_sample(sample_of(size, replicates), 0).size
    assert np.median(whole) == pytest.approx(in_a_bin, abs=1)
    halved = RegressionBins.from_sample(sample_of(size, replicates), 0, halved=True).size
    assert np.median(halved) == pytest.approx(in_a_bin / 2, abs=1)


def test_an_idle_input_has_a_narrower_interval(monkeypatch):
    quantity = QuantityOfInterest(Output("y", "m"), "m")

    def widths():
        found = dict(first_order(sample_of(65_536), quantity))["first_order"].values
        return np.asarray(found[:, 2] - found[:, 1])

    narrow = widths()
    monkeypatch.setattr("uqpen.statistics.sensitivity.local_regression._RUNS_FOR_SMALL_BINS", 2**30)
    wide = widths()
    # The root of the number of bins, by leverages: √(1/2) to a few per cent.
    assert narrow[1] / wide[1] == pytest.approx(0.67, abs=0.06)
