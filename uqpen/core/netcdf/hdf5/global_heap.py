"""Global heap of a file: texts of any length, and lists of references."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from uqpen.core.netcdf.content import Content, RefusedContentError, has_signature, uint

__all__ = ["GlobalHeap"]

# How a variable or an attribute refers to an entry of the heap.
_REFERENCE = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])


@dataclass
class GlobalHeap:
    """Heap of a file. It counts the bytes of texts that were asked for."""

    content: Content
    text_bytes: int = 0
    _collections: dict[int, dict[int, tuple[int, int]]] = field(default_factory=dict)

    def count_texts(self, address: int, count: int) -> None:
        """Add the lengths of `count` texts whose references stand at an address.

        Texts that share an entry take memory each.
        """
        if address + count * _REFERENCE.itemsize > len(self.content):
            raise IndexError("the file ends before")
        references = np.frombuffer(self.content, _REFERENCE, count, address)
        self.text_bytes += int(references["length"].sum(dtype=np.uint64))

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
        """Return where the entries of a collection stand, and their sizes."""
        if at not in self._collections:
            if not has_signature(self.content, at, b"GCOL", 1):
                raise RefusedContentError("it has dimensions that are none")
            end = at + uint(self.content, at + 8, 8)
            self._collections[at] = dict(self._entries(at + 16, min(end, len(self.content))))
        return self._collections[at]

    def _entries(self, at: int, end: int) -> Iterator[tuple[int, tuple[int, int]]]:
        while at + 16 <= end:
            index, size = uint(self.content, at, 2), uint(self.content, at + 8, 8)
            if index == 0:  # the rest is free
                return
            yield index, (at + 16, size)
            at += 16 + -(-size // 8) * 8
