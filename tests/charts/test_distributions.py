"""Distribution functions, read off archived runs."""

import numpy as np
import pytest

from uqpen.charts.distributions import SimultaneousBand, empirical_cdf
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.statistics.distribution_function.cdfs import cdf
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.intervals import dkw_half_width
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample


@pytest.mark.parametrize("size", [2, 7, 400, 3000])
def test_it_is_the_archives_function_at_the_archives_values(size):
    values = np.random.default_rng(size).normal(size=size)
    none = np.empty(0, dtype=np.int64)
    used = np.arange(size)
    columns = InputColumns.none(size)
    sample = Sample(values, used, none, columns, 0 * used, Sampling.INDEPENDENT)
    archived = dict(cdf(sample, QuantityOfInterest(Output("y", "1"), "1")))
    band = archived["cdf_band"].assign_attrs(runs=size, runs_used=size)
    share = empirical_cdf(values, archived["cdf_value"].values)
    np.testing.assert_array_equal(share, band.values[:, 0])
    found = SimultaneousBand.from_estimates(band).around(share)
    np.testing.assert_allclose(found, band.values, rtol=0, atol=1e-15)


def test_it_steps_up_at_each_run():
    share = empirical_cdf(np.array([3.0, 1.0, 2.0, 2.0]), np.array([0.9, 1.0, 1.9, 2.0, 3.0]))
    assert share.tolist() == [0, 0.25, 0.25, 0.75, 1]
    found = SimultaneousBand(0.2).around(share)
    np.testing.assert_allclose(found[:, 1], [0, 0.05, 0.05, 0.55, 0.8])
    np.testing.assert_allclose(found[:, 2], [0.2, 0.45, 0.45, 0.95, 1])


def test_without_a_band_there_are_no_bounds():
    found = SimultaneousBand(np.nan).around(np.array([0.5]))
    assert found[0, 0] == 0.5
    assert np.isnan(found[0, 1:]).all()


def test_a_failed_run_may_have_had_any_result():
    band = SimultaneousBand(dkw_half_width(90, 0.95), missing_share=0.1)
    half = dkw_half_width(100, 0.95)
    (middle,) = band.around(np.array([0.5]))
    # All ten failed runs above the value, and all at or below it.
    np.testing.assert_allclose(middle, [0.5, 45 / 100 - half, 55 / 100 + half], rtol=1e-12)
    (most,) = band.around(np.array([1.0]))
    np.testing.assert_allclose(most, [1.0, 90 / 100 - half, 1.0], rtol=1e-12)


def test_the_band_covers_a_distribution_whose_large_values_fail():
    rng = np.random.default_rng(15)
    grid = np.linspace(0, 1, 201)
    covered = []
    for values in rng.uniform(size=(300, 200)):
        # A fifth of the values above a half fail.
        completed = values[(values < 0.5) | (rng.uniform(size=200) < 0.8)]
        band = SimultaneousBand(
            dkw_half_width(completed.size, 0.95), missing_share=1 - completed.size / 200
        )
        _, lower, upper = band.around(empirical_cdf(completed, grid)).T
        covered.append(bool((lower <= grid).all() and (grid <= upper).all()))
    assert np.mean(covered) >= 0.95
