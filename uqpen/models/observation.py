"""Observation of user-defined code: files that it opens, variables of the environment, programs."""

from __future__ import annotations

import contextlib
import functools
import os
import re
import shlex
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from importlib.util import source_from_cache
from types import FrameType
from typing import Any

from uqpen.core.dependency import (
    CHANGED,
    CONNECTION,
    ENVIRONMENT,
    LIBRARY,
    OPENED,
    PROGRAM,
    Dependency,
    file_sha256,
    value_sha256,
)
from uqpen.models.installed import is_installed, is_standard

_CACHED = "__pycache__"

# Places of the system, whose files change with its version.
_SYSTEM = (
    *("/proc/", "/sys/", "/dev/", "/etc/", "/bin/", "/sbin/"),
    *("/usr/bin/", "/usr/sbin/", "/usr/share/"),
)

# Variables that say where a process runs, and not what it computes.
_PLACE = (
    *("HOME", "PATH", "PWD", "OLDPWD", "TMPDIR", "TMP", "TEMP", "USER", "LOGNAME", "USERNAME"),
    *("HOSTNAME", "SHELL", "TERM", "COLUMNS", "LINES", "DISPLAY"),
    *("LANG", "LANGUAGE"),
)
_PLACES = ("SLURM_", "PBS_", "LSB_", "XDG_", "LC_", "DASK_", "OMP_", "OPENBLAS_", "MKL_", "UQPEN_")

# An environment of so few variables may have been read one by one.
_FEW = 8

# Modules of Python that start programs to ask about the machine.
_ASKING = ("ctypes/util.py", "platform.py", "uuid.py")

_SHELLS = ("sh", "bash", "dash", "zsh", "ksh", "cmd.exe")

_INTERPRETER = os.path.realpath(sys.executable)

_WRITING = os.O_WRONLY | os.O_RDWR

Stamp = tuple[int, int]


# Packages whose compiled code opens files, which Python does not see.
_READERS = re.compile(r"^\s*(?:import|from)\s+(netCDF4|xarray|h5py|pyarrow|tables|zarr)\b", re.M)


