"""Hashes of an archive: of each group's content, and of the whole file.

The hash of a group shows whether it has changed since it was written; that of the file, appended to
it, shows damage before a library opens it. They show integrity, not authorship: a person who
changes an archive on purpose can update them. What uqpen does not write, `uqpen.core.netcdf` looks
for.

The HDF5 library trusts the metadata of a file: of a few hundred archives with a damaged byte, one
kept it busy forever. It ignores bytes behind the end that the metadata state, and removes them when
it changes a file. So an archive that other software has edited has no checksum, and is opened.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import xarray as xr

from uqpen.archive.lazy_variables import value_blocks
from uqpen.core.arrays import raw_bytes
from uqpen.core.files import open_file
from uqpen.core.labels import CONTENT


def group_hashes(tree: xr.DataTree) -> dict[str, str]:
    """Return the SHA-256 of every group, by its path.

    A group's own variables and attributes are hashed in a canonical form, so that its hash is the
    same in memory as in the file, and on every platform. The root's leaves out only the record of
    these hashes.
    """
    found = {}
    for node in tree.subtree:
        digest = hashlib.sha256()
        for chunk in _canonical_bytes(node.to_dataset(inherit=False)):
            digest.update(chunk)
        found[node.path] = digest.hexdigest()
    return found


def hash_record(tree: xr.DataTree) -> dict[str, str]:
    """Return the hashes of a tree's groups, in the form of sha256sum, as a root attribute."""
    lines = (f"{digest}  {path}" for path, digest in group_hashes(tree).items())
    return {CONTENT: "\n".join(lines)}


def recorded_hashes(tree: xr.DataTree) -> dict[str, str]:
    """Return the hashes that an archive was written with; none for a tree that was not."""
    record = tree.attrs.get(CONTENT)
    if not isinstance(record, str):
        return {}
    pairs = (line.partition("  ") for line in record.split("\n"))
    return {path: digest for digest, _, path in pairs}


def _canonical_bytes(dataset: xr.Dataset) -> Iterator[bytes | memoryview]:
    """Yield a group as bytes: attributes, dimensions, then each variable, in order of names.

    Before each piece comes its length, so that no two sequences of pieces look alike.
    """
    attributes = {key: value for key, value in dataset.attrs.items() if key != CONTENT}
    yield _attribute_bytes(attributes)
    for dimension, size in sorted(dataset.sizes.items(), key=lambda pair: str(pair[0])):
        yield _text_bytes(dimension, size)
    coordinates = set(dataset.coords)
    for name, variable in sorted(dataset.variables.items(), key=lambda pair: str(pair[0])):
        kind = "coordinate" if name in coordinates else "variable"
        yield _text_bytes(kind, name, " ".join(map(str, variable.dims)))
        yield from _value_bytes(variable)
        yield _attribute_bytes(variable.attrs)


def _attribute_bytes(attributes: dict[Any, Any]) -> bytes:
    pieces: list[bytes | memoryview] = [_text_bytes(len(attributes))]
    for name, value in sorted(attributes.items(), key=lambda pair: str(pair[0])):
        pieces.append(_text_bytes(name))
        if type(value) is str:  # as most are, of an array of one text
            pieces.append(_text_bytes("text", (1,), value))
        else:
            # NetCDF does not distinguish a single value from a list of one.
            pieces.extend(_value_bytes(np.ravel(np.asarray(value))))
    return b"".join(pieces)


def _value_bytes(values: Any) -> Iterator[bytes | memoryview]:
    """Yield an array's type, shape and content: texts as UTF-8, numbers as little-endian.

    The content of a variable comes by blocks, as that of a file need not fit the memory.
    """
    is_text = values.dtype.kind in "OUS"
    yield _text_bytes("text" if is_text else values.dtype.name, values.shape)
    if is_text:
        for _, block in value_blocks(values):
            yield _text_bytes(*block.ravel().tolist())
        return
    little = values.dtype.newbyteorder("<")
    yield _length_bytes(values.size * values.dtype.itemsize)
    for _, block in value_blocks(values):
        yield raw_bytes(block.astype(little, copy=False))


def _text_bytes(*values: object) -> bytes:
    """Return values as texts, each behind its length."""
    # A damaged file may hold half characters; they have to have a hash as well.
    texts = [str(value).encode("utf-8", "surrogatepass") for value in values]
    return b"".join(piece for text in texts for piece in (_length_bytes(len(text)), text))


def _length_bytes(length: int) -> bytes:
    return length.to_bytes(8, "little")


# The checksum of a file stands behind its bytes.
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
