"""What a model is: named inputs and outputs with units, and one vectorised call."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from uqpen.core.errors import UnknownNameError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import Status
from uqpen.core.limits import Limits
from uqpen.core.lookup import choices
from uqpen.core.variables import POSITIVE, Bounds, Category, Input, Output, Variable

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["POSITIVE", "Bounds", "Category", "Input", "Model", "Output", "Results", "Variable"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Arrays = Mapping[str, FloatArray]


@dataclass(frozen=True)
class Results:
    """What came of a batch of runs.

    Parameters
    ----------
    outputs : mapping of str to ndarray, shape (run,)
        SI values; NaN where a run was lost (any value, for an output with categories).
    status : ndarray of int8, shape (run,)
        See `uqpen.core.labels.Status`.
    reasons : mapping of int to str
        Why each lost run was lost, by its position in the batch.
    files : set of str
        The files that the model has been found to consist of, as lines of sha256sum: each one's
        SHA-256 and its path from the study's folder; see `Model.record_files`.
    """

    outputs: Arrays
    status: npt.NDArray[np.int8]
    reasons: Mapping[int, str] = field(default_factory=dict)
    files: frozenset[str] = frozenset()

    @classmethod
    def all_ok(cls, outputs: Arrays) -> Results:
        """Results of a batch in which no run was lost."""
        runs = len(next(iter(outputs.values())))
        return cls(outputs, np.full(runs, Status.OK, dtype=np.int8))


class Model(ABC):
    """A black box: inputs in, outputs out, a status for every run.

    A subclass says its name, its inputs and its outputs, and implements `evaluate`. It is final:
    frozen settings, no state that a call changes.

    Attributes
    ----------
    name : str
        As a study file's ``use`` knows it, or what a person would call it.
    inputs, outputs : tuple
        In the order in which they are shown.
    alternatives : tuple of tuple of str
        Groups of inputs of which one at least must be given, and one is enough.
    vectorized : bool
        Whether a batch costs far less than its runs one by one.
    is_untrusted : bool
        Whether a call can hang, or end the process that makes it.
    enforced_limits : Limits
        What one run may use, where whoever runs it has to see to that.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()
    vectorized: bool = True
    is_untrusted: bool = False
    enforced_limits: Limits = Limits()

    @abstractmethod
    def evaluate(self, inputs: Arrays) -> Results:
        """Run a batch.

        Parameters
        ----------
        inputs : mapping of str to ndarray, shape (run,)
            SI values, admissible ones only; an input that was not given is absent.

        Returns
        -------
        Results
            Never an exception for a run that fails: a run that fails is data.
        """

    @property
    def run_limits(self) -> Limits:
        """What one run may use, whoever sees to that."""
        return self.enforced_limits

    def prepare(self) -> None:  # noqa: B027 - most models have nothing to prepare
        """Do what is done once before the first run: compile, connect."""

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        """What inputs must satisfy together, beyond the bounds of each.

        Yields
        ------
        holds : ndarray of bool, shape (run,)
            Where the condition holds.
        text : str
            The condition, as the reason of a run that is inadmissible.
        """
        yield from ()

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset | None:
        """The course of one run, or None where the model has none.

        Raises
        ------
        TrajectoryError
            If that run fails.
        """
        return None

    def record_files(self, files: frozenset[str]) -> None:  # noqa: B027 - most models have none
        """Note files of the user's own that runs, here or in another process, were made with.

        Parameters
        ----------
        files : set of str
            As in `Results.files`.

        Raises
        ------
        ModelError
            If others were made with another version of one of them.
        """

    def files(self) -> tuple[FileSnapshot, ...]:
        """The files of the user's own that it has been found to consist of, as it was run."""
        return ()

    def identity(self) -> dict[str, str]:
        """What tells this model from another that would give other results."""
        return {"name": self.name}

    def input(self, name: str) -> Input:
        """The input called `name`."""
        return find_variable(self.inputs, name, "input", self.name)

    def output(self, name: str) -> Output:
        """The output called `name`."""
        return find_variable(self.outputs, name, "output", self.name)

    def missing_inputs(self, given: Collection[str]) -> Iterator[str]:
        """Inputs that still have to be given; of alternatives, the first."""
        optional = {name for group in self.alternatives for name in group}
        for variable in self.inputs:
            is_needed = variable.default is None and variable.name not in optional
            if is_needed and variable.name not in given:
                yield variable.name
        for group in self.alternatives:
            if not any(name in given for name in group):
                yield group[0]


def violated_conditions(model: Model, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
    """Every condition on a batch's inputs, with where it is violated.

    Yields
    ------
    violated : ndarray of bool, shape (run,)
        Where the condition does not hold.
    text : str
        The condition.
    """
    for variable in model.inputs:
        if variable.name in inputs:
            inside = variable.bounds.contain(inputs[variable.name])
            yield ~inside, f"{variable.name} {variable.bounds}"
    # A NaN or an overflow inside a condition makes it false, which is what it should be.
    with np.errstate(all="ignore"):
        for is_satisfied, text in model.conditions(inputs):
            yield ~is_satisfied, text


VariableT = TypeVar("VariableT", bound=Variable)


def find_variable(variables: Sequence[VariableT], name: str, what: str, model: str) -> VariableT:
    for variable in variables:
        if variable.name == name:
            return variable
    known = [variable.name for variable in variables]
    raise UnknownNameError(f'{model} has no {what} "{name}"; {choices(name, known)}')
