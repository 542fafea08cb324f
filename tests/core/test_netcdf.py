"""NetCDF files of others: what is read, what is refused with which remedy, and by one module."""

import ast
import base64
import gzip
import hashlib
import os
import socket
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from scipy.io import netcdf_file
from study_text import study_text

import uqpen
from uqpen.archive.read import open_archive
from uqpen.core.columns import read_columns
from uqpen.core.errors import ArchiveError, SettingsError, TableError
from uqpen.core.netcdf.hdf5 import ARCHIVE_LIMITS, DATA_LIMITS
from uqpen.core.netcdf.opening import (
    LARGEST_DATA,
    RefusedContentError,
    check_netcdf,
    read_variable,
    read_variables,
)
from uqpen.models.command.output_readers import NetcdfReader, RunFiles, UnreadableError
from uqpen.models.data.data_file import read_data_file

ROOT = Path(__file__).parents[2]
DATA = ROOT / "tests" / "data"
SECRET = "8 bytes of a local file that no reader of numbers may show, or so"

A = np.linspace(1, 2, 20)


LIBRARIES = {"netCDF4", "h5py", "h5netcdf"}
FUNCTIONS = {
    *("open_dataset", "open_datatree", "open_mfdataset", "open_groups", "open_dataarray"),
    *("load_dataset", "load_dataarray", "netcdf_file"),
}


def test_one_module_opens_netcdf_files():
    """Types apart, netCDF4 is imported there alone; xarray opens no file."""
    found = set()
    for path in (ROOT / "uqpen").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if not any(word in text for word in (*LIBRARIES, *FUNCTIONS)):
            continue
        tree = ast.parse(text)
        for node in ast.walk(tree):
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                node.body = []
        for node in ast.walk(tree):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [str(node.module)]
            is_reading = isinstance(node, ast.Attribute) and node.attr in FUNCTIONS
            if is_reading or LIBRARIES & {name.split(".")[0] for name in names}:
                found.add(path.relative_to(ROOT / "uqpen").as_posix())
    assert found == {"core/netcdf/opening.py"}


def stored(folder, name):
    path = folder / f"{Path(name).name}.nc"
    path.write_bytes(gzip.decompress((DATA / f"{name}.nc.gz").read_bytes()))
    return path


