"""Opening of NetCDF files: those of others after a look through them, and those uqpen has written.

No other module calls the NetCDF library to open a file.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from uqpen.core.files import open_file
from uqpen.core.netcdf.hdf5 import (
    ARCHIVE_LIMITS,
    DATA_LIMITS,
    SIGNATURE,
    Content,
    ContentLimits,
    RefusedContentError,
    check_count,
    check_hdf5,
)

if TYPE_CHECKING:
    import netCDF4

__all__ = [
    "LARGEST_DATA",
    "MAGIC",
    "NetcdfVariable",
    "RefusedContentError",
    "check_classic",
    "check_netcdf",
    "open_archive_file",
    "open_own",
    "read_variable",
    "read_variables",
]

# Header of a file of NetCDF 3, in its three forms: ``CDF`` and a 1, a 2 or a 5.
#
# The names are those of the "NetCDF Classic Format Specification".

MAGIC = b"CDF"

# Bytes of a count and of an offset by the version, and those of a value by its type.
_WIDTHS = {1: (4, 4), 2: (4, 8), 5: (8, 8)}
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}
_MOST_TYPES = {1: 6, 2: 6, 5: 11}

_DIMENSION, _VARIABLE, _ATTRIBUTE = 10, 11, 12
_MOST_RANK = 32
_LONGEST_NAME = 256

_DAMAGED = "its header is damaged"


def check_classic(content: Content, limits: ContentLimits) -> None:
    """Refuse a file whose header the library could not follow within the file.

    RefusedContentError if a type, a rank, a name or a dimension is none, or values lie outside the
    file.
    """
    try:
        _Header(content, limits).check()
    except (IndexError, UnicodeDecodeError):
        raise RefusedContentError("it ends before what it describes") from None


@dataclass
class _Header:
    content: Content
    limits: ContentLimits
    at: int = 4

    def check(self) -> None:
        """Go through the header; a reason to refuse the file is raised."""
        version = self.content[3]
        if version not in _WIDTHS:
            raise RefusedContentError("it is of a form of NetCDF 3 that is not known")
        self.count_width, self.offset_width = _WIDTHS[version]
        self.most_types = _MOST_TYPES[version]
        records = self._number(self.count_width)
        lengths = [
            self._number(self.count_width) for _ in self._named(_DIMENSION, self.limits.variables)
        ]
        if lengths.count(0) > 1:  # 0 is the length of the dimension of records
            raise RefusedContentError(_DAMAGED)
        self._attributes()
        variables = [self._variable(lengths) for _ in self._named(_VARIABLE, self.limits.in_group)]
        padded = [-(-size // 4) * 4 for size, _, has_records in variables if has_records]
        # The records of a single variable follow each other without a gap.
        step = (
            next(size for size, _, each in variables if each) if len(padded) == 1 else sum(padded)
        )
        memory = 0
        for size, begin, has_records in variables:
            number = records if has_records else 1
            memory += number * size
            if number and size and begin + (number - 1) * step + size > len(self.content):
                raise IndexError("the file ends before")
        if memory > self.limits.most_memory(self.content):
            raise RefusedContentError("its variables lie on each other")

    def _number(self, width: int) -> int:
        return int.from_bytes(self._skip(width), "big")

    def _skip(self, length: int) -> bytes:
        """Return the next bytes; what fills them up to a multiple of four is skipped as well."""
        piece = self.content[self.at : self.at + length]
        if len(piece) != length:
            raise IndexError("the file ends before")
        self.at += -(-length // 4) * 4
        return piece

    def _named(self, tag: int, most: int) -> Iterator[None]:
        """Yield once for each entry of a list, after its name was read."""
        found, count = self._number(4), self._number(self.count_width)
        if found != tag and (found or count):
            raise RefusedContentError(_DAMAGED)
        check_count(count, most, "dimensions, variables or attributes in one place")
        names = set()
        for _ in range(count):
            length = self._number(self.count_width)
            name = self._skip(length).decode("utf-8") if length <= _LONGEST_NAME else ""
            if not name or name in names or {"/", "\0"} & {*name}:
                raise RefusedContentError("it has a name that is none, or one name twice")
            names.add(name)
            yield

    def _type_size(self) -> int:
        kind = self._number(4)
        if not 1 <= kind <= self.most_types:
            raise RefusedContentError("it has a data type that is none")
        return _SIZES[kind]

    def _attributes(self) -> None:
        for _ in self._named(_ATTRIBUTE, self.limits.attributes):
            size = self._type_size()
            self._skip(size * self._number(self.count_width))

    def _variable(self, lengths: list[int]) -> tuple[int, int, bool]:
        """Return the bytes of a variable, or of a record of it, where it begins, and which."""
        rank = self._number(self.count_width)
        if rank > _MOST_RANK:
            raise RefusedContentError(_DAMAGED)
        dims = [self._number(self.count_width) for _ in range(rank)]
        if any(number >= len(lengths) for number in dims):
            raise RefusedContentError("it has a variable with a dimension that is none")
        extent = [lengths[number] for number in dims]
        has_records = bool(extent) and not extent[0]
        if 0 in extent[1:]:
            raise RefusedContentError(_DAMAGED)
        self._attributes()
        size = self._type_size() * math.prod(extent[has_records:])
        self._number(self.count_width)  # a size that the library computes again
        return size, self._number(self.offset_width), has_records


# Bytes of a file of data, which is in memory as a whole, and whose values are so besides.
LARGEST_DATA = 2 * 10**9

# What the library raises for a damaged file, and its warning that values are not what they say.
_LIBRARY_ERRORS = (
    *(OSError, RuntimeError, ValueError, TypeError, AttributeError, LookupError, OverflowError),
    *(MemoryError, UserWarning),
)


@dataclass(frozen=True)
class NetcdfVariable:
    """Variable of a file, with its values or the reason why they cannot be read."""

    name: str  # its name
    unit: str  # its attribute ``units``; empty without one
    stored: Any  # its values, unpacked; texts are whole ones

    def values(self) -> Any:
        """Return its values; RefusedContentError if they cannot be read."""
        if isinstance(self.stored, RefusedContentError):
            raise self.stored
        return self.stored


def read_variables(content: bytes, group: str = "") -> list[NetcdfVariable]:
    """Read the variables of a file in a group, but not those that only number a dimension.

    Without a group they are those outside groups. RefusedContentError if there is no such group, or
    if the libraries must not get the file, or cannot read it.
    """
    found = []
    with _opened(content) as root, _refusing():
        place: Any = root
        for part in filter(None, group.split("/")):
            if part not in place.groups:
                raise RefusedContentError(f'it has no group "{group}"')
            place = place.groups[part]
        for name, each in place.variables.items():
            if name in place.dimensions and "units" not in each.ncattrs():
                continue
            try:
                stored = _values(each)
            except RefusedContentError as error:
                stored = error
            found.append(NetcdfVariable(str(name), str(getattr(each, "units", "")), stored))
    return found


def read_variable(content: bytes, name: str) -> Any:
    """Read the values of a variable of a file of data, as a masked array.

    The name has those of groups before it, with slashes between; KeyError if there is no such
    variable. RefusedContentError if the libraries must not get the file, or cannot read it.
    """
    with _opened(content) as root:
        try:
            found = root[name]
        except LookupError:
            found = None
        if not hasattr(found, "dtype"):
            raise KeyError(name)
        return _values(found)


def check_netcdf(content: Content, limits: ContentLimits) -> None:
    """Refuse a file that the NetCDF and HDF5 libraries must not get, with the reason."""
    if content[: len(SIGNATURE)] == SIGNATURE:
        check_hdf5(content, limits)
    elif content[: len(MAGIC)] == MAGIC:
        check_classic(content, limits)
    else:
        raise RefusedContentError("it is no NetCDF file")


@contextlib.contextmanager
def open_archive_file(path: Path) -> Iterator[netCDF4.Dataset]:
    """Open an archive, whoever has written it; its values may be larger than the memory.

    It is looked through on the disk, and opened there. Whoever can change it in between could have
    changed it before. RefusedContentError if the libraries must not get it, or cannot open it;
    OSError if it cannot be read, or is no file.
    """
    with open_file(path) as stream:
        if stream.read(len(SIGNATURE)) != SIGNATURE:
            raise RefusedContentError("it is no HDF5 file")
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            check_netcdf(content, ARCHIVE_LIMITS)
    with _refusing():
        root = open_own(path)
    with _closing(root):
        yield root


def open_own(path: Path, mode: Literal["r", "w", "a"] = "r") -> netCDF4.Dataset:
    """Open a file that uqpen writes, has written, or has just looked through."""
    import netCDF4

    return netCDF4.Dataset(path, mode, format="NETCDF4")


@contextlib.contextmanager
def _opened(content: bytes) -> Iterator[netCDF4.Dataset]:
    """Open the bytes that were looked through, so that nothing changes in between."""
    check_netcdf(content, DATA_LIMITS)
    import netCDF4

    with _refusing():
        root = netCDF4.Dataset("data.nc", memory=content)
    with _closing(root):
        yield root


@contextlib.contextmanager
def _closing(root: netCDF4.Dataset) -> Iterator[None]:
    try:
        yield
    finally:
        with contextlib.suppress(*_LIBRARY_ERRORS):  # nothing was changed that could be lost
            root.close()


@contextlib.contextmanager
def _refusing(what: str = "it") -> Iterator[None]:
    """Turn an error of the library into a refusal."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # such as an overflow: the values show it
            warnings.simplefilter("error", UserWarning)
            yield
    except _LIBRARY_ERRORS as error:
        told = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise RefusedContentError(f"{what} cannot be read by the library ({told[:200]})") from None


def _values(variable: Any) -> Any:
    """Return the values of a variable; characters along its last dimension become texts."""
    what = f"its variable {variable.name}"
    with _refusing(what):
        scale, offset = (
            float(getattr(variable, name, neutral))
            for name, neutral in (("scale_factor", 1), ("add_offset", 0))
        )
        values = variable[...]
    if scale == 0 or not math.isfinite(scale) or not math.isfinite(offset):
        packed = f"a scale_factor of {scale:g} and an add_offset of {offset:g}"
        raise RefusedContentError(f"{what} is packed by {packed}")
    if values.dtype.kind != "S" or values.ndim < 2:
        return values
    plain = np.ascontiguousarray(np.ma.filled(values, b"\0"))
    if not plain.size:
        return np.full(plain.shape[:-1], "")
    try:
        return np.char.decode(plain.view(f"S{plain.shape[-1]}")[..., 0], "utf-8")
    except UnicodeDecodeError:
        raise RefusedContentError(f"{what} has characters that are no UTF-8") from None
