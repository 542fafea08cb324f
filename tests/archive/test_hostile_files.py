"""Files that the HDF5 library must not get, and files that it gets.

Those of tests/data/hostile were made by the script beside them.
"""

import gzip
import os
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from uqpen.archive.hashes import append_checksum, is_broken
from uqpen.archive.read import is_archive, open_archive
from uqpen.core.errors import ArchiveError
from uqpen.core.netcdf.hdf5 import ARCHIVE_LIMITS, RefusedContentError
from uqpen.core.netcdf.opening import check_netcdf

HOSTILE = Path(__file__).parents[1] / "data" / "hostile"

_SIZE = "with its variable /x it takes over 17 MB of memory, and has"
_WRONG = "has another type or number of values, at /x"
REASONS = {
    "float16": "its variable /x has the type float16",
    "long_double": "its variable /x has the type float128",
    "enumeration": "its variable /x has a type that is an enumeration",
    "compound": "its variable /x has a type that is a compound",
    "type": "its /x is a data type of its own",
    "dimension_list": f"its attribute DIMENSION_LIST {_WRONG}",
    "dimension_number": f"its attribute _Netcdf4Dimid {_WRONG}",
    "coordinate_numbers": f"its attribute _Netcdf4Coordinates {_WRONG}",
    "many_attributes": "its attribute a17 has the type float16, at /",
    "external_storage": "its variable /x refers to another file",
    "external_link": "it refers to another file (from x)",
    "many_links": "it refers to another file (from g60)",
    "soft_link": "it has a link to a path (x)",
    "two_names": "it has /a under two names",
    "virtual": "its variable /x refers to other files",
    "filter": "its variable /x is compressed by filter 32000, lzf",
    "unwritten": f"{_SIZE} 0.0 MB itself",
    "unwritten_chunks": f"{_SIZE} 0.0 MB itself",
    "zeros": f"{_SIZE} 0.1 MB itself",
}


def find_refusal(path, limits=ARCHIVE_LIMITS):
    try:
        check_netcdf(path.read_bytes(), limits)
    except RefusedContentError as error:
        return str(error)
    return None


@pytest.fixture
def hostile(request, tmp_path):
    path = tmp_path / f"{request.param}.nc"
    path.write_bytes(gzip.decompress((HOSTILE / f"{request.param}.nc.gz").read_bytes()))
    return path


def test_every_hostile_file_is_tried():
    assert {file.name.removesuffix(".nc.gz") for file in HOSTILE.glob("*.gz")} == set(REASONS)


@pytest.mark.parametrize("hostile", REASONS, indirect=True)
@pytest.mark.parametrize("is_signed", [False, True])
def test_it_is_refused_in_words(hostile, is_signed):
    """A right checksum proves nothing about who wrote the bytes before it."""
    if is_signed:
        append_checksum(hostile)
        assert not is_broken(hostile)
    with pytest.raises(ArchiveError) as caught:
        open_archive(hostile)
    reason = REASONS[hostile.stem]
    assert str(caught.value) == f"{hostile}: is not an archive of uqpen's: {reason}"
    assert not is_archive(hostile)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.nc")
    with pytest.raises(ArchiveError, match=r"is not an archive of uqpen's: it is not a file\Z"):
        open_archive(tmp_path / "pipe.nc")


@pytest.mark.parametrize(
    ("limit", "what"),
    [
        ("groups", "it has more than 3 groups"),
        ("variables", "it has more than 3 variables"),
        ("in_group", "it has more than 3 variables in one group"),
        ("attributes", "it has more than 3 attributes of one object, at /"),
        ("depth", "it has groups more than 3 deep"),
    ],
)
def test_numbers_of_objects_are_limited(limit, what, tmp_path):
    """The limits are made small here, since files beyond them take long to make."""
    path = tmp_path / "many.nc"
    with netCDF4.Dataset(path, "w") as root:
        root.createGroup("a/b/c/d")
        root.setncatts({f"a{number}": 1 for number in range(4)})
        for number in range(4):
            root.createVariable(f"v{number}", "f8", ())[...] = 1
    assert find_refusal(path) is None
    assert find_refusal(path, replace(ARCHIVE_LIMITS, **{limit: 3})) == what


@pytest.mark.parametrize("compression", [None, "zlib"])
def test_what_netcdf_software_writes_is_read(compression, tmp_path):
    """Enough groups and attributes for indexes of several levels, and attributes of any length."""
    path = tmp_path / "large.nc"
    with netCDF4.Dataset(path, "w") as root:
        root.createDimension("n", 50)
        root.createDimension("endless", None)
        for number in range(400):
            root.createGroup(f"group_{number}").setncattr("long", "x" * (number * 300))
        for kind in ("i1", "u2", "i4", "i8", "f4", "f8"):
            root.createVariable(kind, kind, ("n",), compression=compression)[:] = np.arange(50)
        root.createVariable("text", str, ("n",))[:] = np.array(["é"] * 50, dtype=object)
        root.createVariable("none", "f8", ("endless",))
        root["f8"].setncatts({f"attribute_{number}": ["a", "b"] for number in range(200)})
    assert find_refusal(path) is None


def test_a_cut_file_is_refused_at_any_length(tmp_path):
    path = tmp_path / "whole.nc"
    with netCDF4.Dataset(path, "w") as root:
        root.createDimension("n", 5)
        root.createVariable("x", str, ("n",))[:] = np.array(["text"] * 5, dtype=object)
    data = path.read_bytes()
    assert find_refusal(path) is None
    for length in range(0, len(data) - 1, 97):
        path.write_bytes(data[:length])
        with pytest.raises(ArchiveError):
            open_archive(path)


def test_any_changed_byte_is_read_or_refused(tmp_path):
    """The inspection raises nothing but what it says; the library is not asked."""
    path = tmp_path / "whole.nc"
    with netCDF4.Dataset(path, "w") as root:
        root.createDimension("n", 5)
        root.createGroup("g").setncattr("a", 1)
        root.createVariable("x", str, ("n",))[:] = np.array(["text"] * 5, dtype=object)
    data = path.read_bytes()
    random = np.random.default_rng(1)
    refused = 0
    for at in random.integers(len(data), size=1000).tolist():
        changed = bytearray(data)
        changed[at] = random.integers(256)
        changed[min(at + 1, len(data) - 1)] = random.choice([0, changed[at], 255])
        path.write_bytes(changed)
        refused += find_refusal(path) is not None
    assert refused > 100
