"""Folders of runs: a new one for each run, kept or removed at its end."""

from __future__ import annotations

import contextlib
import hashlib
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

__all__ = ["folder_name", "keep_folder", "working_folder"]

_SHORT = 12


@contextlib.contextmanager
def working_folder() -> Iterator[Path]:
    """Make a new folder; remove it at the end of the context unless it has been moved."""
    folder = Path(tempfile.mkdtemp(prefix="uqpen-")).resolve()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def folder_name(inputs: Mapping[str, float]) -> str:
    """Return the name of the folder of a run, a hash of the bits of its inputs.

    >>> one, same, other = (folder_name({"a": a}) for a in (1.0, 1.0, 1.0 + 1e-15))
    >>> one == same != other
    True
    """
    text = "\n".join(f"{name} {value.hex()}" for name, value in sorted(inputs.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:_SHORT]


def keep_folder(folder: Path, destination: Path, notes: Mapping[str, str]) -> None:
    """Move a run's folder, with notes, to the kept ones; replace an older one of this name.

    If that fails (because a disk is full, say), the run still has its reason.
    """
    with contextlib.suppress(OSError):
        for name, text in notes.items():
            (folder / name).write_text(text, encoding="utf-8", errors="surrogateescape")
        destination.parent.mkdir(parents=True, exist_ok=True)
        # Under a name of its own first: another worker may keep a run with the same inputs.
        staged = Path(tempfile.mkdtemp(prefix=".", dir=destination.parent))
        try:
            shutil.move(folder, staged / destination.name)
            shutil.rmtree(destination, ignore_errors=True)
            (staged / destination.name).rename(destination)
        finally:
            shutil.rmtree(staged, ignore_errors=True)
