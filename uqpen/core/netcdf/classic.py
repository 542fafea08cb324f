"""Header of a file of NetCDF 3, in its three forms: ``CDF`` and a 1, a 2 or a 5.

The names are those of the "NetCDF Classic Format Specification".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from uqpen.core.netcdf.content import Content, ContentLimits, RefusedContentError, check_count

__all__ = ["MAGIC", "check_classic"]

MAGIC = b"CDF"

# Bytes of a count and of an offset by the version, and those of a value by its type.
_WIDTHS = {1: (4, 4), 2: (4, 8), 5: (8, 8)}
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}
_MOST_TYPES = {1: 6, 2: 6, 5: 11}

_DIMENSION, _VARIABLE, _ATTRIBUTE = 10, 11, 12
_MOST_RANK = 32
_LONGEST_NAME = 256

_DAMAGED = "its header is damaged"


def check_classic(content: Content, limits: ContentLimits) -> None:
    """Refuse a file whose header the library could not follow within the file.

    Raises
    ------
    RefusedContentError
        If a type, a rank, a name or a dimension is none, or values lie outside the file.
    """
    try:
        _Header(content, limits).check()
    except (IndexError, UnicodeDecodeError):
        raise RefusedContentError("it ends before what it describes") from None


@dataclass
class _Header:
    content: Content
    limits: ContentLimits
    at: int = 4

    def check(self) -> None:
        """Go through the header; a reason to refuse the file is raised."""
        version = self.content[3]
        if version not in _WIDTHS:
            raise RefusedContentError("it is of a form of NetCDF 3 that is not known")
        self.count_width, self.offset_width = _WIDTHS[version]
        self.most_types = _MOST_TYPES[version]
        records = self._number(self.count_width)
        lengths = [self._dimension() for _ in self._named(_DIMENSION, self.limits.variables)]
        if lengths.count(0) > 1:  # 0 is the length of the dimension of records
            raise RefusedContentError(_DAMAGED)
        self._attributes()
        variables = [self._variable(lengths) for _ in self._named(_VARIABLE, self.limits.in_group)]
        padded = [-(-size // 4) * 4 for size, _, has_records in variables if has_records]
        # The records of a single variable follow each other without a gap.
        step = (
            next(size for size, _, each in variables if each) if len(padded) == 1 else sum(padded)
        )
        memory = 0
        for size, begin, has_records in variables:
            number = records if has_records else 1
            memory += number * size
            if number and size and begin + (number - 1) * step + size > len(self.content):
                raise IndexError("the file ends before")
        if memory > self.limits.most_memory(self.content):
            raise RefusedContentError("its variables lie on each other")

    def _number(self, width: int) -> int:
        piece = self.content[self.at : self.at + width]
        if len(piece) != width:
            raise IndexError("the file ends before")
        self.at += width
        return int.from_bytes(piece, "big")

    def _skip(self, length: int) -> bytes:
        """Return the next bytes; what fills them up to a multiple of four is skipped as well."""
        piece = self.content[self.at : self.at + length]
        if len(piece) != length:
            raise IndexError("the file ends before")
        self.at += -(-length // 4) * 4
        return piece

    def _named(self, tag: int, most: int) -> Iterator[None]:
        """Yield once for each entry of a list, after its name was read."""
        found, count = self._number(4), self._number(self.count_width)
        if found != tag and (found or count):
            raise RefusedContentError(_DAMAGED)
        check_count(count, most, "dimensions, variables or attributes in one place")
        names = set()
        for _ in range(count):
            length = self._number(self.count_width)
            name = self._skip(length).decode("utf-8") if length <= _LONGEST_NAME else ""
            if not name or name in names or {"/", "\0"} & {*name}:
                raise RefusedContentError("it has a name that is none, or one name twice")
            names.add(name)
            yield

    def _type_size(self) -> int:
        kind = self._number(4)
        if not 1 <= kind <= self.most_types:
            raise RefusedContentError("it has a data type that is none")
        return _SIZES[kind]

    def _dimension(self) -> int:
        return self._number(self.count_width)

    def _attributes(self) -> None:
        for _ in self._named(_ATTRIBUTE, self.limits.attributes):
            size = self._type_size()
            self._skip(size * self._number(self.count_width))

    def _variable(self, lengths: list[int]) -> tuple[int, int, bool]:
        """Return the bytes of a variable, or of a record of it, where it begins, and which."""
        rank = self._number(self.count_width)
        if rank > _MOST_RANK:
            raise RefusedContentError(_DAMAGED)
        dims = [self._number(self.count_width) for _ in range(rank)]
        if any(number >= len(lengths) for number in dims):
            raise RefusedContentError("it has a variable with a dimension that is none")
        extent = [lengths[number] for number in dims]
        has_records = bool(extent) and not extent[0]
        if 0 in extent[1:]:
            raise RefusedContentError(_DAMAGED)
        self._attributes()
        size = self._type_size() * math.prod(extent[has_records:])
        self._number(self.count_width)  # a size that the library computes again
        return size, self._number(self.offset_width), has_records
