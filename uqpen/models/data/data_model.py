"""Model whose runs are those of a data file, and no others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.errors import ModelError, toml_text
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
    inputs: tuple[Input, ...]  # with outputs: the variables that the file has columns of
    outputs: tuple[Output, ...]
    points: Arrays  # (run,): the inputs in SI units
    results: Results  # the outputs, and the status of each run
    file: FileSnapshot  # the file
    # (run,): what else the file says of the points: the replicate or the weight of each.
    coordinates: Arrays

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
        return {"name": self.name, "data_sha256": self.file.sha256}


# Points and results of a data file: its inputs, outputs, statuses and reasons.

# The columns with the status of each run, and with the reason of a failed one.
STATUS, REASON = "status", "reason"

_STATUSES = {status.meaning: status for status in Status}


def data_points(
    file: DataFile, inputs: Sequence[Input], units: Mapping[str, str]
) -> dict[str, FloatArray]:
    """Return the inputs of a data file in SI units, each from its column in a unit.

    SettingsError if an entry is blank or no finite number.
    """
    points = {}
    for each in inputs:
        column = file.column(each.name)
        numbers = column.numbers()
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            found = column.entry_text(int(bad[0])) or "nothing"
            expected = "a number: the inputs of a failed run have to be known, too"
            raise data_error(f"{found} in {column.place_text(int(bad[0]))}", expected)
        points[each.name] = _in_si(numbers, units[each.name])
    return points


def data_results(file: DataFile, outputs: Sequence[Output], units: Mapping[str, str]) -> Results:
    """Return the outputs of a data file in SI units, with the status of each run.

    A run with an output that is blank, or the word ``fail``, has failed; so has one that its status
    says so of, whatever its outputs are. Raises a SettingsError for another entry that is no
    number, and for an unknown status.
    """
    status, reasons = _stated(file)
    found = {
        each.name: _in_si(file.column(each.name).numbers(), units[each.name]) for each in outputs
    }
    for kind, test in ((Status.FAILED, np.isnan), (Status.NOT_FINITE, np.isinf)):
        for name, values in found.items():
            for run in np.flatnonzero((status == Status.OK) & test(values)).tolist():
                status[run] = kind
                missing = kind == Status.FAILED and (file.column(name).entry_text(run) or "blank")
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
    known = {column.name for column in file.columns} - {each.name for each in variables}
    found: dict[str, FloatArray] = {}
    if REPLICATE in known:
        replicates = file.column(REPLICATE)
        stated = _complete(replicates)
        broken = np.flatnonzero(stated != np.floor(stated))
        if broken.size:
            place = replicates.place_text(int(broken[0]))
            expected = "a whole number for each run: that of its replicate"
            raise data_error(f"{stated[broken[0]]:g} in {place}", expected)
        _, numbers = np.unique(stated, return_inverse=True)
        found[REPLICATE] = numbers.astype(np.float64)
    if WEIGHT in known:
        found[WEIGHT] = _complete(file.column(WEIGHT))
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
    columns = {column.name: column for column in file.columns}
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
