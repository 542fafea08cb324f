"""Where the lost runs lie: probabilities that are counted right, with intervals that cover."""

import numpy as np
import pytest
import xarray as xr

from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics.failure_analysis import failure_analysis
from uqpen.statistics.run_samples import sample_of


def reported(x, status, **attributes):
    runs = xr.Dataset(
        {"x": ("run", x, {"role": "input"}), "status": ("run", status.astype(np.int8))},
        {"run": np.arange(len(x))},
        {"sampling": str(Sampling.INDEPENDENT), **attributes},
    )
    return dict(failure_analysis(sample_of(runs, "status")))


def test_the_probability_is_the_share_of_pairs():
    generator = np.random.default_rng(1)
    x = generator.integers(0, 20, 90).astype(float)  # with many ties
    status = np.where(generator.random(90) < x / 40, Status.FAILED, Status.OK)
    status[:5] = Status.INADMISSIBLE
    answer = reported(x, status)
    lost, others = x[status == Status.FAILED], x[status == Status.OK]
    pairs = (lost[:, None] > others) + (lost[:, None] == others) / 2
    assert answer["larger"][0].item(0) == pytest.approx(pairs.mean(), rel=1e-12)
    assert answer["lowest"].item() == lost.min()
    assert answer["highest"].item() == lost.max()
    assert answer["larger"]["input"].values.tolist() == ["x"]


def test_failures_at_both_ends_are_further_out():
    x = np.random.default_rng(2).normal(size=500)
    answer = reported(x, np.where(np.abs(x) > 1.8, Status.TIMED_OUT, Status.OK))
    assert answer["further_out"][0].item(0) > 0.99
    assert abs(answer["larger"][0].item(0) - 0.5) < 0.2


def test_where_no_run_was_lost_there_is_nothing_to_tell():
    x = np.arange(20.0)
    assert reported(x, np.zeros(20)) == {}
    assert reported(x, np.where(x > 10, Status.INADMISSIBLE, Status.OK)) == {}


@pytest.mark.parametrize(
    ("lost", "reason"),
    [
        (9, "fewer than 10 failed runs are too few for an interval"),
        (20, "the failed runs are completely separated from the others"),
        (95, "fewer than 10 completed runs are too few for an interval"),
        (100, "no run completed"),
    ],
)
def test_a_probability_without_bounds_says_why(lost, reason):
    x = np.arange(100.0)
    answer = reported(x, np.where(x < lost, Status.CRASHED, Status.OK))
    assert answer["larger"]["note"].values.tolist() == [reason]
    assert np.isnan(answer["larger"].values[0, 1:]).all()


def test_points_that_are_no_draws_have_no_bounds():
    x = np.random.default_rng(3).random(100)
    answer = reported(x, np.where(x + 0.1 > 0.9, 2, 0), sampling=str(Sampling.TRAJECTORIES))
    assert answer["larger"]["note"].values.tolist() == [
        "the points are not a sample of the input distribution"
    ]


@pytest.mark.slow
def test_the_interval_covers_as_often_as_it_says():
    # Lost with probability (0.1 + 0.4 x); of a uniform x, both densities are straight lines.
    t = (np.arange(20_000) + 0.5) / 20_000
    loses = 0.1 + 0.4 * t
    below = np.cumsum(1 - loses) / (1 - loses).sum()
    truth = float((loses * below).sum() / loses.sum())
    generator = np.random.default_rng(4)
    held = []
    for _ in range(300):
        x = generator.random(100)
        status = np.where(generator.random(100) < 0.1 + 0.4 * x, Status.FAILED, Status.OK)
        _, lower, upper = reported(x, status)["larger"].values[0]
        held.append(lower <= truth <= upper)
    # 300 seeds of an interval that covers 95 % give 91.7 to 98.3 % ninety-nine times in a hundred.
    assert 0.917 < np.mean(held) < 0.983
