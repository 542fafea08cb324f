"""Messages of an object header, which describe a group or a variable."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

from uqpen.core.netcdf.content import Content, RefusedContentError, has_signature, uint
from uqpen.core.netcdf.hdf5.datatypes import STORE_NUMBERS

__all__ = ["Message", "MessageKind", "read_messages"]


class MessageKind(IntEnum):
    """Header messages of what uqpen and other NetCDF software write."""

    NIL = 0x00
    DATASPACE = 0x01
    LINK_INFO = 0x02
    DATATYPE = 0x03
    OLD_FILL_VALUE = 0x04
    FILL_VALUE = 0x05
    LINK = 0x06
    EXTERNAL_FILES = 0x07
    LAYOUT = 0x08
    GROUP_INFO = 0x0A
    FILTERS = 0x0B
    ATTRIBUTE = 0x0C
    COMMENT = 0x0D
    OLD_TIME = 0x0E
    CONTINUATION = 0x10
    TIME = 0x12
    ATTRIBUTE_INFO = 0x15
    REFERENCE_COUNT = 0x16


class Message(NamedTuple):
    """One message: its kind, and where its body begins and ends."""

    kind: int
    start: int
    end: int


_KNOWN = frozenset(map(int, MessageKind))
_NIL, _CONTINUATION = int(MessageKind.NIL), int(MessageKind.CONTINUATION)
_SYMBOL_TABLE = 0x11  # of a group in the form before HDF5 1.8
_SHARED = 0x02

# Kind, size and flags of a message, by the version of the object header.
_HEADS = {1: struct.Struct("<HHB3x"), 2: struct.Struct("<BHB")}
_HEAD_WITH_ORDER = struct.Struct("<BHB2x")

# A variable has 20, with up to eight attributes; more attributes stand elsewhere.
_MOST_MESSAGES = 1_000


def read_messages(content: Content, address: int) -> Iterator[Message]:
    """Yield the messages of the object header at an address, without the empty ones.

    Raises
    ------
    RefusedContentError
        If it has messages of a kind that is not listed here, or shared ones.
    IndexError, struct.error
        If the file ends before it does.
    """
    if has_signature(content, address, b"OHDR", 2):
        flags = content[address + 5]
        start = address + 6 + 16 * bool(flags & 0x20) + 4 * bool(flags & 0x10)
        width = 1 << (flags & 0x03)
        first = (start + width, uint(content, start, width))
        head, edges = (_HEAD_WITH_ORDER if flags & 0x04 else _HEADS[2]), (4, 4)
    elif content[address] == 1:
        first, head, edges = (address + 16, uint(content, address + 8, 4)), _HEADS[1], (0, 0)
    else:
        raise RefusedContentError("is not there")
    yield from _block_messages(content, first, head, edges)


def _block_messages(
    content: Content, first: tuple[int, int], head: struct.Struct, edges: tuple[int, int]
) -> Iterator[Message]:
    """Yield the messages of a block and of those that continue it.

    Before and after the messages of a further block there may be a signature and a checksum.
    """
    blocks, count = [first], 0
    for begin, length in blocks:
        at = begin
        while at + head.size <= begin + length:
            kind, size, flags = head.unpack_from(content, at)
            start = at + head.size
            at = start + size
            count += 1
            if count > _MOST_MESSAGES:
                raise RefusedContentError(f"has more than {_MOST_MESSAGES} messages")
            if kind == _CONTINUATION:
                place, size = uint(content, start, 8), uint(content, start + 8, 8)
                blocks.append((place + edges[0], size - sum(edges)))
            elif kind == _SYMBOL_TABLE:
                found = "is a group of an HDF5 file that is no NetCDF"
                raise RefusedContentError(found, 'write it with xarray ("to_netcdf")')
            elif kind not in _KNOWN:
                raise RefusedContentError(f"is in a form that NetCDF does not write ({kind})")
            elif flags & _SHARED:
                raise RefusedContentError("has a type of its own", STORE_NUMBERS)
            elif kind != _NIL:
                yield Message(kind, start, at)
