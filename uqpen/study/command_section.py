"""``[model] command``: a program as a model, checked before anything runs."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from uqpen.core.errors import ModelError, toml_text
from uqpen.models.command.model import INPUTS, OUTCOME, OUTPUTS, RECORD, Command, FolderPolicy
from uqpen.models.command.placeholders import BRACES, Delimiters, find_mistakes, names_in
from uqpen.models.command.process import STDERR, STDOUT
from uqpen.models.command.program import Program, lies_in_study, locate_program
from uqpen.study.model_section import read_limits
from uqpen.study.readings_section import is_inside, read_readings
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import read_variables

__all__ = ["read_command"]

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
    handed = _ProgramFiles(table, _read_delimiters(table))
    handed.read_templates()
    handed.read_copied()
    limits = read_limits(table)
    kept = table.settings(FolderPolicy, given={"folder": _kept_folder(table)})
    named = set().union(*map(names_in, words), handed.names())
    readings = read_readings(table, variables, OUTPUTS if "outputs" in named else STDOUT)
    if len(table.problems) == noted:
        handed.check([variable.name for variable in variables.inputs], words, named)
    program = handed.program(words) if table.trust and words else None
    if kept is None or len(table.problems) > noted:
        return None
    copied = tuple(handed.copied)
    templates, delimiters = handed.templates, handed.delimiters
    inputs, outputs, units, fields = variables
    declared = (words, inputs, outputs, units, readings, kept, program, templates, copied, limits)
    return Command(*declared, delimiters, fields=fields)


@dataclass
class _ProgramFiles:
    """Arguments, templates and files for a program; each is checked as it is read."""

    table: TableReader
    delimiters: Delimiters = BRACES
    templates: dict[str, str] = field(default_factory=dict)
    template_files: dict[str, str] = field(default_factory=dict)
    copied: list[str] = field(default_factory=list)

    def read_templates(self) -> None:
        """Read the texts of all templates, by their file names in the folder of a run."""
        section = self.table.table("templates")
        for name in section:
            file = section.text(name, _BESIDE)
            if not is_inside(name) or name in _TAKEN:
                section.add_wrong(name, name, f"{_INSIDE}, none of {', '.join(_TAKEN)}")
            elif file is not None and self.table.trust:
                self._read_template(section, name, file)

    def read_copied(self) -> None:
        """Read the files that are copied into the folder of each run."""
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


def _read_delimiters(table: TableReader) -> Delimiters:
    """Read the delimiters of placeholders in templates."""
    written = table.take("delimiters")
    if written is None:
        return BRACES
    is_pair = isinstance(written, list) and len(written) == 2
    if is_pair and all(isinstance(each, str) and _DELIMITER.fullmatch(each) for each in written):
        return Delimiters(*written)
    expected = 'two texts of 1 to 8 signs, no letters, digits or blanks, such as ["<<", ">>"]'
    table.add_wrong("delimiters", written, expected)
    return BRACES


def _kept_folder(table: TableReader) -> Path:
    """Return the folder for folders of runs: next to the study, and named after it."""
    kept = table.folder / f"{Path(table.document.label).stem}_runs"
    return kept / str(table.path[-1]) if len(table.path) > 1 else kept  # one of several models
