"""Files of finished runs in the folders of a checkpoint: found, named and removed."""

from __future__ import annotations

import contextlib
from pathlib import Path

from uqpen.checkpoints.fingerprint_file import FILE_NAME
from uqpen.checkpoints.runs_file import TEMPORARY
from uqpen.core.errors import ArchiveError

__all__ = [
    "block_files",
    "has_runs",
    "part_files",
    "part_number",
    "part_path",
    "remove",
    "remove_checkpoint",
    "remove_empty",
    "remove_temporary",
    "whole_blocks",
]

_NUMBER = "[0-9]" * 6


def part_path(folder: Path, round_number: int, number: int) -> Path:
    """Return the path of a file of runs: the number of the round, and its own."""
    return folder / f"{round_number}_{number:06d}.npz"


def part_number(file: Path) -> int:
    """Return the number of a file of runs in its round."""
    return int(file.stem.partition("_")[2])


def remove_temporary(root: Path) -> None:
    """Remove unfinished files below a folder."""
    for name in (f"[0-9]*_{_NUMBER}.npz", "[0-9]*_blocks.nc", FILE_NAME):
        for file in root.rglob(f"{name}{TEMPORARY}"):
            remove(file)


def part_files(folder: Path, number: str = "[0-9]*") -> list[Path]:
    """List the files of runs in a folder: of one round, or of all."""
    return [file for file in sorted(folder.glob(f"{number}_{_NUMBER}.npz")) if file.is_file()]


def block_files(folder: Path, number: int | str = "[0-9]*") -> tuple[Path, Path]:
    """Return the paths of the file of whole blocks of a round, and of the record of them."""
    return folder / f"{number}_blocks.nc", folder / f"{number}_blocks.jsonl"


def has_runs(folder: Path) -> bool:
    """Return True if a folder has finished runs, in parts or in whole blocks."""
    return bool(part_files(folder) or whole_blocks(folder))


def whole_blocks(folder: Path) -> list[Path]:
    """List the files of whole blocks in a folder."""
    return [file for each in block_files(folder) for file in sorted(folder.glob(each.name))]


def remove_checkpoint(root: Path) -> None:
    """Remove the files of checkpoints below a folder, and folders that are then empty.

    Other files may stand beside them, above all where the folder is a link.

    Raises
    ------
    ArchiveError
        If that cannot be done.
    """
    for folder in [root, *root.rglob("*/")]:
        for file in [*part_files(folder), *whole_blocks(folder), folder / FILE_NAME]:
            remove(file)
    remove_empty(root)


def remove(file: Path) -> None:
    """Remove a file if it exists.

    Raises
    ------
    ArchiveError
        If that cannot be done.
    """
    try:
        file.unlink(missing_ok=True)
    except OSError as error:
        raise ArchiveError(f"{file}: cannot be removed: {error.strerror}") from None


def remove_empty(root: Path) -> None:
    """Remove a folder and its subfolders, as far as they are empty."""
    for folder in sorted([root, *root.rglob("*/")], reverse=True):
        with contextlib.suppress(OSError):  # it is not empty, or not there
            folder.rmdir()
