"""Interface of a model: named inputs and outputs with units, and one vectorised call."""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.errors import UnknownNameError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import RANDOM_SEED
from uqpen.core.limits import Limits
from uqpen.core.lookup import choices
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.core.variables import (
    POSITIVE,
    Bounds,
    Category,
    DerivedOutput,
    Dimension,
    Input,
    Output,
    Variable,
)

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "POSITIVE",
    "Arrays",
    "BoolArray",
    "Bounds",
    "Category",
    "Dimension",
    "FloatArray",
    "Input",
    "Model",
    "Noise",
    "Output",
    "Results",
    "RunOutcome",
    "RunWarning",
    "Variable",
    "empty_outputs",
    "joined_outcomes",
]

# Results of a batch of runs, and warnings of a model about them.


@dataclass(frozen=True)
class Results:
    """Results of a batch of runs.

    Parameters
    ----------
    outputs : mapping of str to ndarray, shape (run, *dims)
        SI values, of shape (run,) for an output without dimensions; NaN where a run failed (any
        value for a categorical output).
    status : ndarray of int8, shape (run,)
        See `uqpen.core.status.Status`.
    reasons : mapping of int to str
        The reason why each failed run failed, by its position in the batch.
    files : set of str
        Own modules with which the runs were made, and what was seen in a run that was observed;
        each as `Dependency.line` (`uqpen.core.dependency`).
    """

    outputs: Arrays
    status: npt.NDArray[np.int8]
    reasons: Mapping[int, str] = field(default_factory=dict)
    files: frozenset[str] = frozenset()

    @classmethod
    def all_ok(cls, outputs: Arrays) -> Results:
        """Return the results of a batch in which no run failed."""
        runs = len(next(iter(outputs.values())))
        return cls(outputs, np.full(runs, Status.OK, dtype=np.int8))


class RunOutcome(NamedTuple):
    """Outcome of one run, or of some that have ended alike; outputs are in units of the model."""

    outputs: Mapping[str, FloatArray]
    status: Status = Status.OK
    reason: str = ""

    @classmethod
    def failed(cls, reason: str, status: Status = Status.FAILED) -> RunOutcome:
        """Return the outcome of a run without outputs."""
        return cls({}, status, reason)


def joined_outcomes(
    outcomes: Iterable[tuple[slice, RunOutcome]],
    outputs: Sequence[Output],
    units: Mapping[str, str],
    runs: int,
) -> Results:
    """Return the results of runs from the outcome at each place among them."""
    found = empty_outputs(outputs, runs)
    status = np.full(runs, Status.OK, dtype=np.int8)
    reasons: dict[int, str] = {}
    for place, outcome in outcomes:
        status[place] = outcome.status
        if outcome.reason:
            reasons[place.start] = outcome.reason
        for name, values in outcome.outputs.items():
            found[name][place] = values
    in_si = {name: scale(units[name]).array_to_si(values) for name, values in found.items()}
    return Results(in_si, status, reasons)


class RunWarning(UserWarning):
    """Warning of a model about its runs, in words that name no line of code.

    Parameters
    ----------
    text : str
        The same in all runs that it is true of, so that it is shown once.
    of_one_run : str
        The same with the numbers of one run.
    """

    def __init__(self, text: str, of_one_run: str = "") -> None:
        super().__init__(text)
        self.of_one_run = of_one_run or text


def empty_outputs(outputs: Sequence[Output], runs: int) -> dict[str, FloatArray]:
    """Return an array of NaN for each output, of shape (run, *dims)."""
    return {output.name: np.full((runs, *output.shape), np.nan) for output in outputs}


@dataclass(frozen=True)
class Noise:
    """Statement of a study on the noise of a model: whether runs at the same inputs differ.

    Parameters
    ----------
    is_declared : bool or None
        None where the study says nothing.
    seed : str
        The name of the variable that has the seed of each run: an input of the model, or
        `RANDOM_SEED` where the generators that Python and NumPy share are set before each run.
        Empty where runs get no seed.
    """

    is_declared: bool | None = None
    seed: str = ""

    @property
    def is_unseeded(self) -> bool:
        """True if a run cannot be repeated: each one made again is another one."""
        return bool(self.is_declared) and not self.seed


