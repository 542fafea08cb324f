"""Model that is a program, started for each run in a folder of its own."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import re
import shlex
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.errors import ModelError, counted
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import OUTCOME_OUTPUT
from uqpen.core.limits import Limits
from uqpen.core.model import Input, Model, Output, Results, RunOutcome, joined_outcomes
from uqpen.core.settings import choice, validate
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.models.command.output_readers import OutputReader, RunFiles, TextReader, UnreadableError
from uqpen.models.command.process import STDERR, STDOUT, ProcessEnd, guard_folder, run_process
from uqpen.models.command.program import (
    BRACES,
    Delimiters,
    NotWholeError,
    Program,
    fill,
    lies_in_study,
)
from uqpen.models.outcomes import DeclaredOutcome, with_outcome
from uqpen.models.run_grid import FieldSources, RunGrid, UnusableOutputError, dimension_names
from uqpen.models.user_code import one_line

# Folders of runs: a new one for each run, kept or removed at its end.

_SHORT = 12


@contextlib.contextmanager
def working_folder() -> Iterator[Path]:
    """Make a new folder; remove it at the end of the context unless it has been moved."""
    folder = Path(tempfile.mkdtemp(prefix="uqpen-")).resolve()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def folder_name(inputs: Mapping[str, float | str]) -> str:
    """Return the name of the folder of a run, a hash of the bits of its inputs, and of texts.

    >>> one, same, other = (folder_name({"a": a}) for a in (1.0, 1.0, 1.0 + 1e-15))
    >>> one == same != other
    True
    """
    bits = {name: each if isinstance(each, str) else each.hex() for name, each in inputs.items()}
    text = "\n".join(f"{name} {each}" for name, each in sorted(bits.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:_SHORT]


def keep_folder(folder: Path, destination: Path, notes: Mapping[str, str]) -> None:
    """Move a run's folder, with notes, to the kept ones; replace an older one of this name.

    If that fails (because a disk is full, say), the run still has its reason.
    """
    with contextlib.suppress(OSError):
        for name, text in notes.items():
            (folder / name).write_text(text, encoding="utf-8", errors="surrogateescape")
        destination.parent.mkdir(parents=True, exist_ok=True)
        # Under a name of its own first: another worker may keep a run with the same inputs.
        staged = Path(tempfile.mkdtemp(prefix=".", dir=destination.parent))
        try:
            shutil.move(folder, staged / destination.name)
            shutil.rmtree(destination, ignore_errors=True)
            (staged / destination.name).rename(destination)
        finally:
            shutil.rmtree(staged, ignore_errors=True)


# Outputs of a program's run: single numbers, and fields along their dimensions.


def read_outputs(
    outputs: Sequence[Output],
    readings: Mapping[str, OutputReader],
    grids: Mapping[str, RunGrid],
    written: RunFiles,
) -> dict[str, FloatArray]:
    """Read the outputs of a run, in the units of the program, each of shape (*dims).

    There is a reader of each output, and of the coordinates that a run has of its own.

    UnreadableError or UnusableOutputError if an output is not there, or is not what is declared;
    the message names the place.
    """
    found = {}
    for output in outputs:
        reader, grid = readings[output.name], grids.get(output.name)
        if not output.dims:
            found[output.name] = np.array(reader.value(written))
        elif grid is None:
            found[output.name] = _read_field(output, reader, written)
        else:
            own = {name: readings[key].values(written) for name, key in grid.names.items()}
            sizes = [len(np.atleast_1d(own.get(dim.name, dim.values))) for dim in output.dims]
            values = _arranged(output, reader, reader.values(written), tuple(sizes))
            found[output.name] = grid.interpolate(output, values, own)
    return found


def _read_field(output: Output, reader: OutputReader, written: RunFiles) -> FloatArray:
    """Read a field at its declared coordinates."""
    try:
        values = reader.values(written)
    except UnreadableError as error:
        if error.position is None or error.position >= math.prod(output.shape):
            raise
        place = np.unravel_index(error.position, output.shape)
        coordinates = output.place_text([int(each) for each in place])
        raise UnreadableError(f"{error} ({coordinates})") from None
    if output.may_end and values.ndim == 1 and 0 < len(values) < output.shape[0]:
        rest = np.full(output.shape[0] - len(values), np.nan)
        values = np.append(values, rest)
    return _arranged(output, reader, values, output.shape)


def _arranged(
    output: Output, reader: OutputReader, values: FloatArray, shape: tuple[int, ...]
) -> FloatArray:
    """Return values in their shape; in a list, those along the last dimension follow each other."""
    if values.shape != shape and (values.ndim != 1 or values.size != math.prod(shape)):
        if values.ndim == len(shape) == 1:
            found = f"{reader.place} has {len(values)} numbers, not {shape[0]}"
        else:
            found = f"{reader.place} is of shape {values.shape}, not {shape}"
        raise UnreadableError(found + dimension_names(output))
    return values.reshape(shape)


# Reason of a failed run, in words that are the same for the same cause.

# Bytes at the end of a file in which its last line is searched.
_TAIL = 8192

# Parts of printed texts that differ between runs, and their replacements.
_UNSTEADY = (
    (re.compile(r"\b0[xX][0-9a-fA-F]+\b"), "0x…"),  # addresses
    (re.compile(r"\b[0-9]{4}-[0-9]{2}-[0-9]{2}\b"), "…"),  # dates
    (re.compile(r"\b[0-9]{1,2}:[0-9]{2}(:[0-9]{2}([.,][0-9]+)?)?\b"), "…"),  # times of day
    (re.compile(r"(?i)\b((?:pid|process|thread)\W{0,3})[0-9]+\b"), r"\1…"),
    (re.compile(r"\[[0-9]+\]|==[0-9]+=="), "…"),  # process numbers before a message
    (re.compile(r"(?<![\w./])(?:/[^\s/:;,'\"()<>]+)+/"), ""),  # folders before the name of a file
)


def last_line(path: Path) -> str:
    """Return the last non-blank line of a file; empty if there is none."""
    try:
        with path.open("rb") as stream:
            stream.seek(0, 2)
            stream.seek(max(0, stream.tell() - _TAIL))
            lines = stream.read().decode("utf-8", "replace").splitlines()
    except OSError:
        return ""
    return next((line for line in reversed(lines) if line.strip()), "")


def remove_variable_parts(text: str, folders: Iterable[Path]) -> str:
    """Remove the parts of a line that differ between runs or machines.

    The folders are those that may occur in it; names of files in them are kept.

    >>> line = "[812] /usr/lib/solver.so: overflow at 0x7f3a at 12:31:07"
    >>> remove_variable_parts(line, [])
    '… solver.so: overflow at 0x… at …'
    """
    for folder in folders:
        if folder.name:  # not the root of all
            text = text.replace(f"{folder}/", "").replace(str(folder), ".")
    for pattern, instead in _UNSTEADY:
        text = pattern.sub(instead, text)
    return one_line("".join(each if each.isprintable() else " " for each in text))


# Record of a run in its kept folder, by which its outputs can be read again.

RECORD = "run.json"


def _read_record(folder: Path, made_by: str) -> ProcessEnd | None:
    """Return how a kept run ended; None if there is none, or another program made it.

    A run that was ended for its time has written only a part, so it is not read again.
    """
    try:
        found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        is_own = found["made_by"] == made_by
        code = found["exit_code"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return ProcessEnd(code) if is_own and type(code) is int else None


# Files in the folder of a run: its inputs, the default file for its outputs, and,
# in a folder that is kept, its outcome, and the record by which it can be read again.
INPUTS, OUTPUTS, OUTCOME = "inputs.json", "outputs.json", "outcome.txt"

_PATHS = {"inputs": INPUTS, "outputs": OUTPUTS}

# The file was there when the study was read, so the system means the interpreter that it names.
_NO_INTERPRETER = "cannot be started: what its first line names to run it with is not there"


def _has_ended(outcome: DeclaredOutcome, ending: ProcessEnd, folder: Path) -> bool:
    """Return True if a program ended with an outcome; one that a signal has ended never did."""
    if ending.signal or ending.is_late:
        return False
    if outcome.exit_code is not None:
        return ending.code == outcome.exit_code
    return any(_is_printed(outcome.text.encode(), folder / name) for name in (STDOUT, STDERR))


def _is_printed(text: bytes, path: Path) -> bool:
    try:
        with path.open("rb") as stream:
            return any(text in line for line in stream)
    except OSError:
        return False


@dataclass(frozen=True)
class FolderPolicy:
    """Policy for the folders of runs after their end."""

    which: Literal["failed", "all", "none"] = choice(
        "failed",
        "all",
        "none",
        default="failed",
        expected='which folders of runs are kept: "failed", "all" or "none"',
        key="keep",
    )  # the folders that are kept: those of ``"failed"`` runs, ``"all"`` or ``"none"``
    folder: Path = Path()  # folder for the kept ones

    def __post_init__(self) -> None:
        validate(self)


@dataclass(frozen=True)
class Command(Model):
    """Model that runs a program."""

    # The command as a study has it: the program and its arguments, with placeholders.
    words: tuple[str, ...]
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: Mapping[str, str]  # the unit that the program takes each input and gives each output in
    # Reader of each output, and of the coordinates that runs have of their own.
    readings: Mapping[str, OutputReader]
    folder_policy: FolderPolicy
    program: Program | None = None  # the program; without it, the model cannot be run
    # By their names in the folder of a run, texts with placeholders.
    templates: Mapping[str, str] = field(default_factory=dict)
    copied: tuple[str, ...] = ()  # files beside the study that each run finds in its folder
    limits: Limits = Limits()
    delimiters: Delimiters = BRACES  # those of the placeholders in templates
    # Whether the outputs of a run whose folder is kept are read from there, without a run.
    reads_again: bool = False
    # The grids on which runs write outputs, and the files with coordinates.
    fields: FieldSources = field(default=FieldSources(), repr=False)
    outcomes: tuple[DeclaredOutcome, ...] = ()  # endings that are results
    name: str = field(init=False)

    vectorized = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", " ".join(self.words))

    @property
    def remarks(self) -> tuple[str, ...]:
        word = self.words[0]
        if self.program is None or "/" in word:
            return ()
        text = f"the program {word} is {self.program.executed.read.path}"
        if lies_in_study(word, self.program.folder):
            return (f'warning: {text}; the one beside the study is "./{word}"',)
        return (text,)

    @property
    def may_be_noisy(self) -> bool:
        return True

    @property
    def run_limits(self) -> Limits:
        return self.limits

    @property
    def needs_main_thread(self) -> bool:
        has_pattern = any(isinstance(each, TextReader) for each in self.readings.values())
        return has_pattern and self.limits.seconds is not None

    def evaluate(self, inputs: Arrays) -> Results:
        if self.program is None:
            raise ModelError(f"{self.name} is not executed without --trust")
        program = self.program
        arguments = {name: values.tolist() for name, values in self._own_units(inputs).items()}
        runs = len(next(iter(inputs.values())))
        points = ({name: column[run] for name, column in arguments.items()} for run in range(runs))
        outcomes = (
            (slice(run, run + 1), self._run(program, point)) for run, point in enumerate(points)
        )
        return joined_outcomes(outcomes, self.outputs, self.units, runs)

    def record_files(self, files: frozenset[str]) -> None:
        # Runs report no files, so they are checked between batches.
        if self.program is not None:
            self.program.check_unchanged()

    def files(self) -> tuple[FileSnapshot, ...]:
        own = tuple(file.read for file in self.program.beside) if self.program else ()
        return (*own, *self.fields.files)

    @property
    def uncompared(self) -> tuple[str, ...]:
        return (f"what {self.words[0]} reads and starts",)

    def identity(self) -> dict[str, str]:
        return {"name": self.name, **(self.program.identity() if self.program else {})}

    def run_folder(self, inputs: Mapping[str, float]) -> Path | None:
        taken = {each.name: np.array(inputs[each.name]) for each in self.inputs}
        arguments = {name: value.item() for name, value in self._own_units(taken).items()}
        folder = self.folder_policy.folder / folder_name(arguments)
        return folder if folder.is_dir() else None

    def reading_again(self) -> Command:
        return self._with(reads_again=True)

    def with_folder(self, folder: Path) -> Command:
        """Return a copy that keeps the folders of runs in another folder."""
        return self._with(folder_policy=replace(self.folder_policy, folder=folder))

    def _own_units(self, inputs: Arrays) -> dict[str, Any]:
        """Convert SI values to the units that the program takes; a seed is a whole number."""
        known = {variable.name: variable for variable in self.inputs}
        return {
            name: values
            if values.dtype.kind == "i"
            else known[name].to_own(values, self.units[name])
            for name, values in inputs.items()
        }

    def _run(self, program: Program, inputs: Mapping[str, float]) -> RunOutcome:
        """Make one run, or read its folder again; any failure becomes its status."""
        kept = self.folder_policy.folder / folder_name(inputs)
        if self.reads_again and (ended := _read_record(kept, self._made_by(program))):
            outcome = self._outcome(ended, kept, program)
            with contextlib.suppress(OSError):
                note = _outcome_note(outcome, self._command(program, inputs))
                (kept / OUTCOME).write_text(note, encoding="utf-8", errors="surrogateescape")
            return outcome
        try:
            with working_folder() as folder:
                for name in [*self.copied, *self.templates]:
                    (folder / name).parent.mkdir(parents=True, exist_ok=True)
                for name in self.copied:
                    shutil.copy(program.folder / name, folder / name)
                for name, text in self.templates.items():
                    filled = fill(text, {**inputs, **_PATHS}, self.delimiters)
                    (folder / name).write_bytes(filled.encode())
                (folder / INPUTS).write_text(json.dumps(inputs) + "\n", encoding="utf-8")
                words = self._command(program, inputs)
                with guard_folder(folder) as watch:
                    ending = run_process(words, folder, self.limits, watch)
                    outcome = self._outcome(ending, folder, program)
                which = self.folder_policy.which
                if which == "all" or (which == "failed" and outcome.status != Status.OK):
                    code = None if ending.is_late else ending.code
                    record = {"made_by": self._made_by(program), "exit_code": code}
                    notes = {
                        OUTCOME: _outcome_note(outcome, words),
                        RECORD: json.dumps(record) + "\n",
                    }
                    keep_folder(folder, kept, notes)
                return outcome
        except NotWholeError as error:
            return RunOutcome.failed(str(error))
        except OSError as error:  # a disk that is full, a program for another machine
            if error.filename == str(program.executed.read.path) and error.errno == errno.ENOENT:
                return RunOutcome.failed(_NO_INTERPRETER)
            reason = f"cannot be started: {error.strerror or type(error).__name__}"
            return RunOutcome.failed(reason)

    def _made_by(self, program: Program) -> str:
        """Return a hash of all that decides what a run at some inputs writes."""
        decisive = [program.identity(), self.words, self.templates, self.copied]
        text = json.dumps([*decisive, asdict(self.delimiters)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def _command(self, program: Program, inputs: Mapping[str, float]) -> list[str]:
        """Return the executed command, with full paths of files beside the study."""
        words = [str(program.executed.read.path)]
        # A file in the folder of a run is passed to it by its name there.
        inside = {*self.templates, *self.copied}
        for word in self.words[1:]:
            if word in program.names and word not in inside:
                words.append(str(program.folder / word))
            else:
                words.append(fill(word, {**inputs, **_PATHS}))
        return words

    def _outcome(self, ending: ProcessEnd, folder: Path, program: Program) -> RunOutcome:
        """Return the outcome of a run whose program has ended."""
        if ending.is_late:
            return RunOutcome({}, Status.TIMED_OUT, self.limits.timeout_reason)
        for number, outcome in enumerate(self.outcomes, 1):
            if _has_ended(outcome, ending, folder):
                return with_outcome(number)
        if ending.code:
            status = Status.CRASHED if ending.signal else Status.FAILED
            how = f"ended by {ending.signal}" if ending.signal else f"exit code {ending.code}"
            message = remove_variable_parts(last_line(folder / STDERR), [folder, program.folder])
            return RunOutcome({}, status, f"{how}: {message}" if message else how)
        written = RunFiles(folder, self.limits)
        try:
            outputs = [each for each in self.outputs if not each.categories]
            found = read_outputs(outputs, self.readings, self.fields.grids, written)
        except (UnreadableError, UnusableOutputError) as error:
            return RunOutcome({}, error.status, str(error))
        for output in outputs:
            # A run that comes to its usual end has every number.
            if reason := replace(output, absent="").invalid_text(found[output.name]):
                return RunOutcome(found, Status.NOT_FINITE, reason)
        return RunOutcome({**found, **({OUTCOME_OUTPUT: np.zeros(())} if self.outcomes else {})})


def _outcome_note(outcome: RunOutcome, words: list[str]) -> str:
    """Return a note for the folder of a run: its outcome and the executed command."""
    lines = [f"{STATUS_TEXT[outcome.status]}: {outcome.reason}".removesuffix(": ")]
    for name, values in outcome.outputs.items():
        found = f" = {values.item()!r}" if not values.ndim else f": {counted(values.size, 'value')}"
        lines.append(name + found)
    return "\n".join([*lines, shlex.join(words), ""])
