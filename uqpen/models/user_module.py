"""User-defined modules, and the functions and values in them."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NamedTuple

from uqpen.core.arrays import FloatArray, floats
from uqpen.core.errors import ModelError, UnknownNameError, UqpenError
from uqpen.core.files import is_file, is_folder
from uqpen.core.lookup import choices, installed_members, load_installed, resolve
from uqpen.models.function_source import FunctionSource
from uqpen.models.surroundings import MODEL_MODULE, ModelFolder
from uqpen.models.user_code import error_text, one_line


def load_function(reference: str, folder: Path) -> tuple[Callable[..., Any], ModelFolder]:
    """Load the function of ``"file.py:function"`` or ``"package.module:function"``.

    A path ends in ``.py`` and is relative to the folder of the study, whose modules can be
    imported; anything else is an importable module. The function must be called in the folder that
    comes with it.

    ModelError if there is no such function, or importing it fails.
    """
    module, name, surroundings = load_module(reference, folder)
    return find_function(module, name, reference), surroundings


def find_function(module: ModuleType, name: str, reference: str) -> Callable[..., Any]:
    """Return the function of a module with a name; ModelError if there is none."""
    function = getattr(module, name, None)
    if not callable(function):
        known = [key for key, value in vars(module).items() if inspect.isfunction(value)]
        listing = f"; it defines {', '.join(known)}" if known else ""
        where = reference.rpartition(":")[0]
        raise ModelError(f'"{where}" has no function "{name}"{listing}')
    return function


def load_module(
    reference: str, folder: Path, form: str = "my_model.py:function"
) -> tuple[ModuleType, str, ModelFolder]:
    """Load the module of a reference, with the name after the colon and the module's folder.

    ModelError if the reference is not of the form, there is no such module, or importing it fails.
    """
    where, _, name = reference.rpartition(":")
    if not where or not name:
        raise ModelError(f'"{reference}" is not of the form "{form}"')
    surroundings = ModelFolder(folder)
    with surroundings.loading():
        module = _import_module(where, surroundings)
        if where.endswith(".py"):
            # It may lie outside the folder.
            surroundings.read(str(folder / where))
    return module, name, surroundings


def module_coordinates(module: ModuleType, name: str, surroundings: ModelFolder) -> FloatArray:
    """Return the coordinates that a module of a model has under a name.

    They are a list, an array, or a function without arguments that returns one.

    ModelError if there is no such name, the function fails, or what it has are no numbers along one
    dimension.
    """
    if not hasattr(module, name):
        raise ModelError(f'"{name}", which is not there')
    value = getattr(module, name)
    try:
        with surroundings.on_import_path():
            values = floats(value() if callable(value) else value)
    except (Exception, SystemExit) as error:  # a user's function can raise anything
        raise ModelError(one_line(f'"{name}": {error_text(error)}')) from None
    if values.ndim != 1:
        raise ModelError(f'"{name}" of shape {values.shape}')
    return values


def _import_module(where: str, surroundings: ModelFolder) -> Any:
    try:
        if where.endswith(".py"):
            return _load_file(surroundings.folder / where, where)
        return importlib.import_module(where)
    except ModelError:
        raise
    except ModuleNotFoundError as error:
        searched = f"beside the study, or in the packages of {sys.executable}"
        raise ModelError(f'"{where}": {error}', f"a module {error.name} {searched}") from None
    except (Exception, SystemExit) as error:  # a user's module can raise anything when imported
        if where.endswith(".py"):
            surroundings.read(str(surroundings.folder / where))
        # An error of syntax has its place in its text.
        place = "" if isinstance(error, SyntaxError) else line_in_folder(error, surroundings)
        raise ModelError(f'importing "{where}" failed: {error_text(error)}{place}') from None


def _load_file(path: Path, where: str) -> Any:
    if is_folder(path):
        raise ModelError(f'"{where}" is a folder, not a Python file')
    if not is_file(path):
        raise ModelError(f'there is no file "{where}" beside the study')
    # Under a name of our own: a model in "random.py" must not stand in for Python's module.
    specification = importlib.util.spec_from_file_location(f"{MODEL_MODULE}{path.stem}", path)
    if specification is None or specification.loader is None:
        raise ModelError(f'"{where}" is not a Python file')
    module = importlib.util.module_from_spec(specification)
    sys.modules[module.__name__] = module
    specification.loader.exec_module(module)
    return module


# An exception of a class of its own may have another attribute of this name.
_TRACEBACK = BaseException.__dict__["__traceback__"]

# Characters of a line that are shown.
_LONGEST_LINE = 80


def line_in_folder(error: BaseException, folder: ModelFolder) -> str:
    """Return the innermost line of a folder's modules in the traceback of an exception.

    It is a text such as `` (beam.py, line 7: return force / area)``, empty where no module is
    there. The file is named as in the folder, so the text is the same wherever the folder is. The
    traceback is removed from the exception: an exception that is raised again adds to it.
    """
    for code, number in reversed(_lines(error)):
        content = folder.module_content(code.co_filename)
        if content is not None:
            name = _file_name(Path(code.co_filename), folder.folder)
            return _line_text(name, number, content)
    return ""


def line_in_function(
    error: BaseException, function: Callable[..., Any], source: FunctionSource
) -> str:
    """Return the line of a function itself in the traceback of an exception, as `line_in_folder`.

    Lines count from that of its definition, wherever that stands in a program or a notebook.
    """
    for code, number in reversed(_lines(error)):
        if code is getattr(function, "__code__", None):
            own = number - code.co_firstlineno + 1
            return _line_text(source.name, own, source.text.encode())
    return ""


def _lines(error: BaseException) -> list[tuple[CodeType, int]]:
    """Return the code and the number of each line in a traceback, which is removed."""
    frames = _TRACEBACK.__get__(error)
    _TRACEBACK.__set__(error, None)
    return [(frame.f_code, number) for frame, number in traceback.walk_tb(frames)]


def _file_name(path: Path, folder: Path) -> str:
    """Return the path of a file within a folder; the bare name of a file outside it."""
    is_inside = path.is_relative_to(folder) and ".." not in path.relative_to(folder).parts
    return path.relative_to(folder).as_posix() if is_inside else path.name


def _line_text(name: str, number: int, source: bytes) -> str:
    # Python ends lines where bytes do. Texts end them also at a form feed, or inside a quotation.
    lines = source.splitlines()
    line = one_line(lines[number - 1].decode("utf-8", "replace")) if number <= len(lines) else ""
    line = line if len(line) <= _LONGEST_LINE else f"{line[: _LONGEST_LINE - 1]}…"
    return f" ({name}, line {number}{f': {line}' if line else ''})"


@dataclass(frozen=True)
class UserDefinedFunction:
    """User-defined function that this process calls."""

    reference: str  # the file, module or package and the function, as its user has named it
    function: Callable[..., Any] = field(compare=False)  # the function itself
    # The context in which the function must be called.
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)
    error: type[UqpenError] = ModelError  # class of the error that its failures become

    @property
    def title(self) -> str:
        """First line of its docstring; its name where it has none."""
        return self._documentation[0] or self.name.replace("_", " ").capitalize()

    @property
    def introduction(self) -> str:
        """Docstring of the function without its first line, as one paragraph."""
        return " ".join(" ".join(self._documentation[1:]).split())

    @property
    def name(self) -> str:
        """Name of the function."""
        return str(getattr(self.function, "__name__", type(self.function).__name__))

    @property
    def _documentation(self) -> list[str]:
        text = getattr(self.function, "__doc__", None)
        return str(text).strip().split("\n") if text else [""]

    @contextlib.contextmanager
    def in_context(self) -> Iterator[None]:
        """Provide the context of a call; any exception in it becomes an error with its reference.

        The error, of the class `error`, has the exception and its line in one sentence.
        """
        place = self.surroundings.on_import_path() if self.surroundings else None
        try:
            with place or contextlib.nullcontext():
                yield
        except (Exception, SystemExit) as error:  # a user's function can raise anything
            raise self.failure(failure_text(error, self.function)) from None

    def failure(self, text: str) -> UqpenError:
        """Return the error that a text about the function becomes."""
        return self.error(f"{self.reference}: {text}")


class FunctionFamily(NamedTuple):
    """Family of functions to which others can be added without touching the package."""

    members: Mapping[str, str]  # the built-in members, by name, with their references
    group: str  # the entry points with which installed packages add members
    what: str  # a member, for a message
    form: str  # a reference to a function of the user's, for a message
    error: type[UqpenError]  # class of the errors of such functions

    def find(self, named: str | Callable[..., Any], folder: Path) -> UserDefinedFunction:
        """Return the function with a name or a reference, or a function itself.

        The path of a file is relative to the folder.

        Raises
        ------
        UnknownNameError
            If there is no member of this name.
        UqpenError
            Of the class `error`, if the function cannot be loaded.
        """
        if not isinstance(named, str):
            name = getattr(named, "__qualname__", type(named).__name__)
            return UserDefinedFunction(name, named, error=self.error)
        if named in self.members:
            return UserDefinedFunction(named, resolve(self.members[named]), error=self.error)
        try:
            function, surroundings = self._load(named, folder)
        except ModelError as error:
            raise self.error(str(error)) from None
        if not callable(function):
            raise self.error(
                f"{named} is an object of class {type(function).__name__}, not a function"
            )
        return UserDefinedFunction(named, function, surroundings, self.error)

    def installed(self) -> Iterator[str]:
        """Yield the names that installed packages add."""
        yield from (name for name in installed_members(self.group) if name not in self.members)

    def _load(self, named: str, folder: Path) -> tuple[Any, ModelFolder | None]:
        if ":" not in named:
            installed = list(self.installed())
            if named not in installed:
                known = choices(named, [*self.members, *installed])
                raise UnknownNameError(f'no {self.what} "{named}"; {known}')
            return load_installed(self.group, named), None
        where, _, attribute = named.rpartition(":")
        if where.endswith(".py") and not is_file(folder / where):
            raise ModelError(f'there is no file "{where}"; expected a reference like "{self.form}"')
        module, attribute, surroundings = load_module(named, folder, self.form)
        if not hasattr(module, attribute):
            own = (key for key, value in vars(module).items() if _is_own(value, module.__name__))
            raise ModelError(
                f'"{where}" has no function "{attribute}"; it defines {", ".join(own) or "none"}'
            )
        return getattr(module, attribute), surroundings


def failure_text(error: BaseException, function: Callable[..., Any]) -> str:
    """Return an exception in one line, with the line of the function's file that it comes from."""
    file = getattr(getattr(function, "__code__", None), "co_filename", None)
    frames = traceback.extract_tb(error.__traceback__)
    lines = [each.lineno for each in frames if each.filename == file]
    place = f" (line {lines[-1]})" if lines else ""
    return one_line(f"{type(error).__name__}: {error}{place}")


def _is_own(value: object, module: str) -> bool:
    return callable(value) and getattr(value, "__module__", None) == module
