"""Reading a table of a study key by key, noting mistakes instead of stopping at the first."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.lookup import choices, resolve
from uqpen.core.model import Model
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import Context, declared_settings
from uqpen.core.units import ANY_DIMENSION, are_convertible, describe
from uqpen.study.document import MOST_LISTED, Document

T = TypeVar("T")


class StudyParts(NamedTuple):
    """Parts of a study to which a section can refer."""

    model: Model  # the model with the inputs and outputs of the study
    sources: frozenset[str]  # names of the designs and surrogates
    confidence_level: float  # confidence level of all intervals


@dataclasses.dataclass(eq=False)
class TableReader:
    """A table of a study while it is read; keys that nobody takes are unknown."""

    document: Document  # the study that it stands in
    folder: Path  # what the paths of files are relative to
    trust: bool  # true if code that it names may be executed, and servers may get requests
    content: dict[str, Any]  # its keys and values
    path: tuple[str | int, ...] = ()  # keys that lead to it
    problems: list[Problem] = dataclasses.field(default_factory=list)  # the mistakes in the study
    is_given: bool = True  # false for a table that the study does not have; it is empty
    _noted: set[Problem] = dataclasses.field(default_factory=set)
    _known: dict[str, None] = dataclasses.field(default_factory=dict)  # a set that keeps its order

    def __contains__(self, key: str) -> bool:
        return key in self.content

    def __iter__(self) -> Iterator[str]:
        return iter(self.content)

    def add_problem(self, keys: str | tuple[str | int, ...], found: str, expected: str) -> None:
        """Note a mistake at a key of this table, or further in, or (no keys) in the table."""
        keys = (keys,) if isinstance(keys, str) else keys
        problem = Problem((*self.path, *keys), found, expected)
        if problem not in self._noted:  # several models may miss the same
            self._noted.add(problem)
            self.problems.append(problem)

    def add_missing(self, key: str, expected: str) -> None:
        """Note that a key should be there."""
        self.add_problem(key, "nothing", expected)

    def add_wrong(self, keys: str | tuple[str | int, ...], value: object, expected: str) -> None:
        """Note a value that is not what is expected."""
        self.add_problem(keys, toml_text(value), expected)

    def add_problems(self, problems: Iterable[Problem], *keys: str | int) -> None:
        """Note the problems of the value at some keys."""
        for problem in problems:
            self.add_problem((*keys, *problem.path), problem.found, problem.expected)

    def add_refused(self, problems: Iterable[Problem]) -> None:
        """Note the problems of refused settings, each with the value as its author wrote it."""
        for problem in problems:
            path = (*self.path, *problem.path)
            written = self.document.value_text(path) if problem.path else None
            self.add_problem(problem.path, written or problem.found, problem.expected)

    def take(self, key: str) -> Any:
        """Return the value at a key, or None; the key counts as known from here on."""
        self._known[key] = None
        return self.content.get(key)

    def know(self, *keys: str) -> None:
        """Count keys as known, whether they are there or not."""
        self._known.update(dict.fromkeys(keys))

    def check_unknown_keys(self, what: str = "key") -> None:
        """Note every key that nobody knew."""
        for key in self.content:
            if key not in self._known:
                self.add_problem(key, f"an unknown {what}", self.suggest(key, self._known))

    def suggest(self, name: str, known: Collection[str]) -> str:
        """Suggest names in place of an unknown one, while mistakes are still listed one by one."""
        return choices(name, known) if len(self.problems) < MOST_LISTED else "a known name"

    def text(self, key: str, expected: str) -> str | None:
        """Read a text that is not empty; None where it is missing or wrong."""
        value = self.take(key)
        if value is None:
            self.add_missing(key, expected)
        elif isinstance(value, str) and value.strip():
            return value
        else:
            self.add_wrong(key, value, expected)
        return None

    def entries(self, key: str) -> list[Any]:
        """Return the entries of a list; empty where there is none."""
        value = self.take(key)
        if value is not None and not isinstance(value, list):
            self.add_wrong(key, value, "a list in square brackets")
        return value if isinstance(value, list) else []

    def table(self, key: str, expected: str = "") -> TableReader:
        """Return a table inside; where `expected` says what it is, it must be there."""
        value = self.take(key)
        if value is None and expected:
            self.add_missing(key, expected)
        elif value is not None and not isinstance(value, dict):
            place = (*self.path, key)
            if all(each.path != place for each in self.problems):  # several parts may read it
                self.add_wrong(key, value, expected or "a table")
        return self.inside(value if isinstance(value, dict) else None, key)

    def inside(self, content: dict[str, Any] | None, *keys: str | int) -> TableReader:
        """Return the reader of a table inside, or of one that is not there."""
        path, is_given = (*self.path, *keys), content is not None
        return dataclasses.replace(
            self, content=content or {}, path=path, is_given=is_given, _known={}
        )

    def quantity(self, key: str, like: str) -> float | None:
        """Read a quantity in SI units; None where it is missing or wrong."""
        value = self.take(key)
        try:
            return None if value is None else parse_quantity(value, like).value
        except QuantityError as error:
            self.add_problems(error.problems, key)
        return None

    def settings(
        self,
        cls: type[T],
        *,
        like: str = "",
        allow_offset: bool = True,
        given: Mapping[str, Any] | None = None,
    ) -> T | None:
        """Make an instance of a dataclass, its settings read from their keys.

        Parameters
        ----------
        cls : type
            A dataclass with declared settings.
        like : str
            A unit of the dimension of its quantities; of `ANY_DIMENSION`, they need only agree.
        allow_offset : bool
            Whether their units may have a zero of their own, such as degC.
        given : mapping of str to object, optional
            Values of fields that the table does not have.

        Returns
        -------
        object or None
            None where a mistake was noted.
        """
        values = self.setting_values(cls, like, given, allow_offset=allow_offset)
        try:
            return None if values is None else cls(**values)
        except SettingsError as error:
            self.add_refused(error.problems)
        return None

    def whole_settings(self, cls: type[T], like: str = "") -> T | None:
        """Make an instance as `settings` does; the table has no other keys."""
        made = self.settings(cls, like=like)
        self.check_unknown_keys()
        return made

    def setting_values(
        self,
        cls: type,
        like: str = "",
        given: Mapping[str, Any] | None = None,
        *,
        allow_offset: bool = True,
    ) -> dict[str, Any] | None:
        """Return the fields of a dataclass that are given or read; see `settings`."""
        values, problems = dict(given or {}), list[Problem]()
        context = Context(like, self.folder, allow_offset)
        is_agreed = like is not ANY_DIMENSION or self._has_one_dimension(cls)
        for field, setting in declared_settings(cls):
            key = setting.key or field.name
            written = self.take(key)
            if written is None:
                if field.name not in values and (
                    field.default is dataclasses.MISSING
                    and field.default_factory is dataclasses.MISSING
                ):
                    expected = describe(like) if setting.has_dimension else setting.expected
                    problems.append(Problem((key,), "nothing", expected))
                continue
            try:
                values[field.name] = setting.read(written, context)
            except (SettingsError, QuantityError) as error:
                problems += [problem.within(key) for problem in error.problems]
            else:
                if is_agreed and not setting.accepts(values[field.name]):
                    problems.append(Problem((key,), toml_text(written), setting.expected))
        self.add_problems(problems)
        return None if problems or not is_agreed else values

    def _has_one_dimension(self, cls: type) -> bool:
        """Return True if the quantities among the settings of a class have the same dimension."""
        keys = [field.name for field, setting in declared_settings(cls) if setting.has_dimension]
        try:
            units = [
                parse_quantity(self.content[key], ANY_DIMENSION).unit for key in keys if key in self
            ]
        except QuantityError:
            return False
        return all(are_convertible(units[0], unit) for unit in units)


def check_names(table: TableReader, known: Collection[str], what: str, model: Model) -> list[str]:
    """Return the keys that are names of a model's inputs or outputs; note the others."""
    for name in table:
        if name not in known:
            expected = f"an {what} of {model.name}; {table.suggest(name, known)}"
            table.add_problem(name, f"an unknown {what}", expected)
    return [name for name in table if name in known]


