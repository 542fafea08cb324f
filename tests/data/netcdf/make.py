"""Make the files of this folder, as h5py and h5netcdf write them; uqpen's tests take neither.

Each has 20 runs of ``a``, and ``b``, its square. Run it as ``python make.py`` in this folder.
"""

import gzip
import pathlib

import h5netcdf
import h5netcdf.legacyapi
import h5py
import numpy as np
import xarray as xr

A = np.linspace(1, 2, 20)


def main() -> None:
    for name, write in WRITERS.items():
        path = pathlib.Path(f"{name}.nc")
        write(path)
        pathlib.Path(f"{name}.nc.gz").write_bytes(gzip.compress(path.read_bytes(), mtime=0))
        path.unlink()


def h5py_file(texts=False, **options):
    def write(path):
        with h5py.File(path, "w", **options) as file:
            for name, values in (("a", A), ("b", A**2)):
                chunks = {"chunks": (7,), "compression": "gzip"} if texts else {}
                file.create_dataset(name, data=values, **chunks)
            if texts:
                file.create_dataset("status", data=["ok"] * A.size)

    return write


def lzf(path):
    with h5py.File(path, "w", track_order=True) as file:
        file.create_dataset("a", data=A, compression="lzf")


def xarray_file(**options):
    runs = {"a": ("run", A, {"units": "m"}), "b": ("run", A**2), "large": ("run", A > 1.5)}
    hours = np.datetime64("2020-01-01", "ns") + np.arange(A.size) * np.timedelta64(1, "h")
    beside = {"time": ("run", hours), "status": ("run", ["ok"] * A.size)}
    return lambda path: xr.Dataset({**runs, **beside}).to_netcdf(path, engine="h5netcdf", **options)


def new_form(path):
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"run": A.size}
        for name, values in (("a", A), ("b", A**2)):
            file.create_variable(name, ("run",), data=values)


def legacy_form(path):
    with h5netcdf.legacyapi.Dataset(path, "w") as file:
        file.createDimension("run", A.size)
        for name, values in (("a", A), ("b", A**2)):
            file.createVariable(name, "f8", ("run",))[:] = values


WRITERS = {
    "h5py_default": h5py_file(),
    "h5py_latest": h5py_file(texts=True, libver="latest"),
    "h5py_track_order": h5py_file(texts=True, track_order=True),
    "h5py_lzf": lzf,
    "h5netcdf": new_form,
    "h5netcdf_legacy": legacy_form,
    "xarray_h5netcdf": xarray_file(),
    "xarray_unlimited": xarray_file(unlimited_dims=["run"]),
}

if __name__ == "__main__":
    main()
