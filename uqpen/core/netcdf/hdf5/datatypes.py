"""Data types of variables and attributes that NetCDF and NumPy have in common."""

from __future__ import annotations

import functools
from enum import Enum
from typing import NamedTuple

from uqpen.core.netcdf.content import RefusedContentError

__all__ = ["STORE_NUMBERS", "Datatype", "ValueKind", "read_datatype", "read_extent"]

STORE_NUMBERS = "store its values as numbers"


class ValueKind(Enum):
    """Kind of the values of a type."""

    INTEGER = "integer"
    REAL = "real"
    CHARACTERS = "characters"  # of a fixed number
    TEXT = "text"  # of any length, in a heap
    REFERENCES = "references"  # of a variable to its dimensions
    BACK_REFERENCES = "back references"  # of a dimension to variables


class Datatype(NamedTuple):
    """A kind, and the bytes of one value."""

    kind: ValueKind
    size: int


_INTEGER, _REAL, _STRING, _COMPOUND, _REFERENCE, _VARIABLE_LENGTH = 0, 1, 3, 6, 7, 9
_OTHERS = {
    2: "a time",
    4: "bits",
    5: "opaque",
    _COMPOUND: "a compound",
    _REFERENCE: "a reference",
    8: "an enumeration",
    10: "an array",
}
# Precision, exponent and mantissa of IEEE 754 in the words of the format, by size.
_IEEE = {
    4: bytes.fromhex("0000 2000 17 08 00 17 7f000000"),
    8: bytes.fromhex("0000 4000 34 0b 00 34 ff030000"),
}
_SIGN = {4: 31, 8: 63}
_IMPLIED_BIT = 0x20  # of a normal number; no padding bits
_WIDTHS = (1, 2, 4, 8)


@functools.lru_cache(maxsize=256)
def read_datatype(message: bytes) -> Datatype:
    """Return the type that a message describes; one of few in a file.

    Raises
    ------
    RefusedContentError
        If it is none that uqpen and NetCDF write; the text names it.
    IndexError
        If the message ends before it says all.
    """
    family, size = message[0] & 0x0F, int.from_bytes(message[4:8], "little")
    if family == _INTEGER:
        precision = int.from_bytes(message[8:12], "little")
        if size in _WIDTHS and precision == size << 19 and not message[1] & 0xF6:
            return Datatype(ValueKind.INTEGER, size)
        found = f"has the type of an integer of {size} bytes"
        raise RefusedContentError(found, "store integers of 1, 2, 4 or 8 bytes")
    if family == _REAL:
        bits = (message[1] & 0xFE, message[2], message[3])
        if message[8:20] == _IEEE.get(size) and bits == (_IMPLIED_BIT, _SIGN[size], 0):
            return Datatype(ValueKind.REAL, size)
        raise RefusedContentError(f"has the type float{8 * size}", "store it as float64")
    if family == _STRING and size:
        return Datatype(ValueKind.CHARACTERS, size)
    if family == _VARIABLE_LENGTH and size == 16:
        return _variable_length(message)
    if family == _COMPOUND and size == 16:
        return Datatype(ValueKind.BACK_REFERENCES, size)
    found = f"has a type that is {_OTHERS.get(family, 'unknown')}"
    raise RefusedContentError(found, STORE_NUMBERS)


def _variable_length(message: bytes) -> Datatype:
    base, is_text = message[8:], message[1] & 0x0F == 1
    base_family, base_size = base[0] & 0x0F, int.from_bytes(base[4:8], "little")
    # NetCDF describes the characters of a text as integers of one byte, others as strings.
    if is_text and base_family in (_INTEGER, _STRING) and base_size == 1:
        return Datatype(ValueKind.TEXT, 16)
    if not is_text and base_family == _REFERENCE and base_size == 8 and not base[1] & 0x0F:
        return Datatype(ValueKind.REFERENCES, 16)
    raise RefusedContentError("has a type that is a list", STORE_NUMBERS)


@functools.lru_cache(maxsize=4096)
def read_extent(message: bytes) -> tuple[int, ...] | None:
    """Return the sizes of the dimensions of a dataspace message; None for one without values.

    Raises
    ------
    RefusedContentError
        If it is of a version that is not known.
    """
    version, rank = message[0], message[1]
    if version == 1:
        start = 8
    elif version == 2:
        start = 4
        if message[3] == 2:
            return None
    else:
        raise RefusedContentError("has dimensions in a form that is not known")
    if rank > 32 or len(message) < start + 8 * rank:
        raise RefusedContentError("has more dimensions than there are")
    return tuple(
        int.from_bytes(message[at : at + 8], "little") for at in range(start, start + 8 * rank, 8)
    )
