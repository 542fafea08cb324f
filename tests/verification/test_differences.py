"""Differences of groups: in the order of the archive, and of fields with a place."""

import numpy as np
import xarray as xr

from uqpen.core.labels import BOUND, BOUNDS
from uqpen.verification.check_result import find_differences
from uqpen.verification.diff import disjoint_intervals

TIME = xr.Variable("time", [0.0, 86_400.0, 172_800.0], {"units": "s", "display_units": "day"})


def group(**apart):
    """Estimates 1, with an interval of 0.1 to both sides, moved at some places."""
    sides = np.array([0.0, -0.1, 0.1])
    own = {"time": TIME, "probability": [0.5], BOUND: list(BOUNDS)}
    mean, quantile = (np.array(apart.get(name, 3 * [1.0])) for name in ("mean", "quantile"))
    return xr.Dataset(
        {
            "mean": (("time", BOUND), mean[:, None] + sides, {"units": "m"}),
            "quantile": (("time", "probability", BOUND), quantile[:, None, None] + sides),
        },
        own,
    )


def test_there_is_a_line_for_each_statistic_with_its_first_place():
    other = group(mean=[1.0, 2.0, 2.0], quantile=[1.0, 1.0, 3.0])
    assert list(disjoint_intervals(group(), other)) == [
        "mean at time = 1 day: 1.00 ± 0.10 and 2.00 ± 0.10 m; 2 of 3 are apart",
        "quantile at time = 2 day, probability = 0.5: 1.00 ± 0.10 and 3.00 ± 0.10; "
        "1 of 3 are apart",
    ]
    assert not list(disjoint_intervals(group(), group()))


def test_differences_come_in_the_order_of_the_archive():
    names = ["mean", "std", "skewness", "kurtosis", "quantile", "delta", "spearman", "pearson"]
    one, other = (
        xr.Dataset({name: ("entry", np.full(2, value)) for name in names}) for value in (1.0, 2.0)
    )
    assert [each.what.partition(":")[0] for each in find_differences(one, other)] == names


def test_differences_say_how_many_entries_differ():
    values = {"mean": ("entry", np.array([1.0, 1.0])), "std": ((), 1.0), "delta": ("entry", [2, 2])}
    one = xr.Dataset(values)
    other = one.assign(mean=("entry", [1.0, 2.0]), std=((), 2.0), delta=("entry", [1, 1]))
    assert [each.what for each in find_differences(one, other)] == [
        "mean: 1 of 2 entries differs by up to 0.5 of the largest value",
        "std: the value differs by up to 0.5 of the largest value",
        "delta: 2 of 2 entries differ",
    ]
