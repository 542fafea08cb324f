"""User's Python function as a model, called in this process."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.files import FileSnapshot
from uqpen.core.interrupts import is_user_interrupt
from uqpen.core.limits import Limits
from uqpen.core.model import Input, Model, Output, Results, empty_outputs
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.models.dependencies import Dependencies
from uqpen.models.failed_line import line_in_folder, line_in_function
from uqpen.models.function_outputs import extract_outputs
from uqpen.models.function_source import FunctionSource
from uqpen.models.observation import unseen_readers
from uqpen.models.run_grid import FieldSources, UnusableOutputError
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_code import (
    check_signature,
    end_forked_child,
    error_text,
    one_line,
    pickle_by_value,
    restore_streams,
)
from uqpen.models.user_module import load_function

__all__ = ["PythonFunction", "check_inputs"]


class _FailedRun(NamedTuple):
    """Run without outputs: its reason and its status."""

    reason: str
    status: Status = Status.FAILED


_CallResult = dict[str, FloatArray] | _FailedRun


@dataclass(frozen=True)
class PythonFunction(Model):
    """Model that calls a Python function by keyword.

    Parameters
    ----------
    function : callable
        Takes a keyword argument for each input, returns a mapping with each output; values are in
        the units of `units`. An output with dimensions is an array along them.
    name : str
        Name for display; with surroundings, the reference for `load_function`.
    units : mapping of str to str
        The unit that the function takes each input and gives each output in.
    vectorized : bool
        Whether it takes and returns arrays along the runs; else those of one run.
    surroundings : ModelFolder, optional
        The folder that the function must be called in; a hash of its source identifies the version
        of the model.
    enforced_limits : Limits
        Limits of one run; if anything is limited, runs are made in a process of their own.
    source : FunctionSource, optional
        The source of a function that is an object of this process, without a file to load it from.
    fields : FieldSources
        The grids on which runs return outputs, and the files with coordinates.
    observed : Dependencies
        Record of what the runs of an object depend on besides its source.
    """

    function: Callable[..., Mapping[str, Any]]
    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: Mapping[str, str]
    vectorized: bool = False
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)
    enforced_limits: Limits = Limits()
    source: FunctionSource | None = field(default=None, repr=False)
    fields: FieldSources = field(default=FieldSources(), repr=False)
    observed: Dependencies = field(
        default_factory=partial(Dependencies, Path()), repr=False, compare=False
    )
    is_untrusted: bool = field(default=True, init=False)

    @property
    def is_object(self) -> bool:
        return self.source is not None

    @property
    def is_absent(self) -> bool:
        return self.source is not None and self.source.is_absent

    @property
    def unknown_dependency(self) -> str:
        return self.source.unknown if self.source else ""

    def evaluate(self, inputs: Arrays) -> Results:
        arguments = {
            name: scale(self.units[name]).from_si(values) for name, values in inputs.items()
        }
        runs = len(next(iter(inputs.values())))
        outputs = empty_outputs(self.outputs, runs)
        status = np.full(runs, Status.OK, dtype=np.int8)
        reasons: dict[int, str] = {}
        folder = self.surroundings.on_import_path() if self.surroundings else nullcontext()
        with restore_streams(), folder:
            for batch, answer in self._batch_results(arguments, runs):
                if isinstance(answer, _FailedRun):
                    status[batch] = answer.status
                    reasons[batch.start] = answer.reason
                    continue
                for name, values in answer.items():
                    outputs[name][batch] = values
        for output in self.outputs:
            measure = scale(self.units[output.name])
            outputs[output.name] = measure.array_to_si(outputs[output.name])
        return Results(outputs, status, reasons, self._record.lines_of_runs)

    def evaluate_observed(self, inputs: Arrays) -> Results:
        with self._record.observed_run():
            results = self.evaluate(inputs)
        return replace(results, files=results.files | self._record.lines_of_runs)

    def record_files(self, files: frozenset[str]) -> None:
        self._record.add_reported(files)

    def dependencies(self) -> frozenset[str]:
        return self._record.lines

    @property
    def uncompared(self) -> tuple[str, ...]:
        text = self.source.text if self.source else ""
        return tuple(unseen_readers(self.surroundings.text if self.surroundings else text))

    def files(self) -> tuple[FileSnapshot, ...]:
        return (*self._record.files(), *self.fields.files)

    @property
    def _record(self) -> ModelFolder | Dependencies:
        return self.surroundings or self.observed

    def __reduce__(self) -> tuple[Any, ...]:
        # Another process loads the function itself: its modules cannot be sent.
        declared = (self.name, self.inputs, self.outputs, self.units, self.vectorized)
        fields = FieldSources(self.fields.grids)
        if self.surroundings is None:
            function = pickle_by_value(self.function)
            limits = self.enforced_limits
            observed = Dependencies(self.observed.folder)
            return _unpickle, (function, *declared, None, limits, self.source, fields, observed)
        return _restore, (self.surroundings.folder, *declared, self.enforced_limits, fields)

    def identity(self) -> dict[str, str]:
        if self.source is not None:
            return {"name": self.name, "source_sha256": self.source.sha256 or "unknown"}
        if self.surroundings is None:
            return {"name": self.name}
        sources = self.surroundings.sources()
        return {"name": self.name, "source_sha256": hashlib.sha256(sources).hexdigest()}

    def _batch_results(self, arguments: Arrays, runs: int) -> Iterator[tuple[slice, _CallResult]]:
        """Yield for each batch of runs its outputs, or the reason why it has none."""
        if not self.vectorized:
            columns = {name: values.tolist() for name, values in arguments.items()}
            for run in range(runs):
                one = {name: column[run] for name, column in columns.items()}
                yield slice(run, run + 1), self._call(one, None)
            return
        batches = [slice(0, runs)]
        while batches:
            batch = batches.pop()
            some = {name: values[batch].copy() for name, values in arguments.items()}
            answer = self._call(some, batch.stop - batch.start)
            if isinstance(answer, _FailedRun) and batch.stop - batch.start > 1:
                # One bad run must not spoil its batch: halve until it is alone.
                middle = (batch.start + batch.stop) // 2
                batches += [slice(middle, batch.stop), slice(batch.start, middle)]
            else:
                yield batch, answer

    def _call(self, arguments: Mapping[str, Any], runs: int | None) -> _CallResult:
        """Return the outputs of one call, or the reason why there are none."""
        process = os.getpid()
        answer: _CallResult
        try:
            returned = self.function(**arguments)
            answer = extract_outputs(returned, self.outputs, runs, self.fields.grids)
        except UnusableOutputError as refused:
            answer = _FailedRun(one_line(str(refused)), refused.status)
        except BaseException as error:  # any exception of a black box is data
            end_forked_child(process, error)
            if is_user_interrupt(error):
                raise
            answer = _FailedRun(error_text(error) + self._failed_line(error))
        end_forked_child(process)
        return answer

    def _failed_line(self, error: BaseException) -> str:
        """Return the line of the user's code that an exception comes from; empty if unknown."""
        if self.surroundings is not None:
            return line_in_folder(error, self.surroundings)
        return line_in_function(error, self.function, self.source) if self.source else ""


def _unpickle(function: bytes, *declared: Any) -> PythonFunction:
    """Restore a model from its pickled function and its declaration."""
    return PythonFunction(pickle.loads(function), *declared)


def _restore(
    folder: Path,
    reference: str,
    inputs: tuple[Input, ...],
    outputs: tuple[Output, ...],
    units: Mapping[str, str],
    vectorized: bool,
    limits: Limits,
    fields: FieldSources,
) -> PythonFunction:
    """Restore a model from its declaration, and load its function again."""
    function, surroundings = load_function(reference, folder)
    declared = (reference, inputs, outputs, units, vectorized, surroundings, limits)
    return PythonFunction(function, *declared, fields=fields)


def check_inputs(function: Callable[..., Any], inputs: Iterable[Input]) -> None:
    """Check that a function takes the inputs by name; ModelError gives its signature if not."""
    keywords = {variable.name: 0.0 for variable in inputs}
    check_signature(function, " cannot take the inputs", keywords=keywords)
