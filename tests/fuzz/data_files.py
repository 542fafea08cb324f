"""Data files of five kinds, and each way in which uqpen reads a NetCDF file of others."""

from __future__ import annotations

import contextlib
import gzip
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from uqpen.archive.read import open_archive
from uqpen.core.columns import read_columns
from uqpen.core.errors import QuantityError, SettingsError, TableError, UqpenError
from uqpen.models.command.output_readers import NetcdfReader, RunFiles, UnreadableError
from uqpen.models.data.data_file import read_data_file

__all__ = ["DATA_KINDS", "READERS", "data_outcome", "fixture_content"]

FIXTURES = Path(__file__).parents[1] / "data"


def fixture_content(name: str) -> bytes:
    """Return a file of the folder of tests' data that is compressed there."""
    return gzip.decompress((FIXTURES / f"{name}.nc.gz").read_bytes())


def _read_data(path: Path) -> None:
    for column in read_data_file(path).columns:
        column.texts()


def _read_table(path: Path) -> None:
    for column in read_columns(path).columns:
        with contextlib.suppress(TableError, QuantityError):  # a column that is not used
            column.values(column.unit)


def _read_output(path: Path) -> None:
    NetcdfReader(path.name, variable="a").values(RunFiles(path.parent))


# A table is one of a design, of measurements, of coordinates, of points to predict, or one that an
# archive has.
READERS: dict[str, Callable[[Path], Any]] = {
    "data": _read_data,
    "table": _read_table,
    "output": _read_output,
    "archive": open_archive,
}


def data_outcome(path: Path) -> str:
    """Read a file in each way: some are read, or all are refused."""
    is_read = False
    for read in READERS.values():
        with contextlib.suppress(SettingsError, UnreadableError, UqpenError):
            read(path)
            is_read = True
    return "read" if is_read else "refused"


def _made(file_format: str, **options: Any) -> Callable[[], bytes]:
    def write() -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "made.nc"
            with netCDF4.Dataset(path, "w", format=file_format) as root:
                root.createDimension("run", None if options else 20)
                root.createDimension("letters", 4)
                for number, name in enumerate(("a", "b", "packed"), 1):
                    kind = "i2" if name == "packed" else "f8"
                    variable = root.createVariable(name, kind, ("run",), **options)
                    variable.units = "m"
                    if name == "packed":
                        variable.setncatts({"scale_factor": 0.01, "missing_value": np.int16(7)})
                    variable[:20] = np.linspace(1, 2, 20) ** number
                if file_format == "NETCDF4":
                    status = root.createVariable("status", str, ("run",))
                    status[:20] = np.array(["ok"] * 20, dtype=object)
                else:
                    letters = root.createVariable("letters", "S1", ("run", "letters"))
                    letters[:20] = netCDF4.stringtochar(np.array(["ok"] * 20, "S4"))
            return path.read_bytes()

    return write


DATA_KINDS: dict[str, Callable[[], bytes]] = {
    "data-netcdf3": _made("NETCDF3_CLASSIC", endian="native"),
    "data-netcdf4": _made("NETCDF4"),
    "data-compressed": _made("NETCDF4", zlib=True, shuffle=True, fletcher32=True),
    "data-h5py": lambda: fixture_content("netcdf/h5py_latest"),
    "data-h5netcdf": lambda: fixture_content("netcdf/xarray_unlimited"),
}
