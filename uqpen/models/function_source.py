"""Source of a Python function and of what it depends on, which identifies its version."""

from __future__ import annotations

import dis
import functools
import hashlib
import inspect
import sysconfig
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

__all__ = ["FunctionSource", "function_source"]

# Modules in these folders change only with the versions of packages.
_INSTALLED = tuple(
    sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")
)
_ABSENT = "the function is an object of the Python program that made the study"
_CONSTANTS = (type(None), bool, int, float, complex, str, bytes)
_GLOBALS = ("LOAD_GLOBAL", "LOAD_NAME")


@dataclass(frozen=True)
class FunctionSource:
    """Source of a function.

    Parameters
    ----------
    name : str
        Name of the function.
    text : str
        Its source; empty where that cannot be read.
    sha256 : str
        Hash of its source, of the functions of the user that it calls, and of the values that it
        takes from outside; empty where one of them cannot be hashed.
    unknown : str
        The reason for an empty hash; empty otherwise.
    """

    name: str
    text: str
    sha256: str
    unknown: str = ""

    @classmethod
    def absent(cls, name: str, text: str) -> FunctionSource:
        """Return the source of a function of another process, which is known by its text only."""
        return cls(name, text, "", _ABSENT)

    @property
    def is_absent(self) -> bool:
        """True if the function itself is not in this process."""
        return self.unknown == _ABSENT

    @property
    def is_known(self) -> bool:
        """True if the hash distinguishes its version from every other."""
        return not self.unknown


class _UnknownSourceError(Exception):
    """Part of a function that cannot be hashed; the message names it."""


def function_source(function: Callable[..., Any]) -> FunctionSource:
    """Return the source of a function, also of one defined in a notebook or in a function.

    Parameters
    ----------
    function : callable
        It is read, not called.

    Returns
    -------
    FunctionSource
        Its hash is the same in every process and whatever the lines around the definition.
    """
    name = getattr(function, "__qualname__", type(function).__name__).rpartition(".")[2]
    name = name.replace("<lambda>", "lambda")
    text = _readable_source(function)
    digest = hashlib.sha256()
    try:
        for part in _parts(function, name, set()):
            digest.update(len(part).to_bytes(8, "little") + part)
    except _UnknownSourceError as reason:
        return FunctionSource(name, text, "", str(reason))
    return FunctionSource(name, text, digest.hexdigest())


def _readable_source(function: object) -> str:
    try:
        return textwrap.dedent(inspect.getsource(function))  # type: ignore[arg-type]
    except (OSError, TypeError):
        return ""


def _parts(value: object, label: str, seen: set[int]) -> Iterator[bytes]:
    """Yield a canonical form of a value that a function consists of or takes from outside.

    Raises
    ------
    _UnknownSourceError
        If it has none, so two values of this kind cannot be distinguished.
    """
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biufcSU":
        array = np.asarray(value)
        yield f"array {array.dtype.str} {array.shape}".encode()
        yield np.ascontiguousarray(array).tobytes()
    elif isinstance(value, _CONSTANTS):
        yield f"{type(value).__name__} {value!r}".encode()
    elif isinstance(value, ModuleType | type | BuiltinFunctionType | np.ufunc):
        yield _reference(value, label).encode()
    elif isinstance(value, list | tuple | Mapping):
        yield f"{type(value).__name__} {len(value)}".encode()
        items = value.items() if isinstance(value, Mapping) else value
        for item in items:
            yield from _parts(item, label, seen)
    elif isinstance(value, functools.partial):
        for item in (value.func, value.args, value.keywords):
            yield from _parts(item, label, seen)
    elif isinstance(value, FunctionType):
        yield from _function_parts(value, label, seen)
    else:
        raise _UnknownSourceError(f'"{label}" is an object of class {type(value).__name__}')


def _function_parts(function: FunctionType, label: str, seen: set[int]) -> Iterator[bytes]:
    """Yield the source of a function, its default values, and the values from outside it."""
    if _is_installed(function):
        yield _reference(function, label).encode()
        return
    if id(function) in seen:
        return
    seen.add(id(function))
    text = _readable_source(function)
    if not text:
        raise _UnknownSourceError(f'the source of "{label}" cannot be read')
    yield text.encode()
    if function.__name__ == "<lambda>":
        # Its source is the statement around it, which may contain others.
        code = function.__code__
        yield code.co_code + repr((code.co_names, code.co_varnames)).encode()
        constants = [each for each in code.co_consts if not isinstance(each, CodeType)]
        yield from _parts(constants, label, seen)
    for name, value in _outside_values(function):
        yield name.encode()
        yield from _parts(value, name, seen)


def _outside_values(function: FunctionType) -> Iterator[tuple[str, object]]:
    """Yield defaults, variables of enclosing functions, and global variables, by their names."""
    defaults = {**(function.__kwdefaults__ or {}), "defaults": function.__defaults__}
    yield from sorted(defaults.items())
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:
            raise _UnknownSourceError(f'"{name}" has no value yet') from None
    for name in sorted(set(_global_names(function.__code__))):
        if name in function.__globals__:
            yield name, function.__globals__[name]


def _global_names(code: CodeType) -> Iterator[str]:
    """Yield the global names in a function's code and in the functions that it defines."""
    for instruction in dis.get_instructions(code):
        if instruction.opname in _GLOBALS:
            yield str(instruction.argval)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _global_names(constant)


def _reference(value: Any, label: str) -> str:
    """Return the name of something from an installed package; refuse the user's own."""
    if isinstance(value, ModuleType):
        module, name = value.__name__, ""
    elif isinstance(value, np.ufunc):
        module, name = "numpy", value.__name__
    else:
        module, name = str(value.__module__), value.__qualname__
    if not _is_installed(value):
        kind = "a module" if isinstance(value, ModuleType) else "a class"
        raise _UnknownSourceError(f'"{label}" is {kind} of your own')
    return f"{module}:{name}"


def _is_installed(value: Any) -> bool:
    """Check that something comes with Python or with an installed package."""
    if isinstance(value, BuiltinFunctionType | np.ufunc):
        return True
    # The main program may be installed, such as that of a kernel, and what it executes is not.
    if getattr(value, "__module__", value.__name__) == "__main__":
        return False
    try:
        file = inspect.getfile(value)
    except (OSError, TypeError):  # compiled into the interpreter
        return True
    return file.startswith(_INSTALLED)
