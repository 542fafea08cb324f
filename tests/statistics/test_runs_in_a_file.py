"""Analyses take a handle to runs, which may be those of a file."""

import netCDF4
import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.core.blocks import BlockedRuns, LoadedDataset
from uqpen.core.labels import FAILED_RUN, RUN, SAMPLING, WEIGHT
from uqpen.execution import status_counts
from uqpen.statistics import ANALYSES, INPUT_ANALYSES
from uqpen.statistics.analyze import analyze, analyze_failures
from uqpen.statistics.run_samples import samples_of
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis

pytestmark = pytest.mark.processor

STUDY = study_text(
    "ishigami",
    seed=3,
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    constraints={"keep": ["x1 < 2.5"]},
    outputs={"y": {"exceeds": [5], "hold": [0.9]}},
    designs={
        "monte_carlo": {"kind": "monte-carlo", "runs": 600},
        "sobol": {"kind": "sobol-sequence", "runs": 512, "replicates": 8},
        "one_hypercube": {"kind": "latin-hypercube", "runs": 300, "replicates": 1},
        "pick_freeze": {"kind": "saltelli", "base": 32},
        "morris": {"kind": "morris", "trajectories": 12},
        "quadrature": {"kind": "quadrature", "order": 5},
    },
)
DESIGNS = ["monte_carlo", "sobol", "one_hypercube", "pick_freeze", "morris", "quadrature"]


class RunsInFile(BlockedRuns):
    """Runs of a design in an archive, read from the file part by part."""

    def __init__(self, path, design):
        self._file = netCDF4.Dataset(path)
        self._group = self._file["runs"][design]
        self.columns = set()

    def close(self):
        self._file.close()

    @property
    def size(self):
        return len(self._group.dimensions[RUN])

    def read(self, start, stop):
        failed = np.empty(0, dtype=np.int64)
        if FAILED_RUN in self._group.variables:
            numbers = np.asarray(self._group[FAILED_RUN][:])
            failed = np.flatnonzero((numbers >= start) & (numbers < stop))
        places = {RUN: slice(start, stop), FAILED_RUN: failed}
        variables = {}
        for name, each in self._group.variables.items():
            at = tuple(places.get(dim, slice(None)) for dim in each.dimensions)
            values = np.asarray(each[at])
            own = {key: each.getncattr(key) for key in each.ncattrs() if key != "coordinates"}
            variables[name] = (each.dimensions, values, own)
        labels = {*self._group.dimensions, "replicate", "block", "matrix", "position", "round"}
        labels |= {"moved_input", "moved_by", "moved_uncertainty", "quadrature_weight", WEIGHT}
        attributes = {key: self._group.getncattr(key) for key in self._group.ncattrs()}
        return xr.Dataset(variables, attrs=attributes).set_coords(labels & variables.keys())

    def column(self, name):
        self.columns.add(name)
        return np.asarray(self._group[name][:])


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("archive") / "study.nc"
    uqpen.make_archive(uqpen.parse_study(STUDY), path)
    return path


@pytest.fixture
def handle(archive, request):
    runs = RunsInFile(archive, request.param)
    yield runs
    runs.close()


def loaded(archive, design):
    return uqpen.open_archive(archive)[f"runs/{design}"].to_dataset(inherit=False)


def width(sample, quantity):
    """A user-defined analysis, which takes all points."""
    from uqpen.statistics.estimate import Estimate

    spread = float(np.ptp(sample.points[sample.used], axis=0).sum())
    estimate = Estimate.without_bounds(spread, "none")
    yield "width", estimate.to_array(units="1", long_name="width of the points")


@pytest.mark.parametrize(("handle", "design"), [(d, d) for d in DESIGNS], indirect=["handle"])
def test_estimates_are_those_of_runs_in_memory_to_the_bit(archive, handle, design):
    quantities = uqpen.parse_study(STUDY).quantities_of_interest
    user_defined = [UserDefinedAnalysis("width.py:width", width)]
    runs = loaded(archive, design)
    here = analyze(runs, quantities, user_defined=user_defined)["y"]
    there = analyze(handle, quantities, user_defined=user_defined)["y"]
    assert here.keys() == there.keys()
    assert here.keys() >= ({"mu"} if design == "morris" else {"mean"})
    for name, array in here.items():
        assert array.identical(there[name]), name
    failures = analyze_failures(handle)
    for name, array in analyze_failures(runs).items():
        assert array.identical(failures[name]), name
    assert status_counts(handle) == status_counts(runs)


@pytest.mark.parametrize("handle", ["monte_carlo"], indirect=True)
def test_blocks_of_a_file_are_those_in_memory(archive, handle, monkeypatch):
    monkeypatch.setattr("uqpen.core.blocks.BLOCK", 256)
    runs = LoadedDataset(loaded(archive, "monte_carlo"))
    assert handle.size == runs.size == 600
    for here, there in zip(runs.blocks(), handle.blocks(), strict=True):
        assert here.sizes[RUN] == there.sizes[RUN]
        for name in here.variables:
            assert here.variables[name].equals(there.variables[name]), name
    assert len(handle.dataset()[FAILED_RUN]) == len(runs.dataset()[FAILED_RUN]) > 0
    assert handle.attrs[SAMPLING] == runs.attrs[SAMPLING]


INPUTS = {"x1", "x2"}


@pytest.mark.parametrize(
    ("handle", "only"),
    [(design, name) for design in ("monte_carlo", "sobol") for name in ANALYSES],
    indirect=["handle"],
)
def test_an_analysis_reads_no_more_than_it_declares(handle, only):
    quantities = uqpen.parse_study(STUDY).quantities_of_interest
    analyze(handle, quantities, only=[only])
    assert handle.columns & INPUTS == (INPUTS if only in INPUT_ANALYSES else set())
    assert handle.columns - INPUTS <= {"y", "status", "replicate"}


@pytest.mark.parametrize("handle", ["monte_carlo"], indirect=True)
def test_points_are_put_together_when_they_are_needed(handle):
    one, other = samples_of(handle, ["y", "status"]).values()
    assert one.inputs == ("x1", "x2")
    assert not handle.columns & INPUTS
    assert one.points.shape == (600, 2)
    assert one.points is other.points, "outputs have them in common"
    assert np.array_equal(one.points[:, 1], handle.column("x2"))
    with pytest.raises(ValueError, match="read-only"):
        one.points[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        other.columns[0][0] = 1.0
