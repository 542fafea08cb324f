"""Files that a study names, in its archive (group ``/files``), and their extraction.

They are extracted to a temporary folder, and to no other place.
"""

from __future__ import annotations

import base64
import binascii
import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path, PurePath, PureWindowsPath
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.errors import ArchiveError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import FILES

__all__ = [
    "FILES",
    "ArchivedFile",
    "ExtractedFiles",
    "archived_files",
    "extract_files",
    "files_by_name",
    "files_group",
    "find_file_faults",
]

_FILE = "file"
# The variables, which are the fields of an `ArchivedFile`. All but the size are texts.
_SIZE = "size"
_LONG_NAMES = {
    "name": "name that the study knows the file by",
    "sha256": "SHA-256 of the file's bytes",
    "content": "the file's bytes, as its encoding says",
    "encoding": "how the content stands here",
    _SIZE: "size of the file in bytes",
}

# How a content stands there; of none, the archive has the hash alone.
_TEXT, _BASE64, _NONE = "utf-8", "base64", "none"


@dataclass(frozen=True)
class ArchivedFile:
    """A file in an archive."""

    name: str  # as the study names it, with ``/`` between folders
    sha256: str  # of its bytes, as recorded
    size: int  # of its bytes, as recorded
    content: str  # its bytes in that encoding
    encoding: str  # ``"utf-8"``, ``"base64"`` or ``"none"``

    @property
    def is_whole(self) -> bool:
        """True if the archive has its content."""
        return self.encoding != _NONE

    def read(self) -> bytes:
        """Return the content of the file.

        ArchiveError if the content does not match the archived hash and size.
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
    entries = [ArchivedFile(name, file.sha256, file.size, *_encode(file)) for name, file in named]
    variables = {}
    for key, long_name in _LONG_NAMES.items():
        values = [getattr(entry, key) for entry in entries]
        units = {"units": "byte"} if key == _SIZE else {}
        kind = np.int64 if key == _SIZE else object
        variables[key] = (_FILE, np.array(values, dtype=kind), {**units, "long_name": long_name})
    name = variables.pop("name")
    return xr.Dataset(variables, {"name": name})


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
    columns = [group[each.name].values.tolist() for each in fields(ArchivedFile)]
    return [ArchivedFile(*entries) for entries in zip(*columns, strict=True)]


def find_file_faults(node: xr.DataTree) -> Iterator[str]:
    """Yield the faults of the group of files, each to stand behind its path."""
    dataset = node.dataset
    for name in _LONG_NAMES:
        if name not in dataset.variables or dataset[name].dims != (_FILE,):
            yield f": no {name} along {_FILE}"
        elif name == _SIZE and dataset[name].dtype.kind not in "iu":
            yield f": a {name} that is no number"
        elif name != _SIZE and not all(isinstance(each, str) for each in dataset[name].values):
            yield f": a {name} that is no text"


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


# A study that names files further up than this is none that anybody has written.
_MOST_UPWARD = 16

_UP = ".."

# Of a part of a path, in bytes, on every system.
_LONGEST = 255

_FIRST_PRINTABLE = 0x20


class ExtractedFiles(NamedTuple):
    """Temporary folder in place of the study's, with a line for each file that is not available."""

    folder: Path
    missing: list[str]


@contextlib.contextmanager
def extract_files(files: Sequence[ArchivedFile], other_folder: Path) -> Iterator[ExtractedFiles]:
    """Provide an archive's files in a temporary folder, and write nothing outside it.

    Files that the archive has only as hashes are taken from another folder.

    ArchiveError if a name is not that of a file in the study's folder or next to it, a file does
    not match its hash, or two files cannot be in one folder.
    """
    paths = {file: _path_parts(file.name) for file in files}
    # As far down as files are further up, so that these are in the folder as well.
    depth = max((parts.count(_UP) for parts in paths.values()), default=0)
    try:
        # That only this user can read; it is removed in the end with its content.
        fresh = tempfile.TemporaryDirectory(prefix="uqpen_", ignore_cleanup_errors=True)
    except OSError as error:
        raise ArchiveError(f"no folder for the archive's files: {error.strerror}") from None
    with fresh as name:
        # Not by way of a link: a model's modules are known by where they lie.
        root = Path(name).resolve()
        study = root.joinpath(*["study"] * (depth + 1))
        study.mkdir(parents=True)
        missing = []
        for file, parts in paths.items():
            content = file.read() if file.is_whole else _content_of_hash(file, parts, other_folder)
            if isinstance(content, str):
                missing.append(content)
            else:
                _write_new(content, _make_folders(root, study, parts), file.name)
        yield ExtractedFiles(study, missing)


def _path_parts(name: str) -> tuple[str, ...]:
    """Return the folders and the last part of a name; refuse one that is no name of a file."""
    parts = tuple(part for part in name.split("/") if part not in ("", "."))
    is_upward = parts.count(_UP) > _MOST_UPWARD
    is_none = not parts or parts[-1] == _UP or name.startswith("/") or name.endswith("/")
    if is_none or is_upward or any(map(_is_refused, parts)):
        raise ArchiveError(f"{name!r}: is not the name of a file that a study could name")
    return parts


def _is_refused(part: str) -> bool:
    """Return True if a part of a path is no plain file name to the operating system."""
    try:
        encoded = part.encode("utf-8")
    except UnicodeEncodeError:
        return True
    if len(encoded) > _LONGEST or any(byte < _FIRST_PRINTABLE for byte in encoded):
        return True
    return os.name == "nt" and (
        PureWindowsPath(part).is_reserved()
        or part[-1] in " ." * (part != _UP)
        or any(character in part for character in '<>:"\\|?*')
    )


def _make_folders(root: Path, study: Path, parts: tuple[str, ...]) -> Path:
    """Make the folders of a file below the root and return the path of the file."""
    place = study
    try:
        for part in parts[:-1]:
            place = place.parent if part == _UP else place / part
            if not place.is_relative_to(root):
                raise ArchiveError(f'"{"/".join(parts)}": leads out of the folder of the study')
            place.mkdir(exist_ok=True)
    except OSError as error:
        raise ArchiveError(f'"{"/".join(parts)}": {error.strerror}') from None
    return place / parts[-1]


def _write_new(content: bytes, path: Path, name: str) -> None:
    """Write what is not there yet."""
    try:
        with path.open("xb") as stream:
            stream.write(content)
        # One may be a model's program; nothing here executes it.
        path.chmod(0o700)
    except FileExistsError:
        if not path.is_file() or path.read_bytes() != content:
            raise ArchiveError(f'"{name}": two files are to lie in the same place') from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ArchiveError(f'"{name}": {reason}') from None


def _content_of_hash(file: ArchivedFile, parts: tuple[str, ...], folder: Path) -> bytes | str:
    """Return the content of a file that is archived as a hash, or the reason why it is missing."""
    path = folder.joinpath(*parts)
    kept = f'"{file.name}": the archive has its hash alone, and '
    try:
        if not path.is_file():
            return f"{kept}there is no such file in {folder}"
        size = path.stat().st_size
        content = path.read_bytes() if size == file.size else b""
    except OSError as error:
        return f"{kept}{path} cannot be read: {error.strerror}"
    found = hashlib.sha256(content).hexdigest()
    if size != file.size:
        return f"{kept}{path} is another: found {size} bytes, expected {file.size}"
    if found != file.sha256:
        return f"{kept}{path} is another: found the SHA-256 {found}, expected {file.sha256}"
    return content