# What a file needs to be read, by the message of a table. Points to predict, measurements,
# coordinates and a table in an archive are read as tables are.
HOSTILE = {
    "float16": "store it as float64",
    "long_double": "store it as float64",
    "enumeration": "store its values as numbers",
    "compound": "store its values as numbers",
    "type": "store its values as numbers",
    "filter": 'copy it by "nccopy -d 1 in.nc out.nc"',
    "dimension_list": "",
    "dimension_number": "",
    "coordinate_numbers": "",
    "many_attributes": "store it as float64",
    "external_storage": "",
    "external_link": "",
    "many_links": "",
    "soft_link": "",
    "two_names": "",
    "virtual": "",
    "unwritten": "",
    "unwritten_chunks": "",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_refused_by_each_reader(name, tmp_path):
    (tmp_path / "secret.txt").write_text(SECRET)
    path = stored(tmp_path, f"hostile/{name}")
    with pytest.raises(
        TableError, match=f'"{name}.nc" cannot be read as NetCDF: (its?|with) '
    ) as caught:
        read_columns(path)
    assert str(caught.value).endswith(HOSTILE[name])
    found = f"found {name}.nc, which cannot be read as NetCDF: (its?|with) .*expected a NetCDF file"
    with pytest.raises(SettingsError, match=found):
        read_data_file(path)
    with pytest.raises(UnreadableError, match=f"{name}.nc cannot be read as NetCDF: (its?|with) "):
        NetcdfReader(path.name, variable="x").values(RunFiles(tmp_path))
    with pytest.raises(ArchiveError, match=r"is not an archive of uqpen's: (its?|with) "):
        open_archive(path)


def test_a_constant_column_may_be_far_larger_than_its_file(tmp_path):
    """Of an archive, 17 MB are the limit for so small a file."""
    path = stored(tmp_path, "hostile/zeros")
    (variable,) = read_variables(path.read_bytes())
    assert variable.values().shape == (3_000_000,)
    with pytest.raises(RefusedContentError, match="it takes over 17 MB of memory"):
        check_netcdf(path.read_bytes(), ARCHIVE_LIMITS)


@pytest.mark.parametrize("name", ["h5py_track_order", "h5py_latest"])
def test_a_variable_takes_the_memory_of_its_values_and_of_one_chunk(name, tmp_path):
    """Of 20 values and of 7; the two files describe their chunks in different forms."""
    content = stored(tmp_path, f"netcdf/{name}").read_bytes()
    for memory, first in ((8 * 27 - 1, "/a"), (8 * 27, "/b")):
        limits = replace(DATA_LIMITS, memory=memory, memory_ratio=0)
        with pytest.raises(RefusedContentError, match=f"with its variable {first} it takes over"):
            check_netcdf(content, limits)


class TestWhatIsNoFile:
    def refused(self, path):
        with pytest.raises(TableError, match=f'"{path}" is not a file'):
            read_columns(path)
        with pytest.raises(SettingsError, match=f'"{path}", which is not a file'):
            read_data_file(path)
        with pytest.raises(UnreadableError, match=f"{path.name} is no file"):
            NetcdfReader(path.name, variable="x").values(RunFiles(path.parent))
        with pytest.raises(ArchiveError, match="is not an archive of uqpen's: it is not a file"):
            open_archive(path)

    def test_a_pipe_a_folder_and_a_socket_are_refused(self, tmp_path, monkeypatch):
        os.mkfifo(tmp_path / "pipe.nc")
        self.refused(tmp_path / "pipe.nc")
        (tmp_path / "folder.nc").mkdir()
        self.refused(tmp_path / "folder.nc")
        monkeypatch.chdir(tmp_path)  # a socket's name is short
        with socket.socket(socket.AF_UNIX) as server:
            server.bind("socket.nc")
            self.refused(tmp_path / "socket.nc")

    @pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
    def test_a_device_is_refused_by_way_of_a_link_too(self, device, tmp_path):
        (tmp_path / "device.nc").symlink_to(device)
        self.refused(tmp_path / "device.nc")

    def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(self, tmp_path, monkeypatch):
        """Between the look at a path and its opening, another may take its place."""
        (tmp_path / "file").touch()
        about = (tmp_path / "file").stat()
        os.mkfifo(tmp_path / "pipe.nc")
        monkeypatch.setattr(Path, "stat", lambda _, **__: about)
        with pytest.raises(TableError, match="is not a file"):
            read_columns(tmp_path / "pipe.nc")

    def test_a_link_to_a_file_is_a_file(self, tmp_path):
        (tmp_path / "link.nc").symlink_to(stored(tmp_path, "netcdf/h5netcdf"))
        assert np.array_equal(read_columns(tmp_path / "link.nc").columns[0].load(), A)
        assert read_data_file(tmp_path / "link.nc").rows == A.size
        read = NetcdfReader("link.nc", variable="a").values(RunFiles(tmp_path))
        assert np.array_equal(read, A)

    def test_no_name_of_a_file_is_one_that_is_not_there(self, tmp_path):
        for name in ("a\0b.nc", "a\0b.csv"):
            with pytest.raises(SettingsError, match="found no file"):
                read_data_file(tmp_path / name)
            with pytest.raises(TableError, match="there is no file"):
                read_columns(tmp_path / name)

    def test_a_huge_file_is_refused_before_it_is_read(self, tmp_path):
        with (tmp_path / "huge.nc").open("wb") as stream:
            stream.truncate(LARGEST_DATA + 10**8)
        with pytest.raises(TableError, match=r"it has 2\.1 GB, and at most 2 GB are read"):
            read_columns(tmp_path / "huge.nc")


def by_netcdf4(file_format="NETCDF4", size=20, **options):
    def write(path):
        with netCDF4.Dataset(path, "w", format=file_format) as root:
            root.createDimension("run", size)
            for name, values in (("a", A), ("b", A**2)):
                root.createVariable(name, "f8", ("run",), **options)[:] = values

    return write


def with_texts(**options):
    def write(path):
        by_netcdf4(size=options.pop("size", 20))(path)
        with netCDF4.Dataset(path, "a") as root:
            root.createGroup("more/deep").createVariable("c", "f8", ("run",))[:] = A
            texts = root.createVariable("status", str, ("run",), **options)
            texts[:] = np.array(["ok"] * A.size, dtype=object)

    return write


def with_characters(path):
    by_netcdf4("NETCDF3_CLASSIC")(path)
    with netCDF4.Dataset(path, "a") as root:
        root.createDimension("length", 4)
        letters = root.createVariable("status", "S1", ("run", "length"))
        letters[:] = netCDF4.stringtochar(np.array(["ok"] * A.size, "S4"))


def named_by_characters(path):
    by_netcdf4()(path)
    with netCDF4.Dataset(path, "a") as root:
        root.createDimension("length", 4)
        letters = root.createVariable("run", "S1", ("run", "length"))
        letters[:] = netCDF4.stringtochar(np.array([f"r{each}" for each in range(A.size)], "S4"))


def packed(path):
    with netCDF4.Dataset(path, "w") as root:
        root.createDimension("run", A.size)
        for name, values in (("a", A), ("b", A**2)):
            variable = root.createVariable(name, "i4", ("run",), fill_value=-1)
            variable.setncatts({"scale_factor": 1e-8, "add_offset": 1.0})
            variable[:] = values


def by_xarray(engine, **options):
    hours = np.datetime64("2020-01-01", "ns") + np.arange(A.size) * np.timedelta64(1, "h")
    runs = {"a": ("run", A), "b": ("run", A**2), "large": ("run", A > 1.5), "time": ("run", hours)}
    beside = {"run": np.arange(A.size), "status": ("run", ["ok"] * A.size)}
    dataset = xr.Dataset(runs, beside, {"history": "x" * 1000})
    return lambda path: dataset.to_netcdf(path, engine=engine, **options)


def by_scipy(version):
    def write(path):
        with netcdf_file(path, "w", version=version) as file:
            file.createDimension("run", None if version == 2 else A.size)
            for name, values in (("a", A), ("b", A**2)):
                file.createVariable(name, "d", ("run",))[:] = values

    return write


FORMATS = (
    *("NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA"),
    *("NETCDF4_CLASSIC", "NETCDF4"),
)
GOOD = {
    **{each: by_netcdf4(each) for each in FORMATS},
    **{f"{each} unlimited": by_netcdf4(each, None) for each in FORMATS},
    "zlib": by_netcdf4(zlib=True),
    "shuffle": by_netcdf4(zlib=True, shuffle=True, fletcher32=True),
    "quantised": by_netcdf4(zlib=True, significant_digits=12),
    "packed": packed,
    "texts": with_texts(),
    "texts, unlimited": with_texts(size=None),
    "texts in chunks": with_texts(chunksizes=(7,)),
    "characters": with_characters,
    "coordinate of characters": named_by_characters,
    "xarray": by_xarray("netcdf4"),
    "xarray, unlimited": by_xarray("netcdf4", unlimited_dims=["run"]),
    "xarray by scipy": by_xarray("scipy"),
    "scipy": by_scipy(1),
    "scipy, 64 bits": by_scipy(2),
}
STORED = (
    *("h5py_latest", "h5py_track_order", "h5netcdf", "h5netcdf_legacy"),
    *("xarray_h5netcdf", "xarray_unlimited"),
)


@pytest.mark.parametrize("name", [*GOOD, *STORED])
def test_what_other_software_writes_is_read(name, tmp_path):
    path = tmp_path / "runs.nc"
    if name in GOOD:
        GOOD[name](path)
    else:
        path = stored(tmp_path, f"netcdf/{name}")
    # The last digits are lost by packing and quantising.
    near = {"rtol": 1e-8} if name in ("packed", "quantised") else {"rtol": 0}
    file = read_data_file(path)
    for column, expected in (("a", A), ("b", A**2)):
        np.testing.assert_allclose(file.by_name[column].numbers(), expected, **near)
        read = {each.name: each for each in read_columns(path).columns}
        np.testing.assert_allclose(read[column].load(), expected, **near)
        output = NetcdfReader(path.name, variable=column).values(RunFiles(tmp_path))
        np.testing.assert_allclose(output, expected, **near)
    columns = {each.name: each for each in file.columns}
    if "status" in columns:
        assert columns["status"].texts() == ["ok"] * A.size
    if "large" in columns:
        assert np.array_equal(columns["large"].numbers(), A > 1.5)


def of_own_type(make):
    """A file with a variable of a data type that it defines."""

    def write(path):
        with netCDF4.Dataset(path, "w") as root:
            root.createDimension("run", 2)
            root.createVariable("a", make(root), ("run",))

    return write


def changed(change):
    """A good file with a variable changed."""

    def write(path):
        by_netcdf4(fletcher32=True)(path)
        with netCDF4.Dataset(path, "a") as root:
            change(root["a"])

    return write


def flipped(path):
    """A value that its checksum contradicts."""
    by_netcdf4(fletcher32=True)(path)
    data = bytearray(path.read_bytes())
    data[data.index(np.float64(A[1]).tobytes())] ^= 1
    path.write_bytes(data)


def loaded(path):
    return [column.load() for column in read_columns(path).columns]


STORE_NUMBERS = "store its values as numbers"
COPY = 'copy it by "nccopy -d 1 in.nc out.nc"'
REFUSED = {
    "bzip2": (by_netcdf4(compression="bzip2"), f"by filter 307, bzip2; {COPY}"),
    "texts": (with_texts(zlib=True), 'of a later form; copy it by "nccopy -d 0 in.nc out.nc"'),
    "enumeration": (of_own_type(lambda root: root.createEnumType(np.uint8, "kind", {"one": 0})),
                    f"is a data type of its own; {STORE_NUMBERS}"),
    "list": (of_own_type(lambda root: root.createVLType("f8", "list")),
             f"is a data type of its own; {STORE_NUMBERS}"),
    "compound": (of_own_type(lambda root: root.createCompoundType([("x", "f8")], "pair")),
                 f"is a data type of its own; {STORE_NUMBERS}"),
    "text": (lambda path: path.write_text("a,b\n1,2\n"), "it is no NetCDF file"),
    "HDF5 behind another head": (
        lambda path: path.write_bytes(bytes(512) + b"\x89HDF\r\n\x1a\n" + bytes(512)),
        "it is no NetCDF file"),
    "scale 0": (changed(lambda variable: variable.setncattr("scale_factor", 0.0)),
                "its variable a is packed by a scale_factor of 0 and an add_offset of 0"),
    "scale that is a text": (
        changed(lambda variable: variable.setncattr("scale_factor", "x")),
        "its variable a cannot be read by the library (could not convert string to float: 'x')",
    ),
    "a value for none that is a text": (
        changed(lambda variable: variable.setncattr("missing_value", "none")),
        "its variable a cannot be read by the library (WARNING: missing_value not used"),
    "checksum": (flipped, "its variable a cannot be read by the library (NetCDF: HDF error)"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_names_its_remedy(name, tmp_path):
    write, reported = REFUSED[name]
    write(tmp_path / "runs.nc")
    with pytest.raises(TableError) as caught:
        loaded(tmp_path / "runs.nc")
    assert str(caught.value).startswith('"runs.nc" cannot be read as NetCDF: it')
    assert reported in str(caught.value)
    with pytest.raises(SettingsError) as noted:
        read_data_file(tmp_path / "runs.nc")
    assert reported.partition("; ")[0] in str(noted.value)
    with pytest.raises(UnreadableError, match=r"runs\.nc cannot be read as NetCDF"):
        NetcdfReader("runs.nc", variable="a").values(RunFiles(tmp_path))


@pytest.mark.parametrize(
    ("name", "reported"),
    [
        ("h5py_default", 'an HDF5 file that is no NetCDF; write it with xarray ("to_netcdf")'),
        ("h5py_lzf", f"compressed by filter 32000, lzf; {COPY}"),
    ],
)
def test_what_h5py_writes_is_refused_with_a_remedy(name, reported, tmp_path):
    with pytest.raises(TableError, match="cannot be read as NetCDF") as caught:
        read_columns(stored(tmp_path, f"netcdf/{name}"))
    assert str(caught.value).endswith(reported)


@pytest.mark.slow
def test_a_thousand_columns_are_read_from_one_group(tmp_path):
    with netCDF4.Dataset(tmp_path / "wide.nc", "w") as root:
        root.createDimension("run", 2)
        for each in [root.createVariable(f"x{n}", "f4", ("run",)) for n in range(1100)]:
            each[:] = 1
    content = (tmp_path / "wide.nc").read_bytes()
    assert len(read_variables(content)) == 1100
    check_netcdf(content, ARCHIVE_LIMITS)
    with pytest.raises(RefusedContentError, match="more than 1099 variables in one group"):
        check_netcdf(content, replace(DATA_LIMITS, in_group=1099))


@pytest.mark.parametrize("options", [{}, {"chunksizes": (2,)}])
def test_forged_lengths_of_texts_take_no_memory(options, tmp_path):
    """The library would take 4 GB for the length that it finds before the address of a text."""
    with netCDF4.Dataset(tmp_path / "texts.nc", "w") as root:
        root.createDimension("run", 3)
        texts = root.createVariable("x", str, ("run",), **options)
        texts[:] = np.array(["text" * 100] * 3, dtype=object)
    data = bytearray((tmp_path / "texts.nc").read_bytes())
    # A reference is a length, and the address of the collection with the text.
    references = [
        at
        for at in range(len(data) - 15)
        if data[at : at + 4] == struct.pack("<I", 400)
        and data[(place := int.from_bytes(data[at + 4 : at + 12], "little")) :][:4] == b"GCOL"
        and place
    ]
    assert len(references) == 3
    assert read_variables(bytes(data))[0].values().tolist() == ["text" * 100] * 3
    for at in references:
        data[at : at + 4] = struct.pack("<I", 2**32 - 16)
    with pytest.raises(RefusedContentError, match="with its variable /x it takes over 268 MB"):
        read_variables(bytes(data))


def test_a_heap_of_texts_without_lengths_is_not_gone_through_without_end(tmp_path):
    """The library would, already while it opens the file."""
    path = tmp_path / "texts.nc"
    with_texts()(path)
    data = path.read_bytes()
    begin = data.index(b"ok\0\0\0\0\0\0", data.index(b"GCOL")) + 8
    path.write_bytes(data[:begin] + bytes(48) + data[begin + 48 :])
    with pytest.raises(RefusedContentError, match="it has texts whose lengths are damaged"):
        read_variables(path.read_bytes())
    with pytest.raises(ArchiveError, match="it has texts whose lengths are damaged"):
        open_archive(path)


class TestNetcdf3:
    @pytest.fixture(params=["NETCDF3_CLASSIC", "NETCDF3_64BIT_DATA"])
    def content(self, request, tmp_path):
        with netCDF4.Dataset(tmp_path / "x.nc", "w", format=request.param) as root:
            root.createDimension("run", None)
            root.createDimension("place", 3)
            root.setncattr("title", "A title")
            root.createVariable("x", "f8", ("run", "place"))[:] = np.ones((5, 3))
            root.createVariable("y", "i2", ("run",))[:] = np.arange(5)
        return (tmp_path / "x.nc").read_bytes()

    def refusal(self, content):
        with pytest.raises(RefusedContentError) as caught:
            check_netcdf(content, DATA_LIMITS)
        return str(caught.value)

    def test_records_lie_within_the_file(self, content):
        check_netcdf(content, DATA_LIMITS)
        assert self.refusal(content[:-8]) == "it ends before what it describes"
        width = 8 if content[3] == 5 else 4
        many = content[:4] + (2**31 - 1).to_bytes(width, "big") + content[4 + width :]
        assert self.refusal(many) == "it ends before what it describes"

    def test_names_and_types_are_those_of_the_format(self, content):
        assert "a name that is none" in self.refusal(content.replace(b"place", b"pl/ce"))
        assert "a name that is none" in self.refusal(content.replace(b"place\0\0\0", b"\0" * 8))
        assert "one name twice" in self.refusal(content.replace(b"place\0\0\0", b"run\0\0\0\0\0"))
        at = content.index(b"title\0\0\0") + 8
        wrong = content[:at] + (99).to_bytes(4, "big") + content[at + 4 :]
        assert self.refusal(wrong) == "it has a data type that is none"
        assert "not known" in self.refusal(b"CDF\x03" + content[4:])

    def test_numbers_of_objects_are_limited(self, content):
        with pytest.raises(RefusedContentError, match="more than 1 dimensions, variables or"):
            check_netcdf(content, replace(DATA_LIMITS, in_group=1))

    def test_a_damaged_file_is_refused_or_within_its_bytes(self, content):
        """The check raises nothing but what it says, and what it lets pass, the library reads."""
        random = np.random.default_rng(1)
        outcomes = {"refused": 0, "read": 0}
        for at in random.integers(len(content), size=300).tolist():
            damaged = bytearray(content)
            damaged[at] = random.integers(256)
            try:
                check_netcdf(bytes(damaged), DATA_LIMITS)
            except RefusedContentError:
                outcomes["refused"] += 1
            else:
                outcomes["read"] += 1
        assert min(outcomes.values()) > 20


def test_a_variable_is_found_in_its_group(tmp_path):
    with_texts()(tmp_path / "x.nc")
    content = (tmp_path / "x.nc").read_bytes()
    assert np.array_equal(read_variable(content, "more/deep/c"), A)
    for name in ("more", "more/c", "none", "more/deep/c/d", "/", ""):
        with pytest.raises(KeyError):
            read_variable(content, name)


STUDY = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": 1, "x3": 1},
    designs={
        "mc": {"kind": "monte-carlo", "runs": 20},
        "given": {"kind": "table", "file": "points.nc"},
    },
    surrogates={"pce": {"kind": "polynomial-chaos", "design": "mc"}},
)


@pytest.mark.slow
def test_no_command_reads_another_file_by_way_of_a_hostile_one(command_line, tmp_path):
    Path("secret.txt").write_text(SECRET)
    Path("study.toml").write_text(STUDY)
    with netCDF4.Dataset("points.nc", "w") as root:
        root.createDimension("point", 3)
        root.createVariable("x1", "f8", ("point",))[:] = [1, 2, 3]
    assert command_line("study", "study.toml", "-o", "good.nc").code == 0
    stored(tmp_path, "hostile/external_storage").replace("points.nc")
    reported = "its variable /x refers to another file"
    done = command_line("study", "study.toml", "-o", "other.nc")
    assert (done.code, done.err.count("Traceback")) == (2, 0)
    assert reported in " ".join(done.err.split())
    done = command_line("predict", "good.nc:pce", "points.nc")
    assert done.code == 2
    assert reported in " ".join(done.err.split())
    Path("data.toml").write_text('seed = 1\n[model]\ndata = "points.nc"\noutputs = ["x"]\n')
    done = command_line("check", "data.toml")
    assert done.code == 2
    assert reported in " ".join(done.err.split())

    # A stranger's archive, whose hashes are right.
    content = Path("points.nc").read_bytes()
    Path("points.nc").unlink()
    tree = open_archive(Path("good.nc"))
    files = tree["files"].to_dataset()
    for name, value in (
        ("content", base64.b64encode(content).decode()),
        ("sha256", hashlib.sha256(content).hexdigest()),
        ("size", len(content)),
    ):
        files[name].values[0] = value
    tree["files"] = xr.DataTree(files)
    uqpen.write(tree, Path("hostile.nc"))
    for words in (("verify", "hostile.nc"), ("rerun", "hostile.nc", "-o", "again.nc")):
        done = command_line(*words)
        assert done.code in (2, 4)
        assert reported in " ".join((done.out + done.err).split())
    assert not Path("again.nc").exists()


@pytest.mark.slow
def test_damaged_data_end_no_process(tmp_path):
    """In processes of their own; `benchmarks/fuzz.py` makes as many as one likes."""
    fuzz = ROOT / "benchmarks" / "fuzz.py"
    kinds = ["--kind", "data-netcdf3", "--kind", "data-h5netcdf", "--files", "8"]
    done = subprocess.run(
        [sys.executable, fuzz, *kinds, "--seconds", "999", "--keep", tmp_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(": 8 files: ") == 2
