"""Code of a Python function and of what it depends on, which identifies its version."""

from __future__ import annotations

import builtins
import contextlib
import dis
import functools
import hashlib
import importlib
import inspect
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec, resolve_name
from itertools import chain
from pathlib import Path
from types import (
    CodeType,
    EllipsisType,
    FunctionType,
    MethodType,
    ModuleType,
    NotImplementedType,
)
from typing import Any

import numpy as np

from uqpen.models.installed import (
    is_installed,
    is_of_no_model,
    loaded_own_modules,
    module_file,
    module_sha256,
    reachable_modules,
)

_ABSENT = "the function is an object of the Python program that made the study"
_CONSTANTS: tuple[type, ...] = (
    *(type(None), bool, int, float, complex, str, bytes, range, slice),
    *(EllipsisType, NotImplementedType),
)
_GLOBALS = ("LOAD_GLOBAL", "LOAD_NAME")

# Packages with universal functions, which do not say where they are from.
_UFUNCS = ("numpy", "scipy.special")

_MISSING = object()

# Functions that may read values under names that no code states.
_UNFOLLOWED = (globals, locals, vars, eval, exec, __import__, importlib.import_module)


@dataclass(frozen=True)
class FunctionSource:
    """Source of a function."""

    name: str  # name of the function
    text: str  # its source; empty where that cannot be read
    # Hash of its byte code, of the functions of the user that it calls, and of the values that it
    # takes from outside; empty where one of them cannot be hashed. Byte code differs between
    # versions of Python.
    sha256: str
    unknown: str = ""  # the reason for an empty hash; empty otherwise

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

    The function is not called. Its hash is the same in every process and whatever the lines around
    the definition.
    """
    name = getattr(function, "__qualname__", type(function).__name__).rpartition(".")[2]
    name = name.replace("<lambda>", "lambda")
    text = ""
    with contextlib.suppress(OSError, TypeError):  # it cannot be read
        text = textwrap.dedent(inspect.getsource(function))
    try:
        digest = _digest(_parts(function, name, {}))
    except _UnknownSourceError as reason:
        return FunctionSource(name, text, "", str(reason))
    return FunctionSource(name, text, digest.hex())


def _digest(parts: Iterable[bytes]) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little") + part)
    return digest.digest()


def _parts(value: object, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    """Yield a canonical form of a value that a function consists of or takes from outside.

    Types are compared exactly: what a subclass adds is not known. `seen` has the number of each
    value that may contain itself.

    _UnknownSourceError if it has none, so two values of this kind cannot be distinguished.
    """
    kind = type(value)
    if kind in _CONSTANTS:
        yield f"{kind.__name__} {value!r}".encode("utf-8", "surrogatepass")
    elif _is_numbers(value):
        yield from _array_parts(value)
    elif id(value) in seen:
        yield f"again {seen[id(value)]}".encode()
    elif (parts := _PARTS.get(ModuleType if isinstance(value, ModuleType) else kind)) is not None:
        if kind not in (tuple, frozenset):  # equal constants may be one object or two
            seen[id(value)] = len(seen)
        yield kind.__name__.encode()
        yield from parts(value, label, seen)
    else:
        yield _reference(value, label).encode()


def _is_numbers(value: object) -> bool:
    """Check for an array or a number of NumPy itself, of numbers or texts."""
    kind = type(value)
    if kind is not np.ndarray and getattr(np, kind.__name__, None) is not kind:
        return False
    return isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "biufcSUmM"


def _array_parts(value: Any) -> Iterator[bytes]:
    order = ""
    if type(value) is np.ndarray:
        order = f" {value.flags.c_contiguous} {value.flags.f_contiguous}"
    yield f"{type(value).__name__} {value.dtype.str} {value.shape}{order}".encode()
    yield np.ascontiguousarray(value).tobytes()


def _all_parts(values: Iterable[Any], label: str, seen: dict[int, int]) -> Iterator[bytes]:
    for each in values:
        yield from _parts(each, label, seen)


def _sequence_parts(value: Any, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    yield str(len(value)).encode()
    yield from _all_parts(value, label, seen)


def _set_parts(value: Any, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    yield str(len(value)).encode()
    yield from sorted(_digest(_parts(item, label, dict(seen))) for item in value)


def _dict_parts(value: Any, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    yield str(len(value)).encode()
    yield from _all_parts(chain.from_iterable(value.items()), label, seen)


def _partial_parts(value: Any, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    return _all_parts((value.func, value.args, value.keywords, vars(value)), label, seen)


def _method_parts(value: Any, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    return _all_parts((value.__func__, value.__self__), label, seen)


def _function_parts(function: Any, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    """Yield the code of a function, its default values, and the values from outside it."""
    code = function.__code__
    if is_installed(code.co_filename) and _is_named(function):
        yield _reference(function, label).encode()
        return
    yield from _code_parts(code, label, seen)
    for name, value in _outside_values(function):
        yield name.encode()
        yield from _parts(value, name, seen)
        if isinstance(value, ModuleType) and _is_own(value):
            # The values that it names there: a program may have changed them.
            for own in sorted(
                {name for each in _nested(code) for name in each.co_names} & {*vars(value)}
            ):
                with contextlib.suppress(_UnknownSourceError):  # the module's own hash remains
                    yield _digest(_parts(vars(value)[own], own, dict(seen)))
    package = str(function.__globals__.get("__package__") or "")
    for each in _nested(code):
        for module in _inner_imports(each, package):
            yield from _parts(module, module.__name__, seen)


def _code_parts(code: CodeType, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    """Yield what a function does, whatever the lines and the file around it."""
    yield code.co_code
    yield code.co_exceptiontable
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars, code.co_name)
    yield repr((counts, names)).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code_parts(constant, label, seen)
        else:
            yield from _parts(constant, label, seen)


def _module_parts(value: ModuleType, label: str, seen: dict[int, int]) -> Iterator[bytes]:
    """Yield the name of a module; of an own one also its hash, and those that it imports."""
    name = value.__name__
    yield name.encode()
    if sys.modules.get(name) is not value:
        raise _UnknownSourceError(f'"{label}" is a module that is not imported under its name')
    for own, module in sorted(_own_modules(name, value).items()) if _is_own(value) else ():
        yield f"{own} {module_sha256(own, module)}".encode()


def _is_own(module: ModuleType) -> bool:
    """Check for a module of the user's, which does not change with a version."""
    file = module_file(module)
    return bool(file) and not is_of_no_model(module.__name__) and not is_installed(file)


