"""Variables: their types, their sizes and where their values are."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from uqpen.core.netcdf.content import UNDEFINED, Content, RefusedContentError, uint
from uqpen.core.netcdf.hdf5.datatypes import ValueKind, read_datatype, read_extent
from uqpen.core.netcdf.hdf5.object_header import Message, MessageKind

__all__ = ["VARIABLE_MESSAGES", "StoredVariable", "read_variable"]

# What every variable has, and once.
VARIABLE_MESSAGES = frozenset({MessageKind.DATASPACE, MessageKind.DATATYPE, MessageKind.LAYOUT})

_COMPACT, _CONTIGUOUS, _CHUNKED, _VIRTUAL = range(4)
# The later two differ in the indexes of chunks, which only the library reads.
_LAYOUT_VERSIONS = (3, 4, 5)
# Filters that are part of the library: deflate, shuffle, Fletcher's checksum. It loads others.
_FILTERS = (1, 2, 3)
_OTHER_FILTERS = {4: "szip", 307: "bzip2", 32000: "lzf", 32001: "blosc", 32015: "zstd"}

_PLAIN_TEXTS = 'copy it by "nccopy -d 0 in.nc out.nc"'

_NODE_HEAD = 24  # bytes of a node of a tree of chunks before its keys


class StoredVariable(NamedTuple):
    """Sizes of a variable's dimensions, its bytes in memory, and where its texts are referred to.

    Of texts these are addresses, each with the number of references there. The bytes do not include
    those of texts.
    """

    extent: tuple[int, ...]
    memory: int
    texts: tuple[tuple[int, int], ...]


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
        layout = bodies[MessageKind.LAYOUT].start
        address, chunk = _stored(content, layout, size)
        texts: tuple[tuple[int, int], ...] = ()
        if datatype.kind is ValueKind.TEXT and size and chunk:
            if MessageKind.FILTERS in bodies or content[layout] != _LAYOUT_VERSIONS[0]:
                found = "has texts in chunks that are compressed, or of a later form"
                raise RefusedContentError(found, _PLAIN_TEXTS)
            texts = tuple((each, chunk // datatype.size) for each in _chunks(content, layout))
        elif datatype.kind is ValueKind.TEXT and size and address != UNDEFINED:
            texts = ((address, math.prod(extent)),)
        if datatype.kind is ValueKind.TEXT:
            texts += tuple((at, 1) for at in _fill_texts(content, bodies))
    except RefusedContentError as error:
        raise error.within(f"its variable {path} ") from None
    return StoredVariable(extent, size + chunk, texts)


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


def _fill_texts(content: Content, bodies: Mapping[int, Message]) -> Iterator[int]:
    """Yield the address of the reference to the text that fills a variable, where it has one."""
    for kind in (MessageKind.FILL_VALUE, MessageKind.OLD_FILL_VALUE):
        if kind in bodies:
            start = bodies[kind].start
            is_defined, at = True, start
            if kind == MessageKind.FILL_VALUE and content[start] >= 3:
                is_defined, at = bool(content[start + 1] & 0x20), start + 2
            elif kind == MessageKind.FILL_VALUE:
                is_defined, at = content[start] < 2 or bool(content[start + 3]), start + 4
            if is_defined and uint(content, at, 4):
                yield at + 4


def _chunks(content: Content, layout: int) -> Iterator[int]:
    """Yield the addresses of the chunks of a variable, whose layout is of the third version."""
    # A key has the bytes of a chunk, its filters, and its place along each dimension.
    chunk = _chunk_bytes(content, layout, _LAYOUT_VERSIONS[0])
    step = 8 + 8 * content[layout + 2] + 8
    nodes, seen = [(uint(content, layout + 3, 8), -1)], set()
    while nodes:
        node, level = nodes.pop()
        if node == UNDEFINED:
            continue
        found, entries = content[node + 5], uint(content, node + 6, 2)
        is_right = content[node : node + 5] == b"TREE\x01" and level in (-1, found)
        if not is_right or node in seen:
            raise RefusedContentError("is stored in a form that is not known")
        seen.add(node)
        for key in range(node + _NODE_HEAD, node + _NODE_HEAD + entries * step, step):
            child = uint(content, key + step - 8, 8)
            if found:
                nodes.append((child, found - 1))
            elif uint(content, key, 4) != chunk or child in seen:
                raise RefusedContentError("is stored in a form that is not known")
            else:
                seen.add(child)
                yield child


def _check_filters(content: Content, message: Message) -> None:
    """Refuse compression for which the library would load code."""
    version, count = content[message.start], content[message.start + 1]
    at = message.start + (8 if version == 1 else 2)
    for _ in range(count):
        number = uint(content, at, 2)
        if number not in _FILTERS:
            name = _OTHER_FILTERS.get(number, "a filter that HDF5 would have to load")
            remedy = 'copy it by "nccopy -d 1 in.nc out.nc"'
            raise RefusedContentError(f"is compressed by filter {number}, {name}", remedy)
        if version == 1:
            length, values = uint(content, at + 2, 2), uint(content, at + 6, 2)
            at += 8 + length + 4 * (values + values % 2)
        else:  # names belong to other filters
            at += 6 + 4 * uint(content, at + 4, 2)
