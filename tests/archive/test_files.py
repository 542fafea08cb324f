"""Files in an archive: the same bytes come out, in one folder and nowhere else."""

import base64
import hashlib
import os
import subprocess
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uqpen.archive.files import (
    ArchivedFile,
    archived_files,
    extract_files,
    files_by_name,
    files_group,
)
from uqpen.archive.netcdf import write_tree
from uqpen.archive.read import read_group, read_tree
from uqpen.core.errors import ArchiveError
from uqpen.core.files import LARGEST, FileSnapshot

CONTENTS = [
    b"",
    b"seed = 1\n",
    b"with\r\nother ends\r",
    "\ufeffGröße".encode(),
    b"a\0b",
    bytes(range(256)),
    b"\xed\xa0\x80",
    b"x" * LARGEST,
]


def kept(name, content=b"content"):
    digest = hashlib.sha256(content).hexdigest()
    return ArchivedFile(name, digest, len(content), base64.b64encode(content).decode(), "base64")


@pytest.mark.parametrize("content", CONTENTS, ids=range(len(CONTENTS)))
def test_what_is_read_is_what_was_kept(content, tmp_path):
    import xarray as xr

    file = FileSnapshot.from_content(tmp_path / "a", content)
    tree = xr.DataTree.from_dict(
        {"/": xr.Dataset(attrs={"uqpen_schema": 1}), "/files": files_group([file], tmp_path)}
    )
    write_tree(tree, tmp_path / "a.nc")
    (read,) = archived_files(read_group(read_tree(tmp_path / "a.nc"), "files"))
    assert read.read() == content
    with extract_files([read], tmp_path) as place:
        assert (place.folder / "a").read_bytes() == content
    assert not place.folder.exists()


def test_what_is_too_large_is_kept_by_its_hash(tmp_path):
    file = FileSnapshot.from_content(tmp_path / "a", b"x" * (LARGEST + 1))
    (read,) = archived_files(files_group([file], tmp_path))
    assert (read.content, read.encoding, read.size) == ("", "none", LARGEST + 1)
    assert not read.is_whole


def test_no_name_tells_a_path_of_the_machine(tmp_path):
    folder = tmp_path / "study"
    elsewhere = ("/elsewhere/a.csv", "/elsewhere/d.csv", "/other/a.csv")
    names = ["a.csv", "sub/b.csv", "../c.csv", *elsewhere]
    files = [FileSnapshot.from_content(folder / name, b"") for name in names]
    found = [*files_by_name([*files, *files], folder)]
    assert found == ["a.csv", "sub/b.csv", "../c.csv", "a-2.csv", "d.csv", "a-3.csv"]


def test_the_order_is_that_of_the_names(tmp_path):
    files = [FileSnapshot.from_content(tmp_path / name, b"") for name in ("b", "a/c", "B")]
    in_both = [
        files_group(order, tmp_path)["name"].values.tolist() for order in (files, files[::-1])
    ]
    assert in_both == [["B", "a/c", "b"]] * 2
    assert not files_group([], tmp_path).variables


_PARTS = (
    *("..", ".", "", "a", "b", "a.py", "~", "$HOME", "nul", "C:", "\0", "\n", "\ud800", "x" * 256),
)
_NAMES = st.one_of(
    st.text(max_size=12), st.lists(st.sampled_from(_PARTS), max_size=6).map("/".join)
)


@pytest.mark.slow
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(names=st.lists(_NAMES, max_size=4))
def test_no_name_leads_out_of_the_folder(names, tmp_path_factory):
    outside = tmp_path_factory.getbasetemp() / "outside"
    inside = outside / "inside"
    inside.mkdir(parents=True, exist_ok=True)
    before = tempfile.tempdir
    tempfile.tempdir = str(inside)
    try:
        with extract_files([kept(name) for name in names], outside) as place:
            (root,) = inside.iterdir()
            written = [Path(top, each) for top, _, files in os.walk(outside) for each in files]
            assert all(root in path.parents for path in written)
            assert all(path.read_bytes() == b"content" for path in written)
            assert bool(written) == bool(names)
            for name in names:
                assert (place.folder / name).read_bytes() == b"content"
    except ArchiveError:
        pass
    finally:
        tempfile.tempdir = before
    assert [*outside.iterdir()] == [inside]
    assert [*inside.iterdir()] == []


@pytest.mark.parametrize(
    ("files", "reported"),
    [
        ([kept("")], "'': is not the name of a file that a study could name"),
        ([kept("/etc/passwd")], "'/etc/passwd': is not the name of a file"),
        ([kept("a/")], "'a/': is not the name of a file"),
        ([kept("../" * 17 + "a")], "is not the name of a file"),
        ([kept("a\0")], "'a\\x00': is not the name of a file"),
        ([kept("..")], "'..': is not the name of a file"),
        ([kept("n" * 256)], "is not the name of a file"),
        ([kept("a"), kept("./a", b"other")], '"./a": two files are to lie in the same place'),
        ([kept("a"), kept("b/../a", b"other")], '"b/../a": two files are to lie in the same'),
        ([kept("a"), kept("a/b")], '"a/b": File exists'),
        ([kept("a/b"), kept("a")], '"a": two files are to lie in the same place'),
    ],
)
def test_what_cannot_be_in_a_folder_is_reported(files, reported, tmp_path):
    with pytest.raises(ArchiveError) as raised, extract_files(files, tmp_path):
        pass
    assert reported in str(raised.value)


def test_the_same_file_twice_is_one_file(tmp_path):
    with extract_files([kept("a"), kept("./a")], tmp_path) as place:
        assert [path.name for path in place.folder.iterdir()] == ["a"]


def test_a_program_can_be_executed(tmp_path):
    with extract_files([kept("a.sh", b"#!/bin/sh\necho done\n")], tmp_path) as place:
        done = subprocess.run([place.folder / "a.sh"], capture_output=True, check=True)
    assert done.stdout == b"done\n"


def test_a_link_that_lies_around_is_not_followed(tmp_path):
    # Large files are looked for there; what is written is written elsewhere.
    (tmp_path / "a").symlink_to(tmp_path / "target")
    with extract_files([kept("a")], tmp_path) as place:
        assert not (place.folder / "a").is_symlink()
    assert not (tmp_path / "target").exists()