class Model(ABC):
    """Black-box model: it takes inputs, and returns outputs and a status for every run.

    A subclass declares its name, inputs and outputs, and implements `evaluate`. It is final, with
    frozen settings, and no call changes its state.

    Attributes
    ----------
    name : str
        Name in a study file's ``use``, or a name for display.
    inputs, outputs : tuple
        In the order in which they are shown.
    alternatives : tuple of tuple of str
        Groups of inputs. At least one input of each group must be given, and one is enough.
    vectorized : bool
        Whether a batch costs far less than its runs one by one.
    is_untrusted : bool
        Whether a call can hang, or end the process that makes it.
    enforced_limits : Limits
        Limits of one run that its caller has to enforce.
    derived : tuple of DerivedOutput
        What a study derives from its inputs and outputs, after a run. `evaluate` knows nothing
        of them.
    noise : Noise
        What a study says of its noise.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    alternatives: tuple[tuple[str, ...], ...] = ()
    vectorized: bool = True
    is_untrusted: bool = False
    enforced_limits: Limits = Limits()
    derived: tuple[DerivedOutput, ...] = ()
    noise: Noise = Noise()

    @property
    def may_be_noisy(self) -> bool:
        """True if its code is not uqpen's: its runs have to show if they can be repeated."""
        return False

    @property
    def run_inputs(self) -> tuple[str, ...]:
        """Names of all that decides a run: its inputs, and a seed that is none of them."""
        names = tuple(variable.name for variable in self.inputs)
        return (*names, RANDOM_SEED) if self.noise.seed == RANDOM_SEED else names

    @property
    def all_outputs(self) -> tuple[Output, ...]:
        """All outputs of its runs: those of the model, then those derived from them."""
        return (*self.outputs, *(each.output for each in self.derived))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for a user before it runs, a line each."""
        return ()

    @property
    def is_object(self) -> bool:
        """True if it is an object of this process that no text describes."""
        return False

    @property
    def is_absent(self) -> bool:
        """True if it is an object of another process, so it cannot be run here."""
        return False

    @property
    def is_batch_independent(self) -> bool:
        """True if a run has the same bits in any batch.

        `uqpen.testing.check_model` demands it of a model. A user's function may differ in last
        bits: libraries of array operations add and round by the place in an array.
        """
        return not self.is_untrusted

    @property
    def unknown_dependency(self) -> str:
        """Part of it whose versions `identity` cannot distinguish; empty where it can."""
        return ""

    @property
    def uncallable_reason(self) -> str:
        """Reason why it cannot be run at any inputs; empty where it can."""
        return ""

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
            A failed run is data, so it raises no exception.
        """

    def evaluate_observed(self, inputs: Arrays) -> Results:
        """Run a batch as `evaluate` does, and report in `Results.files` what its runs depend on."""
        return self.evaluate(inputs)

    @property
    def run_limits(self) -> Limits:
        """Limits of one run, enforced by its caller or by the model itself."""
        return self.enforced_limits

    @property
    def needs_main_thread(self) -> bool:
        """True if it can enforce its limits in the main thread of a process only."""
        return False

    def prepare(self) -> None:  # noqa: B027 - most models have nothing to prepare
        """Prepare the model once before the first run: compile, connect."""

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        """Yield the conditions that several inputs must satisfy, beyond the bounds of each.

        Yields
        ------
        satisfied : ndarray of bool, shape (run,)
            Mask of the runs that satisfy the condition.
        text : str
            The condition, as the reason of a run that is inadmissible.
        """
        yield from ()

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset | None:
        """Return the trajectory of one run, or None where the model has none.

        Raises
        ------
        TrajectoryError
            If that run fails.
        """
        return None

    def with_folder(self, folder: Path) -> Model:
        """Return a model that keeps the files of its runs, if any, in another folder.

        The folder is made with the first file.
        """
        return self

    def reading_again(self) -> Model:
        """Return a model that reads its outputs from the kept folders of runs, where there are any.

        It is the model itself where its runs have no folders.
        """
        return self

    def run_folder(self, inputs: Mapping[str, float]) -> Path | None:
        """Return the folder in which the files of a run are kept; None if they are not kept.

        Parameters
        ----------
        inputs : mapping of str to float
            SI values.
        """
        return None

    def record_files(self, files: frozenset[str]) -> None:  # noqa: B027 - most models have none
        """Record files with which runs were made, here or in another process; see `Results`.

        Raises
        ------
        ModelError
            If other runs were made with another version of one of them.
        """

    def dependencies(self) -> frozenset[str]:
        """Return what its runs depend on besides their inputs, as far as it is known.

        The form is that of `Results.files`.
        """
        return frozenset()

    @property
    def uncompared(self) -> tuple[str, ...]:
        """Parts of it that `identity` and `dependencies` do not cover, in words."""
        return ()

    def files(self) -> tuple[FileSnapshot, ...]:
        """Return snapshots of the user's own files that it consisted of when it was run."""
        return ()

    def identity(self) -> dict[str, str]:
        """Return the properties that determine its results, to distinguish it from other models."""
        return {"name": self.name}

    def with_derived(self, derived: Sequence[DerivedOutput]) -> Self:
        """Return the same model with other derived outputs.

        It shares all else with this one: a copy by `copy` or `dataclasses` may load it anew.
        """
        if self.derived == tuple(derived):
            return self
        return self._with(derived=tuple(derived))

    def with_noise(self, noise: Noise) -> Self:
        """Return the same model with what a study says of its noise."""
        return self if self.noise == noise else self._with(noise=noise)

    def _with(self, **attributes: Any) -> Self:
        model = object.__new__(type(self))
        vars(model).update(vars(self), **attributes)
        return model

    def derive(
        self, outputs: Arrays, status: npt.NDArray[np.int8], inputs: Arrays
    ) -> dict[str, FloatArray]:
        """Return the values of all outputs of runs: those of the model, and the derived ones.

        Parameters
        ----------
        outputs, status
            As in `Results`; NaN in runs that are still to come.
        inputs : mapping of str to ndarray, shape (run,)
            SI values.
        """
        is_ok = status == Status.OK
        absent = {each.name for each in self.outputs if each.absent}
        for name in outputs.keys() - absent if self.derived else ():
            is_ok = is_ok & ~np.isnan(outputs[name].reshape(len(is_ok), -1)[:, 0])
        found = {**inputs, **outputs}
        for each in self.derived:
            found[each.output.name] = each.values(found, is_ok)
        return {name: found[name] for name in (*outputs, *(d.output.name for d in self.derived))}

    def input(self, name: str) -> Input:
        """Return the input named `name`."""
        return find_variable(self.inputs, name, "input", self.name)

    def output(self, name: str) -> Output:
        """Return the output named `name`."""
        return find_variable(self.outputs, name, "output", self.name)

    def missing_inputs(self, given: Collection[str]) -> Iterator[str]:
        """Yield the inputs that still have to be given; of alternatives, the first.

        A seed is not among them: each run gets one.
        """
        optional = {self.noise.seed, *given, *itertools.chain.from_iterable(self.alternatives)}
        for variable in self.inputs:
            if variable.default is None and variable.name not in optional:
                yield variable.name
        for group in self.alternatives:
            if not any(name in given for name in group):
                yield group[0]


def violated_conditions(model: Model, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
    """Yield a mask of the runs that violate a condition on a batch's inputs, and the condition."""
    for variable in model.inputs:
        if variable.name in inputs:
            inside = variable.bounds.contain(inputs[variable.name])
            yield ~inside, f"{variable.name} {variable.bounds}"
    # A NaN or an overflow in a condition makes it false, as it should.
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
