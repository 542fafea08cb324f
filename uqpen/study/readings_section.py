"""``[model.read]``: where in what a program has written its outputs stand."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import PurePosixPath

from uqpen.core.errors import toml_text
from uqpen.core.model import Output
from uqpen.models.command.readings import (
    CsvReader,
    JsonReader,
    NetcdfReader,
    OutputReader,
    TextReader,
)
from uqpen.study.table_reader import TableReader

__all__ = ["is_inside", "read_readings"]

_FILE = "the name of a file in the folder of the run"
_ROW = "a whole number: rows count from 0, and back from -1"


def is_inside(name: str) -> bool:
    """Return True if a name is a path in the folder of a run, or below it."""
    path = PurePosixPath(name)
    is_relative = bool(path.parts) and not path.is_absolute() and ".." not in path.parts
    return is_relative and "\0" not in name


def read_readings(
    table: TableReader, outputs: Sequence[Output], file: str
) -> dict[str, OutputReader]:
    """Read how to find each output of a program; mistakes are noted.

    Parameters
    ----------
    table : TableReader
        Of the model. Its table ``read`` has a table for each output, or one reader for all.
    outputs : sequence of Output
        The outputs of the program.
    file : str
        The JSON file of the outputs for which the table specifies no reader.
    """
    readings: dict[str, OutputReader] = {
        output.name: JsonReader(file, output.name) for output in outputs
    }
    section = table.table("read")
    if section is None:
        return readings
    is_common = any(isinstance(section.content.get(kind), str) for kind in _READERS)
    for name in readings:
        own = section.table(name) if _is_output_key(section, name) else None
        reading = None
        if own is not None:
            reading = _output_reader(own, name)
            own.check_unknown_keys()
        elif is_common:
            reading = _output_reader(section, name)
        readings[name] = reading or readings[name]
    for name in readings:
        section.take(name)
    section.check_unknown_keys("output")
    return readings


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
    file = section.text(kinds[0], _FILE)
    if file is not None and not is_inside(file):
        section.add_problem(kinds[0], toml_text(file), f"{_FILE}, relative to it")
    return None if file is None else _READERS[kinds[0]](section, file, name)


def _json(section: TableReader, file: str, name: str) -> OutputReader | None:
    key = section.text("key", "the names that lead to it, with dots between", default=name)
    return None if key is None else JsonReader(file, key)


def _csv(section: TableReader, file: str, name: str) -> OutputReader | None:
    column = section.text("column", "a heading", default=name)
    row = _row(section)
    return None if column is None else CsvReader(file, column.strip(), -1 if row is None else row)


def _netcdf(section: TableReader, file: str, name: str) -> OutputReader | None:
    variable = section.text("variable", "the name of a variable", default=name)
    return None if variable is None else NetcdfReader(file, variable, _row(section))


def _text(section: TableReader, file: str, name: str) -> OutputReader | None:
    expected = f"a regular expression with one group, or one called {name}: '{name} = (\\S+)'"
    pattern = section.text("pattern", expected)
    if pattern is None:
        return None
    try:
        compiled = re.compile(pattern, re.MULTILINE)
    except (re.error, OverflowError, RecursionError) as error:
        section.add_problem("pattern", f"{toml_text(pattern)}: {error}", expected)
        return None
    if name in compiled.groupindex:
        return TextReader(file, pattern, compiled.groupindex[name])
    if compiled.groups != 1:
        found = f"{toml_text(pattern)}, with {compiled.groups or 'no'} groups"
        section.add_problem("pattern", found, expected)
    return TextReader(file, pattern)


def _row(section: TableReader) -> int | None:
    row = section.take("row")
    if row is None or (isinstance(row, int) and not isinstance(row, bool)):
        return row
    section.add_problem("row", toml_text(row), _ROW)
    return None


_READERS: dict[str, Callable[[TableReader, str, str], OutputReader | None]] = {
    "json": _json,
    "csv": _csv,
    "netcdf": _netcdf,
    "text": _text,
}
