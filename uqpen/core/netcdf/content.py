"""Bytes of a file of NetCDF, limits of what it describes, and the error for what is refused."""

from __future__ import annotations

import mmap
from dataclasses import dataclass, replace

__all__ = [
    "ARCHIVE_LIMITS",
    "DATA_LIMITS",
    "UNDEFINED",
    "Content",
    "ContentLimits",
    "RefusedContentError",
    "check_count",
    "has_signature",
    "limit_width",
    "uint",
]

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
    """Largest numbers of objects in a file, and the memory that their values may take.

    Parameters
    ----------
    groups, variables : int
        In the whole file.
    in_group : int
        Variables in one group.
    links : int
        Groups and variables in one group.
    attributes : int
        Of one object.
    depth : int
        Of groups within groups.
    memory : int
        Bytes of all values in memory, whatever the size of the file.
    memory_ratio : int
        Bytes of all values in memory for each byte of the file, where that is more.
    """

    groups: int
    variables: int
    in_group: int
    links: int
    attributes: int
    depth: int
    memory: int
    memory_ratio: int

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


def has_signature(content: Content, address: int, signature: bytes, version: int) -> bool:
    """Return True if a structure of a kind and a version begins at an address."""
    end = address + len(signature)
    return content[address:end] == signature and content[end] == version


def uint(content: Content, address: int, width: int) -> int:
    """Return the unsigned integer of `width` bytes at an address, the low byte first.

    Raises
    ------
    IndexError
        If the file ends before.
    """
    piece = content[address : address + width]
    if len(piece) != width:
        raise IndexError("the file ends before")
    return int.from_bytes(piece, "little")


def limit_width(largest: int) -> int:
    """Return the number of bytes that hold every number up to the largest."""
    return (max(largest, 1).bit_length() - 1) // 8 + 1
