"""Checksum of a whole file, appended to it, which shows damage before a library opens the file.

The HDF5 library trusts the metadata of a file: of a few hundred archives with a damaged byte, one
kept it busy forever. It ignores bytes behind the end that the metadata state, and removes them when
it changes a file. So an archive that other software has edited has no checksum, and is opened.

It proves nothing about who wrote a file: `uqpen.core.netcdf` looks for what uqpen does not write.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

from uqpen.core.files import open_file

__all__ = ["append_checksum", "is_broken"]

_MARK = b"\nuqpen sha256 "
_LENGTH = len(_MARK) + 64 + 1
_CHUNK = 1 << 20


def append_checksum(path: Path) -> None:
    """Write the checksum of a file's bytes behind them, and bring all of it to the disk."""
    with path.open("rb+") as stream:
        stream.write(_checksum(stream, path.stat().st_size))
        os.fsync(stream.fileno())


def is_broken(path: Path) -> bool:
    """Return True if a file ends with a checksum that does not match its bytes."""
    try:
        with open_file(path) as stream:
            length = os.fstat(stream.fileno()).st_size - _LENGTH
            if length < 0:
                return False
            stream.seek(length)
            found = stream.read()
            stream.seek(0)
            return found.startswith(_MARK) and found != _checksum(stream, length)
    except OSError:
        return False  # whoever opens it next will say what is wrong with it


def _checksum(stream: BinaryIO, length: int) -> bytes:
    """Read `length` bytes and return the trailer that must follow them."""
    digest = hashlib.sha256()
    while length > 0 and (chunk := stream.read(min(_CHUNK, length))):
        digest.update(chunk)
        length -= len(chunk)
    return _MARK + digest.hexdigest().encode() + b"\n"
