"""Reading of data files of every format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from uqpen.core.files import FileSnapshot, NotAFileError, read_file
from uqpen.core.netcdf.opening import LARGEST_DATA
from uqpen.models.data.binary_files import read_netcdf, read_parquet
from uqpen.models.data.columns import DataColumn, DataFile, data_error
from uqpen.models.data.delimited_text import read_text

__all__ = ["data_file", "read_data_file"]

# The readers of the endings of names; any other file is text.
_READERS: dict[str, Callable[[str, bytes], tuple[DataColumn, ...]]] = {
    ".nc": read_netcdf,
    ".parquet": read_parquet,
}


def read_data_file(path: Path) -> DataFile:
    """Read a data file.

    Parameters
    ----------
    path : Path
        Ends in ``.nc`` for NetCDF and in ``.parquet`` for Parquet; anything else is text.

    Raises
    ------
    SettingsError
        If it is not there, or has a mistake, which it names with its line.
    """
    expected = "a CSV, NetCDF, Parquet or Dakota file"
    try:
        is_netcdf = path.suffix.lower() == ".nc"
        return data_file(path, read_file(path, LARGEST_DATA if is_netcdf else None))
    except FileNotFoundError:
        raise data_error(f'no file "{path}"', expected) from None
    except NotAFileError:
        raise data_error(f'"{path}", which is not a file', expected) from None
    except OSError as error:
        raise data_error(f'"{path}", which cannot be read: {error.strerror}', expected) from None


def data_file(path: Path, content: bytes) -> DataFile:
    """Return the data file of a content; see `read_data_file`."""
    read = _READERS.get(path.suffix.lower(), read_text)
    return DataFile(FileSnapshot.from_content(path, content), read(path.name, content))
