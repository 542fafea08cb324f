"""Attributes of an object: their types, their sizes and their references."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from uqpen.core.netcdf.content import Content, RefusedContentError
from uqpen.core.netcdf.hdf5.datatypes import (
    STORE_NUMBERS,
    Datatype,
    ValueKind,
    read_datatype,
    read_extent,
)
from uqpen.core.netcdf.hdf5.global_heap import GlobalHeap

__all__ = ["Attribute", "check_attribute", "read_attribute"]


class Attribute(NamedTuple):
    """An attribute, and the address of its values."""

    name: str
    datatype: Datatype
    extent: tuple[int, ...] | None
    address: int

    @property
    def size(self) -> int:
        """Number of values."""
        return 0 if self.extent is None else math.prod(self.extent)


# The NetCDF library reads these into memory of the size that it expects. Each is of one kind of
# values, and has one, or one for each dimension of its variable.
_RESERVED = {
    "CLASS": (ValueKind.CHARACTERS, False),
    "NAME": (ValueKind.CHARACTERS, False),
    "_Netcdf4Dimid": (ValueKind.INTEGER, False),
    "_Netcdf4Coordinates": (ValueKind.INTEGER, True),
    "_nc3_strict": (ValueKind.INTEGER, False),
    "DIMENSION_LIST": (ValueKind.REFERENCES, True),
}
_BACK_REFERENCES = "REFERENCE_LIST"

# Version, flags, and the bytes of name, data type and dataspace.
_HEAD = struct.Struct("<BBHHH")


def read_attribute(content: Content, start: int) -> Attribute:
    """Return the attribute whose message begins at an address.

    Raises
    ------
    RefusedContentError
        If uqpen and NetCDF write none such.
    IndexError, struct.error
        If the file ends before it does.
    """
    version, flags, *sizes = _HEAD.unpack_from(content, start)
    if not 1 <= version <= 3 or (version > 1 and flags):
        raise RefusedContentError("it has an attribute with a type of its own", STORE_NUMBERS)
    at = start + (_HEAD.size + 1 if version == 3 else _HEAD.size)
    parts = []
    for size in sizes:
        parts.append(content[at : at + size])
        # The first version fills each part up to a multiple of eight bytes.
        at += -(-size // 8) * 8 if version == 1 else size
    name = parts[0].rstrip(b"\0").decode("utf-8", "replace")
    try:
        attribute = Attribute(name, read_datatype(parts[1]), read_extent(parts[2]), at)
    except RefusedContentError as error:
        raise error.within(f"its attribute {name} ") from None
    if at + attribute.size * attribute.datatype.size > len(content):
        raise IndexError("the file ends before")
    return attribute


def check_attribute(attribute: Attribute, rank: int, heap: GlobalHeap) -> None:
    """Refuse an attribute of an object that does not have what NetCDF expects by its name.

    Parameters
    ----------
    attribute : Attribute
        As `read_attribute` returns it.
    rank : int
        Number of dimensions of the variable that has it; 0 for a group.
    heap : GlobalHeap
        Where texts and references are kept.
    """
    name, kind = attribute.name, attribute.datatype.kind
    expected, along_dimensions = _RESERVED.get(name, (None, False))
    if expected is None:
        is_right = kind not in (ValueKind.REFERENCES, ValueKind.BACK_REFERENCES) or (
            kind is ValueKind.BACK_REFERENCES and name == _BACK_REFERENCES
        )
    else:
        is_right = kind is expected and attribute.size == (rank if along_dimensions else 1)
    if not is_right:
        raise RefusedContentError(f"its attribute {name} has another type or number of values")
    if kind is ValueKind.TEXT:
        heap.count_texts(attribute.address, attribute.size)
