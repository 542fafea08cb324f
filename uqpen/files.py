"""Files that a study names, as they stood when they were read."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

__all__ = ["LARGEST", "FileRead"]

# An archive keeps what is larger by its hash alone: sources and measurements are far smaller, and
# whoever has more than that in a table has it elsewhere as well.
LARGEST = 2**20


@dataclass(frozen=True)
class FileRead:
    """A file as it stood when it was read, whatever has become of it since.

    Parameters
    ----------
    path : Path
        Where it was read.
    sha256 : str
        Of its content.
    size : int
        In bytes.
    content : bytes or None
        None where it is larger than `LARGEST`.
    """

    path: Path
    sha256: str
    size: int
    content: bytes | None

    @classmethod
    def of(cls, path: Path, content: bytes) -> FileRead:
        """A file with what was read from it."""
        kept = content if len(content) <= LARGEST else None
        return cls(path, hashlib.sha256(content).hexdigest(), len(content), kept)
