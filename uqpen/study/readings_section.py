"""``[model.read]``: where in what a program has written its outputs stand."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import PurePosixPath

from uqpen.errors import as_written
from uqpen.model import Output
from uqpen.models.command.readings import InCsv, InJson, InNetcdf, InText, Reading
from uqpen.study.section import Section

__all__ = ["is_inside", "read_readings"]

_FILE = "the name of a file in the folder of the run"
_ROW = "a whole number: rows count from 0, and back from -1"


def is_inside(name: str) -> bool:
    """Whether a name is that of something in the folder of a run, or below it."""
    path = PurePosixPath(name)
    is_relative = bool(path.parts) and not path.is_absolute() and ".." not in path.parts
    return is_relative and "\0" not in name


def read_readings(table: Section, outputs: Sequence[Output], file: str) -> dict[str, Reading]:
    """Where each output of a program stands; mistakes are noted.

    Parameters
    ----------
    table : Section
        Of the model. Its table ``read`` holds one for each output, or itself says it for all.
    outputs : sequence of Output
        What the program gives.
    file : str
        The JSON file that outputs are read from of which nothing is said.
    """
    readings: dict[str, Reading] = {output.name: InJson(file, output.name) for output in outputs}
    section = table.table("read")
    if section is None:
        return readings
    is_common = any(isinstance(section.content.get(kind), str) for kind in _KINDS)
    for name in readings:
        own = section.table(name) if _is_own(section, name) else None
        reading = None
        if own is not None:
            reading = _reading(own, name)
            own.close()
        elif is_common:
            reading = _reading(section, name)
        readings[name] = reading or readings[name]
    for name in readings:
        section.take(name)
    section.close("output")
    return readings


def _is_own(section: Section, name: str) -> bool:
    """Whether a key is an output's; one may be called as a kind of file is."""
    is_table = isinstance(section.content.get(name), dict)
    return name in section and (is_table or name not in _KINDS)


def _reading(section: Section, name: str) -> Reading | None:
    kinds = [kind for kind in _KINDS if isinstance(section.content.get(kind), str)]
    if len(kinds) != 1:
        found = " and ".join(kinds) or "nothing that names a file"
        section.wrong((), found, f"one of {', '.join(_KINDS)}, with the name of a file")
        for kind in _KINDS:
            section.take(kind)
        return None
    file = section.text(kinds[0], _FILE)
    if file is not None and not is_inside(file):
        section.wrong(kinds[0], as_written(file), f"{_FILE}, relative to it")
    return None if file is None else _KINDS[kinds[0]](section, file, name)


def _json(section: Section, file: str, name: str) -> Reading | None:
    key = section.text("key", "the names that lead to it, with dots between", default=name)
    return None if key is None else InJson(file, key)


def _csv(section: Section, file: str, name: str) -> Reading | None:
    column = section.text("column", "a heading", default=name)
    row = _row(section)
    return None if column is None else InCsv(file, column.strip(), -1 if row is None else row)


def _netcdf(section: Section, file: str, name: str) -> Reading | None:
    variable = section.text("variable", "the name of a variable", default=name)
    return None if variable is None else InNetcdf(file, variable, _row(section))


def _text(section: Section, file: str, name: str) -> Reading | None:
    expected = f"a regular expression with one group, or one called {name}: '{name} = (\\S+)'"
    pattern = section.text("pattern", expected)
    if pattern is None:
        return None
    try:
        compiled = re.compile(pattern, re.MULTILINE)
    except (re.error, OverflowError, RecursionError) as error:
        section.wrong("pattern", f"{as_written(pattern)}: {error}", expected)
        return None
    if name in compiled.groupindex:
        return InText(file, pattern, compiled.groupindex[name])
    if compiled.groups != 1:
        found = f"{as_written(pattern)}, with {compiled.groups or 'no'} groups"
        section.wrong("pattern", found, expected)
    return InText(file, pattern)


def _row(section: Section) -> int | None:
    row = section.take("row")
    if row is None or (isinstance(row, int) and not isinstance(row, bool)):
        return row
    section.wrong("row", as_written(row), _ROW)
    return None


_KINDS: dict[str, Callable[[Section, str, str], Reading | None]] = {
    "json": _json,
    "csv": _csv,
    "netcdf": _netcdf,
    "text": _text,
}
