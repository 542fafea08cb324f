"""User-defined members of families: classes in files, modules and packages."""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.errors import ModelError, toml_text
from uqpen.core.files import FileSnapshot
from uqpen.core.lookup import installed_members, load_installed
from uqpen.core.model import Model
from uqpen.core.settings import declared_settings
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design
from uqpen.distributions import COPULAS, DISTRIBUTIONS
from uqpen.distributions.copulas import Dependence
from uqpen.distributions.distribution import Distribution
from uqpen.models import MODELS
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_code import error_text
from uqpen.models.user_module import load_module
from uqpen.statistics.user_defined_analysis import SALIB
from uqpen.study.table_reader import OBJECT, SETTINGS, TableReader, family_member, read_named_object
from uqpen.surrogates import ENTRY_POINTS, SURROGATES
from uqpen.surrogates.surrogate import Surrogate

Files = tuple[FileSnapshot, ...]


class ClassFamily(NamedTuple):
    """Family of classes to which a user's own can be added without touching the package."""

    base: type  # the class that its members derive from
    members: Mapping[str, str]  # the built-in members, by name, with their references
    group: str  # the entry points with which installed packages add members
    what: str  # a member, for a message
    form: str  # a reference to a class of the user's, for a message
    can_lack_settings: bool = False  # true if a class without settings need not be a dataclass
    # Fields that are no settings: the reader of the family's table gives them.
    given: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        """The accepted classes, for a message."""
        required = "a class" if self.can_lack_settings else "a frozen dataclass"
        return f"{required} derived from {self.base.__module__}.{self.base.__name__}"


DESIGN = ClassFamily(Design, DESIGNS, "uqpen.designs", "design", "my_designs.py:Design")
DISTRIBUTION = ClassFamily(
    Distribution,
    DISTRIBUTIONS,
    "uqpen.distributions",
    "distribution",
    "my_distributions.py:Distribution",
)
SURROGATE = ClassFamily(
    Surrogate, SURROGATES, ENTRY_POINTS, "surrogate", "my_surrogates.py:Surrogate"
)
MODEL = ClassFamily(
    Model, MODELS, "uqpen.models", "model", "my_model.py:MyModel", can_lack_settings=True
)
COPULA = ClassFamily(
    Dependence,
    COPULAS,
    "uqpen.copulas",
    "copula",
    "my_copulas.py:Copula",
    given=("inputs", "matrix"),
)


def is_reference(name: object) -> bool:
    """Check for the reference of a class; the name of a member has no colon, but SALib's."""
    return isinstance(name, str) and ":" in name and not name.startswith(SALIB)


def installed_names(family: ClassFamily, name: str) -> list[str]:
    """Return the names that packages add to a family; none, without a search, for a built-in."""
    return [] if name in family.members else list(installed_members(family.group))


def read_member(
    table: TableReader,
    family: ClassFamily,
    unloaded: Callable[[str, bool], Any],
    check: Callable[[type], None] = lambda built_in: None,
) -> tuple[Any, str, Files]:
    """Read a member of any origin from its table: by ``kind``, or an object of a Python program.

    Parameters
    ----------
    table : TableReader
        The table of the settings; it has no other keys.
    family : ClassFamily
        The family that it belongs to.
    unloaded : callable
        Makes a stand-in for code that is not trusted, or (True) for an object that is not here.
    check : callable
        Notes what a built-in class cannot have.

    Returns
    -------
    member, origin, files
        None where a mistake was noted; its name if it is not built in; the files of its code.
    """
    if OBJECT in table and "kind" not in table:
        expected = f'kind = "{family.form}": a file cannot contain a Python object'
        found = read_named_object(table, family.what, expected)
        table.check_unknown_keys()
        if found is None:
            return None, "", ()
        is_here = isinstance(found.value, family.base)
        return found.value if is_here else unloaded(found.name, True), found.name, ()
    name = str(table.content.get("kind"))
    if is_reference(name) and not table.trust:
        return unloaded(name, False), name, ()
    if is_reference(name) or name in installed_names(family, name):
        table.take("kind")
        member, surroundings = read_user_defined(table, "kind", name, family)
        return member, name, surroundings.files() if surroundings else ()
    built_in = family_member(table, "kind", family.members, f"a kind of {family.what}")
    if built_in:
        check(built_in)
    return built_in and table.whole_settings(built_in), "", ()


def read_user_defined(
    table: TableReader, key: str | tuple[str, ...], name: str, family: ClassFamily, like: str = ""
) -> tuple[Any, ModelFolder | None]:
    """Read the settings of a user-defined class, named by a reference or an entry point.

    Parameters
    ----------
    table : TableReader
        The table of the settings; it has no other keys.
    key : str or tuple of str
        The key that names the class; empty where it is the table's own.
    name : str
        The reference, or the name of an entry point.
    like : str
        Unit like that of its quantities.

    Returns
    -------
    member, surroundings
        An instance, or None where a mistake was noted; the folder that its file belongs to, which a
        class of an installed package has not.
    """
    noted = len(table.problems)
    try:
        cls, surroundings = load_class(name, table.folder, family)
        with surroundings.loading() if surroundings else contextlib.nullcontext():
            made: Any
            if dataclasses.is_dataclass(cls):
                made = table.whole_settings(cls, like)
            else:
                table.check_unknown_keys()
                made = cls()
        if isinstance(made, Distribution):
            # Whatever is wrong with its functions is raised here.
            probability = np.array([0.25, 0.5])
            values = made.ppf(probability)
            for function in (made.isf, made.cdf, made.sf):
                if np.shape(function(probability if function == made.isf else values)) != (2,):
                    raise ValueError("its functions do not keep the shape of an array")
    except ModelError as error:
        table.add_problem(key, str(error), error.expected or family.expected)
    except Exception as error:  # a user-defined class can raise anything
        found = f"{toml_text(name)}: {error_text(error)}"
        table.add_problem(key, found, "settings that it accepts")
    else:
        return (made, surroundings) if len(table.problems) == noted else (None, None)
    return None, None


