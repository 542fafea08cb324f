"""Links of a group to the groups and variables in it."""

from __future__ import annotations

from typing import NamedTuple

from uqpen.core.netcdf.content import Content, RefusedContentError, uint

__all__ = ["Link", "read_link"]

_HARD, _SOFT, _EXTERNAL = 0, 1, 64


class Link(NamedTuple):
    """Name of a group or a variable, and the address of its object header."""

    name: str
    address: int


def read_link(content: Content, start: int) -> Link:
    """Return the link whose message begins at an address.

    Raises
    ------
    RefusedContentError
        If it leads to another file, or to a path instead of an object.
    IndexError
        If the file ends before it does.
    """
    version, flags = content[start], content[start + 1]
    at = start + 2
    kind = content[at] if flags & 0x08 else _HARD
    at += bool(flags & 0x08) + 8 * bool(flags & 0x04) + bool(flags & 0x10)
    width = 1 << (flags & 0x03)
    size = uint(content, at, width)
    at += width
    name = content[at : at + min(size, 1000)].decode("utf-8", "replace")
    if kind == _EXTERNAL:
        raise RefusedContentError(f"it refers to another file (from {name})")
    if kind == _SOFT:
        raise RefusedContentError(f"it has a link to a path ({name})")
    if version != 1 or kind != _HARD or not name or "/" in name:
        raise RefusedContentError(f"it has a link that NetCDF does not write ({name})")
    return Link(name, uint(content, at + size, 8))
