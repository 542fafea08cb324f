"""Files of a command: the program, files beside the study, and placeholders in them."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from uqpen.core.errors import ModelError
from uqpen.core.files import FileSnapshot, is_file
from uqpen.core.lookup import choices
from uqpen.models.user_code import changed_file_error

# Files of a command: the program, and files beside the study.


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
    """Program that has been found, and the files that it needs."""

    folder: Path  # folder of the study
    executed: ProgramFile  # the executed file
    # The study's own files among the program, the words of the command, the files copied into the
    # folder of each run, and the templates.
    beside: tuple[ProgramFile, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """Names of the study's own files."""
        return frozenset(file.name for file in self.beside)

    def identity(self) -> dict[str, str]:
        """Return hashes that identify the files: the study's own, and a program from elsewhere."""
        lines = [f"{file.read.sha256}  {file.name}\n" for file in self.beside]
        lines.sort(key=lambda line: line.partition("  ")[2])
        digest = hashlib.sha256("".join(lines).encode())
        found = {"source_sha256": digest.hexdigest()} if self.beside else {}
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

    ModelError if there is no such program, or a file cannot be read.
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

    ModelError if there is none that can be executed.
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


# Placeholders in a text: ``{rod_length}``, ``{rod_length:.6e}``, and ``{{`` for a brace.
#
# With other delimiters, ``<<rod_length>>``, nothing stands for a delimiter: what is no name between
# two of them is a part of the text.

_IN_BRACES = re.compile(r"\{\{|\}\}|\{(?P<name>[^{}:\n]*)(?::(?P<format>[^{}\n]*))?\}|[{}]")

# Python's formats of floating-point numbers, but for those that depend on the place on Earth, and
# no width that fills a disk; and of whole numbers.
_FORMAT = re.compile(r"(?:.?[<>=^])?[+\- ]?#?0?[0-9]{0,3}[,_]?(?:(?:\.[0-9]{1,3})?[eEfFgG%]?|d)")

_BRACE = "{name} or {name:.6e}, and {{ or }} for a brace"


class NotWholeError(ValueError):
    """A number with a format of whole numbers is none; the message is the reason of the run."""


@dataclass(frozen=True)
class Delimiters:
    """Delimiters of placeholders; braces within the text are only doubled where they are them."""

    opening: str = "{"
    closing: str = "}"

    @property
    def tokens(self) -> re.Pattern[str]:
        """Pattern of a placeholder, and of braces where they are the delimiters."""
        if self == BRACES:
            return _IN_BRACES
        opening, closing = re.escape(self.opening), re.escape(self.closing)
        return re.compile(rf"{opening}(?P<name>[^\W\d]\w*)(?::(?P<format>[^\n]*?))?{closing}")

    def around(self, placeholder: str) -> str:
        """Return a placeholder as it is written."""
        return f"{self.opening}{placeholder}{self.closing}"


BRACES = Delimiters()


def fill(text: str, values: Mapping[str, float | str], delimiters: Delimiters = BRACES) -> str:
    """Replace the placeholders of a text in which `find_mistakes` finds none.

    Numbers are written so that reading them gives the same number again, unless the placeholder
    has a format. NotWholeError if that is one of whole numbers, and the number is none.

    >>> fill("a = {a}; b = {b:.2e}; {{}}", {"a": 0.1, "b": 1234.5})
    'a = 0.1; b = 1.23e+03; {}'
    """

    def replaced(token: re.Match[str]) -> str:
        if token["name"] is None:
            return token[0][0]
        value = values[token["name"]]
        if isinstance(value, str):
            return value
        form = token["format"] or ""
        if not form.endswith("d"):
            return format(value, form) if form else repr(value)
        if not value.is_integer():
            raise NotWholeError(f"{token[0]} is {value!r}, which is no whole number")
        return format(int(value), form)

    return delimiters.tokens.sub(replaced, text)


def names_in(text: str, delimiters: Delimiters = BRACES) -> set[str]:
    """Return the names of a text's placeholders."""
    tokens = delimiters.tokens.finditer(text)
    return {token["name"] for token in tokens if token["name"] is not None}


def find_mistakes(
    text: str,
    numbers: Collection[str],
    paths: Collection[str],
    delimiters: Delimiters = BRACES,
) -> Iterator[tuple[int, str, str]]:
    """Yield the mistakes in placeholders: the line, from 1, the text there, and the expected one.

    Placeholders of paths have no format.
    """
    for token in delimiters.tokens.finditer(text):
        if expected := _expected(token, numbers, paths, delimiters):
            found = token[0] if len(token[0]) > 1 else f"a single {token[0]}"
            yield text.count("\n", 0, token.start()) + 1, found, expected


def _expected(
    token: re.Match[str], numbers: Collection[str], paths: Collection[str], delimiters: Delimiters
) -> str:
    """Return the expected text in place of a placeholder or brace; empty if it is correct."""
    name, form = token["name"], token["format"]
    if name is None:
        return _BRACE if token[0] in "{}" else ""
    if name not in numbers and name not in paths:
        known = choices(name, [*numbers, *paths])
        braces = "; {{ and }} stand for braces" if delimiters == BRACES else ""
        return f"an input of the model; {known}{braces}"
    if form is not None and name in paths:
        return f"{delimiters.around(name)}: a path has no format"
    if form is not None and not _is_format(form):
        return f"a format such as {delimiters.around(f'{name}:.6e')}"
    return ""


def _is_format(form: str) -> bool:
    try:
        return bool(
            form and _FORMAT.fullmatch(form) and format(1 if form[-1] == "d" else 1.5, form)
        )
    except ValueError:
        return False