def is_variable_name(table: TableReader, name: str) -> bool:
    """Check that a key of a table can be the name of an input or output; note it if not."""
    is_name = bool(NAME.match(name)) and name not in RESERVED
    if not is_name:
        others = ", ".join(sorted(RESERVED))
        expected = f"a name of letters, digits and _, at most 100, none of {others}"
        table.add_wrong(name, name, expected)
    return is_name


def named_tables(table: TableReader) -> Iterator[tuple[str, TableReader]]:
    """Yield the tables in a table by name; what cannot be the name of a group is noted."""
    for name in table:
        section = table.table(name)
        if section.is_given and NAME.match(name):
            yield name, section
        elif section.is_given:
            section.add_wrong((), name, "a name of letters, digits and _, at most 100")


def family_member(
    table: TableReader, key: str, family: Mapping[str, str], what: str, expected: str = ""
) -> Any:
    """Return the class that a key of a table names; None where a mistake was noted.

    `family` has names and their references; `what` is a member with its article. A message expects
    the names of the family, unless `expected` says otherwise.
    """
    name = table.text(key, expected or f"one of {', '.join(family)}")
    if name is None or name in family:
        return name and resolve(family[name])
    table.add_wrong(key, name, f"{what}; {choices(name, family)}")
    return None


# The key with the name of an object.
OBJECT = "object"

# The key with the settings of an object of a user's class, for reading only.
SETTINGS = "settings"


class NamedObject(NamedTuple):
    """Name of an object in the text of a study, and the object; None where it is not here."""

    name: str
    value: Any


def read_named_object(table: TableReader, family: str, expected: str) -> NamedObject | None:
    """Read which object of the Python program a table names; None where a mistake was noted.

    Parameters
    ----------
    table : TableReader
        The table with the key ``object``.
    family : str
        What the object is, for a message.
    expected : str
        What a file has in place of an object, which it cannot contain.
    """
    name = table.text(OBJECT, f"the text of a {family}")
    objects = table.document.objects
    if objects is None:
        table.add_wrong(OBJECT, name, expected)
        return None
    return None if name is None else NamedObject(name, objects.get(table.path))
