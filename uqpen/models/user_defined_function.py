"""User-defined functions: loaded from a file, a module or a package, and called with care."""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from uqpen.core.errors import ModelError, UnknownNameError, UqpenError
from uqpen.core.files import is_file
from uqpen.core.lookup import choices, installed_members, load_installed, resolve
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_code import one_line
from uqpen.models.user_module import load_module

__all__ = ["FunctionFamily", "UserDefinedFunction", "failure_text"]


@dataclass(frozen=True)
class UserDefinedFunction:
    """User-defined function that this process calls.

    Parameters
    ----------
    reference : str
        The file, module or package and the function, as its user has named it.
    function : callable
        The function itself.
    surroundings : ModelFolder, optional
        The context in which the function must be called.
    error : type
        Class of the error that its failures become.
    """

    reference: str
    function: Callable[..., Any] = field(compare=False)
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)
    error: type[UqpenError] = ModelError

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

        Raises
        ------
        UqpenError
            Of the class `error`, with the exception and its line in one sentence.
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
    """Family of functions to which others can be added without touching the package.

    Attributes
    ----------
    members : mapping of str to str
        The built-in members, by name, with their references.
    group : str
        The entry points with which installed packages add members.
    what : str
        A member, for a message.
    form : str
        A reference to a function of the user's, for a message.
    error : type
        Class of the errors of such functions.
    """

    members: Mapping[str, str]
    group: str
    what: str
    form: str
    error: type[UqpenError]

    def find(self, named: str | Callable[..., Any], folder: Path) -> UserDefinedFunction:
        """Return the function with a name or a reference.

        Parameters
        ----------
        named : str or callable
            Name of a built-in or installed member, a reference such as ``"my_file.py:function"``
            or ``"package.module:function"``, or the function itself.
        folder : Path
            Folder to which the path of a file is relative.

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
