"""``[model.read]``: where in what a program has written its outputs stand."""

from __future__ import annotations

import re
from pathlib import PurePosixPath

from uqpen.core.errors import toml_text
from uqpen.models.command.column_readings import ColumnReader, CsvReader
from uqpen.models.command.output_reader import OutputReader
from uqpen.models.command.readings import JsonReader, NetcdfReader, TextReader
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import Variables

__all__ = ["is_inside", "read_readings"]

_FILE = "the name of a file in the folder of the run"

# Of each kind of file, the reader and its setting that is the output's name by default.
_READERS: dict[str, tuple[type[OutputReader], str]] = {
    "json": (JsonReader, "key"),
    "csv": (CsvReader, "column"),
    "table": (ColumnReader, "column"),
    "netcdf": (NetcdfReader, "variable"),
    "text": (TextReader, "pattern"),
}


def is_inside(name: str) -> bool:
    """Return True if a name is a path in the folder of a run, or below it."""
    path = PurePosixPath(name)
    is_relative = bool(path.parts) and not path.is_absolute() and ".." not in path.parts
    return is_relative and "\0" not in name


def read_readings(table: TableReader, variables: Variables, file: str) -> dict[str, OutputReader]:
    """Read how to find each output of a program, and its own coordinates; mistakes are noted.

    The table ``read`` has a table for each output, or one reader for all. An output without either
    is in the JSON file `file`.
    """
    coordinates = [name for grid in variables.fields.grids.values() for name in grid.names.values()]
    lists = {*coordinates, *(output.name for output in variables.outputs if output.dims)}
    names = dict.fromkeys([*(output.name for output in variables.outputs), *coordinates])
    readings: dict[str, OutputReader] = {name: JsonReader(file, name) for name in names}
    section = table.table("read")
    if not section.is_given:
        return readings
    is_common = any(isinstance(section.content.get(kind), str) for kind in _READERS)
    for name, default in readings.items():
        own = section.table(name) if _is_output_key(section, name) else None
        if own is not None and own.is_given:
            readings[name] = _output_reader(own, name) or default
            own.check_unknown_keys()
        elif is_common:
            own = section
            readings[name] = _output_reader(section, name) or default
        if own is not None and name in lists:
            _check_whole(own, name)
    for name in readings:
        section.take(name)
    section.check_unknown_keys("output")
    return readings


def _check_whole(section: TableReader, name: str) -> None:
    """Note keys that take one number where all are read."""
    for key in ("row", "match"):
        if key in section:
            found = f"a choice among the numbers of {name}"
            section.add_problem(key, found, "none: all of them are read, along its dimensions")


def _is_output_key(section: TableReader, name: str) -> bool:
    """Return True if a key is an output's, which may have the name of a kind of file."""
    is_table = isinstance(section.content.get(name), dict)
    return name in section and (is_table or name not in _READERS)


def _output_reader(section: TableReader, name: str) -> OutputReader | None:
    kinds = [kind for kind in _READERS if isinstance(section.content.get(kind), str)]
    if len(kinds) != 1:
        found = " and ".join(kinds) or "nothing that names a file"
        section.add_problem((), found, f"one of {', '.join(_READERS)}, with the name of a file")
        for kind in _READERS:
            section.take(kind)
        return None
    (kind,) = kinds
    file = section.text(kind, _FILE)
    if file is None:
        return None
    if not is_inside(file):
        section.add_wrong(kind, file, f"{_FILE}, relative to it")
    if kind == "text":
        return _text_reader(section, file, name)
    cls, key = _READERS[kind]
    return section.settings(cls, given={"file": file, key: name})


def _text_reader(section: TableReader, file: str, name: str) -> OutputReader | None:
    expected = f"a regular expression with one group, or one called {name}: '{name} = (\\S+)'"
    pattern = section.text("pattern", expected)
    if pattern is None:
        return None
    try:
        compiled = re.compile(pattern, re.MULTILINE)
    except (re.error, OverflowError, RecursionError) as error:
        section.add_problem("pattern", f"{toml_text(pattern)}: {error}", expected)
        return None
    if name not in compiled.groupindex and compiled.groups != 1:
        found = f"{toml_text(pattern)}, with {compiled.groups or 'no'} groups"
        section.add_problem("pattern", found, expected)
    group = compiled.groupindex.get(name, 1)
    return section.settings(TextReader, given={"file": file, "pattern": pattern, "group": group})
