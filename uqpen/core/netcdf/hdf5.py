"""Metadata of an HDF5 file, read without the HDF5 library."""

from __future__ import annotations

import functools
import math
import mmap
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum
from itertools import islice
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Content = bytes | mmap.mmap

# The address of what is not stored.
UNDEFINED = 2**64 - 1


class RefusedContentError(Exception):
    """Content of a file that is not read: a clause on "it" or "its", the file.

    Its `remedy` says what makes a file that is read; empty where there is none.
    """

    def __init__(self, reason: str, remedy: str = "") -> None:
        super().__init__(reason)
        self.remedy = remedy

    def within(self, before: str = "", after: str = "") -> RefusedContentError:
        """Return the error with the place of the content before or after its reason."""
        return RefusedContentError(f"{before}{self}{after}", self.remedy)


@dataclass(frozen=True)
class ContentLimits:
    """Largest numbers of objects in a file, and the memory that their values may take."""

    groups: int  # in the whole file
    variables: int  # in the whole file
    in_group: int  # variables in one group
    links: int  # groups and variables in one group
    attributes: int  # of one object
    depth: int  # of groups within groups
    memory: int  # bytes of all values in memory, whatever the size of the file
    memory_ratio: int  # bytes of all values in memory for each byte of the file, where that is more

    def most_memory(self, content: Content) -> int:
        """Return the bytes that the values of a file may take."""
        return max(self.memory, self.memory_ratio * len(content))


# uqpen writes one group for each output and source: ten sources of a thousand outputs. It writes 15
# to 60 variables in a group of statistics, in a group of runs as many as a data file has columns,
# and at most 30 attributes of an object. The deepest of its groups is
# /models/<name>/statistics/<source>/<output>. What it writes takes as much memory as disk. Other
# software may have compressed a copy: runs shrink to a half, columns of one value to a hundredth.
ARCHIVE_LIMITS = ContentLimits(
    groups=10_000,
    variables=100_000,
    in_group=100_000,
    links=110_000,
    attributes=300,
    depth=8,
    memory=1 << 24,
    memory_ratio=50,
)

# A table may have long columns of one value, compressed.
DATA_LIMITS = replace(ARCHIVE_LIMITS, memory=1 << 28)


def check_count(count: int, most: int, what: str) -> None:
    """Refuse a file with more of something than a limit."""
    if count > most:
        raise RefusedContentError(f"it has more than {most} {what}")


def _has_signature(content: Content, address: int, signature: bytes, version: int = 0) -> bool:
    """Return True if a structure of a kind and a version begins at an address."""
    end = address + len(signature)
    return content[address:end] == signature and content[end] == version


def _stored_bytes(content: Content, address: int, size: int) -> bytes:
    """Return some bytes of a file; IndexError if it ends before."""
    piece = content[address : address + size]
    if len(piece) != size:
        raise IndexError("the file ends before")
    return piece


def _uint(content: Content, address: int, width: int) -> int:
    """Return the unsigned integer of `width` bytes at an address, the low byte first."""
    return int.from_bytes(_stored_bytes(content, address, width), "little")


def _limit_width(largest: int) -> int:
    """Return the number of bytes that hold every number up to the largest."""
    return (max(largest, 1).bit_length() - 1) // 8 + 1


# Superblock of a file, with which it begins.

SIGNATURE = b"\x89HDF\r\n\x1a\n"

# Where the bytes of an address and of a length stand, by the version of the superblock, then the
# address that all others count from, that of the end of the file, that of a driver for files of
# parts or of settings of the library, and that of the root group.
_SUPERBLOCKS = {0: (13, 24, 40, 48, 64), 2: (9, 12, 28, 20, 36), 3: (9, 12, 28, 20, 36)}
_OFFSET_WIDTHS = b"\x08\x08"


def _root_address(content: Content) -> int:
    """Return the address of the root group; refuse a file of parts, or in another form."""
    if content[8] in _SUPERBLOCKS:
        widths, base, end, elsewhere, root = _SUPERBLOCKS[content[8]]
        if (size := _uint(content, end, 8)) > len(content):
            raise RefusedContentError(f"it is cut off: {len(content)} of its {size} bytes are here")
        is_plain = content[widths : widths + 2] == _OFFSET_WIDTHS and not _uint(content, base, 8)
        if is_plain and _uint(content, elsewhere, 8) == UNDEFINED:
            return _uint(content, root, 8)
    raise RefusedContentError("it begins in a form that NetCDF does not write")