class Observation:
    """Dependencies of code that runs within the context `active`.

    Python reports what its own functions open, start and connect to. Not seen is what compiled
    libraries open by themselves, and what programs and forked processes do.
    """

    def __init__(self) -> None:
        self._opened: dict[str, Stamp] = {}
        self._written: set[str] = set()
        self._folders: tuple[str, ...] = ()
        self._since = 0
        self._libraries: set[str] = set()
        self._programs: set[str] = set()
        self._hosts: set[str] = set()
        self._variables: dict[str, str | None] = {}
        self._read: Counter[str] = Counter()
        self._set: set[str] = set()
        self._is_noting = False

    @contextlib.contextmanager
    def active(self) -> Iterator[None]:
        """Observe within this context; within that of another observation, do nothing."""
        global _observation
        if _observation is not None:
            yield
            return
        _add_hook()
        environment: Any = os._Environ
        original = environment.__getitem__
        environment.__getitem__ = _observed(original)
        _observation = self
        self._since = time.time_ns()
        try:
            yield
        finally:
            _observation = None
            environment.__getitem__ = original

    def dependencies(self, folder: str) -> Iterator[tuple[Dependency, str]]:
        """Yield what was observed, with hashes as of now and the path of each file.

        Names are relative to the folder of the study.
        """
        for role, paths in ((OPENED, self._opened), (LIBRARY, self._libraries)):
            for path in sorted(paths):
                if _is_noise(path):
                    continue
                name = relative_name(path, folder)
                if role == OPENED and _stamp(path) != self._opened[path]:
                    yield Dependency(CHANGED, name), path
                elif sha256 := file_sha256(path):
                    yield Dependency(role, name, sha256), path
        for name in sorted(self._programs):
            yield Dependency(PROGRAM, name), ""
        for name in sorted(self._hosts):
            yield Dependency(CONNECTION, name), ""
        yield from ((each, "") for each in self._environment())

    def _environment(self) -> Iterator[Dependency]:
        """Yield the variables that were read."""
        # Where all are read alike, the environment was copied as a whole, which reads each of them.
        copies = min((self._read[name] for name in os.environ), default=0)
        copies *= len(os.environ) > _FEW
        if copies:
            yield Dependency(ENVIRONMENT, "")
        for name, value in sorted(self._variables.items()):
            if self._read[name] > copies:
                yield Dependency(ENVIRONMENT, name, value_sha256(name, value))

    def note_event(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Note an audit event of Python."""
        note = _NOTES.get(event)
        if note is None or self._is_noting:
            return
        self._is_noting = True
        try:
            note(self, *arguments)
        except (OSError, TypeError, ValueError, IndexError, AttributeError):
            pass  # of odd arguments; it would become an error of the user's code
        finally:
            self._is_noting = False

    def note_variable(self, name: str | bytes, value: str | bytes | None) -> None:
        """Note a variable of the environment that is read, None for one that is not set."""
        text = os.fsdecode(name)
        is_guess = self._is_noting and value is None  # a word that may be no variable
        if not is_guess and _is_users():
            self._read[text] += 1
            if text not in self._set and text not in _PLACE and not text.startswith(_PLACES):
                found = None if value is None else os.fsdecode(value)
                self._variables.setdefault(text, found)

    # A file that is open already is a number, which `os.fsdecode` refuses.

    def _note_open(self, file: Any, mode: object = None, flags: object = 0) -> None:
        path = os.path.abspath(os.fsdecode(file))
        if path.endswith(".pyc") and os.path.basename(os.path.dirname(path)) == _CACHED:
            with contextlib.suppress(ValueError):
                path = source_from_cache(path)
        if path in self._opened or path in self._written:
            return
        flags = flags if isinstance(flags, int) else 0
        # Of a file that is opened to be read and changed, the content counts.
        reads_first = flags & os.O_RDWR and not flags & (os.O_TRUNC | os.O_EXCL | os.O_APPEND)
        if flags & _WRITING and not reads_first:
            self._written.add(path)
        elif os.path.isfile(path) and not self._is_made(path):
            self._opened[path] = _stamp(path)

    def _is_made(self, path: str) -> bool:
        """Check for a file that the code itself has made, also by a program that it has started."""
        if path in self._written or path.startswith(self._folders):
            return True
        return _stamp(path)[0] >= self._since

    def _note_database(self, file: Any) -> None:
        text = os.fsdecode(file).removeprefix("file:").partition("?")[0]
        if text and text != ":memory:":
            self._note_open(text)

    def _note_folder(self, path: Any, *_: object) -> None:
        self._folders += (os.path.abspath(os.fsdecode(path)) + os.sep,)

    def _note_library(self, name: Any, *_: object) -> None:
        path = os.path.abspath(os.fsdecode(name))
        if _is_users() and os.path.isfile(path) and not self._is_made(path):
            self._libraries.add(path)

    def _note_process(
        self, program: object, arguments: object = (), folder: object = None, *_: object
    ) -> None:
        if not _is_users():
            return
        given = [arguments] if isinstance(arguments, str | bytes | os.PathLike) else arguments
        words = [os.fsdecode(each) for each in given]  # type: ignore[attr-defined]
        first = os.fsdecode(program) if isinstance(program, str | bytes | os.PathLike) else ""
        if len(words) > 2 and words[1] == "-c" and os.path.basename(words[0]) in _SHELLS:
            self._note_words(shlex.split(words[2]) + words[3:], folder)
        else:
            self._note_words([first or words[0], *words[1:]], folder)

    def _note_command(self, command: Any, *_: object) -> None:
        if _is_users():
            self._note_words(shlex.split(os.fsdecode(command)), None)

    def _note_fork(self, *_: object) -> None:
        if _is_users():
            self._programs.add("a forked process")

    def _note_words(self, words: list[str], folder: object) -> None:
        """Note a program with its words; those that are files are hashed."""
        start = os.fsdecode(folder) if isinstance(folder, str | bytes | os.PathLike) else ""
        paths = [os.path.abspath(os.path.join(start, os.path.expandvars(word))) for word in words]
        own = [each for each in paths if os.path.isfile(each) and not _is_noise(each)]
        for path in own:
            if not self._is_made(path):
                self._opened.setdefault(path, _stamp(path))
        first = os.path.basename(words[0])
        is_interpreter = first in _SHELLS or os.path.realpath(words[0]) == _INTERPRETER
        self._programs.add(os.path.basename(own[0]) if own and is_interpreter else first)

    def _note_connection(self, _: object, address: object) -> None:
        # Not the port, which may be another one each time.
        local = "a socket of this machine"
        self._hosts.add(str(address[0]) if isinstance(address, tuple) else local)


_NOTES: dict[str, Callable[..., None]] = {
    "open": Observation._note_open,
    "sqlite3.connect": Observation._note_database,
    "ctypes.dlopen": Observation._note_library,
    "subprocess.Popen": Observation._note_process,
    "os.posix_spawn": Observation._note_process,
    "os.spawn": lambda self, mode, path, args, *_: self._note_process(path, args),
    "os.system": Observation._note_command,
    "os.mkdir": Observation._note_folder,
    "os.fork": Observation._note_fork,
    "os.forkpty": Observation._note_fork,
    "socket.connect": Observation._note_connection,
    "os.putenv": lambda self, name, *_: self._set.add(os.fsdecode(name)),
}

_observation: Observation | None = None


@functools.cache
def _add_hook() -> None:
    """Add the hook, which cannot be removed: while nothing is observed, it returns at once."""

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if _observation is not None:
            _observation.note_event(event, arguments)

    sys.addaudithook(hook)


def _observed(original: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return the reading of a variable that notes it: Python has no audit event for that."""

    def read(environment: Any, name: Any) -> Any:
        try:
            value = original(environment, name)
        except KeyError:
            if _observation is not None:
                _observation.note_variable(name, None)
            raise
        if _observation is not None:
            _observation.note_variable(name, value)
        return value

    return read


def _is_users() -> bool:
    """Check that the nearest frame outside the standard library and this file is the user's."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        file = frame.f_code.co_filename
        if file != __file__ and not is_standard(file):
            return file.startswith("<") or not is_installed(file)
        if file.replace(os.sep, "/").endswith(_ASKING):
            return False
        frame = frame.f_back
    return False


def _is_noise(path: str) -> bool:
    """Check for a file of the system, of an installed package, or of a cache."""
    if path.startswith(_SYSTEM) or f"{os.sep}{_CACHED}{os.sep}" in path or is_installed(path):
        return True
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if path.startswith(cache + os.sep):
        return True
    return os.path.realpath(path) == _INTERPRETER


def _stamp(path: str) -> Stamp:
    try:
        about = os.stat(path)
    except OSError:
        return (0, 0)
    return about.st_mtime_ns, about.st_size


def unseen_readers(source: str) -> Iterator[str]:
    """Yield what a source may open without being seen, in words."""
    for name in dict.fromkeys(_READERS.findall(source)):
        yield f"files that {name} opens"


def relative_name(path: str, folder: str) -> str:
    """Return the path of a file from a folder, with ``/`` between folders."""
    try:
        return os.path.relpath(path, folder).replace(os.sep, "/")
    except ValueError:  # on another drive
        return os.path.basename(path)
