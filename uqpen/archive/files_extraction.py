"""Extraction of the files of an archive to a temporary folder, and to no other place."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path, PureWindowsPath
from typing import NamedTuple

from uqpen.archive.files import ArchivedFile
from uqpen.core.errors import ArchiveError

__all__ = ["ExtractedFiles", "extract_files"]

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
    """Provide an archive's files in a temporary folder.

    Parameters
    ----------
    files : sequence of ArchivedFile
        Nothing is written outside the temporary folder, whatever their names are.
    other_folder : Path
        Folder with the files that the archive has only as hashes.

    Raises
    ------
    ArchiveError
        If a name is not that of a file in the study's folder or next to it, a file does not match
        its hash, or two files cannot be in one folder.
    """
    paths = {file: _path_parts(file.name) for file in files}
    # As far down as files are further up, so that these are in the folder as well.
    depth = max((parts.count(_UP) for parts in paths.values()), default=0)
    with _fresh_folder() as root:
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


@contextlib.contextmanager
def _fresh_folder() -> Iterator[Path]:
    """Provide a folder that only this user can read; it is removed in the end with its content."""
    try:
        folder = tempfile.TemporaryDirectory(prefix="uqpen_", ignore_cleanup_errors=True)
    except OSError as error:
        raise ArchiveError(f"no folder for the archive's files: {error.strerror}") from None
    with folder as name:
        # Not by way of a link: a model's modules are known by where they lie.
        yield Path(name).resolve()


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
