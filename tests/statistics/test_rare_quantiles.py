"""Quantiles and tolerance limits far out, from subset simulation."""

import numpy as np
import pytest
from scipy import special

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.statistics.intervals import runs_needed


def model(a, b):
    y = (a + b) / np.sqrt(2)
    return {"y": y, "z": a}


def failing(a, b):
    made = model(a, b)
    return {**made, "y": np.where((b > 2.5) & (made["y"] > 2), np.nan, made["y"])}


def study(event, *, fails=False, level=0.95, **requests):
    made = failing if fails else model
    return uqpen.Study(
        uqpen.PythonModel(made, {"a": "1", "b": "1"}, {"y": "m", "z": "m"}, vectorized=True),
        {"a": uqpen.Normal(0, 1), "b": uqpen.Normal(0, 1)},
        outputs={"y": uqpen.OutputSpec("m", **requests)},  # type: ignore[arg-type]
        designs={"rare": uqpen.SubsetSimulation(event=event, samples=500)},
        confidence_level=level,
        seed=3,
    )


CONTENTS = (0.99, 0.9999, 0.99999)
# So that the tests of these intervals fail by chance once in a thousand seeds.
LEVEL = 0.999


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study("y > 5 m", level=LEVEL, quantiles=CONTENTS, hold=[*CONTENTS, 1 - 1e-11]))


def test_intervals_contain_the_quantiles_of_the_normal_distribution(tree):
    found = tree["statistics/rare/y"]["quantile"]
    for probability, values in zip(found["probability"].values, found.values, strict=True):
        value, lower, upper = values
        assert lower <= special.ndtri(probability) <= upper, probability
        assert lower <= value <= upper


def test_tolerance_limits_lie_above_them(tree):
    found = tree["statistics/rare/y"]["tolerance_limit"]
    for content, values in zip(CONTENTS, found.values, strict=False):
        assert np.isnan(values[1])
        assert special.ndtri(content) <= values[2]
    assert found["content_runs_needed"].values[1] == runs_needed(0.9999, LEVEL)


def test_what_no_run_reaches_has_no_number(tree):
    reported = archive_json(tree)["designs"]["rare"]["outputs"]["y"]["hold"]["0.99999999999"]
    assert reported["estimate"] is None
    assert reported["note"] == "too far out: the runs do not reach it in all replicates"


def test_the_archive_is_whole_and_tables_show_it(tree):
    assert list(find_faults(tree)) == []
    rows = [label for table in output_tables(tree) for label, _ in table.rows]
    assert "not exceeded, 99.99 %" in rows
    assert "99.999 % quantile" in rows


def test_an_event_below_its_limit_has_the_mirrored_quantiles():
    found = uqpen.run(study("y < -4 m", quantiles=[1e-4], hold_above=[0.9999]))
    statistics = found["statistics/rare/y"]
    value, lower, upper = statistics["quantile"].values[0]
    exact = special.ndtri(1e-4)
    assert lower <= exact <= upper
    assert lower <= value <= upper
    limit = statistics["lower_tolerance_limit"].values[0]
    assert limit[1] <= exact
    assert np.isnan(limit[2])


def test_several_limits_are_refused_with_the_reason():
    found = uqpen.run(study("y > 2.5 m and z > 2 m", hold=[0.9999]))
    reported = archive_json(found)["designs"]["rare"]["outputs"]["y"]["hold"]["0.9999"]
    assert reported["estimate"] is None
    assert (
        reported["note"]
        == "the event has several limits, so its levels are not those of one output"
    )


def test_failed_runs_move_the_upper_end_to_what_they_may_have_given():
    found = uqpen.run(study("y > 2.5 m", fails=True, hold=[0.98, 0.999]))
    limits = found["statistics/rare/y"]["tolerance_limit"].values
    assert limits[0, 2] >= special.ndtri(0.98)
    # More than one run in a thousand fails, so none of the others bounds the value.
    assert np.isnan(limits[1, 2])


def test_nothing_is_computed_that_is_not_requested():
    found = uqpen.run(study("y > 2.5 m"))
    assert "y" not in found["statistics/rare"].children