def read_class(table: TableReader, key: str, family: ClassFamily) -> Any:
    """Return the class that a key names, built in or installed; None where a mistake was noted."""
    name = table.content.get(key)
    if isinstance(name, str) and name in installed_names(family, name):
        table.take(key)
        try:
            return load_class(name, table.folder, family)[0]
        except ModelError as error:
            table.add_problem(key, str(error), error.expected or family.expected)
            return None
    return family_member(table, key, family.members, f"a {family.what}")


def load_class(name: str, folder: Path, family: ClassFamily) -> tuple[type, ModelFolder | None]:
    """Load a user-defined class; of a reference, with the folder that its file belongs to.

    A class of an installed package is loaded without the study's folder: what an archive contains
    cannot stand in for a module of the package.

    Raises
    ------
    ModelError
        If there is none of this name, or it cannot be a member of the family.
    """
    if is_reference(name):
        module, attribute, surroundings = load_module(name, folder, family.form)
        return _member_class(module, attribute, name, family), surroundings
    cls = load_installed(family.group, name)
    if fault := _class_fault(cls, family):
        raise ModelError(f'"{name}", which {fault}')
    return cls, None


def _member_class(module: ModuleType, attribute: str, reference: str, family: ClassFamily) -> type:
    cls = getattr(module, attribute, None)
    if not isinstance(cls, type):
        known = [
            key
            for key, value in vars(module).items()
            if isinstance(value, type) and value.__module__ == module.__name__
        ]
        listing = f"; it defines {', '.join(known)}" if known else ""
        where = reference.rpartition(":")[0]
        raise ModelError(f'"{where}" has no class "{attribute}"{listing}')
    if fault := _class_fault(cls, family):
        raise ModelError(f'"{reference}", which {fault}')
    return cls


def class_reference(member: object, folder: Path, family: ClassFamily) -> str:
    """Return the name by which a study in a folder can name an object's class; empty for none."""
    cls = type(member)
    reference = f"{cls.__module__}:{cls.__qualname__}"
    if cls.__module__ == "__main__" or "." in cls.__qualname__:
        return ""
    try:
        module, attribute, _ = load_module(reference, folder)
        _member_class(module, attribute, reference, family)
    except ModelError:
        return ""
    loaded = sys.modules.get(cls.__module__)
    if loaded is None or getattr(loaded, "__file__", "") != getattr(module, "__file__", None):
        return ""
    installed = installed_members(family.group)
    return next((name for name, known in installed.items() if known == reference), reference)


def named_references(content: Mapping[str, Any], *sections: str) -> list[str]:
    """Return the references of user-defined classes in sections of a study, each once."""
    names: list[Any] = []
    for section in sections:
        for table in _tables(content, section):
            # The name of a distribution is a key.
            names += table if section == "inputs" else [table.get("kind")]
    return list(dict.fromkeys(str(name) for name in names if is_reference(name)))


def named_objects(content: Mapping[str, Any], *sections: str) -> list[str]:
    """Return the Python objects that sections of a study name."""
    names: list[Any] = []
    for section in sections:
        for table in _tables(content, section):
            named = table.get(OBJECT)
            if section == "inputs":
                named = named.get(OBJECT) if isinstance(named, dict) else None
            names.append(named)
    return [str(name) for name in names if name is not None]


def user_defined_objects(content: Mapping[str, Any]) -> list[str]:
    """Return the objects of user's classes: those of other libraries are known by their text."""
    inputs = {
        name: table
        for name, table in content.get("inputs", {}).items()
        if isinstance(table, dict) and SETTINGS in table.get(OBJECT, {})
    }
    return named_objects({**content, "inputs": inputs}, "designs", "inputs")


def _tables(content: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    tables = content.get(key)
    values = tables.values() if isinstance(tables, dict) else ()
    return [table for table in values if isinstance(table, dict)]


def _class_fault(cls: object, family: ClassFamily) -> str:
    """Return why something cannot be a member of a family; empty where it can."""
    if not isinstance(cls, type) or not issubclass(cls, family.base):
        return f"does not derive from {family.base.__name__}"
    is_bare = not dataclasses.is_dataclass(cls) and cls.__init__ is object.__init__
    if not (family.can_lack_settings and is_bare) and not (
        dataclasses.is_dataclass(cls) and cls.__dataclass_params__.frozen  # type: ignore[attr-defined]
    ):
        return "is no frozen dataclass"
    if inspect.isabstract(cls):
        return f"lacks {', '.join(sorted(getattr(cls, '__abstractmethods__', ())))}"
    if not dataclasses.is_dataclass(cls):
        return ""
    declared = {*family.given, *(field.name for field, _ in declared_settings(cls))}
    others = [field.name for field in dataclasses.fields(cls) if field.init]
    undeclared = [name for name in others if name not in declared]
    return f"has fields that are no settings: {', '.join(undeclared)}" if undeclared else ""
