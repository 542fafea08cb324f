"""Distribution functions, read off archived runs."""

from __future__ import annotations

import numpy as np
import pytest

from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.results.empirical_cdf import empirical_cdf
from uqpen.statistics.distribution_function.cdfs import cdf
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample


@pytest.mark.parametrize("size", [2, 7, 400, 3000])
def test_it_is_the_archives_function_at_the_archives_values(size: int) -> None:
    values = np.random.default_rng(size).normal(size=size)
    none = np.empty(0, dtype=np.int64)
    used = np.arange(size)
    columns = InputColumns.none(size)
    sample = Sample(values, used, none, columns, 0 * used, Sampling.INDEPENDENT)
    archived = dict(cdf(sample, QuantityOfInterest(Output("y", "1"), "1")))
    band = archived["cdf_band"].values
    found = empirical_cdf(values, band, archived["cdf_value"].values)
    np.testing.assert_array_equal(found[:, 0], band[:, 0])
    np.testing.assert_allclose(found, band, rtol=0, atol=1e-15)


def test_it_steps_up_at_each_run() -> None:
    band = np.array([[0.5, 0.3, 0.7], [1.0, 0.8, 1.0]])
    found = empirical_cdf(np.array([3.0, 1.0, 2.0, 2.0]), band, np.array([0.9, 1.0, 1.9, 2.0, 3.0]))
    assert found[:, 0].tolist() == [0, 0.25, 0.25, 0.75, 1]
    np.testing.assert_allclose(found[:, 1], [0, 0.05, 0.05, 0.55, 0.8])
    np.testing.assert_allclose(found[:, 2], [0.2, 0.45, 0.45, 0.95, 1])


def test_without_a_band_there_are_no_bounds() -> None:
    found = empirical_cdf(np.array([1.0, 2.0]), np.array([[1.0, np.nan, np.nan]]), np.array([1.5]))
    assert found[0, 0] == 0.5
    assert np.isnan(found[0, 1:]).all()
