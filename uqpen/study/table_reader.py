"""Reading a TOML table key by key, noting mistakes instead of stopping at the first."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.labels import NAME
from uqpen.core.lookup import choices, resolve
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import Setting, declared_settings
from uqpen.core.units import ANY_DIMENSION, are_convertible, describe
from uqpen.study.document import Document

__all__ = ["TableReader", "family_member", "named_tables"]

T = TypeVar("T")


class TableReader:
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

    def add_problem(self, keys: str | tuple[str | int, ...], found: str, expected: str) -> None:
        """Note a mistake at a key of this table, or further in, or (no keys) in the table."""
        keys = (keys,) if isinstance(keys, str) else keys
        problem = Problem((*self.path, *keys), found, expected)
        if problem not in self.problems:  # several models may miss the same
            self.problems.append(problem)

    def add_missing(self, key: str, expected: str) -> None:
        """Note that a key should be there."""
        self.add_problem(key, "nothing", expected)

    def take(self, key: str) -> Any:
        """The value at a key, or None; the key counts as known from here on."""
        self._known[key] = None
        return self.content.get(key)

    def check_unknown_keys(self, what: str = "key") -> None:
        """Note every key that nobody knew."""
        for key in self.content:
            if key not in self._known:
                self.add_problem(key, f"an unknown {what}", choices(key, self._known))

    def text(self, key: str, expected: str, default: str | None = None) -> str | None:
        """Read a text that is not empty."""
        value = self.take(key)
        if value is None:
            if default is None:
                self.add_missing(key, expected)
            return default
        if not isinstance(value, str) or not value.strip():
            self.add_problem(key, toml_text(value), expected)
            return None
        return value

    def flag(self, key: str, *, default: bool) -> bool:
        """True or false."""
        value = self.take(key)
        if value is not None and not isinstance(value, bool):
            self.add_problem(key, toml_text(value), "true or false")
        return value if isinstance(value, bool) else default

    def entries(self, key: str) -> list[Any]:
        """The entries of a list; empty where there is none."""
        value = self.take(key)
        if value is not None and not isinstance(value, list):
            self.add_problem(key, toml_text(value), "a list in square brackets")
        return value if isinstance(value, list) else []

    def table(self, key: str, expected: str = "") -> TableReader | None:
        """A table inside; where `expected` says what it is, it must be there."""
        value = self.take(key)
        if value is None:
            if expected:
                self.add_missing(key, expected)
            return None
        if not isinstance(value, dict):
            self.add_problem(key, toml_text(value), expected or "a table")
            return None
        return TableReader(self.document, self.problems, (*self.path, key), value)

    def probabilities(self, key: str) -> tuple[float, ...]:
        """A list of numbers strictly between 0 and 1, ascending and each once."""
        found = set()
        for position, value in enumerate(self.entries(key)):
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if is_number and 0 < value < 1:
                found.add(float(value))
            else:
                self.add_problem((key, position), toml_text(value), "a probability between 0 and 1")
        return tuple(sorted(found))

    def settings(self, cls: type[T], *, like: str = "", folder: Path = Path()) -> T | None:
        """An instance of a dataclass, its settings read from the keys of their names.

        Parameters
        ----------
        cls : type
            A dataclass with declared settings.
        like : str
            A unit of the dimension that its quantities have; of `ANY_DIMENSION`, they need only
            agree.
        folder : Path
            What the paths of files are relative to.

        Returns
        -------
        object or None
            None where a mistake was noted.
        """
        given: dict[str, Any] = {}
        noted = len(self.problems)
        is_agreed = like is not ANY_DIMENSION or self._has_one_dimension(cls)
        for field, setting in declared_settings(cls):
            value = self.take(field.name)
            if value is not None:
                given[field.name] = self._setting(field.name, value, setting, like, folder)
            elif _is_required(field):
                self.add_missing(
                    field.name, describe(like) if _has_unit(setting) else setting.expected
                )
        if not is_agreed:
            return None
        if len(self.problems) > noted:
            self._check_ranges(cls, given)
            return None
        try:
            return cls(**given)
        except SettingsError as error:
            self.add_problems(error)
        return None

    def add_problems(self, error: SettingsError) -> None:
        """Note the problems of a refused object, each as its author wrote it."""
        for problem in error.problems:
            path = (*self.path, *problem.path)
            written = self.document.value_text(path) if problem.path else None
            self.problems.append(Problem(path, written or problem.found, problem.expected))

    def quantity(self, key: str, like: str, *, difference: bool = False) -> float | None:
        """A quantity in SI units; None where it is missing or wrong."""
        value = self.take(key)
        if value is None:
            return None
        try:
            return parse_quantity(value, like, difference=difference).value
        except QuantityError as error:
            self.add_problem(key, error.found, error.expected)
        return None

    def _check_ranges(self, cls: type, given: Mapping[str, Any]) -> None:
        """Note settings out of range among those that have no mistake yet."""
        depth = len(self.path) + 1
        wrong = {problem.path[:depth] for problem in self.problems}
        for field, setting in declared_settings(cls):
            value = given.get(field.name)
            is_noted = (*self.path, field.name) in wrong
            if value is not None and not is_noted and not setting.accepts(value):
                self.add_problem(field.name, toml_text(self.content[field.name]), setting.expected)

    def _has_one_dimension(self, cls: type) -> bool:
        """Whether the quantities among the settings of a class are of the same dimension."""
        units = []
        for field, setting in declared_settings(cls):
            if _has_unit(setting) and field.name in self:
                try:
                    units.append(parse_quantity(self.content[field.name], ANY_DIMENSION).unit)
                except QuantityError:
                    return False
        return all(are_convertible(units[0], unit) for unit in units)

    def _setting(self, key: str, value: Any, setting: Setting, like: str, folder: Path) -> Any:
        """A value of the type that a setting wants; its range is checked by its owner."""
        if _has_unit(setting):
            return self.quantity(key, like, difference=setting.kind == "difference")
        if setting.kind == "file":
            if isinstance(value, str) and value and "\0" not in value:
                return folder / value
            self.add_problem(key, toml_text(value), setting.expected)
            return None
        if setting.kind == "number" and isinstance(value, int) and not isinstance(value, bool):
            return float(value) if abs(value) < 1e300 else math.inf
        if not _has_type(setting, value):
            self.add_problem(key, toml_text(value), setting.expected)
        elif setting.kind == "choices":
            for name, chosen in value.items():
                if not setting.accepts({name: chosen}):
                    self.add_problem((key, name), toml_text(chosen), setting.expected)
        return value


def named_tables(table: TableReader | None) -> Iterator[tuple[str, TableReader]]:
    """The tables in a table by their names; what cannot be the name of a group is noted."""
    for name in table or ():
        assert table is not None
        section = table.table(name)
        if section is None:
            continue
        if NAME.match(name):
            yield name, section
        else:
            section.add_problem((), toml_text(name), "a name of letters, digits and _, at most 100")


def family_member(
    table: TableReader, key: str, family: Mapping[str, str], what: str, expected: str = ""
) -> Any:
    """Return the class that a key of a table names.

    Parameters
    ----------
    table : TableReader
        Where the key stands.
    key : str
        The key.
    family : mapping of str to str
        Names and their references.
    what : str
        What the family holds, with its article, for a message.
    expected : str
        What a message says is expected; by default the names of the family.

    Returns
    -------
    type or None
        None where a mistake was noted.
    """
    name = table.text(key, expected or f"one of {', '.join(family)}")
    if name is None:
        return None
    if name not in family:
        table.add_problem(key, toml_text(name), f"{what}; {choices(name, family)}")
        return None
    return resolve(family[name])


def _has_unit(setting: Setting) -> bool:
    return setting.kind in ("quantity", "difference")


def _is_required(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _has_type(setting: Setting, value: Any) -> bool:
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
