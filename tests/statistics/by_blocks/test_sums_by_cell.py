"""Sums of variables by cell: those of NumPy's count with weights."""

from __future__ import annotations

import numpy as np
import pytest

from uqpen.statistics.by_blocks.sums_by_cell import sums_by_cell


@pytest.mark.parametrize("runs", [0, 1, 5_000])
def test_it_adds_each_variable_over_each_cell(runs: int) -> None:
    rng = np.random.default_rng(runs)
    cells, variables = rng.integers(0, 40, runs, dtype=np.int32), rng.normal(size=(3, runs))
    sums = sums_by_cell(cells, variables, 40)
    expected = [np.bincount(cells, weights, minlength=40) for weights in variables]
    # Both add in the order of the runs.
    np.testing.assert_array_equal(sums, np.transpose(expected))
