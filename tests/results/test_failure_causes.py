"""Reasons that differ in their numbers alone are one cause."""

import numpy as np
import pytest
import xarray as xr

from uqpen.core.status import Status
from uqpen.results.failed_runs import FailedRuns, common_reasons, failure_causes


@pytest.mark.parametrize(
    ("reason", "cause"),
    [
        ("residual {}", "residual #"),
        ("residual -{}E+04 after 50", "residual # after #"),
        ("x2 of level_3 is {}", "x2 of level_3 is #"),
        ("at ({}, 0.25)", "at (#, #)"),
        ("not {} (a.py, line 12: y = f(2, 3))", "not # (a.py, line 12: y = f(2, 3))"),
        ("not {} (a/b 2.py, line 12)", "not # (a/b 2.py, line 12)"),
        ("{} (after 3, line 4) in all", "# (after #, line #) in all"),
    ],
)
def test_numbers_are_masked_and_names_are_not(reason, cause):
    reasons = [reason.format(number) for number in (1.5, 2.5, 3.5, 4.5)]
    assert set(common_reasons(reasons).values()) == {cause}


def test_an_example_does_not_repeat_its_line_of_code():
    place = " (a.py, line 12: y = root(x, 2))"
    found = FailedRuns(Status.FAILED, f"no # m{place}", 5, f"no 2.5 m{place}", "one")
    assert found.text == f"no # m, such as: no 2.5 m{place}"
    assert found._replace(example="").text == f"no # m{place}"


def test_reasons_without_numbers_and_few_exit_codes_stay_as_they_are():
    reasons = ["no number", "exit code 1", "exit code 2", "exit code 139"]
    assert common_reasons(reasons) == dict(zip(reasons, reasons, strict=True))


def test_causes_are_counted_over_designs():
    def runs(numbers, reasons, statuses):
        status = np.zeros(10, dtype=np.int8)
        status[numbers] = statuses
        return xr.Dataset(
            {"status": ("run", status), "lost_reason": ("lost_run", reasons)},
            {"run": np.arange(10), "lost_run": numbers},
        )

    one = runs([1, 4], ["residual 1.0", "took 3 s"], [Status.FAILED, Status.TIMED_OUT])
    other = runs([6, 7, 8], [f"residual {n}.0" for n in (2, 3, 4)], [Status.FAILED] * 3)
    without = xr.Dataset({"status": ("run", [0])}, {"run": [0]})
    first, second = failure_causes([one, without, other])
    assert first == (Status.FAILED, "residual #", 4, "residual 1.0", "")
    assert second == (Status.TIMED_OUT, "took 3 s", 1, "", "")
