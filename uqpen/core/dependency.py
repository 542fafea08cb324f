"""Dependency of a model's runs besides their inputs: a file, a variable of the environment."""

from __future__ import annotations

import functools
import hashlib
import stat
from pathlib import Path
from typing import NamedTuple

from uqpen.core.files import LARGEST

# Files in the folder of the study, or beside it, by their path from there.
IMPORTED, OPENED, LIBRARY = "imported", "opened", "library"

# A module that lies elsewhere, by its name.
MODULE = "module"

ENVIRONMENT = "environment"

# These have no hash: a program that was started, a host, a file that a run itself changes.
PROGRAM, CONNECTION, CHANGED = "program", "connection", "changed"

# Says that a run was observed, even if it has opened and read nothing.
OBSERVED = "observed"

_UNHASHED = "-"

_LABELS = {MODULE: "module ", ENVIRONMENT: "environment variable "}

_UNCOMPARED = {
    PROGRAM: "what {} reads and starts",
    CONNECTION: "what {} answers",
    CHANGED: "{}, which a run changes",
    ENVIRONMENT: "the environment, which is read as a whole",
}


class Dependency(NamedTuple):
    """Dependency of a model's runs."""

    role: str  # one of the roles of this module
    # A path from the study's folder, or the name of a module, variable, program or host. Empty for
    # the whole environment.
    name: str
    # Hash of the file, or of the value of the variable; empty if it is known by its name alone.
    sha256: str = ""

    @classmethod
    def from_line(cls, line: str) -> Dependency:
        """Return the dependency of a line."""
        sha256, _, rest = line.partition(" ")
        role, _, name = rest.partition(" ")
        return cls(role, name, "" if sha256 == _UNHASHED else sha256)

    @property
    def line(self) -> str:
        """The dependency as a line of text: its hash, its role and its name."""
        name = self.name.encode("utf-8", "backslashreplace").decode().replace("\n", "\\n")
        return f"{self.sha256 or _UNHASHED} {self.role} {name}"

    @property
    def label(self) -> str:
        """Name for a message, with its kind."""
        return f"{_LABELS.get(self.role, 'file ')}{self.name}"

    @property
    def uncompared(self) -> str:
        """The part of it that is not compared, in words; empty if its hash says all of it."""
        return "" if self.sha256 else _UNCOMPARED.get(self.role, "").format(self.name)


def file_sha256(path: str | Path) -> str:
    """Return the hash of a file; empty where there is none that can be read.

    A large file is read once as long as nobody writes it.
    """
    file = Path(path)
    try:
        about = file.stat()
        if not stat.S_ISREG(about.st_mode):  # a device or a pipe may have no end
            return ""
        if about.st_size > LARGEST:
            return _large_file_sha256(file, about.st_mtime_ns, about.st_ctime_ns, about.st_size)
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except (OSError, ValueError):
        return ""


@functools.lru_cache(maxsize=256)
def _large_file_sha256(file: Path, *_: int) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def value_sha256(name: str, value: str | None) -> str:
    """Return the hash of a variable of the environment, whose value may be a password.

    The value is None for a variable that is not set.
    """
    text = name if value is None else f"{name}={value}"
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()
