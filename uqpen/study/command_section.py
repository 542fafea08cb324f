"""``[model] command``: a program as a model, checked before anything runs."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from uqpen.core.errors import ModelError, toml_text
from uqpen.models.command.model import (
    INPUTS,
    OUTCOME,
    OUTPUTS,
    RECORD,
    Command,
    FolderPolicy,
)
from uqpen.models.command.output_readers import (
    ColumnReader,
    CsvReader,
    JsonReader,
    NetcdfReader,
    OutputReader,
    TextReader,
)
from uqpen.models.command.process import STDERR, STDOUT
from uqpen.models.command.program import (
    BRACES,
    Delimiters,
    Program,
    find_mistakes,
    lies_in_study,
    locate_program,
    names_in,
)
from uqpen.study.model_section import read_limits
from uqpen.study.outcomes_section import OF_PROGRAMS, add_outcomes, read_outcomes
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import Variables, read_variables

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


def _read_readings(table: TableReader, variables: Variables, file: str) -> dict[str, OutputReader]:
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
        # An output may have the name of a kind of file.
        is_own = name not in _READERS or isinstance(section.content.get(name), dict)
        own = section.table(name) if is_own and name in section else None
        if own is not None and own.is_given:
            readings[name] = _output_reader(own, name) or default
            own.check_unknown_keys()
        elif is_common:
            own = section
            readings[name] = _output_reader(section, name) or default
        for key in ("row", "match"):
            if own is not None and name in lists and key in own:
                found = f"a choice among the numbers of {name}"
                own.add_problem(key, found, "none: all of them are read, along its dimensions")
    for name in readings:
        section.take(name)
    section.check_unknown_keys("output")
    return readings


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
    if kind != "text":
        cls, key = _READERS[kind]
        return section.settings(cls, given={"file": file, key: name})
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


_COMMAND = 'a program and its arguments, such as ["./solver", "{inputs}"]'
_BESIDE = "the name of a file beside the study"
_INSIDE = "a path relative to the folder of the run"

_DELIMITER = re.compile(r"[^\w\s:]{1,8}")

# What placeholders can stand for beside inputs, and what files in the folder of a run are taken.
_PATHS = ("inputs", "outputs")
_TAKEN = (INPUTS, OUTPUTS, OUTCOME, RECORD, STDOUT, STDERR)


def read_command(table: TableReader) -> Command | None:
    """Read a program as a model; None where a mistake was noted.

    Without trust, neither the program nor its files are searched.
    """
    noted = len(table.problems)
    words = tuple(_read_words(table))
    variables = read_variables(table)
    handed = _ProgramFiles(table)
    handed.read()
    outcomes = read_outcomes(table, variables, OF_PROGRAMS)
    limits = read_limits(table)
    # Folders of runs are next to the study, and named after it, and after one of several models.
    folder = table.folder / f"{Path(table.document.label).stem}_runs"
    folder = folder / str(table.path[-1]) if len(table.path) > 1 else folder
    kept = table.settings(FolderPolicy, given={"folder": folder})
    named = set().union(*map(names_in, words), handed.names())
    readings = _read_readings(table, variables, OUTPUTS if "outputs" in named else STDOUT)
    if len(table.problems) == noted:
        handed.check([variable.name for variable in variables.inputs], words, named)
    program = handed.program(words) if table.trust and words else None
    if kept is None or len(table.problems) > noted:
        return None
    copied = tuple(handed.copied)
    templates, delimiters = handed.templates, handed.delimiters
    inputs, outputs, units, fields = add_outcomes(variables, outcomes)
    declared = (words, inputs, outputs, units, readings, kept, program, templates, copied, limits)
    return Command(*declared, delimiters, fields=fields, outcomes=outcomes)


@dataclass
class _ProgramFiles:
    """Arguments, templates and files for a program; each is checked as it is read."""

    table: TableReader
    delimiters: Delimiters = BRACES
    templates: dict[str, str] = field(default_factory=dict)
    template_files: dict[str, str] = field(default_factory=dict)
    copied: list[str] = field(default_factory=list)

    def read(self) -> None:
        """Read the delimiters of placeholders, the templates, and the names of other files."""
        written = self.table.take("delimiters")
        is_pair = isinstance(written, list) and len(written) == 2
        if is_pair and all(
            isinstance(each, str) and _DELIMITER.fullmatch(each) for each in written
        ):
            self.delimiters = Delimiters(*written)
        elif written is not None:
            expected = (
                'two texts of 1 to 8 signs, no letters, digits or blanks, such as ["<<", ">>"]'
            )
            self.table.add_wrong("delimiters", written, expected)
        section = self.table.table("templates")
        for name in section:
            file = section.text(name, _BESIDE)
            if not is_inside(name) or name in _TAKEN:
                section.add_wrong(name, name, f"{_INSIDE}, none of {', '.join(_TAKEN)}")
            elif file is not None and self.table.trust:
                self._read_template(section, name, file)
        for position, name in enumerate(self.table.entries("files")):
            at = ("files", position)
            if not isinstance(name, str) or not is_inside(name):
                self.table.add_wrong(at, name, _BESIDE)
            elif name in _TAKEN or name in self.templates:
                self.table.add_wrong(at, name, "a name that nothing else has")
            elif self.table.trust and not lies_in_study(name, self.table.folder):
                self.table.add_problem(at, f'no file "{name}" beside the study', _BESIDE)
            else:
                self.copied.append(name)

    def names(self) -> set[str]:
        """Return the names of the placeholders in all templates."""
        texts = self.templates.values()
        return set[str]().union(*(names_in(text, self.delimiters) for text in texts))

    def check(self, inputs: list[str], words: tuple[str, ...], named: set[str]) -> None:
        """Note placeholders without an input, and inputs without a placeholder."""
        for taken in filter(_PATHS.__contains__, inputs):
            expected = "another name: {inputs} and {outputs} are files"
            self.table.add_wrong(("inputs", taken), taken, expected)
        for position, word in enumerate(words):
            for _, found, expected in find_mistakes(word, inputs, _PATHS):
                found = f"{found} in {toml_text(word)}"
                self.table.add_problem(("command", position), found, expected)
        for name, text in self.templates.items():
            for line, found, expected in find_mistakes(text, inputs, _PATHS, self.delimiters):
                found = f'{found} in "{self.template_files[name]}", line {line}'
                self.table.add_problem(("templates", name), found, expected)
        if not self.table.trust or "inputs" in named:
            return
        for name in inputs:
            if name not in named:
                expected = f"{{inputs}} or {{{name}}} in the command, or in a template"
                found = "an input that the program does not get"
                self.table.add_problem(("inputs", name), found, expected)

    def program(self, words: tuple[str, ...]) -> Program | None:
        """Return the program with the files that belong to it, or None where there is none."""
        if sys.platform == "win32":
            expected = "Linux or macOS: elsewhere a program and its children cannot be ended"
            self.table.add_problem("command", "a program to be run on Windows", expected)
            return None
        folder, inside = self.table.folder, {*self.templates, *self.copied}
        named = [word for word in words[1:] if word not in inside and lies_in_study(word, folder)]
        others = [*named, *self.copied, *self.template_files.values()]
        try:
            return locate_program(words[0], folder, others)
        except ModelError as error:
            self.table.add_problem("command", str(error), "a program that can be executed")
        return None

    def _read_template(self, section: TableReader, name: str, file: str) -> None:
        if not lies_in_study(file, self.table.folder):
            section.add_problem(name, f'no file "{file}" beside the study', _BESIDE)
            return
        try:
            self.templates[name] = (self.table.folder / file).read_bytes().decode("utf-8")
            self.template_files[name] = file
        except OSError as error:
            section.add_problem(name, f'"{file}", which cannot be read: {error.strerror}', _BESIDE)
        except UnicodeDecodeError:
            section.add_problem(name, f'"{file}", which is not UTF-8', "a text file saved as UTF-8")


def _read_words(table: TableReader) -> Iterator[str]:
    """Read the words of a command as written."""
    words = table.take("command")
    if not isinstance(words, list) or not words:
        table.add_problem("command", toml_text(words) if words != [] else "an empty list", _COMMAND)
        return
    for position, word in enumerate(words):
        at = ("command", position)
        if not isinstance(word, str) or "\0" in word or (position == 0 and not word.strip()):
            table.add_wrong(at, word, "a word in quotes")
        elif position == 0 and names_in(word):
            table.add_wrong(at, word, "a program, without placeholders")
        else:
            yield word