def _own_modules(name: str, module: ModuleType) -> dict[str, ModuleType]:
    """Return a module of the user's, the modules in it, and all that these import."""
    loaded = loaded_own_modules()
    found = {name: module, **{key: loaded[key] for key in loaded if key.startswith(f"{name}.")}}
    sources = []
    for each in found.values():
        with contextlib.suppress(OSError):
            sources.append((each.__package__ or "", Path(module_file(each)).read_bytes()))
    return {**found, **reachable_modules(sources, loaded)}


def _nested(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function, and of the functions that it defines."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _nested(constant)


def _inner_imports(code: CodeType, package: str) -> Iterator[ModuleType]:
    """Yield the modules of the user's that a function imports when it is called.

    Installed ones are known by their versions, and are not imported before they are needed. One
    that cannot be imported is no known source.
    """
    instructions = [each for each in dis.get_instructions(code) if each.opname != "EXTENDED_ARG"]
    for position, instruction in enumerate(instructions):
        if instruction.opname != "IMPORT_NAME":
            continue
        level, names = (each.argval for each in instructions[position - 2 : position])
        name = str(instruction.argval)
        try:
            full = resolve_name("." * int(level) + name, package)
            found = find_spec(full.partition(".")[0])
            origin = getattr(found, "origin", None) or ""
            if found is None or (not found.has_location and origin) or is_installed(origin):
                continue
            module = importlib.import_module(full)
        except Exception:  # a module of the user's may raise anything
            raise _UnknownSourceError(f'the module "{name}" cannot be imported') from None
        yield module
        for each in names or ():
            with contextlib.suppress(ImportError):
                yield importlib.import_module(f"{full}.{each}")


def _outside_values(function: FunctionType) -> Iterator[tuple[str, object]]:
    """Yield defaults, attributes, variables of enclosing functions, and global variables."""
    defaults = {**(function.__kwdefaults__ or {}), "defaults": function.__defaults__}
    yield from sorted(defaults.items())
    yield from sorted(vars(function).items())
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:
            raise _UnknownSourceError(f'"{name}" has no value yet') from None
    names = {
        str(instruction.argval)
        for each in _nested(function.__code__)
        for instruction in dis.get_instructions(each)
        if instruction.opname in _GLOBALS
    }
    for name in sorted(names):
        value = function.__globals__.get(name, vars(builtins).get(name, _MISSING))
        if any(value is each for each in _UNFOLLOWED):
            raise _UnknownSourceError(f'it calls "{name}", which may read anything')
        if value is not _MISSING:
            yield name, value


def _is_named(value: Any) -> bool:
    """Check that a module has this very object under its name: names can be made up."""
    try:
        found: Any = sys.modules.get(_home(value))
        for name in str(value.__qualname__).split("."):
            found = getattr(found, name)
    except Exception:  # an object may raise anything where an attribute is asked for
        return False
    return found is value


def _home(value: Any) -> str:
    """Return the name of the module that something says it is of."""
    home = getattr(value, "__module__", None)
    if home is None:  # a method of a class in C
        home = getattr(getattr(value, "__objclass__", None), "__module__", None)
    return str(home)


def _reference(value: Any, label: str) -> str:
    """Return the name of something from an installed package; refuse the user's own."""
    if type(value) is np.ufunc:
        name = value.__name__
        home = next((m for m in _UFUNCS if getattr(sys.modules.get(m), name, None) is value), "")
        if home:
            return f"{home}:{name}"
    elif _is_named(value):
        home = _home(value)
        file = module_file(sys.modules[home])
        is_own = home == "__main__" or (bool(file) and not is_installed(file))
        if not is_own:
            return f"{home}:{value.__qualname__}"
    if isinstance(value, type):
        raise _UnknownSourceError(f'"{label}" is a class of your own')
    raise _UnknownSourceError(f'"{label}" is an object of class {type(value).__name__}')


_PARTS: dict[type, Callable[[Any, str, dict[int, int]], Iterator[bytes]]] = {
    list: _sequence_parts,
    tuple: _sequence_parts,
    set: _set_parts,
    frozenset: _set_parts,
    dict: _dict_parts,
    functools.partial: _partial_parts,
    FunctionType: _function_parts,
    MethodType: _method_parts,
    ModuleType: _module_parts,
}
