"""Superblock of a file, with which it begins."""

from __future__ import annotations

from uqpen.core.netcdf.content import UNDEFINED, Content, RefusedContentError, uint

__all__ = ["SIGNATURE", "root_address"]

SIGNATURE = b"\x89HDF\r\n\x1a\n"

# Bytes of an address and of a length.
_WIDTHS = b"\x08\x08"


def root_address(content: Content) -> int:
    """Return the address of the root group.

    Raises
    ------
    RefusedContentError
        If the file is of parts, or in a form that NetCDF does not write.
    IndexError
        If the file ends before the superblock does.
    """
    version = content[8]
    if version == 0:
        widths, base, elsewhere, root = content[13:15], 24, 48, 64
    elif version in (2, 3):
        widths, base, elsewhere, root = content[9:11], 12, 20, 36
    else:
        raise _unknown()
    # Elsewhere stand, by version, a driver for files of parts and settings of the library.
    if widths != _WIDTHS or uint(content, base, 8) or uint(content, elsewhere, 8) != UNDEFINED:
        raise _unknown()
    return uint(content, root, 8)


def _unknown() -> RefusedContentError:
    return RefusedContentError("it begins in a form that NetCDF does not write")
