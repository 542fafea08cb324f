"""Hashes of groups: the same wherever they are computed, another for every change."""

import numpy as np
import pytest
import xarray as xr
from hashed_trees import with_hashes

from uqpen.archive.hashes import group_hashes, recorded_hashes
from uqpen.archive.netcdf import write_tree
from uqpen.archive.read import read_tree


def tree_of(order="<"):
    values = np.array([1.5, np.nan, -0.0], dtype=f"{order}f8")
    group = xr.Dataset(
        {"a": ("run", values, {"units": "m"}), "kind": ("run", np.array([1, 2, 3], np.int8))},
        {"name": ("run", np.array(["ä", "", "c"], dtype=object))},
        {"one": 3, "several": ["x", "y"], "real": 0.5},
    )
    root = xr.Dataset(attrs={"uqpen_schema": 1, "study_text": "seed = 1\n"})
    return xr.DataTree.from_dict({"/": root, "/outer/inner": group})


def test_they_are_those_of_the_file(tmp_path):
    tree = tree_of()
    write_tree(with_hashes(tree), tmp_path / "a.nc")
    read = read_tree(tmp_path / "a.nc")
    assert group_hashes(tree) == group_hashes(read) == recorded_hashes(read)
    assert set(group_hashes(tree)) == {"/", "/outer", "/outer/inner"}
    assert recorded_hashes(tree) == {}, "what is written is not touched"


def test_they_do_not_depend_on_the_order_of_bytes():
    assert group_hashes(tree_of("<")) == group_hashes(tree_of(">"))


def test_they_stay_what_they_are():
    # Those of archives that have been written must be found by every later version.
    assert {path: digest[:8] for path, digest in group_hashes(tree_of()).items()} == {
        "/": "ce2c0ad6",
        "/outer": "ac65cbb9",
        "/outer/inner": "6269b380",
    }


def _set(path, name, position, value):
    def change(tree):
        tree[path][name].values[position] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        _set("outer/inner", "a", 2, 0.0),
        _set("outer/inner", "a", 0, np.nextafter(1.5, 2)),
        _set("outer/inner", "kind", 0, 2),
        _set("outer/inner", "name", 1, " "),
        lambda tree: tree["outer/inner"].attrs.update(one=4),
        lambda tree: tree["outer/inner"].attrs.update(several=["xy"]),
        lambda tree: tree["outer/inner"]["a"].attrs.update(units="cm"),
        lambda tree: tree["outer/inner"].attrs.pop("real"),
    ],
)
def test_every_change_of_a_group_changes_its_own_only(change):
    tree = tree_of()
    before = group_hashes(tree)
    change(tree)
    after = group_hashes(tree)
    assert [path for path in before if before[path] != after[path]] == ["/outer/inner"]


def test_that_of_the_root_covers_the_study():
    tree = tree_of()
    before = group_hashes(tree)
    tree.attrs["study_text"] += " "
    assert group_hashes(tree)["/"] != before["/"]
