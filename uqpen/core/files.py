"""Snapshots of files that were read, and atomic writing of files."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

__all__ = ["LARGEST", "FileSnapshot", "replace_file"]

# An archive keeps only the hash of a larger file. Sources and measurements are far smaller, and
# the user of a larger table has it elsewhere as well.
LARGEST = 2**20


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


def replace_file(path: Path, content: bytes | Iterable[bytes]) -> None:
    """Replace a file in one step; make its folders where they are missing.

    The content may come by parts, so that it need not be in memory.

    Raises
    ------
    OSError
        If it cannot be written; a file that was there before is unchanged. Its ``strerror`` can be
        shown to a user.
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
