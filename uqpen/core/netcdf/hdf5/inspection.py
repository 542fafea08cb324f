"""Search of a whole HDF5 file for what uqpen does not write."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from uqpen.core.netcdf.content import (
    Content,
    ContentLimits,
    RefusedContentError,
    check_count,
    uint,
)
from uqpen.core.netcdf.hdf5.attributes import Attribute, check_attribute, read_attribute
from uqpen.core.netcdf.hdf5.datatypes import STORE_NUMBERS
from uqpen.core.netcdf.hdf5.global_heap import GlobalHeap
from uqpen.core.netcdf.hdf5.indexes import heap_objects
from uqpen.core.netcdf.hdf5.links import read_link
from uqpen.core.netcdf.hdf5.object_header import Message, MessageKind, read_messages
from uqpen.core.netcdf.hdf5.superblock import root_address
from uqpen.core.netcdf.hdf5.variables import VARIABLE_MESSAGES, StoredVariable, read_variable

__all__ = ["check_hdf5"]

_LINKS = frozenset({MessageKind.LINK, MessageKind.LINK_INFO})


def check_hdf5(content: Content, limits: ContentLimits) -> None:
    """Refuse a file that the HDF5 library must not get.

    It gets what refers to no other file, has no types but those that NetCDF and NumPy share, and
    keeps within the limits.

    Raises
    ------
    RefusedContentError
        With the first reason found.
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
            raise error.within(f"its {path or '/'} ") from None
        kinds = {message.kind for message in messages}
        if MessageKind.EXTERNAL_FILES in kinds:
            raise RefusedContentError(f"its variable {path} refers to another file")
        is_variable, is_group = kinds >= VARIABLE_MESSAGES, not _LINKS.isdisjoint(kinds)
        if not is_group and kinds & VARIABLE_MESSAGES == {MessageKind.DATATYPE}:
            raise RefusedContentError(f"its {path} is a data type of its own", STORE_NUMBERS)
        if is_variable == is_group or (is_group and kinds & VARIABLE_MESSAGES):
            raise RefusedContentError(f"it has {path or '/'}, neither group nor variable")
        self.known[address] = is_variable
        if is_variable:
            self._variable(messages, path)
        else:
            self._group(messages, path, depth)

    def _group(self, messages: list[Message], path: str, depth: int) -> None:
        self.groups += 1
        check_count(self.groups, self.limits.groups, "groups")
        if depth > self.limits.depth:
            raise RefusedContentError(f"it has groups more than {self.limits.depth} deep")
        self._attributes(messages, path or "/", 0)
        links: dict[str, int] = {}
        for place in self._parts(messages, MessageKind.LINK, MessageKind.LINK_INFO):
            name, address = read_link(self.content, place)
            if links.setdefault(name, address) != address:
                raise RefusedContentError(f"it has two objects by the name {path}/{name}")
            check_count(len(links), self.limits.links, "objects in one group")
        for name, address in links.items():
            self._object(address, f"{path}/{name}", depth + 1)
        in_group = sum(self.known[each] for each in links.values())
        check_count(in_group, self.limits.in_group, "variables in one group")

    def _variable(self, messages: list[Message], path: str) -> None:
        self.variables += 1
        check_count(self.variables, self.limits.variables, "variables")
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
                check_count(len(found), self.limits.attributes, "attributes of one object")
        except RefusedContentError as error:
            raise error.within(after=f", at {path}") from None
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
        for address, count in variable.texts:
            self.heap.count_texts(address, count)
        most = self.limits.most_memory(self.content)
        if self.memory + self.heap.text_bytes > most:
            raise RefusedContentError(
                f"with its variable {path} it takes over {most / 1e6:.0f} MB of memory, "
                f"and has {len(self.content) / 1e6:.1f} MB itself"
            )
