"""Objects of a Python program that the text of a study only names."""

from __future__ import annotations

from typing import Any, NamedTuple

from uqpen.study.table_reader import TableReader

__all__ = ["OBJECT", "NamedObject", "read_named_object"]

# The key with the name of an object.
OBJECT = "object"


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
