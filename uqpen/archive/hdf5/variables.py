"""Variables: their types, their sizes and where their values are."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from uqpen.archive.hdf5.content import UNDEFINED, Content, RefusedContentError, uint
from uqpen.archive.hdf5.datatypes import ValueKind, read_datatype, read_extent
from uqpen.archive.hdf5.object_header import Message, MessageKind

__all__ = ["VARIABLE_MESSAGES", "StoredVariable", "read_variable"]

# What every variable has, and once.
VARIABLE_MESSAGES = frozenset({MessageKind.DATASPACE, MessageKind.DATATYPE, MessageKind.LAYOUT})

_COMPACT, _CONTIGUOUS, _CHUNKED, _VIRTUAL = range(4)
_LAYOUT_VERSIONS = (3, 4)
# Filters that are part of the library: deflate, shuffle, Fletcher's checksum. It loads others.
_FILTERS = (1, 2, 3)


class StoredVariable(NamedTuple):
    """Sizes of a variable's dimensions, its bytes in memory, and the address of its texts.

    The address is undefined where it has none. The bytes do not include those of texts.
    """

    extent: tuple[int, ...]
    memory: int
    texts_at: int


def read_variable(content: Content, messages: Iterable[Message], path: str) -> StoredVariable:
    """Return the variable whose object header has some messages.

    Raises
    ------
    RefusedContentError
        If its type, its layout or its compression is none that uqpen and NetCDF write.
    IndexError
        If the file ends before its values do.
    """
    bodies: dict[int, Message] = {}
    for message in messages:
        if message.kind in VARIABLE_MESSAGES and message.kind in bodies:
            raise RefusedContentError(f"its variable {path} is described twice")
        bodies[message.kind] = message
    try:
        if MessageKind.FILTERS in bodies:
            _check_filters(content, bodies[MessageKind.FILTERS])
        space, described = bodies[MessageKind.DATASPACE], bodies[MessageKind.DATATYPE]
        extent = read_extent(content[space.start : space.end])
        datatype = read_datatype(content[described.start : described.end])
        if extent is None or datatype.kind in (ValueKind.REFERENCES, ValueKind.BACK_REFERENCES):
            raise RefusedContentError("has no values, or none that can be read")
        size = math.prod(extent) * datatype.size
        address, chunk = _stored(content, bodies[MessageKind.LAYOUT].start, size)
        is_text = datatype.kind is ValueKind.TEXT and size > 0
        if is_text and chunk:
            raise RefusedContentError("has texts in chunks")
    except RefusedContentError as error:
        raise RefusedContentError(f"its variable {path} {error}") from None
    return StoredVariable(extent, size + chunk, address if is_text else UNDEFINED)


def _stored(content: Content, at: int, size: int) -> tuple[int, int]:
    """Return where values of some bytes are stored, or else the bytes of one chunk of them."""
    version, layout = content[at], content[at + 1]
    if layout == _VIRTUAL:
        raise RefusedContentError("refers to other files")
    if version not in _LAYOUT_VERSIONS or layout > _VIRTUAL:
        raise RefusedContentError("is stored in a form that is not known")
    if layout == _COMPACT:
        return _within(content, at + 4, uint(content, at + 2, 2), size), 0
    if layout == _CONTIGUOUS:
        address = uint(content, at + 2, 8)
        if address == UNDEFINED:
            return UNDEFINED, 0
        return _within(content, address, uint(content, at + 10, 8), size), 0
    return UNDEFINED, _chunk_bytes(content, at, version)


def _within(content: Content, address: int, stored: int, size: int) -> int:
    if stored < size or address + stored > len(content):
        raise IndexError("the file ends before")
    return address


def _chunk_bytes(content: Content, at: int, version: int) -> int:
    if version == 3:
        rank, sizes, width = content[at + 2], at + 11, 4
    else:
        rank, sizes, width = content[at + 3], at + 5, content[at + 4]
    # The last of the dimensions is the size of a value.
    return math.prod(uint(content, sizes + number * width, width) for number in range(rank))


def _check_filters(content: Content, message: Message) -> None:
    """Refuse compression for which the library would load code."""
    version, count = content[message.start], content[message.start + 1]
    at = message.start + (8 if version == 1 else 2)
    for _ in range(count):
        number = uint(content, at, 2)
        if number not in _FILTERS:
            raise RefusedContentError(f"is compressed by filter {number}")
        if version == 1:
            name, values = uint(content, at + 2, 2), uint(content, at + 6, 2)
            at += 8 + name + 4 * (values + values % 2)
        else:  # names belong to other filters
            at += 6 + 4 * uint(content, at + 4, 2)
