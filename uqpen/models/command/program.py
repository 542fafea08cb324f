"""Files of a command: the program, and files beside the study."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from uqpen.core.errors import ModelError
from uqpen.core.files import FileSnapshot, is_file
from uqpen.models.reasons import changed_file_error

__all__ = ["Program", "ProgramFile", "find_program", "lies_in_study", "locate_program"]


@dataclass(frozen=True)
class ProgramFile:
    """File of a command, with its content at the time the study was read.

    Its name is the path from the study's folder, or the name in the command. Its stamp changes when
    the file is written.
    """

    name: str
    read: FileSnapshot
    stamp: tuple[int, int]

    @classmethod
    def from_path(cls, name: str, path: Path) -> ProgramFile:
        """Read an existing file; OSError if it cannot be read."""
        stamp = _stamp(path)
        return cls(name, FileSnapshot.from_content(path, path.read_bytes()), stamp)

    def is_changed(self) -> bool:
        """Check that its content has changed since it was read."""
        try:
            if _stamp(self.read.path) == self.stamp:
                return False
            content = self.read.path.read_bytes()
        except OSError:
            return True
        return hashlib.sha256(content).hexdigest() != self.read.sha256


@dataclass(frozen=True)
class Program:
    """Program that has been found, and the files that it needs.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    executed : ProgramFile
        The executed file.
    beside : tuple of ProgramFile
        The study's own files among the program, the words of the command, the files copied into
        the folder of each run, and the templates.
    """

    folder: Path
    executed: ProgramFile
    beside: tuple[ProgramFile, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """Names of the study's own files."""
        return frozenset(file.name for file in self.beside)

    def identity(self) -> dict[str, str]:
        """Return hashes that identify the files: the study's own, and a program from elsewhere."""
        found = {"source_sha256": _hash_files(self.beside)} if self.beside else {}
        if self.executed not in self.beside:
            found["program_sha256"] = self.executed.read.sha256
        return found

    def check_unchanged(self) -> None:
        """Check that no file has changed since the study was read; ModelError names one."""
        for file in (self.executed, *self.beside):
            if file.is_changed():
                raise changed_file_error(file.name)


def locate_program(word: str, folder: Path, others: Iterable[str]) -> Program:
    """Find the program that the first word of a command names, and the other files of the study.

    Raises
    ------
    ModelError
        If there is no such program, or a file cannot be read.
    """
    try:
        executed = ProgramFile.from_path(str(Path(word)), find_program(word, folder))
        beside = [executed] if "/" in word and lies_in_study(word, folder) else []
        names = dict.fromkeys(name for name in others if name not in [each.name for each in beside])
        beside += [ProgramFile.from_path(name, folder / name) for name in names]
    except OSError as error:
        raise ModelError(f'"{error.filename}" cannot be read: {error.strerror}') from None
    return Program(folder, executed, tuple(beside))


def find_program(word: str, folder: Path) -> Path:
    """Find the program that the first word of a command names.

    The word is a path (with a slash), from the study's folder if it is relative, or a name.

    Raises
    ------
    ModelError
        If there is none that can be executed.
    """
    if "/" not in word:
        found = shutil.which(word)
        if found is None:
            own = f'; the one beside the study is "./{word}"' if lies_in_study(word, folder) else ""
            raise ModelError(f'there is no program "{word}" in the PATH{own}')
        return Path(found).absolute()
    path = Path(os.path.normpath(folder / word))
    if not is_file(path):
        where = "" if Path(word).is_absolute() else " beside the study"
        raise ModelError(f'there is no program "{word}"{where}')
    if not os.access(path, os.X_OK):
        raise ModelError(f'"{word}" is not executable')
    return path


def lies_in_study(word: str, folder: Path) -> bool:
    """Check that a word is the relative path of a file beside the study, or below."""
    path = Path(word)
    is_inside = bool(path.parts) and not path.is_absolute() and ".." not in path.parts
    return is_inside and "\0" not in word and is_file(folder / path)


def _stamp(path: Path) -> tuple[int, int]:
    about = path.stat()
    return about.st_mtime_ns, about.st_size


def _hash_files(files: Iterable[ProgramFile]) -> str:
    digest = hashlib.sha256()
    for file in sorted(files, key=lambda file: file.name):
        digest.update(f"{file.read.sha256}  {file.name}\n".encode())
    return digest.hexdigest()
