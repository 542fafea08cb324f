"""Files and modules of Python and of installed packages, which change with their versions alone."""

from __future__ import annotations

import ast
import contextlib
import functools
import os
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from importlib.util import resolve_name
from pathlib import Path
from types import ModuleType
from typing import Any

from uqpen.core.dependency import file_sha256

# This package, which says its own version.
_PACKAGE = "uqpen"
_PACKAGE_FOLDER = str(Path(__file__).parents[1]) + os.sep


def _folders(*names: str) -> tuple[str, ...]:
    found = (sysconfig.get_path(name) for name in names)
    return tuple({folder + os.sep for path in found for folder in (path, os.path.realpath(path))})


_SITE = _folders("purelib", "platlib")
_STANDARD = _folders("stdlib", "platstdlib")

# Packages of the system lie here, mostly without a record of their files.
_SYSTEM = ("/usr/lib/", "/usr/lib64/", "/lib/", "/lib64/") if os.name == "posix" else ()


def is_standard(file: str) -> bool:
    """Check that a file of source code belongs to Python itself."""
    return file.startswith("<frozen") or (
        file.startswith(_STANDARD) and not file.startswith(_SITE) and "-packages" not in file
    )


def is_installed(file: str) -> bool:
    """Check that a file comes with Python, with an installed package, or with this one.

    A file is installed if the record of an installed distribution lists it. So a package that is
    installed as editable is not, nor is a file that was put beside installed ones.
    """
    file = os.path.abspath(file)
    if file.startswith(_SYSTEM):
        return True
    if file.startswith((*_STANDARD, *_SITE, _PACKAGE_FOLDER)):
        # Of a file directly in a folder of packages alone: reading every record would take long.
        is_single = any(file.startswith(each) and os.sep not in file[len(each) :] for each in _SITE)
        return _is_recorded(file) if is_single else True
    real = os.path.realpath(file)
    if real != file and real.startswith((*_STANDARD, *_SITE, _PACKAGE_FOLDER, *_SYSTEM)):
        return is_installed(real)
    return _is_recorded(file)


def _is_recorded(file: str) -> bool:
    """Check that a distribution in the entry of the import path above a file lists the file."""
    for entry in sys.path:
        folder = os.path.abspath(entry) + os.sep
        if file.startswith(folder):
            name = file[len(folder) :].replace(os.sep, "/")
            if name.encode(errors="replace") in _recorded_files(folder):
                return True
    return False


@functools.cache
def _recorded_files(folder: str) -> frozenset[bytes]:
    """Return the files that the records of the distributions in a folder list."""
    found: set[bytes] = set()
    for record in Path(folder).glob("*.dist-info/RECORD"):
        with contextlib.suppress(OSError):
            # Behind a file stand its hash and its size.
            lines = record.read_bytes().replace(b'"', b"").splitlines()
            found.update(line.rsplit(b",", 2)[0] for line in lines)
    return frozenset(found)


def _module_attributes(module: object) -> dict[str, Any]:
    """Return the names of a module; none of another object that stands among the modules.

    Packages put objects there whose attributes import others, or raise.
    """
    try:
        found = object.__getattribute__(module, "__dict__")
    except AttributeError:
        return {}
    return found if isinstance(found, dict) else {}


def module_file(module: object) -> str:
    """Return the file that a module was loaded from; empty where there is none.

    That of a module in a zip file is the zip file. A namespace package has no file.
    """
    attributes = _module_attributes(module)
    specification = attributes.get("__spec__")
    archive = getattr(getattr(specification, "loader", None), "archive", None)
    if isinstance(archive, str):
        return archive
    origin = getattr(specification, "origin", None)
    if not isinstance(origin, str) or not getattr(specification, "has_location", False):
        origin = attributes.get("__file__")
    return origin if isinstance(origin, str) else ""


# Hash of each module that was asked for, as of then: another study may import the module again,
# which Python does not read again.
_HASHES: dict[str, tuple[ModuleType, str]] = {}


def module_sha256(name: str, module: ModuleType) -> str:
    """Return the hash of the file of a module, as it was when it was first asked for."""
    known, sha256 = _HASHES.get(name, (None, ""))
    if known is not module:
        sha256 = file_sha256(module_file(module))
        _HASHES[name] = module, sha256
    return sha256


def is_of_no_model(name: str) -> bool:
    """Check for the main program and this package, which belong to no model."""
    return name in ("__main__", "__mp_main__") or name.partition(".")[0] == _PACKAGE


@functools.lru_cache(maxsize=2)  # with the folder of a study on the path, and without it
def _modules_under(_: tuple[str, ...]) -> tuple[dict[str, ModuleType], dict[str, ModuleType]]:
    """Return the modules known to be installed under an import path, and those that are not."""
    return {}, {}


def installed_modules() -> dict[str, ModuleType]:
    """Return those known to be installed under the import path, which the next study looks up."""
    return _modules_under(tuple(sys.path))[0]


def loaded_own_modules() -> dict[str, ModuleType]:
    """Return the imported modules that are not installed, by name."""
    installed, known = _modules_under(tuple(sys.path))
    own: dict[str, ModuleType] = {}
    for name, module in list(sys.modules.items()):
        if installed.get(name) is module or is_of_no_model(name):
            continue
        if known.get(name) is module:
            own[name] = module
        elif file := module_file(module):
            (installed if is_installed(file) else own)[name] = module
    known.clear()  # modules that are not imported any more end
    known.update(own)
    return own


def reachable_modules(
    sources: Iterable[tuple[str, bytes]], candidates: dict[str, ModuleType]
) -> dict[str, ModuleType]:
    """Return those of some modules that sources import, by any statement, or that these import.

    Each source comes with the name of its package.
    """
    found: dict[str, ModuleType] = {}
    waiting = list(sources) if candidates else []
    while waiting:
        package, source = waiting.pop()
        for name in imported_names(source, package):
            if name in candidates and name not in found:
                found[name] = candidates[name]
                own = str(_module_attributes(candidates[name]).get("__package__") or "")
                try:
                    waiting.append((own, Path(module_file(candidates[name])).read_bytes()))
                except OSError:
                    continue
    return found


def imported_names(source: bytes, package: str) -> Iterator[str]:
    """Yield the modules that a source may import, with the packages that they are in."""
    try:
        nodes = list(ast.walk(ast.parse(source)))
    except (SyntaxError, ValueError, RecursionError):  # compiled, for example
        return
    for node in nodes:
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            try:
                base = resolve_name("." * node.level + (node.module or ""), package)
            except (ImportError, ValueError):
                continue
            names = [base, *(f"{base}.{alias.name}" for alias in node.names)]
        for name in names:
            parts = name.split(".")
            yield from (".".join(parts[:end]) for end in range(1, len(parts) + 1))
