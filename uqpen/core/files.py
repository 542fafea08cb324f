"""Snapshots of files that were read, and atomic writing of files."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

# An archive keeps only the hash of a larger file. Sources and measurements are far smaller, and
# the user of a larger table has it elsewhere as well.
LARGEST = 2**20


class NotAFileError(OSError):
    """Something on a disk that is no regular file."""


@dataclass(frozen=True)
class FileSnapshot:
    """Snapshot of a file at the time it was read; later changes have no effect.

    Its size is in bytes; its content is None if it is larger than `LARGEST`.
    """

    path: Path
    sha256: str
    size: int
    content: bytes | None

    @classmethod
    def from_content(cls, path: Path, content: bytes) -> FileSnapshot:
        """Make the snapshot of a file from its content."""
        kept = content if len(content) <= LARGEST else None
        return cls(path, hashlib.sha256(content).hexdigest(), len(content), kept)


@contextlib.contextmanager
def open_file(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file, or a link to one, for reading; nothing is waited for.

    FileNotFoundError if there is none, or no system could have one of the name; NotAFileError if it
    is a folder, a pipe, a socket or a device. The ``strerror`` of any can be shown to a user.
    """
    try:
        mode = path.stat().st_mode
    except ValueError:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT)) from None
    # Before it is opened, as that alone has effects on some devices; and after it.
    _check_is_file(mode)
    with open(path, "rb", opener=_without_waiting) as stream:
        _check_is_file(os.fstat(stream.fileno()).st_mode)
        yield stream


def read_file(path: Path, most: int | None = None) -> bytes:
    """Return the content of a file as `open_file` opens it.

    OSError with the number EFBIG if the file has more than `most` bytes.
    """
    with open_file(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if most is not None and size > most:
            found = f"it has {size / 1e9:.1f} GB, and at most {most / 1e9:g} GB are read"
            raise OSError(errno.EFBIG, found)
        return stream.read()


def _check_is_file(mode: int) -> None:
    if not stat.S_ISREG(mode):
        raise NotAFileError(errno.EINVAL, "it is not a file")


def _without_waiting(path: str, flags: int) -> int:
    # A pipe that has taken the place of the file would otherwise be waited for.
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def is_file(path: Path) -> bool:
    """Return True if there is a regular file; False too for a name that no system could have."""
    try:
        return path.is_file()
    except OSError:
        return False


def is_folder(path: Path) -> bool:
    """Return True if there is a folder; False too for a name that no system could have."""
    try:
        return path.is_dir()
    except OSError:
        return False


def replace_file(path: Path, content: bytes | Iterable[bytes]) -> None:
    """Replace a file in one step; make its folders where they are missing.

    The content may come by parts, so that it need not be in memory.

    OSError if it cannot be written; a file that was there before is unchanged. Its ``strerror`` can
    be shown to a user.
    """
    if path.is_dir():
        raise OSError(errno.EISDIR, "it is a folder")
    if path.exists() and not path.is_file():
        # A device or a pipe, say, which must not be replaced by a file.
        raise OSError(errno.EEXIST, "there is something that is no file")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("wb") as stream:
            stream.writelines([content] if isinstance(content, bytes) else content)
        temporary.replace(path)
    except OSError as error:
        is_file = isinstance(error, FileExistsError | NotADirectoryError)
        reason = f"{path.parent} is no folder" if is_file else error.strerror
        raise OSError(error.errno, reason) from None
    finally:
        with contextlib.suppress(OSError):  # is there only if something has failed
            temporary.unlink()
