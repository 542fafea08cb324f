"""Files that a run has written: they can contain anything, and each is read once."""

from __future__ import annotations

import csv
import errno
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uqpen.core.files import NotAFileError, read_file
from uqpen.core.limits import Limits
from uqpen.core.status import Status

__all__ = ["RunFiles", "UnreadableError"]

# Largest file that is read: a run gone wild must not take this process along.
_LARGEST = 64 * 1024 * 1024


class UnreadableError(Exception):
    """Requested content is not there; the message is the reason of a failed run.

    Of an entry of a list that is no number, `position` is its position there.
    """

    def __init__(
        self, reason: str, position: int | None = None, status: Status = Status.FAILED
    ) -> None:
        super().__init__(reason)
        self.position = position
        self.status = status


@dataclass
class RunFiles:
    """Files in the folder of a run, and the limits of the run."""

    folder: Path
    limits: Limits = Limits()
    _texts: dict[str, str] = field(default_factory=dict)
    _documents: dict[str, Any] = field(default_factory=dict)
    _tables: dict[str, list[list[str]]] = field(default_factory=dict)

    def content(self, name: str) -> bytes:
        """Return the bytes of a file.

        Raises
        ------
        UnreadableError
            If it is not there, is no file (reading a pipe would never end) or is huge.
        """
        try:
            return read_file(self.folder / name, _LARGEST)
        except (FileNotFoundError, NotADirectoryError):
            raise UnreadableError(f"wrote no {name}") from None
        except NotAFileError:
            raise UnreadableError(f"{name} is no file") from None
        except OSError as error:
            is_large = error.errno == errno.EFBIG
            found = f"is larger than {_LARGEST // 2**20} MiB" if is_large else "cannot be read"
            raise UnreadableError(f"{name} {found}") from None

    def text(self, name: str) -> str:
        """Return a file as text; bytes that are not UTF-8 become replacement characters."""
        if name not in self._texts:
            self._texts[name] = self.content(name).decode("utf-8-sig", "replace")
        return self._texts[name]

    def document(self, name: str) -> Any:
        """Return the content of a JSON file."""
        if name not in self._documents:
            try:
                self._documents[name] = json.loads(self.text(name))
            except (ValueError, RecursionError):
                found = "is not JSON" if self.text(name).strip() else "is empty"
                raise UnreadableError(f"{name} {found}") from None
        return self._documents[name]

    def table(self, name: str) -> Sequence[Sequence[str]]:
        """Return the non-empty rows of a CSV file."""
        if name not in self._tables:
            lines = csv.reader(io.StringIO(self.text(name), newline=""))
            try:
                rows = [[cell.strip() for cell in row] for row in lines]
            except csv.Error:
                raise UnreadableError(f"{name} is not CSV") from None
            self._tables[name] = [row for row in rows if any(row)]
        return self._tables[name]
