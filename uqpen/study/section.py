"""Reading a TOML table key by key, noting mistakes instead of stopping at the first."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from uqpen.errors import Problem, QuantityError, SettingsError, as_written
from uqpen.labels import NAME
from uqpen.lookup import choices, resolve
from uqpen.quantities import parse_quantity
from uqpen.settings import Setting, declared
from uqpen.study.document import Document
from uqpen.units import describe

__all__ = ["Section", "member", "named"]

T = TypeVar("T")


class Section:
    """A TOML table while it is read.

    Whoever reads it takes the keys it knows; what is left when it is closed was not known.

    Parameters
    ----------
    document : Document
        The file it stands in.
    problems : list of Problem
        Where mistakes are noted.
    path : tuple
        Keys that lead to it.
    content : dict
        What stands in it.
    """

    def __init__(
        self,
        document: Document,
        problems: list[Problem],
        path: tuple[str | int, ...],
        content: dict[str, Any],
    ) -> None:
        self.document = document
        self.problems = problems
        self.path = path
        self.content = content
        self._known: dict[str, None] = {}  # a set that keeps its order

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def __iter__(self) -> Iterator[str]:
        return iter(self.content)

    def wrong(self, keys: str | tuple[str | int, ...], found: str, expected: str) -> None:
        """Note a mistake at a key of this table, or further in, or (no keys) in the table."""
        keys = (keys,) if isinstance(keys, str) else keys
        problem = Problem((*self.path, *keys), found, expected)
        if problem not in self.problems:  # several models may miss the same
            self.problems.append(problem)

    def missing(self, key: str, expected: str) -> None:
        """Note that a key should be there."""
        self.wrong(key, "nothing", expected)

    def take(self, key: str) -> Any:
        """The value at a key, or None; the key counts as known from here on."""
        self._known[key] = None
        return self.content.get(key)

    def close(self, what: str = "key") -> None:
        """Note every key that nobody knew."""
        for key in self.content:
            if key not in self._known:
                self.wrong(key, f"an unknown {what}", choices(key, self._known))

    def text(self, key: str, expected: str, default: str | None = None) -> str | None:
        """A text that is not empty."""
        value = self.take(key)
        if value is None:
            if default is None:
                self.missing(key, expected)
            return default
        if not isinstance(value, str) or not value.strip():
            self.wrong(key, as_written(value), expected)
            return None
        return value

    def flag(self, key: str, *, default: bool) -> bool:
        """True or false."""
        value = self.take(key)
        if value is not None and not isinstance(value, bool):
            self.wrong(key, as_written(value), "true or false")
        return value if isinstance(value, bool) else default

    def entries(self, key: str) -> list[Any]:
        """The entries of a list; empty where there is none."""
        value = self.take(key)
        if value is not None and not isinstance(value, list):
            self.wrong(key, as_written(value), "a list in square brackets")
        return value if isinstance(value, list) else []

    def table(self, key: str, expected: str = "") -> Section | None:
        """A table inside; where `expected` says what it is, it must be there."""
        value = self.take(key)
        if value is None:
            if expected:
                self.missing(key, expected)
            return None
        if not isinstance(value, dict):
            self.wrong(key, as_written(value), expected or "a table")
            return None
        return Section(self.document, self.problems, (*self.path, key), value)

    def probabilities(self, key: str) -> tuple[float, ...]:
        """A list of numbers strictly between 0 and 1, ascending and each once."""
        found = set()
        for position, value in enumerate(self.entries(key)):
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if is_number and 0 < value < 1:
                found.add(float(value))
            else:
                self.wrong((key, position), as_written(value), "a probability between 0 and 1")
        return tuple(sorted(found))

    def settings(self, cls: type[T], *, like: str = "", folder: Path = Path()) -> T | None:
        """An instance of a dataclass, its settings read from the keys of their names.

        Parameters
        ----------
        cls : type
            A dataclass with declared settings.
        like : str
            A unit of the dimension that its quantities have.
        folder : Path
            What the paths of files are relative to.

        Returns
        -------
        object or None
            None where a mistake was noted.
        """
        given: dict[str, Any] = {}
        noted = len(self.problems)
        for field, setting in declared(cls):
            value = self.take(field.name)
            if value is not None:
                given[field.name] = self._setting(field.name, value, setting, like, folder)
            elif _is_required(field):
                self.missing(field.name, describe(like) if _has_unit(setting) else setting.expected)
        if len(self.problems) > noted:
            return None
        try:
            return cls(**given)
        except SettingsError as error:
            self.refused(error)
        return None

    def refused(self, error: SettingsError) -> None:
        """Note the problems of a refused object, each as its author wrote it."""
        for problem in error.problems:
            path = (*self.path, *problem.path)
            written = self.document.written_at(path) if problem.path else None
            self.problems.append(Problem(path, written or problem.found, problem.expected))

    def quantity(self, key: str, like: str, *, difference: bool = False) -> float | None:
        """A quantity in SI units; None where it is missing or wrong."""
        value = self.take(key)
        if value is None:
            return None
        try:
            return parse_quantity(value, like, difference=difference).value
        except QuantityError as error:
            self.wrong(key, error.found, error.expected)
        return None

    def _setting(self, key: str, value: Any, setting: Setting, like: str, folder: Path) -> Any:
        """A value of the type that a setting wants; its range is checked by its owner."""
        if _has_unit(setting):
            return self.quantity(key, like, difference=setting.kind == "difference")
        if setting.kind == "file":
            if isinstance(value, str) and value and "\0" not in value:
                return folder / value
            self.wrong(key, as_written(value), setting.expected)
            return None
        if setting.kind == "number" and isinstance(value, int) and not isinstance(value, bool):
            return float(value) if abs(value) < 1e300 else math.inf
        if not _is_of_kind(setting, value):
            self.wrong(key, as_written(value), setting.expected)
        elif setting.kind == "choices":
            for name, chosen in value.items():
                if not setting.accepts({name: chosen}):
                    self.wrong((key, name), as_written(chosen), setting.expected)
        return value


def named(table: Section | None) -> Iterator[tuple[str, Section]]:
    """The tables in a table by their names; what cannot be the name of a group is noted."""
    for name in table or ():
        assert table is not None
        section = table.table(name)
        if section is None:
            continue
        if NAME.match(name):
            yield name, section
        else:
            section.wrong((), as_written(name), "a name of letters, digits and _, at most 100")


def member(table: Section, key: str, family: Mapping[str, str], what: str) -> Any:
    """The class that a key of a table names.

    Parameters
    ----------
    table : Section
        Where the key stands.
    key : str
        The key.
    family : mapping of str to str
        Names and their references.
    what : str
        What the family holds, with its article, for a message.

    Returns
    -------
    type or None
        None where a mistake was noted.
    """
    name = table.text(key, f"one of {', '.join(family)}")
    if name is None:
        return None
    if name not in family:
        table.wrong(key, as_written(name), f"{what}; {choices(name, family)}")
        return None
    return resolve(family[name])


def _has_unit(setting: Setting) -> bool:
    return setting.kind in ("quantity", "difference")


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _is_of_kind(setting: Setting, value: Any) -> bool:
    types = {
        "count": int,
        "number": float,
        "flag": bool,
        "choice": str,
        "choices": dict,
        "name": str,
    }
    is_flag = isinstance(value, bool)
    return isinstance(value, types[setting.kind]) and is_flag == (setting.kind == "flag")
