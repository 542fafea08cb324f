"""Which of the finished runs of a design are a sample, while it runs."""

import numpy as np
import pytest
import xarray as xr

from uqpen.core.labels import REPLICATE, RUN, SAMPLING, STATUS
from uqpen.core.sampling import Sampling
from uqpen.statistics.convergence import first_runs, sample_so_far


def runs_of(numbers, sampling, replicates=None):
    size = len(numbers)
    runs = xr.Dataset(
        {"x": (RUN, np.arange(size) / 7.0), STATUS: (RUN, np.zeros(size, dtype=np.int8))},
        {RUN: numbers},
        {SAMPLING: str(sampling)},
    )
    runs["x"].attrs["role"] = "input"
    return runs if replicates is None else runs.assign_coords({REPLICATE: (RUN, replicates)})


def test_runs_behind_one_that_is_not_finished_are_left_out():
    """Else runs that take long would be too rare."""
    finished = runs_of([0, 1, 2, 4, 5], Sampling.INDEPENDENT).assign(
        {"lost_run": ("lost_run", [1, 4]), "lost_reason": ("lost_run", ["a", "b"])}
    )
    first = first_runs(finished)
    assert first[RUN].values.tolist() == [0, 1, 2]
    assert first["lost_reason"].values.tolist() == ["a"]
    assert first_runs(runs_of([1, 2], Sampling.INDEPENDENT)).sizes[RUN] == 0


def test_independent_draws_are_a_sample_from_20_on():
    few = sample_so_far(runs_of([*range(19)], Sampling.INDEPENDENT), is_complete=False)
    assert few.runs is None
    assert few.reason == "fewer than 20 of its first runs are finished"
    some = sample_so_far(runs_of([*range(20)], Sampling.INDEPENDENT), is_complete=False)
    assert some.runs is not None
    assert (some.runs.sizes[RUN], some.reason) == (20, "")


@pytest.mark.parametrize(
    ("replicates", "used"),
    [([0, 0, 0], 0), ([0, 0, 0, 1, 1], 0), ([0, 0, 1, 1], 4), ([0, 0, 1, 1, 2], 4)],
)
def test_of_replicates_only_complete_ones_are_used(replicates, used):
    runs = runs_of([*range(len(replicates))], Sampling.STRATIFIED, replicates)
    sample = sample_so_far(runs, is_complete=False)
    assert (0 if sample.runs is None else sample.runs.sizes[RUN]) == used
    assert ("fewer than two complete replicates" in sample.reason) == (not used)


@pytest.mark.parametrize(
    ("sampling", "reason"),
    [
        (Sampling.PICK_FREEZE, "a part of them is no sample"),
        (Sampling.GIVEN, "not declared independent"),
        (Sampling.QUADRATURE, "not a sample"),
        (Sampling.TRAJECTORIES, "not a sample"),
        (Sampling.ONE_AT_A_TIME, "not a sample"),
        (Sampling.STRATIFIED, "no part is a stratified set"),
    ],
)
def test_other_designs_say_why_a_part_of_them_has_no_estimates(sampling, reason):
    sample = sample_so_far(runs_of([*range(50)], sampling), is_complete=False)
    assert sample.runs is None
    assert reason in sample.reason


@pytest.mark.parametrize("sampling", [Sampling.GIVEN, Sampling.STRATIFIED])
def test_a_whole_sample_is_used_whatever_its_parts_are(sampling):
    sample = sample_so_far(runs_of([*range(5)], sampling), is_complete=True)
    assert sample.runs is not None
