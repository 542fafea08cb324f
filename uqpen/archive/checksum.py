"""A checksum of a whole file behind its last byte, which tells damage before a library meets it.

The HDF5 library trusts what a file says of itself: of a few hundred archives with a damaged byte,
one kept it busy for good. It ignores what stands behind the end that a file tells of, and cuts that
off when it changes a file; so an archive that others have edited has no checksum, and is opened.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

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
    """Whether a file ends with a checksum that is not that of its bytes."""
    try:
        with path.open("rb") as stream:
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
    """What stands behind so many bytes, which are read."""
    digest = hashlib.sha256()
    while length > 0 and (chunk := stream.read(min(_CHUNK, length))):
        digest.update(chunk)
        length -= len(chunk)
    return _MARK + digest.hexdigest().encode() + b"\n"
