"""Bytes of an HDF5 file, and the error for what they should not say."""

from __future__ import annotations

import mmap

__all__ = ["UNDEFINED", "Content", "RefusedContentError", "has_signature", "limit_width", "uint"]

Content = mmap.mmap

# The address of what is not stored.
UNDEFINED = 2**64 - 1


class RefusedContentError(Exception):
    """Content of a file that uqpen does not write; the text of the error follows "it" or "its"."""


def has_signature(content: Content, address: int, signature: bytes, version: int) -> bool:
    """Return True if a structure of a kind and a version begins at an address."""
    end = address + len(signature)
    return content[address:end] == signature and content[end] == version


def uint(content: Content, address: int, width: int) -> int:
    """Return the unsigned integer of `width` bytes at an address.

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
