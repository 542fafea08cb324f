"""What one part of an archive says of another holds, or is reported; hashes do not show it."""

import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.archive.read import open_archive, read_tree
from uqpen.archive.structure import find_faults
from uqpen.core.errors import ArchiveError
from uqpen.surrogates.archived_surrogate import restore_surrogate

STUDY = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    designs={
        "first": {"kind": "monte-carlo", "runs": 30},
        "second": {"kind": "saltelli", "base": 32},
    },
    surrogates={"chaos": {"kind": "polynomial-chaos", "design": "first", "order": 2}},
)


@pytest.fixture(scope="module")
def whole():
    return uqpen.run(uqpen.parse_study(STUDY))


@pytest.fixture
def tree(whole):
    return whole.copy(deep=True)


def without(group, name):
    return lambda tree: tree[group].__delitem__(name)


def reported(group, name, value):
    return lambda tree: tree[group].attrs.__setitem__(name, value)


def entry(group, position, name):
    def change(tree):
        names = tree[group]["input"].values.tolist()
        names[position] = name
        tree[group].dataset = tree[group].to_dataset().assign_coords(input=names)

    return change


def values(group, name, value):
    return lambda tree: tree[group][name].values.fill(value)


CHAOS = "surrogates/chaos"
FAULTS = {
    "input": (without("runs/second", "x1"), "/runs/second: other inputs or outputs than elsewhere"),
    "output": (without("runs/second", "y"), "/runs/second: other inputs or outputs than elsewhere"),
    "design": (reported(CHAOS, "design", "third"), f"/{CHAOS}: fitted to runs of no design"),
    "check": (reported(CHAOS, "check", "x"), f"/{CHAOS}: checked by runs of no design"),
    "statistics": (without("statistics", "first"), "/runs/first: without a group of statistics"),
    "source": (
        without("surrogates", "chaos"),
        "/statistics/chaos: of what /surrogates does not have",
    ),
    "entry": (
        entry("statistics/second/y", 0, "x9"),
        "/statistics/second/y: of x9, which is no input of the runs",
    ),
    "level": (
        lambda tree: tree["statistics/first/y"]["mean"].attrs.__setitem__("interval_level", 2.0),
        "/statistics/first/y/mean: interval_level is no probability",
    ),
    "not a number": (
        values("runs/first", "y", np.nan),
        "/runs/first: y of a completed run is not finite",
    ),
    "matrix": (
        without("runs/second", "matrix"),
        "/runs/second: no matrix to distinguish its blocks",
    ),
}


def test_a_whole_archive_has_no_faults(whole):
    assert list(find_faults(whole)) == []


@pytest.mark.parametrize("how", FAULTS)
def test_a_broken_reference_is_named(tree, how):
    change, message = FAULTS[how]
    change(tree)
    assert next(find_faults(tree), None) == message


def test_right_hashes_do_not_hide_it(tree, tmp_path):
    FAULTS["design"][0](tree)
    uqpen.write(tree, tmp_path / "study.nc")
    read_tree(tmp_path / "study.nc")
    with pytest.raises(ArchiveError, match=r"study\.nc: is damaged: /surrogates/chaos: fitted to"):
        open_archive(tmp_path / "study.nc")


@pytest.mark.parametrize("degree", [-1, 10**9])
def test_degrees_beyond_the_polynomials_are_refused(tree, degree):
    node = tree["surrogates/chaos/y"]
    degrees = np.full(node["degree"].shape, degree, dtype=np.int64)
    node.dataset = node.to_dataset().assign(degree=(node["degree"].dims, degrees))
    with pytest.raises(ArchiveError, match=r"/surrogates/chaos: is damaged: .* terms of y that"):
        restore_surrogate(tree["surrogates/chaos"], "chaos")


def test_time_grows_with_the_number_of_variables_and_not_with_its_square(tree, monkeypatch):
    """Building a DataArray looks at every variable, so no check builds one for each."""
    many = {f"v{number}": ((), 0.0) for number in range(300)}
    tree["statistics/first/y"].dataset = tree["statistics/first/y"].to_dataset().assign(many)
    built = []
    construct = xr.Dataset._construct_dataarray

    def counted(dataset, name):
        built.append(name)
        return construct(dataset, name)

    monkeypatch.setattr(xr.Dataset, "_construct_dataarray", counted)
    assert list(find_faults(tree)) == []
    assert not [name for name in built if str(name).startswith("v")]
