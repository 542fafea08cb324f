"""User's Python function as a model, called in this process."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import OUTCOME_OUTPUT
from uqpen.core.limits import Limits
from uqpen.core.model import Input, Output, Results, RunOutcome, joined_outcomes
from uqpen.models.dependencies import Dependencies
from uqpen.models.function_source import FunctionSource
from uqpen.models.outcomes import DeclaredOutcome, with_outcome, without_gaps
from uqpen.models.run_grid import FieldSources, extract_outputs
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_code import (
    check_signature,
    ending_forks,
    pickle_by_value,
    restore_streams,
)
from uqpen.models.user_defined_model import UserModel, batch_results
from uqpen.models.user_module import line_in_function, load_function


@dataclass(frozen=True)
class PythonFunction(UserModel):
    """Model that calls a Python function by keyword."""

    # Takes a keyword argument for each input, returns a mapping with each output; values are in the
    # units of `units`. An output with dimensions is an array along them.
    function: Callable[..., Mapping[str, Any]]
    name: str  # name for display; with surroundings, the reference for `load_function`
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: Mapping[str, str]  # the unit that the function takes each input and gives each output in
    # Whether it takes and returns arrays along the runs; else those of one run.
    vectorized: bool = False
    # The folder that the function must be called in; a hash of its source identifies the version of
    # the model.
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)
    # Limits of one run; if anything is limited, runs are made in a process of their own.
    enforced_limits: Limits = Limits()
    # The source of a function that is an object of this process, without a file to load it from.
    source: FunctionSource | None = field(default=None, repr=False)
    # The grids on which runs return outputs, and the files with coordinates.
    fields: FieldSources = field(default=FieldSources(), repr=False)
    observed: Dependencies = field(
        default_factory=partial(Dependencies, Path()), repr=False, compare=False
    )  # record of what the runs of an object depend on besides its source
    outcomes: tuple[DeclaredOutcome, ...] = ()  # exceptions that are results

    def evaluate(self, inputs: Arrays) -> Results:
        known = {variable.name: variable for variable in self.inputs}
        arguments = {
            # A seed is a whole number, without a unit.
            name: values
            if values.dtype.kind == "i"
            else known[name].to_own(values, self.units[name])
            for name, values in inputs.items()
        }
        runs = len(next(iter(inputs.values())))
        with restore_streams(), self.in_folder():
            outcomes = self._outcomes(arguments, runs)
            results = joined_outcomes(outcomes, self.outputs, self.units, runs)
        if self.outcomes:
            results = without_gaps(results, self._returned)
        return replace(results, files=self.record.lines_of_runs)

    def files(self) -> tuple[FileSnapshot, ...]:
        return (*self.record.files(), *self.fields.files)

    def identity(self) -> dict[str, str]:
        return {"name": self.name, **self.source_identity}

    def __reduce__(self) -> tuple[Any, ...]:
        # Another process loads the function itself: its modules cannot be sent.
        declared = (self.name, self.inputs, self.outputs, self.units, self.vectorized)
        fields = FieldSources(self.fields.grids)
        if self.surroundings is None:
            function = pickle_by_value(self.function)
            limits = self.enforced_limits
            observed = Dependencies(self.observed.folder)
            own = (None, limits, self.source, fields, observed, self.outcomes)
            return _unpickle, (function, *declared, *own)
        folder, limits = self.surroundings.folder, self.enforced_limits
        return _restore, (folder, *declared, limits, fields, self.outcomes)

    @property
    def _returned(self) -> tuple[Output, ...]:
        """The outputs that the function returns."""
        return self.outputs[:-1] if self.outcomes else self.outputs

    def _outcomes(self, arguments: Arrays, runs: int) -> Iterator[tuple[slice, RunOutcome]]:
        """Yield for each batch of runs its outputs, or the reason why it has none."""
        if self.vectorized:
            yield from batch_results(
                lambda batch: self._call(
                    {name: values[batch].copy() for name, values in arguments.items()},
                    batch.stop - batch.start,
                ),
                runs,
            )
            return
        columns = {name: values.tolist() for name, values in arguments.items()}
        for run in range(runs):
            one = {name: column[run] for name, column in columns.items()}
            yield slice(run, run + 1), self._call(one, None)

    def _call(self, arguments: Mapping[str, Any], runs: int | None) -> RunOutcome:
        """Return the outputs of one call, or the reason why there are none."""
        try:
            with ending_forks():
                returned = self.function(**arguments)
            found = extract_outputs(returned, self._returned, runs, self.fields.grids)
            usual = {OUTCOME_OUTPUT: np.zeros(())} if self.outcomes else {}
            return RunOutcome({**found, **usual})
        except BaseException as error:  # any exception of a black box is data
            # Of several runs, each is made by itself to see which of them has ended so.
            if runs is None or runs == 1:
                for number, outcome in enumerate(self.outcomes, 1):
                    if outcome.is_raised(error):
                        return with_outcome(number)
            return self.failed_run(error)

    def failed_line(self, error: BaseException) -> str:
        if self.surroundings is None and self.source is not None:
            return line_in_function(error, self.function, self.source)
        return super().failed_line(error)


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
    outcomes: tuple[DeclaredOutcome, ...],
) -> PythonFunction:
    """Restore a model from its declaration, and load its function again."""
    function, surroundings = load_function(reference, folder)
    declared = (reference, inputs, outputs, units, vectorized, surroundings, limits)
    return PythonFunction(function, *declared, fields=fields, outcomes=outcomes)


def check_inputs(function: Callable[..., Any], inputs: Iterable[Input]) -> None:
    """Check that a function takes the inputs by name; ModelError gives its signature if not."""
    keywords = {variable.name: 0.0 for variable in inputs}
    check_signature(function, " cannot take the inputs", keywords=keywords)
