"""Make the hostile files of this folder; it takes h5py, which uqpen's tests do not.

Each is a small HDF5 file that says it is an archive of schema 1. It holds one thing that uqpen does
not write. Run it as ``python make.py`` in this folder.
"""

import gzip
import pathlib

import h5py
import numpy as np


def main() -> None:
    for name, change in CHANGES.items():
        path = pathlib.Path(f"{name}.nc")
        with h5py.File(path, "w", libver=("v108", "v110"), track_order=True) as file:
            file.attrs["uqpen_schema"] = np.int64(1)
            change(file)
        pathlib.Path(f"{name}.nc.gz").write_bytes(gzip.compress(path.read_bytes(), mtime=0))
        path.unlink()


def numbers(dtype):
    return lambda file: file.create_dataset("x", data=np.ones(3, dtype))


def attribute(name, value):
    return lambda file: file.create_dataset("x", data=np.ones(3)).attrs.create(name, value)


def many_attributes(file):
    for number in range(40):
        file.attrs[f"a{number}"] = number if number != 17 else np.float16(1)


def many_links(file):
    for number in range(60):
        file.create_group(f"g{number}", track_order=True)
    file["g60"] = h5py.ExternalLink("other.nc", "/")


def virtual(file):
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource("other.nc", "x", (3,))
    file.create_virtual_dataset("x", layout)


def link(value):
    return lambda file: file.__setitem__("x", value)


def loop(file):
    file["a"] = file.create_group("b", track_order=True)


CHANGES = {
    "float16": numbers("f2"),
    "long_double": numbers(np.longdouble),
    "enumeration": numbers(bool),
    "compound": numbers([("a", "f8")]),
    "type": link(np.dtype("f8")),
    "dimension_list": attribute("DIMENSION_LIST", np.ones(1)),
    "dimension_number": attribute("_Netcdf4Dimid", "0"),
    "coordinate_numbers": attribute("_Netcdf4Coordinates", np.zeros(9, "i4")),
    "many_attributes": many_attributes,
    "external_storage": lambda file: file.create_dataset(
        "x", (8,), "f8", external=[("secret.txt", 0, 64)]
    ),
    "external_link": link(h5py.ExternalLink("other.nc", "/")),
    "many_links": many_links,
    "soft_link": link(h5py.SoftLink("/")),
    "two_names": loop,
    "virtual": virtual,
    "filter": lambda file: file.create_dataset("x", data=np.ones(300), compression="lzf"),
    "unwritten": lambda file: file.create_dataset("x", (400_000_000,), "f8"),
    "unwritten_chunks": lambda file: file.create_dataset("x", (9**9,), "f8", chunks=(1000,)),
    "zeros": lambda file: file.create_dataset(
        "x", data=np.zeros(3_000_000), compression="gzip", compression_opts=9
    ),
}

if __name__ == "__main__":
    main()
