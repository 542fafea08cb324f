"""Search of a whole HDF5 file for what uqpen does not write."""

from __future__ import annotations

import math
import mmap
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from uqpen.archive.hdf5.attributes import Attribute, check_attribute, read_attribute
from uqpen.archive.hdf5.content import UNDEFINED, Content, RefusedContentError, uint
from uqpen.archive.hdf5.global_heap import GlobalHeap
from uqpen.archive.hdf5.indexes import heap_objects
from uqpen.archive.hdf5.links import read_link
from uqpen.archive.hdf5.object_header import Message, MessageKind, read_messages
from uqpen.archive.hdf5.superblock import SIGNATURE, root_address
from uqpen.archive.hdf5.variables import VARIABLE_MESSAGES, StoredVariable, read_variable

__all__ = ["find_refusal"]

# uqpen writes one group for each output and source: ten sources of a thousand outputs.
_MOST_GROUPS = 10_000
# It writes 15 to 60 variables in a group of statistics, and as many as a study has inputs and
# outputs in a group of runs.
_MOST_VARIABLES = 100_000
_MOST_IN_GROUP = 2_500
# Outputs of a source, inputs and outputs of runs.
_MOST_LINKS = 10_000
# It writes at most 30 attributes of an object.
_MOST_ATTRIBUTES = 300
# The deepest of uqpen's groups is /models/<name>/statistics/<source>/<output>.
_MOST_DEPTH = 8
# What uqpen writes takes as much memory as disk. Other software may have compressed a copy: runs
# shrink to a half, columns of one value to a hundredth.
_MOST_BYTES_PER_BYTE = 50
_MOST_BYTES_ANYWAY = 1 << 24

_IN_GROUP = "variables in one group"

_LINKS = frozenset({MessageKind.LINK, MessageKind.LINK_INFO})


def find_refusal(path: Path) -> str | None:
    """Return why the HDF5 library does not get a file, or None if it gets it.

    It gets what refers to no other file, has no types but those that NetCDF and NumPy share, and
    takes no more memory than an archive would. The reason is a clause on "it", the file.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as stream:
        if stream.read(len(SIGNATURE)) != SIGNATURE:
            return "it is no HDF5 file"
        with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
            try:
                _Inspection(content).run()
            except RefusedContentError as error:
                return str(error)
            except (IndexError, OverflowError, struct.error):
                return "it ends before what it describes"
    return None


@dataclass
class _Inspection:
    content: Content
    groups: int = 0
    variables: int = 0
    memory: int = 0
    known: dict[int, bool] = field(default_factory=dict)
    dimensions: list[tuple[str, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.heap = GlobalHeap(self.content)

    def run(self) -> None:
        """Go through all groups; a reason to refuse the file is raised."""
        self._object(root_address(self.content), "", 0)
        for name, address in self.dimensions:
            if self.known.get(address) is not True:
                raise RefusedContentError(f"its variable {name} has dimensions that are none")

    def _object(self, address: int, path: str, depth: int) -> None:
        if address in self.known:
            raise RefusedContentError(f"it has {path or '/'} under two names")
        try:
            messages = list(read_messages(self.content, address))
        except RefusedContentError as error:
            raise RefusedContentError(f"its {path or '/'} {error}") from None
        kinds = {message.kind for message in messages}
        if MessageKind.EXTERNAL_FILES in kinds:
            raise RefusedContentError(f"its variable {path} refers to another file")
        is_variable, is_group = kinds >= VARIABLE_MESSAGES, not _LINKS.isdisjoint(kinds)
        if is_variable == is_group or (is_group and kinds & VARIABLE_MESSAGES):
            raise RefusedContentError(f"it has {path or '/'}, neither group nor variable")
        self.known[address] = is_variable
        if is_variable:
            self._variable(messages, path)
        else:
            self._group(messages, path, depth)

    def _group(self, messages: list[Message], path: str, depth: int) -> None:
        self.groups += 1
        _limit(self.groups, _MOST_GROUPS, "groups")
        if depth > _MOST_DEPTH:
            raise RefusedContentError(f"it has groups more than {_MOST_DEPTH} deep")
        self._attributes(messages, path or "/", 0)
        links: dict[str, int] = {}
        for place in self._parts(messages, MessageKind.LINK, MessageKind.LINK_INFO):
            name, address = read_link(self.content, place)
            if links.setdefault(name, address) != address:
                raise RefusedContentError(f"it has two objects by the name {path}/{name}")
            _limit(len(links), _MOST_LINKS, "objects in one group")
        for name, address in links.items():
            self._object(address, f"{path}/{name}", depth + 1)
        _limit(sum(self.known[each] for each in links.values()), _MOST_IN_GROUP, _IN_GROUP)

    def _variable(self, messages: list[Message], path: str) -> None:
        self.variables += 1
        _limit(self.variables, _MOST_VARIABLES, "variables")
        variable = read_variable(self.content, messages, path)
        self._use(variable, path)
        for attribute in self._attributes(messages, path, len(variable.extent)):
            if attribute.name == "DIMENSION_LIST":
                found = self.heap.object_references(attribute.address, attribute.size)
                self.dimensions.extend((path, address) for address in found)

    def _attributes(self, messages: list[Message], path: str, rank: int) -> list[Attribute]:
        """Return the attributes of an object after a check of each."""
        found = []
        try:
            for place in self._parts(messages, MessageKind.ATTRIBUTE, MessageKind.ATTRIBUTE_INFO):
                attribute = read_attribute(self.content, place)
                check_attribute(attribute, rank, self.heap)
                found.append(attribute)
                _limit(len(found), _MOST_ATTRIBUTES, "attributes of one object")
        except RefusedContentError as error:
            raise RefusedContentError(f"{error}, at {path}") from None
        return found

    def _parts(self, messages: list[Message], kind: int, info: int) -> Iterator[int]:
        """Yield where links or attributes begin, in the object header and in its heap."""
        # Before the addresses stands the number of the last part, in two widths.
        width = 8 if info == MessageKind.LINK_INFO else 2
        seen = set()
        for message in messages:
            if message.kind == kind:
                yield message.start
            elif message.kind == info:
                flags = self.content[message.start + 1]
                at = message.start + 2 + width * (flags & 0x01)
                heap, *trees = (
                    uint(self.content, at + 8 * each, 8) for each in range(2 + bool(flags & 0x02))
                )
                for place in heap_objects(self.content, heap, tuple(trees)):
                    if place not in seen:
                        seen.add(place)
                        yield place

    def _use(self, variable: StoredVariable, path: str) -> None:
        """Count the memory that the values of a variable take."""
        self.memory += variable.memory
        if variable.texts_at != UNDEFINED:
            self.heap.count_texts(variable.texts_at, math.prod(variable.extent))
        most = max(_MOST_BYTES_ANYWAY, _MOST_BYTES_PER_BYTE * len(self.content))
        if self.memory + self.heap.text_bytes > most:
            raise RefusedContentError(
                f"with its variable {path} it takes over {most / 1e6:.0f} MB of memory, "
                f"and has {len(self.content) / 1e6:.1f} MB itself"
            )


def _limit(count: int, most: int, what: str) -> None:
    if count > most:
        raise RefusedContentError(f"it has more than {most} {what}")
