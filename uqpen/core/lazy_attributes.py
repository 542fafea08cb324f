"""Attributes of a package that are imported when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any


def lazy_attributes(package: str, homes: Mapping[str, Sequence[str]]) -> Callable[[str], Any]:
    """Return the function ``__getattr__`` of a package.

    `homes` has the names of its attributes under the module that each is imported from.
    """

    def find(name: str) -> Any:
        for module, names in homes.items():
            if name in names:
                import importlib

                return getattr(importlib.import_module(module), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return find


def member_homes(*families: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the classes of families under the modules that they are imported from.

    A family has references ``"module:class"`` by the names of its members.

    >>> member_homes({"normal": "continuous:Normal", "log-uniform": "continuous:LogUniform"})
    {'continuous': ['Normal', 'LogUniform']}
    """
    homes: dict[str, list[str]] = {}
    for reference in (each for family in families for each in family.values()):
        module, _, name = reference.partition(":")
        homes.setdefault(module, []).append(name)
    return homes
