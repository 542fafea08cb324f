"""Work of the statistics, counted: it follows from inputs, outputs and runs, not from the clock."""

import tracemalloc
import weakref
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from uqpen.archive import estimates
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.statistics import run_samples
from uqpen.statistics.analyze import analyze
from uqpen.statistics.input_columns import Ordering
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.sensitivity.local_regression import RegressionBins

INPUTS, OUTPUTS = ("a", "b", "c"), ("y", "z")
QUANTITIES = [QuantityOfInterest(Output(name, "m"), "m") for name in OUTPUTS]


def runs_of(size, *, failed=0):
    generator = np.random.default_rng(size)
    points = {name: generator.random(size) for name in INPUTS}
    y = points["a"] + points["b"] * points["c"]
    columns = {name: ("run", values, {"role": "input"}) for name, values in points.items()}
    columns |= {"y": ("run", y), "z": ("run", np.exp(y))}
    status = np.where(np.arange(size) < failed, 2, 0).astype(np.int8)
    attributes = {"sampling": str(Sampling.INDEPENDENT)}
    return xr.Dataset({**columns, "status": ("run", status)}, attrs=attributes)


@pytest.mark.parametrize("failed", [0, 30])
def test_each_column_is_ordered_once(failed, monkeypatch):
    counted = Counter[str]()
    order_of, unique = Ordering.of, np.unique

    def ordered(values):
        counted["ordered"] += 1
        return order_of(values)

    runs = runs_of(700, failed=failed)
    columns = [runs[name].values[failed:] for name in (*INPUTS, *OUTPUTS)]

    def searched(values, **options):
        is_column = any(np.array_equal(np.sort(values), np.sort(each)) for each in columns)
        counted["searched for distinct values"] += is_column
        return unique(values, **options)

    monkeypatch.setattr(Ordering, "of", ordered)
    monkeypatch.setattr(np, "unique", searched)
    analyze(runs, QUANTITIES, only=["moments", "quantiles", "cdfs", "sensitivity"])
    assert counted["ordered"] == len(INPUTS) + len(OUTPUTS)
    assert counted["searched for distinct values"] == 0


def peak_in_columns(runs):
    """The peak of allocations of an analysis, in columns of floats."""
    tracemalloc.start()
    try:
        analyze(runs, QUANTITIES)
        return tracemalloc.get_traced_memory()[1] / runs.sizes["run"] / 8
    finally:
        tracemalloc.stop()


def test_memory_of_an_analysis_is_a_few_columns():
    analyze(runs_of(200), QUANTITIES)  # imports
    # Measured: 40.5 columns of floats, for 3 inputs and 2 outputs.
    assert peak_in_columns(runs_of(65_536)) < 45


def test_memory_of_an_analysis_does_not_grow_with_its_thresholds():
    runs, peaks = runs_of(8192), []
    for number in (2, 2, 60):  # the first imports
        limits = tuple(Threshold(f"{at} m", at) for at in np.linspace(0.2, 1.2, number).tolist())
        tracemalloc.start()
        analyze(runs, [replace(QUANTITIES[0], thresholds=limits)], only=["sensitivity"])
        peaks.append(tracemalloc.get_traced_memory()[1] / runs.sizes["run"] / 8)
        tracemalloc.stop()
    # In columns of floats, of which each threshold would keep two or more.
    assert peaks[2] - peaks[1] < 20


def test_the_values_of_an_output_end_before_those_of_the_next_are_taken(monkeypatch):
    taken = []
    alive = []
    with_variable = run_samples._with_variable

    def found(whole, runs, name):
        alive.append(sum(each() is not None for each in taken))
        sample = with_variable(whole, runs, name)
        taken.append(weakref.ref(sample.values))
        return sample

    monkeypatch.setattr(run_samples, "_with_variable", found)
    analyze(runs_of(700, failed=30), QUANTITIES)
    assert alive == [0, 0]


def test_bins_are_made_once_for_all_outputs(monkeypatch):
    counted = Counter[int]()
    from_sample = RegressionBins.from_sample

    def made(sample, column, *, halved=False):
        counted[column] += not halved
        return from_sample(sample, column, halved=halved)

    monkeypatch.setattr(RegressionBins, "from_sample", made)
    analyze(runs_of(700), QUANTITIES, only=["sensitivity"])
    assert counted == dict.fromkeys(range(len(INPUTS)), 1)


def test_growing_parts_make_one_array_of_each_statistic(monkeypatch):
    made = Counter[str]()
    array = estimates.estimate_array

    def counted(*values, **described):
        made[described["long_name"]] += 1
        return array(*values, **described)

    monkeypatch.setattr(estimates, "estimate_array", counted)
    found = analyze(runs_of(700), QUANTITIES[:1], only=["convergence"])["y"]
    assert found["convergence_mean"].sizes["runs_so_far"] > 5
    assert set(made.values()) == {1}
