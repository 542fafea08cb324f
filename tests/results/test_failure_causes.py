"""Reasons that differ in their numbers alone are one cause."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from uqpen.core.status import Status
from uqpen.results.failure_causes import failure_causes, without_numbers


@pytest.mark.parametrize(
    ("reason", "cause"),
    [
        ("residual 5.3e-4", "residual …"),
        ("residual -5.3E+04 after 50", "residual … after …"),
        ("x is nan, y is -inf", "x is …, y is -…"),
        ("x2 of level_3 is 1", "x2 of level_3 is …"),
        ("at (0.5, .25)", "at (…, …)"),
        ("no number", "no number"),
    ],
)
def test_numbers_are_masked_and_names_are_not(reason: str, cause: str) -> None:
    assert without_numbers(reason) == cause


def test_causes_are_counted_over_designs() -> None:
    def runs(numbers: list[int], reasons: list[str], statuses: list[Status]) -> xr.Dataset:
        status = np.zeros(10, dtype=np.int8)
        status[numbers] = statuses
        return xr.Dataset(
            {"status": ("run", status), "lost_reason": ("lost_run", reasons)},
            {"run": np.arange(10), "lost_run": numbers},
        )

    one = runs([1, 4], ["residual 1.0", "took 3 s"], [Status.FAILED, Status.TIMED_OUT])
    other = runs([7, 8], ["residual 2.0", "residual 3.0"], [Status.FAILED, Status.FAILED])
    without = xr.Dataset({"status": ("run", [0])}, {"run": [0]})
    first, second = failure_causes([one, without, other])
    assert first == (Status.FAILED, "residual …", "residual 1.0", 3)
    assert second == (Status.TIMED_OUT, "took … s", "took 3 s", 1)
