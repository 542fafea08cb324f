"""Model whose runs are those of a data file, and no others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.errors import ModelError, Problem, SettingsError, toml_text
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import REPLICATE, WEIGHT
from uqpen.core.model import Input, Model, Output, Results, Variable
from uqpen.core.status import STATUS_TEXT, Status
from uqpen.core.units import scale
from uqpen.models.data.data_file import DataColumn, DataFile, data_error


@dataclass(frozen=True, eq=False)
class DataModel(Model):
    """Runs of a model that is not here: their points and results."""

    name: str  # the name of the file
    inputs: tuple[Input, ...]  # that the file has columns of
    outputs: tuple[Output, ...]  # that the file has columns of
    points: Arrays  # (run,): the inputs in SI units
    results: Results  # the outputs, and the status of each run
    file: FileSnapshot  # the file
    # (run,): what else the file says of the points: the replicate or the weight of each.
    coordinates: Arrays
    dropped: str = ""  # how many rows of the file are left out, and why
    distant: tuple[str, ...] = ()  # values that stand alone in the column of a variable
    coded: str = ""  # the codes of inputs that are texts in the file
    together: bool = False  # whether the inputs are distributed as its rows, with their dependence
    # What the study says of entries and rows, as its own text, where it says so.
    treatment: Mapping[str, str] = field(default_factory=dict)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.results.status)

    @property
    def uncallable_reason(self) -> str:
        return f"{self.name} has runs of a model that is not here, so no other run can be made"

    def evaluate(self, inputs: Arrays) -> Results:
        raise ModelError(self.uncallable_reason)

    def files(self) -> tuple[FileSnapshot, ...]:
        return (self.file,)

    def identity(self) -> dict[str, str]:
        return {"name": self.name, "data_sha256": self.file.sha256, **self.treatment}


# Points and results of a data file: its inputs, outputs, statuses and reasons.

# The columns with the status of each run, and with the reason of a failed one.
STATUS, REASON = "status", "reason"

# What a study leaves out by this word.
BLANK_INPUTS = "blank inputs"

# Rows of a column that a message lists.
_MOST_ROWS = 20

_STATUSES = {status.meaning: status for status in Status}


def data_points(
    file: DataFile, inputs: Sequence[Input], units: Mapping[str, str]
) -> dict[str, FloatArray]:
    """Return the inputs of a data file in SI units, each from its column in a unit.

    SettingsError if entries are blank or no finite numbers, with the rows of all of them.
    """
    numbers = {each.name: file.by_name[each.name].numbers() for each in inputs}
    problems = []
    for name, values in numbers.items():
        bad = np.flatnonzero(~np.isfinite(values)).tolist()
        if bad:
            column = file.by_name[name]
            more = "".join(
                f", {column.place(row).rpartition(', ')[2]}" for row in bad[1:_MOST_ROWS]
            )
            more += f" and {len(bad) - _MOST_ROWS} others" if len(bad) > _MOST_ROWS else ""
            expected = (
                "a number: the inputs of a failed run have to be known, too; "
                f'drop = "{BLANK_INPUTS}" leaves out rows without one'
            )
            found = f"{column.entry_text(bad[0]) or 'nothing'} in {column.place_text(bad[0])}{more}"
            problems.append(Problem((), found, expected))
    if problems:
        raise SettingsError(problems)
    return {name: _in_si(values, units[name]) for name, values in numbers.items()}


def without_blank_inputs(file: DataFile, inputs: Sequence[str]) -> tuple[DataFile, str]:
    """Return a file without the rows in which an input is blank, and a text on them.

    SettingsError if no row is left.
    """
    blank = {name: np.isnan(file.by_name[name].numbers()) for name in inputs}
    is_dropped = np.any([*blank.values()], axis=0)
    if not is_dropped.any():
        return file, ""
    kept = np.flatnonzero(~is_dropped).tolist()
    parts = ", ".join(f"{name} in {each.sum()}" for name, each in blank.items() if each.any())
    text = f"{is_dropped.sum()} of {file.rows} rows of {file.name} are left out"
    return replace(file, columns=tuple(each.rows(kept) for each in file.columns)), (
        f"{text}: an input is blank ({parts})"
    )


def data_results(file: DataFile, outputs: Sequence[Output], units: Mapping[str, str]) -> Results:
    """Return the outputs of a data file in SI units, with the status of each run.

    A run with an output that is blank, or the word ``fail``, has failed; so has one that its status
    says so of, whatever its outputs are. Raises a SettingsError for another entry that is no
    number, and for an unknown status.
    """
    status, reasons = _stated(file)
    found = {
        each.name: _in_si(file.by_name[each.name].numbers(), units[each.name]) for each in outputs
    }
    for kind, test in ((Status.FAILED, np.isnan), (Status.NOT_FINITE, np.isinf)):
        for name, values in found.items():
            for run in np.flatnonzero((status == Status.OK) & test(values)).tolist():
                status[run] = kind
                missing = kind == Status.FAILED and (file.by_name[name].entry_text(run) or "blank")
                reasons[run] = reasons.get(run) or f"{name} is {missing or 'infinite'}"
    is_ok = status == Status.OK
    reasons = {
        run: reasons.get(run) or STATUS_TEXT[Status(int(status[run]))]
        for run in np.flatnonzero(~is_ok).tolist()
    }
    return Results(
        {name: np.where(is_ok, each, np.nan) for name, each in found.items()}, status, reasons
    )


def data_coordinates(file: DataFile, variables: Sequence[Variable]) -> dict[str, FloatArray]:
    """Return the replicates, from 0, and the weights of points, where the file has them.

    SettingsError if a replicate is no whole number of 0 or more, or a weight no number of 0 or
    more.
    """
    known = file.by_name.keys() - {each.name for each in variables}
    found: dict[str, FloatArray] = {}
    if REPLICATE in known:
        replicates = file.by_name[REPLICATE]
        stated = _complete(replicates)
        broken = np.flatnonzero(stated != np.floor(stated))
        if broken.size:
            place = replicates.place_text(int(broken[0]))
            expected = "a whole number for each run: that of its replicate"
            raise data_error(f"{stated[broken[0]]:g} in {place}", expected)
        _, numbers = np.unique(stated, return_inverse=True)
        found[REPLICATE] = numbers.astype(np.float64)
    if WEIGHT in known:
        found[WEIGHT] = _complete(file.by_name[WEIGHT])
    return found


def _complete(column: DataColumn) -> FloatArray:
    """Return the numbers of a column without a blank one, or one below 0."""
    numbers = column.numbers()
    bad = np.flatnonzero(~(np.isfinite(numbers) & (numbers >= 0)))
    if bad.size:
        found = f"{numbers[bad[0]]:g} in {column.place_text(int(bad[0]))}"
        raise data_error(found, "a number of 0 or more for each run")
    return numbers


def _in_si(numbers: FloatArray, unit: str) -> FloatArray:
    values: FloatArray = scale(unit).array_to_si(numbers)
    return values


def _stated(file: DataFile) -> tuple[npt.NDArray[np.int8], dict[int, str]]:
    """Return the statuses and reasons that a file states; without a status, a run is ok so far."""
    columns = file.by_name
    status = np.full(file.rows, Status.OK, dtype=np.int8)
    if STATUS in columns:
        for run, text in enumerate(columns[STATUS].texts()):
            word = text.lower().replace(" ", "_").replace("-", "_")
            if word and word not in _STATUSES:
                expected = f"one of {', '.join(STATUS_TEXT.values())}, or nothing"
                found = f"{toml_text(text)} in {columns[STATUS].place_text(run)}"
                raise data_error(found, expected)
            status[run] = _STATUSES.get(word, Status.OK)
    texts = enumerate(columns[REASON].texts() if REASON in columns else ())
    return status, {run: text for run, text in texts if text}
