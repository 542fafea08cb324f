"""Many links or attributes of one object: a fractal heap, and the B-trees into it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from uqpen.core.netcdf.content import (
    UNDEFINED,
    Content,
    RefusedContentError,
    has_signature,
    limit_width,
    uint,
)

__all__ = ["heap_objects"]

# Where a heap's identifier begins in the records of a B-tree, by the tree's type: links by name and
# by order of creation, attributes likewise. Of attributes it has 8 bytes, of links 7.
_IDENTIFIERS = {5: 4, 6: 8, 8: 0, 9: 0}
_HUGE = 1  # the type of the tree of objects beside a heap
_MOST_DEPTH = 8
_MOST_HUGE = 1_000


def heap_objects(content: Content, heap: int, trees: tuple[int, ...]) -> Iterator[int]:
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
        if not has_signature(content, at, b"FRHP", 0) or uint(content, at + 7, 2):
            raise _unreadable()
        heap = cls(
            huge_tree=uint(content, at + 22, 8),
            width=uint(content, at + 110, 2),
            start_size=uint(content, at + 112, 8),
            largest_direct=uint(content, at + 120, 8),
            offset_width=(uint(content, at + 128, 2) + 7) // 8,
            root=uint(content, at + 132, 8),
            rows=uint(content, at + 140, 2),
        )
        sizes = (heap.width, heap.start_size, heap.largest_direct)
        if any(size < 1 or size & (size - 1) for size in sizes) or heap.rows > 64:
            raise _unreadable()
        return heap

    def address(self, content: Content, identifier: int) -> int:
        """Return the address of the object whose identifier stands at an address."""
        flags = content[identifier]
        if flags == 0x00:
            return self._managed(content, uint(content, identifier + 1, self.offset_width))
        if flags == 0x10:
            return self._huge(content, uint(content, identifier + 1, 7))
        raise _unreadable()

    def _managed(self, content: Content, offset: int) -> int:
        block, rows = self.root, self.rows
        while rows:
            row = max((offset // (self.width * self.start_size)).bit_length(), 0)
            size = self.start_size << max(row - 1, 0)
            first = self.width * size if row else 0
            column = (offset - first) // size
            if row >= rows or not has_signature(content, block, b"FHIB", 0):
                raise _unreadable()
            child = block + 13 + self.offset_width + 8 * (row * self.width + column)
            block = uint(content, child, 8)
            offset = offset - first - column * size
            is_direct = size <= self.largest_direct
            rows = 0 if is_direct else (size // (self.width * self.start_size)).bit_length()
        if not has_signature(content, block, b"FHDB", 0):
            raise _unreadable()
        return block + offset

    def _huge(self, content: Content, identifier: int) -> int:
        kind, records = _tree_records(content, self.huge_tree)
        for record in islice(records, _MOST_HUGE) if kind == _HUGE else ():
            if uint(content, record + 16, 8) == identifier:
                return uint(content, record, 8)
        raise _unreadable()


def _tree_records(content: Content, at: int) -> tuple[int, Iterator[int]]:
    """Return the type of a version 2 B-tree, and the addresses of its records."""
    if not has_signature(content, at, b"BTHD", 0):
        raise _unreadable()
    node_size, size = uint(content, at + 6, 4), uint(content, at + 10, 2)
    depth, root, count = (
        uint(content, at + 12, 2),
        uint(content, at + 16, 8),
        uint(content, at + 24, 2),
    )
    if not size or depth > _MOST_DEPTH:
        raise _unreadable()
    widths = _pointer_widths(node_size, size, depth)
    return content[at + 5], _node_records(content, root, count, size, widths)


def _pointer_widths(node_size: int, size: int, depth: int) -> list[tuple[int, int]]:
    """Return the bytes of both counts beside the pointers of the nodes, from the leaves up."""
    most = (node_size - 10) // size
    leaf_width = limit_width(most)
    widths, together, together_width = [], most, 0
    for _ in range(depth):
        widths.append((leaf_width, together_width))
        pointer = 8 + leaf_width + together_width
        most = (node_size - 10 - pointer) // (size + pointer)
        together = (most + 1) * together + most
        together_width = limit_width(together)
    return widths


def _node_records(
    content: Content, node: int, count: int, size: int, widths: list[tuple[int, int]]
) -> Iterator[int]:
    if node == UNDEFINED and not count:
        return
    if not has_signature(content, node, b"BTIN" if widths else b"BTLF", 0):
        raise _unreadable()
    end = node + 6 + count * size
    yield from range(node + 6, end, size)
    if widths:
        width, together = widths[-1]
        for child in range(count + 1):
            at = end + child * (8 + width + together)
            yield from _node_records(
                content, uint(content, at, 8), uint(content, at + 8, width), size, widths[:-1]
            )


def _unreadable() -> RefusedContentError:
    return RefusedContentError("it has links or attributes in a form that NetCDF does not write")
