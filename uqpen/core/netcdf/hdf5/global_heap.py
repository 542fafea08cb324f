"""Global heap of a file: texts of any length, and lists of references."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from uqpen.core.netcdf.content import Content, RefusedContentError, uint

__all__ = ["GlobalHeap"]

# How a variable or an attribute refers to an entry of the heap.
_REFERENCE = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])

# How a collection of entries begins, and the index and the size of an entry before its bytes.
_COLLECTION = b"GCOL\x01"
_ENTRY = struct.Struct("<H6xQ")


@dataclass
class GlobalHeap:
    """Heap of a file. It counts the bytes of texts that were asked for."""

    content: Content
    text_bytes: int = 0
    _count: int = 0
    _collections: dict[int, dict[int, tuple[int, int]]] = field(default_factory=dict)

    def count_texts(self, address: int, count: int) -> None:
        """Add the lengths of `count` texts whose references stand at an address.

        Texts that share an entry take memory each.
        """
        stored = self.content[address : address + count * _REFERENCE.itemsize]
        if len(stored) != count * _REFERENCE.itemsize:
            raise IndexError("the file ends before")
        references = np.frombuffer(stored, _REFERENCE)
        self.text_bytes += int(references["length"].sum(dtype=np.uint64))
        for place in np.unique(references["address"]).tolist():
            if place:  # or the text is empty
                self._collection(place)

    def object_references(self, address: int, count: int) -> list[int]:
        """Return the addresses to which `count` lists refer, each a list of one."""
        found = []
        for at in range(address, address + count * _REFERENCE.itemsize, _REFERENCE.itemsize):
            length, place = uint(self.content, at, 4), uint(self.content, at + 4, 8)
            entries = self._collection(place)
            start, size = entries.get(uint(self.content, at + 12, 4), (0, 0))
            if length != 1 or size != 8:
                raise RefusedContentError("it has dimensions that are none")
            found.append(uint(self.content, start, 8))
        return found

    def _collection(self, at: int) -> dict[int, tuple[int, int]]:
        """Return where the entries of a collection stand, and their sizes.

        It is refused if the library could not go through it.
        """
        if at not in self._collections:
            if self.content[at : at + len(_COLLECTION)] != _COLLECTION:
                raise RefusedContentError("it has texts or dimensions that are none")
            self._collections[at] = found = {}
            for index, place in self._entries(at):
                found[index] = place
                self._count += 1
                if self._count > len(self.content) // _ENTRY.size:
                    raise RefusedContentError("it has texts that lie on each other")
            found.pop(0, None)
        return self._collections[at]

    def _entries(self, at: int) -> Iterator[tuple[int, tuple[int, int]]]:
        """Yield the indexes of entries, 0 for free room, with their places and sizes."""
        end = at + uint(self.content, at + 8, 8)
        at += _ENTRY.size
        while at + _ENTRY.size <= end:
            index, size = _ENTRY.unpack_from(self.content, at)
            # The size of free room includes its head, and that of an entry does not.
            step = _ENTRY.size + -(-size // 8) * 8 if index else size
            # The library would go on without end where an entry takes no room.
            if step < _ENTRY.size or at + step > end:
                raise RefusedContentError("it has texts whose lengths are damaged")
            yield index, (at + _ENTRY.size, size)
            at += step