# Global heap of a file: texts of any length, and lists of references.

# How a variable or an attribute refers to an entry of the heap.
_HEAP_REFERENCE = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])

# How a collection of entries begins, and the index and the size of an entry before its bytes.
_COLLECTION = b"GCOL\x01"
_ENTRY = struct.Struct("<H6xQ")


@dataclass
class _GlobalHeap:
    """Heap of a file. It counts the bytes of texts that were asked for."""

    content: Content
    text_bytes: int = 0
    entries: int = 0
    collections: dict[int, dict[int, tuple[int, int]]] = field(default_factory=dict)

    def references(self, address: int, count: int) -> npt.NDArray[np.void]:
        """Return references to entries that stand at an address."""
        stored = _stored_bytes(self.content, address, count * _HEAP_REFERENCE.itemsize)
        return np.frombuffer(stored, _HEAP_REFERENCE)

    def count_texts(self, address: int, count: int) -> None:
        """Add the lengths of `count` texts whose references stand at an address.

        Texts that share an entry take memory each.
        """
        references = self.references(address, count)
        self.text_bytes += int(references["length"].sum(dtype=np.uint64))
        for place in np.unique(references["address"]).tolist():
            if place:  # or the text is empty
                self.collection(place)

    def object_addresses(self, address: int, count: int) -> Iterator[int]:
        """Yield the addresses to which `count` lists refer, each a list of one."""
        for length, place, index in self.references(address, count).tolist():
            start, size = self.collection(place).get(index, (0, 0))
            if length != 1 or size != 8:
                raise RefusedContentError("it has dimensions that are none")
            yield _uint(self.content, start, 8)

    def collection(self, at: int) -> dict[int, tuple[int, int]]:
        """Return where the entries of a collection stand, and their sizes.

        It is refused if the library could not go through it.
        """
        if at in self.collections:
            return self.collections[at]
        if self.content[at : at + len(_COLLECTION)] != _COLLECTION:
            raise RefusedContentError("it has texts or dimensions that are none")
        self.collections[at] = found = {}
        end = at + _uint(self.content, at + 8, 8)
        at += _ENTRY.size
        while at + _ENTRY.size <= end:
            index, size = _ENTRY.unpack_from(self.content, at)
            # The size of free room, with the index 0, includes its head, that of an entry does not.
            step = _ENTRY.size + -(-size // 8) * 8 if index else size
            # The library would go on without end where an entry takes no room.
            if step < _ENTRY.size or at + step > end:
                raise RefusedContentError("it has texts whose lengths are damaged")
            if index:
                found[index] = at + _ENTRY.size, size
            at += step
            self.entries += 1
            if self.entries > len(self.content) // _ENTRY.size:
                raise RefusedContentError("it has texts that lie on each other")
        return found


# Data types of variables and attributes that NetCDF and NumPy have in common.

_STORE_NUMBERS = "store its values as numbers"


class _ValueKind(Enum):
    """Kind of the values of a type."""

    INTEGER = "integer"
    REAL = "real"
    CHARACTERS = "characters"  # of a fixed number
    TEXT = "text"  # of any length, in a heap
    REFERENCES = "references"  # of a variable to its dimensions
    BACK_REFERENCES = "back references"  # of a dimension to variables


class _Datatype(NamedTuple):
    """A kind, and the bytes of one value."""

    kind: _ValueKind
    size: int


_INTEGER, _REAL, _STRING, _COMPOUND, _REFERENCE, _VARIABLE_LENGTH = 0, 1, 3, 6, 7, 9
_OTHERS = {
    2: "a time",
    4: "bits",
    5: "opaque",
    _COMPOUND: "a compound",
    _REFERENCE: "a reference",
    8: "an enumeration",
    10: "an array",
}
# Precision, exponent and mantissa of IEEE 754 in the words of the format, by size.
_IEEE = {
    4: bytes.fromhex("0000 2000 17 08 00 17 7f000000"),
    8: bytes.fromhex("0000 4000 34 0b 00 34 ff030000"),
}
_SIGN = {4: 31, 8: 63}
_IMPLIED_BIT = 0x20  # of a normal number; no padding bits
_WIDTHS = (1, 2, 4, 8)


@functools.lru_cache(maxsize=256)
def _read_datatype(message: bytes) -> _Datatype:
    """Return the type that a message describes, one of few in a file; refuse an unknown one."""
    family, size = message[0] & 0x0F, int.from_bytes(message[4:8], "little")
    if family == _INTEGER:
        precision = int.from_bytes(message[8:12], "little")
        if size in _WIDTHS and precision == size << 19 and not message[1] & 0xF6:
            return _Datatype(_ValueKind.INTEGER, size)
        found = f"has the type of an integer of {size} bytes"
        raise RefusedContentError(found, "store integers of 1, 2, 4 or 8 bytes")
    if family == _REAL:
        bits = (message[1] & 0xFE, message[2], message[3])
        if message[8:20] == _IEEE.get(size) and bits == (_IMPLIED_BIT, _SIGN[size], 0):
            return _Datatype(_ValueKind.REAL, size)
        raise RefusedContentError(f"has the type float{8 * size}", "store it as float64")
    if family == _STRING and size:
        return _Datatype(_ValueKind.CHARACTERS, size)
    if family == _COMPOUND and size == 16:
        return _Datatype(_ValueKind.BACK_REFERENCES, size)
    if family != _VARIABLE_LENGTH or size != 16:
        found = f"has a type that is {_OTHERS.get(family, 'unknown')}"
        raise RefusedContentError(found, _STORE_NUMBERS)
    base, is_text = message[8:], message[1] & 0x0F == 1
    base_family, base_size = base[0] & 0x0F, int.from_bytes(base[4:8], "little")
    # NetCDF describes the characters of a text as integers of one byte, others as strings.
    if is_text and base_family in (_INTEGER, _STRING) and base_size == 1:
        return _Datatype(_ValueKind.TEXT, size)
    if not is_text and base_family == _REFERENCE and base_size == 8 and not base[1] & 0x0F:
        return _Datatype(_ValueKind.REFERENCES, size)
    raise RefusedContentError("has a type that is a list", _STORE_NUMBERS)


@functools.lru_cache(maxsize=4096)
def _read_extent(message: bytes) -> tuple[int, ...] | None:
    """Return the sizes of the dimensions of a dataspace message; None for one without values."""
    version, rank = message[0], message[1]
    if version not in (1, 2):
        raise RefusedContentError("has dimensions in a form that is not known")
    if version == 2 and message[3] == 2:
        return None
    start = 8 if version == 1 else 4
    if rank > 32 or len(message) < start + 8 * rank:
        raise RefusedContentError("has more dimensions than there are")
    return struct.unpack_from(f"<{rank}Q", message, start)


# Attributes of an object: their types, their sizes and their references.


class _Attribute(NamedTuple):
    name: str
    datatype: _Datatype
    size: int  # number of values
    address: int  # of the values


# The NetCDF library reads these into memory of the size that it expects. Each is of one kind of
# values, and has one, or one for each dimension of its variable.
_RESERVED = {
    "CLASS": (_ValueKind.CHARACTERS, False),
    "NAME": (_ValueKind.CHARACTERS, False),
    "_Netcdf4Dimid": (_ValueKind.INTEGER, False),
    "_Netcdf4Coordinates": (_ValueKind.INTEGER, True),
    "_nc3_strict": (_ValueKind.INTEGER, False),
    "DIMENSION_LIST": (_ValueKind.REFERENCES, True),
}
_BACK_REFERENCES = "REFERENCE_LIST"

# Version, flags, and the bytes of name, data type and dataspace.
_HEAD = struct.Struct("<BBHHH")


def _read_attribute(content: Content, start: int) -> _Attribute:
    """Return the attribute whose message begins at an address."""
    version, flags, *sizes = _HEAD.unpack_from(content, start)
    if not 1 <= version <= 3 or (version > 1 and flags):
        raise RefusedContentError("it has an attribute with a type of its own", _STORE_NUMBERS)
    at = start + (_HEAD.size + 1 if version == 3 else _HEAD.size)
    parts = []
    for size in sizes:
        parts.append(content[at : at + size])
        # The first version fills each part up to a multiple of eight bytes.
        at += -(-size // 8) * 8 if version == 1 else size
    name = parts[0].rstrip(b"\0").decode("utf-8", "replace")
    try:
        datatype, extent = _read_datatype(parts[1]), _read_extent(parts[2])
    except RefusedContentError as error:
        raise error.within(f"its attribute {name} ") from None
    size = 0 if extent is None else math.prod(extent)
    if at + size * datatype.size > len(content):
        raise IndexError("the file ends before")
    return _Attribute(name, datatype, size, at)


def _is_expected(attribute: _Attribute, rank: int) -> bool:
    """Check that an attribute has what NetCDF expects by its name.

    The rank is that of the variable that has it, 0 for a group.
    """
    kind = attribute.datatype.kind
    if attribute.name in _RESERVED:
        expected, along_dimensions = _RESERVED[attribute.name]
        return kind is expected and attribute.size == (rank if along_dimensions else 1)
    if kind is _ValueKind.BACK_REFERENCES:
        return attribute.name == _BACK_REFERENCES
    return kind is not _ValueKind.REFERENCES


# Messages of an object header, which describe a group or a variable.


class _MessageKind(IntEnum):
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


class _Message(NamedTuple):
    """One message: its kind, and where its body begins and ends."""

    kind: int
    start: int
    end: int


_KNOWN = frozenset(map(int, _MessageKind))
_NIL, _CONTINUATION = int(_MessageKind.NIL), int(_MessageKind.CONTINUATION)
_SYMBOL_TABLE = 0x11  # of a group in the form before HDF5 1.8
_SHARED = 0x02

# Kind, size and flags of a message, by the version of the object header.
_HEADS = {1: struct.Struct("<HHB3x"), 2: struct.Struct("<BHB")}
_HEAD_WITH_ORDER = struct.Struct("<BHB2x")

# A variable has 20, with up to eight attributes; more attributes stand elsewhere.
_MOST_MESSAGES = 1_000


def _read_messages(content: Content, address: int) -> Iterator[_Message]:
    """Yield the messages of the object header at an address, without the empty ones.

    Shared ones, and those of a kind that is not listed here, are refused.
    """
    # Before and after the messages of a further block there may be a signature and a checksum.
    if _has_signature(content, address, b"OHDR", 2):
        flags = content[address + 5]
        start = address + 6 + 16 * bool(flags & 0x20) + 4 * bool(flags & 0x10)
        width = 1 << (flags & 0x03)
        blocks = [(start + width, _uint(content, start, width))]
        head, edges = (_HEAD_WITH_ORDER if flags & 0x04 else _HEADS[2]), (4, 4)
    elif content[address] == 1:
        blocks = [(address + 16, _uint(content, address + 8, 4))]
        head, edges = _HEADS[1], (0, 0)
    else:
        raise RefusedContentError("is not there")
    count = 0
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
                place, size = _uint(content, start, 8), _uint(content, start + 8, 8)
                blocks.append((place + edges[0], size - sum(edges)))
            elif kind != _NIL:
                _check_kind(kind, flags)
                yield _Message(kind, start, at)


def _check_kind(kind: int, flags: int) -> None:
    if kind == _SYMBOL_TABLE:
        found = "is a group of an HDF5 file that is no NetCDF"
        raise RefusedContentError(found, 'write it with xarray ("to_netcdf")')
    if kind not in _KNOWN:
        raise RefusedContentError(f"is in a form that NetCDF does not write ({kind})")
    if flags & _SHARED:
        raise RefusedContentError("has a type of its own", _STORE_NUMBERS)


# Many links or attributes of one object: a fractal heap, and the B-trees into it.

# Where a heap's identifier begins in the records of a B-tree, by the tree's type: links by name and
# by order of creation, attributes likewise. Of attributes it has 8 bytes, of links 7.
_IDENTIFIERS = {5: 4, 6: 8, 8: 0, 9: 0}
_HUGE = 1  # the type of the tree of objects beside a heap
_MOST_DEPTH = 8
_MOST_HUGE = 1_000


def _heap_objects(content: Content, heap: int, trees: Sequence[int]) -> Iterator[int]:
    """Yield the addresses of the objects in a fractal heap, once for each B-tree that has them.

    The library may go by any of the trees, so that objects of all of them are wanted.
    """
    if heap == UNDEFINED:
        return
    opened = _FractalHeap.read(content, heap)
    for tree in trees:
        if tree != UNDEFINED:
            kind, records = _tree_records(content, tree)
            if kind not in _IDENTIFIERS:
                raise _unreadable()
            for record in records:
                yield opened.address(content, record + _IDENTIFIERS[kind])


@dataclass(frozen=True)
class _FractalHeap:
    huge_tree: int
    width: int
    start_size: int
    largest_direct: int
    offset_width: int
    root: int
    rows: int

    @classmethod
    def read(cls, content: Content, at: int) -> _FractalHeap:
        if not _has_signature(content, at, b"FRHP") or _uint(content, at + 7, 2):
            raise _unreadable()
        heap = cls(
            huge_tree=_uint(content, at + 22, 8),
            width=_uint(content, at + 110, 2),
            start_size=_uint(content, at + 112, 8),
            largest_direct=_uint(content, at + 120, 8),
            offset_width=(_uint(content, at + 128, 2) + 7) // 8,
            root=_uint(content, at + 132, 8),
            rows=_uint(content, at + 140, 2),
        )
        sizes = (heap.width, heap.start_size, heap.largest_direct)
        if any(size < 1 or size & (size - 1) for size in sizes) or heap.rows > 64:
            raise _unreadable()
        return heap

    def address(self, content: Content, identifier: int) -> int:
        """Return the address of the object whose identifier stands at an address."""
        flags = content[identifier]
        if flags == 0x00:
            return self._managed(content, _uint(content, identifier + 1, self.offset_width))
        kind, records = _tree_records(content, self.huge_tree) if flags == 0x10 else (0, iter(()))
        wanted = content[identifier + 1 : identifier + 8] + b"\0"
        for record in islice(records, _MOST_HUGE) if kind == _HUGE else ():
            if _stored_bytes(content, record + 16, 8) == wanted:
                return _uint(content, record, 8)
        raise _unreadable()

    def _managed(self, content: Content, offset: int) -> int:
        block, rows, first_row = self.root, self.rows, self.width * self.start_size
        while rows:
            row = (offset // first_row).bit_length()
            size = self.start_size << max(row - 1, 0)
            first = self.width * size if row else 0
            column = (offset - first) // size
            if row >= rows or not _has_signature(content, block, b"FHIB"):
                raise _unreadable()
            child = block + 13 + self.offset_width + 8 * (row * self.width + column)
            block = _uint(content, child, 8)
            offset -= first + column * size
            rows = 0 if size <= self.largest_direct else (size // first_row).bit_length()
        if not _has_signature(content, block, b"FHDB"):
            raise _unreadable()
        return block + offset


def _tree_records(content: Content, at: int) -> tuple[int, Iterator[int]]:
    """Return the type of a version 2 B-tree, and the addresses of its records."""
    if not _has_signature(content, at, b"BTHD"):
        raise _unreadable()
    node_size, size = _uint(content, at + 6, 4), _uint(content, at + 10, 2)
    depth, root = _uint(content, at + 12, 2), _uint(content, at + 16, 8)
    count = _uint(content, at + 24, 2)
    if not size or depth > _MOST_DEPTH:
        raise _unreadable()
    # The bytes of both counts beside the pointers of the nodes, from the leaves up.
    most = (node_size - 10) // size
    leaf_width = _limit_width(most)
    widths, together, together_width = [], most, 0
    for _ in range(depth):
        widths.append((leaf_width, together_width))
        pointer = 8 + leaf_width + together_width
        most = (node_size - 10 - pointer) // (size + pointer)
        together = (most + 1) * together + most
        together_width = _limit_width(together)
    return content[at + 5], _node_records(content, root, count, size, widths)


def _node_records(
    content: Content, node: int, count: int, size: int, widths: list[tuple[int, int]]
) -> Iterator[int]:
    if node == UNDEFINED and not count:
        return
    if not _has_signature(content, node, b"BTIN" if widths else b"BTLF"):
        raise _unreadable()
    end = node + 6 + count * size
    yield from range(node + 6, end, size)
    if widths:
        width, together = widths[-1]
        for child in range(count + 1):
            at = end + child * (8 + width + together)
            yield from _node_records(
                content, _uint(content, at, 8), _uint(content, at + 8, width), size, widths[:-1]
            )


def _unreadable() -> RefusedContentError:
    return RefusedContentError("it has links or attributes in a form that NetCDF does not write")


# Links of a group to the groups and variables in it.

_HARD, _SOFT, _EXTERNAL = 0, 1, 64


def _read_link(content: Content, start: int) -> tuple[str, int]:
    """Return the name of a group or a variable, and the address of its object header.

    A link to another file, or to a path instead of an object, is refused.
    """
    version, flags = content[start], content[start + 1]
    at = start + 2
    kind = content[at] if flags & 0x08 else _HARD
    at += bool(flags & 0x08) + 8 * bool(flags & 0x04) + bool(flags & 0x10)
    width = 1 << (flags & 0x03)
    size = _uint(content, at, width)
    at += width
    name = content[at : at + min(size, 1000)].decode("utf-8", "replace")
    if kind == _EXTERNAL:
        raise RefusedContentError(f"it refers to another file (from {name})")
    if kind == _SOFT:
        raise RefusedContentError(f"it has a link to a path ({name})")
    if version != 1 or kind != _HARD or not name or "/" in name:
        raise RefusedContentError(f"it has a link that NetCDF does not write ({name})")
    return name, _uint(content, at + size, 8)


# Variables: their types, their sizes and where their values are.

# What every variable has, and once.
_VARIABLE_MESSAGES = frozenset({_MessageKind.DATASPACE, _MessageKind.DATATYPE, _MessageKind.LAYOUT})

_COMPACT, _CONTIGUOUS, _CHUNKED, _VIRTUAL = range(4)
# The later two differ in the indexes of chunks, which only the library reads.
_LAYOUT_VERSIONS = (3, 4, 5)
# Filters that are part of the library: deflate, shuffle, Fletcher's checksum. It loads others.
_FILTERS = (1, 2, 3)
_OTHER_FILTERS = {4: "szip", 307: "bzip2", 32000: "lzf", 32001: "blosc", 32015: "zstd"}

_PLAIN_TEXTS = 'copy it by "nccopy -d 0 in.nc out.nc"'

_NODE_HEAD = 24  # bytes of a node of a tree of chunks before its keys


class _StoredVariable(NamedTuple):
    rank: int
    memory: int  # bytes, without those of texts
    texts: list[tuple[int, int]]  # addresses of references to texts, and how many are there


def _read_variable(content: Content, messages: Iterable[_Message]) -> _StoredVariable:
    """Return the variable whose object header has some messages."""
    bodies: dict[int, _Message] = {}
    for message in messages:
        if message.kind in _VARIABLE_MESSAGES and message.kind in bodies:
            raise RefusedContentError("is described twice")
        bodies[message.kind] = message
    if _MessageKind.FILTERS in bodies:
        _check_filters(content, bodies[_MessageKind.FILTERS].start)
    space, described = bodies[_MessageKind.DATASPACE], bodies[_MessageKind.DATATYPE]
    extent = _read_extent(content[space.start : space.end])
    kind, width = _read_datatype(content[described.start : described.end])
    if extent is None or kind in (_ValueKind.REFERENCES, _ValueKind.BACK_REFERENCES):
        raise RefusedContentError("has no values, or none that can be read")
    count, layout = math.prod(extent), bodies[_MessageKind.LAYOUT].start
    address, chunk = _stored(content, layout, count * width)
    texts: list[tuple[int, int]] = []
    if kind is _ValueKind.TEXT:
        if count and chunk:
            if _MessageKind.FILTERS in bodies or content[layout] != _LAYOUT_VERSIONS[0]:
                found = "has texts in chunks that are compressed, or of a later form"
                raise RefusedContentError(found, _PLAIN_TEXTS)
            texts = [(each, chunk // width) for each in _chunks(content, layout)]
        elif count and address != UNDEFINED:
            texts = [(address, count)]
        texts += [(at, 1) for at in _fill_texts(content, bodies)]
    return _StoredVariable(len(extent), count * width + chunk, texts)


def _stored(content: Content, at: int, size: int) -> tuple[int, int]:
    """Return where values of some bytes are stored, or else the bytes of one chunk of them."""
    version, layout = content[at], content[at + 1]
    if layout == _VIRTUAL:
        raise RefusedContentError("refers to other files")
    if version not in _LAYOUT_VERSIONS or layout > _VIRTUAL:
        raise RefusedContentError("is stored in a form that is not known")
    if layout == _CHUNKED:
        return UNDEFINED, _chunk_bytes(content, at)
    if layout == _COMPACT:
        address, stored = at + 4, _uint(content, at + 2, 2)
    else:
        address, stored = _uint(content, at + 2, 8), _uint(content, at + 10, 8)
    if address != UNDEFINED and (stored < size or address + stored > len(content)):
        raise IndexError("the file ends before")
    return address, 0


def _chunk_bytes(content: Content, at: int) -> int:
    if content[at] == _LAYOUT_VERSIONS[0]:
        rank, sizes, width = content[at + 2], at + 11, 4
    else:
        rank, sizes, width = content[at + 3], at + 5, content[at + 4]
    # The last of the dimensions is the size of a value.
    return math.prod(_uint(content, sizes + number * width, width) for number in range(rank))


def _fill_texts(content: Content, bodies: Mapping[int, _Message]) -> Iterator[int]:
    """Yield the address of the reference to the text that fills a variable, where it has one."""
    for kind in (_MessageKind.FILL_VALUE, _MessageKind.OLD_FILL_VALUE):
        if kind in bodies:
            start = bodies[kind].start
            is_defined, at = True, start
            if kind == _MessageKind.FILL_VALUE and content[start] >= 3:
                is_defined, at = bool(content[start + 1] & 0x20), start + 2
            elif kind == _MessageKind.FILL_VALUE:
                is_defined, at = content[start] < 2 or bool(content[start + 3]), start + 4
            if is_defined and _uint(content, at, 4):
                yield at + 4


def _chunks(content: Content, layout: int) -> Iterator[int]:
    """Yield the addresses of the chunks of a variable, whose layout is of the third version."""
    # A key has the bytes of a chunk, its filters, and its place along each dimension.
    chunk = _chunk_bytes(content, layout)
    step = 8 + 8 * content[layout + 2] + 8
    nodes, seen = [(_uint(content, layout + 3, 8), -1)], set()
    while nodes:
        node, level = nodes.pop()
        if node == UNDEFINED:
            continue
        found, entries = content[node + 5], _uint(content, node + 6, 2)
        is_right = content[node : node + 5] == b"TREE\x01" and level in (-1, found)
        if not is_right or node in seen:
            raise RefusedContentError("is stored in a form that is not known")
        seen.add(node)
        for key in range(node + _NODE_HEAD, node + _NODE_HEAD + entries * step, step):
            child = _uint(content, key + step - 8, 8)
            if found:
                nodes.append((child, found - 1))
            elif _uint(content, key, 4) != chunk or child in seen:
                raise RefusedContentError("is stored in a form that is not known")
            else:
                seen.add(child)
                yield child


def _check_filters(content: Content, start: int) -> None:
    """Refuse compression for which the library would load code."""
    version, count = content[start], content[start + 1]
    at = start + (8 if version == 1 else 2)
    for _ in range(count):
        number = _uint(content, at, 2)
        if number not in _FILTERS:
            name = _OTHER_FILTERS.get(number, "a filter that HDF5 would have to load")
            remedy = 'copy it by "nccopy -d 1 in.nc out.nc"'
            raise RefusedContentError(f"is compressed by filter {number}, {name}", remedy)
        if version == 1:
            length, values = _uint(content, at + 2, 2), _uint(content, at + 6, 2)
            at += 8 + length + 4 * (values + values % 2)
        else:  # names belong to other filters
            at += 6 + 4 * _uint(content, at + 4, 2)


# Search of a whole HDF5 file for what uqpen does not write.

_LINKS = frozenset({_MessageKind.LINK, _MessageKind.LINK_INFO})


def check_hdf5(content: Content, limits: ContentLimits) -> None:
    """Refuse a file that the HDF5 library must not get, with the first reason found.

    It gets what refers to no other file, has no types but those that NetCDF and NumPy share, and
    keeps within the limits.
    """
    try:
        _Inspection(content, limits).run()
    except (IndexError, OverflowError, struct.error):
        raise RefusedContentError("it ends before what it describes") from None


@dataclass
class _Inspection:
    content: Content
    limits: ContentLimits
    groups: int = 0
    variables: int = 0
    memory: int = 0
    known: dict[int, bool] = field(default_factory=dict)
    dimensions: list[tuple[str, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.heap = _GlobalHeap(self.content)

    def run(self) -> None:
        """Go through all groups; a reason to refuse the file is raised."""
        self._object(_root_address(self.content), "", 0)
        for name, address in self.dimensions:
            if self.known.get(address) is not True:
                raise RefusedContentError(f"its variable {name} has dimensions that are none")

    def _object(self, address: int, path: str, depth: int) -> None:
        if address in self.known:
            raise RefusedContentError(f"it has {path or '/'} under two names")
        try:
            messages = list(_read_messages(self.content, address))
        except RefusedContentError as error:
            raise error.within(f"its {path or '/'} ") from None
        kinds = {message.kind for message in messages}
        if _MessageKind.EXTERNAL_FILES in kinds:
            raise RefusedContentError(f"its variable {path} refers to another file")
        is_variable, is_group = kinds >= _VARIABLE_MESSAGES, not _LINKS.isdisjoint(kinds)
        if not is_group and kinds & _VARIABLE_MESSAGES == {_MessageKind.DATATYPE}:
            raise RefusedContentError(f"its {path} is a data type of its own", _STORE_NUMBERS)
        if is_variable == is_group or (is_group and kinds & _VARIABLE_MESSAGES):
            raise RefusedContentError(f"it has {path or '/'}, neither group nor variable")
        self.known[address] = is_variable
        if is_variable:
            self._variable(messages, path)
        else:
            self._group(messages, path, depth)

    def _group(self, messages: list[_Message], path: str, depth: int) -> None:
        self.groups += 1
        check_count(self.groups, self.limits.groups, "groups")
        if depth > self.limits.depth:
            raise RefusedContentError(f"it has groups more than {self.limits.depth} deep")
        self._attributes(messages, path or "/", 0)
        links: dict[str, int] = {}
        for place in self._parts(messages, _MessageKind.LINK, _MessageKind.LINK_INFO):
            name, address = _read_link(self.content, place)
            if links.setdefault(name, address) != address:
                raise RefusedContentError(f"it has two objects by the name {path}/{name}")
            check_count(len(links), self.limits.links, "objects in one group")
        for name, address in links.items():
            self._object(address, f"{path}/{name}", depth + 1)
        in_group = sum(self.known[each] for each in links.values())
        check_count(in_group, self.limits.in_group, "variables in one group")

    def _variable(self, messages: list[_Message], path: str) -> None:
        self.variables += 1
        check_count(self.variables, self.limits.variables, "variables")
        try:
            variable = _read_variable(self.content, messages)
        except RefusedContentError as error:
            raise error.within(f"its variable {path} ") from None
        self.memory += variable.memory
        for address, count in variable.texts:
            self.heap.count_texts(address, count)
        most = self.limits.most_memory(self.content)
        if self.memory + self.heap.text_bytes > most:
            raise RefusedContentError(
                f"with its variable {path} it takes over {most / 1e6:.0f} MB of memory, "
                f"and has {len(self.content) / 1e6:.1f} MB itself"
            )
        for attribute in self._attributes(messages, path, variable.rank):
            if attribute.name == "DIMENSION_LIST":
                found = self.heap.object_addresses(attribute.address, attribute.size)
                self.dimensions.extend((path, address) for address in found)

    def _attributes(self, messages: list[_Message], path: str, rank: int) -> list[_Attribute]:
        """Return the attributes of an object after a check of each."""
        found = []
        try:
            for place in self._parts(messages, _MessageKind.ATTRIBUTE, _MessageKind.ATTRIBUTE_INFO):
                attribute = _read_attribute(self.content, place)
                if not _is_expected(attribute, rank):
                    wrong = "has another type or number of values"
                    raise RefusedContentError(f"its attribute {attribute.name} {wrong}")
                if attribute.datatype.kind is _ValueKind.TEXT:
                    self.heap.count_texts(attribute.address, attribute.size)
                found.append(attribute)
                check_count(len(found), self.limits.attributes, "attributes of one object")
        except RefusedContentError as error:
            raise error.within(after=f", at {path}") from None
        return found

    def _parts(self, messages: list[_Message], kind: int, info: int) -> Iterator[int]:
        """Yield where links or attributes begin, in the object header and in its heap."""
        # Before the addresses stands the number of the last part, in two widths.
        width = 8 if info == _MessageKind.LINK_INFO else 2
        seen = set()
        for message in messages:
            if message.kind == kind:
                yield message.start
            elif message.kind == info:
                flags = self.content[message.start + 1]
                at = message.start + 2 + width * (flags & 0x01)
                heap, *trees = (
                    _uint(self.content, at + 8 * each, 8) for each in range(2 + bool(flags & 0x02))
                )
                for place in _heap_objects(self.content, heap, trees):
                    if place not in seen:
                        seen.add(place)
                        yield place
