"""Files that a study names, in its archive: group ``/files``."""

from __future__ import annotations

import base64
import binascii
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath

import numpy as np
import xarray as xr

from uqpen.core.errors import ArchiveError
from uqpen.core.files import FileSnapshot

__all__ = [
    "FILES",
    "ArchivedFile",
    "archived_files",
    "files_by_name",
    "files_group",
    "find_file_faults",
]

FILES = "files"

_FILE = "file"
_NAME, _SHA256, _SIZE, _CONTENT, _ENCODING = "name", "sha256", "size", "content", "encoding"
_TEXTS = (_NAME, _SHA256, _CONTENT, _ENCODING)

# How a content stands there; of none, the archive has the hash alone.
_TEXT, _BASE64, _NONE = "utf-8", "base64", "none"

_LONG_NAMES = {
    _NAME: "name that the study knows the file by",
    _SHA256: "SHA-256 of the file's bytes",
    _SIZE: "size of the file in bytes",
    _CONTENT: "the file's bytes, as its encoding says",
    _ENCODING: "how the content stands here",
}


@dataclass(frozen=True)
class ArchivedFile:
    """A file in an archive.

    Parameters
    ----------
    name : str
        As the study names it, with ``/`` between folders.
    sha256, size
        Of its bytes, as recorded.
    content, encoding : str
        Its bytes, as ``"utf-8"``, ``"base64"`` or ``"none"``.
    """

    name: str
    sha256: str
    size: int
    content: str
    encoding: str

    @property
    def is_whole(self) -> bool:
        """True if the archive has its content."""
        return self.encoding != _NONE

    def read(self) -> bytes:
        """Return the content of the file.

        Raises
        ------
        ArchiveError
            If the content does not match the archived hash and size.
        """
        try:
            content = {
                _TEXT: lambda: self.content.encode("utf-8"),
                _BASE64: lambda: base64.b64decode(self.content, validate=True),
            }[self.encoding]()
        except (KeyError, UnicodeEncodeError, binascii.Error, ValueError):
            raise ArchiveError(f'"{self.name}" is not encoded as the archive says') from None
        found = hashlib.sha256(content).hexdigest()
        if (found, len(content)) != (self.sha256, self.size):
            raise ArchiveError(
                f'"{self.name}" is changed: found {len(content)} bytes with the SHA-256 {found}; '
                f"expected {self.size} with {self.sha256}"
            )
        return content


def files_group(files: Iterable[FileSnapshot], folder: Path) -> xr.Dataset:
    """Return the group of a study's files, in the order of their names; empty without files.

    The folder is that of the study. Duplicates among the files are permitted.
    """
    named = sorted(files_by_name(files, folder).items())
    if not named:
        return xr.Dataset()
    encoded = [_encode(file) for _, file in named]
    columns = {
        _NAME: [name for name, _ in named],
        _SHA256: [file.sha256 for _, file in named],
        _CONTENT: [content for content, _ in encoded],
        _ENCODING: [encoding for _, encoding in encoded],
    }
    variables = {
        name: (_FILE, np.array(values, dtype=object), {"long_name": _LONG_NAMES[name]})
        for name, values in columns.items()
    }
    sizes = np.array([file.size for _, file in named], dtype=np.int64)
    described = {"units": "byte", "long_name": _LONG_NAMES[_SIZE]}
    name = variables.pop(_NAME)
    return xr.Dataset({**variables, _SIZE: (_FILE, sizes, described)}, {_NAME: name})


def files_by_name(files: Iterable[FileSnapshot], folder: Path) -> dict[str, FileSnapshot]:
    """Return files by their names in an archive, which reveal no path of the machine.

    The name of a file is its path relative to the study's folder. A file in another place, which
    the study names by an absolute path, has its file name alone, with a number where another file
    has that name already.
    """
    named: dict[str, FileSnapshot] = {}
    known: set[Path] = set()
    for file in files:
        if file.path in known:
            continue
        known.add(file.path)
        inside = file.path.is_relative_to(folder)
        name = file.path.relative_to(folder).as_posix() if inside else file.path.name
        stem, number = PurePath(name), 1
        while name in named:
            number += 1
            name = f"{stem.stem}-{number}{stem.suffix}"
        named[name] = file
    return named


def archived_files(group: xr.Dataset) -> list[ArchivedFile]:
    """Return the files of a group without faults; none for an empty group."""
    if not group.variables:
        return []
    columns = (group[name].values.tolist() for name in (_NAME, _SHA256, _SIZE, _CONTENT, _ENCODING))
    return [ArchivedFile(*entries) for entries in zip(*columns, strict=True)]


def find_file_faults(groups: Mapping[str, xr.DataTree]) -> Iterator[str]:
    """Yield the faults of the group of files among the groups of a root, a line each."""
    if FILES not in groups:
        return
    dataset = groups[FILES].dataset
    for name in (*_TEXTS, _SIZE):
        if name not in dataset.variables or dataset[name].dims != (_FILE,):
            yield f"/{FILES}: no {name} along {_FILE}"
        elif name == _SIZE and dataset[name].dtype.kind not in "iu":
            yield f"/{FILES}: a {name} that is no number"
        elif name != _SIZE and not all(isinstance(each, str) for each in dataset[name].values):
            yield f"/{FILES}: a {name} that is no text"


def _encode(file: FileSnapshot) -> tuple[str, str]:
    """Return a file's content as a text, and its encoding."""
    if file.content is None:
        return "", _NONE
    try:
        text = file.content.decode("utf-8")
    except UnicodeDecodeError:
        text = "\0"
    # A text ends at its first NUL in NetCDF.
    if "\0" in text:
        return base64.b64encode(file.content).decode("ascii"), _BASE64
    return text, _TEXT
