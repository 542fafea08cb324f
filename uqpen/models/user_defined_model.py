"""User's class as a model: from a file, a module or a package, or an object of this process."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray
from uqpen.core.errors import ModelError, TrajectoryError, UqpenError
from uqpen.core.files import FileSnapshot
from uqpen.core.interrupts import is_user_interrupt
from uqpen.core.limits import Limits
from uqpen.core.lookup import package_version
from uqpen.core.model import Input, Model, Output, Results, RunOutcome, empty_outputs
from uqpen.core.status import Status
from uqpen.models.dependencies import Dependencies
from uqpen.models.function_source import FunctionSource
from uqpen.models.observation import unseen_readers
from uqpen.models.run_grid import UnusableOutputError, extract_outputs
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_code import (
    ending_forks,
    error_text,
    one_line,
    pickle_by_value,
    restore_streams,
)
from uqpen.models.user_module import line_in_folder, load_module

if TYPE_CHECKING:
    import xarray as xr

Answer = TypeVar("Answer")


class UserModel(Model):
    """Base of the models of the user's code, from a folder or as an object of this process."""

    surroundings: ModelFolder | None
    source: FunctionSource | None
    observed: Dependencies
    is_untrusted = True

    @property
    def may_be_noisy(self) -> bool:
        return True

    @property
    def is_object(self) -> bool:
        return self.source is not None

    @property
    def is_absent(self) -> bool:
        return self.source is not None and self.source.is_absent

    @property
    def unknown_dependency(self) -> str:
        return self.source.unknown if self.source else ""

    def evaluate_observed(self, inputs: Arrays) -> Results:
        with self.record.observed_run():
            results = self.evaluate(inputs)
        return dataclasses.replace(results, files=results.files | self.record.lines_of_runs)

    def record_files(self, files: frozenset[str]) -> None:
        self.record.add_reported(files)

    def dependencies(self) -> frozenset[str]:
        return self.record.lines

    @property
    def uncompared(self) -> tuple[str, ...]:
        text = self.source.text if self.source else ""
        return tuple(unseen_readers(self.surroundings.text if self.surroundings else text))

    @property
    def record(self) -> Dependencies:
        """Record of what its runs depend on."""
        return self.surroundings or self.observed

    @property
    def source_identity(self) -> dict[str, str]:
        """Hash of its source, as far as it is known; empty for a model of an installed package."""
        if self.source is not None:
            return {"source_sha256": self.source.sha256 or "unknown"}
        if self.surroundings is None:
            return {}
        return {"source_sha256": hashlib.sha256(self.surroundings.sources()).hexdigest()}

    def in_folder(self) -> contextlib.AbstractContextManager[None]:
        """Return the context in which its code is called."""
        return self.surroundings.on_import_path() if self.surroundings else contextlib.nullcontext()

    def failed_run(self, error: BaseException) -> RunOutcome:
        """Return the run whose call has ended by an exception; Ctrl-C is raised again."""
        if isinstance(error, UnusableOutputError):
            return RunOutcome.failed(one_line(str(error)), error.status)
        if is_user_interrupt(error):
            raise error
        return RunOutcome.failed(error_text(error) + self.failed_line(error))

    def failed_line(self, error: BaseException) -> str:
        """Return the line of the user's code that an exception comes from; empty if unknown."""
        return line_in_folder(error, self.surroundings) if self.surroundings else ""


def batch_results(
    call: Callable[[slice], Answer | RunOutcome], runs: int
) -> Iterator[tuple[slice, Answer | RunOutcome]]:
    """Yield the answers for parts of a batch, in order: one bad run must not spoil it.

    A part is halved as long as its call fails, until the bad run is alone.
    """
    batches = [slice(0, runs)]
    while batches:
        batch = batches.pop()
        answer = call(batch)
        is_failed = isinstance(answer, RunOutcome) and answer.status != Status.OK
        if is_failed and batch.stop - batch.start > 1:
            middle = (batch.start + batch.stop) // 2
            batches += [slice(middle, batch.stop), slice(batch.start, middle)]
        else:
            yield batch, answer


@dataclass(frozen=True)
class UserDefinedModel(UserModel):
    """Model whose class is not one of the package's; its failures are data of its runs."""

    model: Model  # the model itself
    reference: str  # ``"file.py:Class"`` or ``"package.module:Class"``, or a name for display
    # The folder that the model must be called in; a hash of its source identifies the version.
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)
    # Source of a class that is an object of this process, without a file to load it from.
    source: FunctionSource | None = field(default=None, repr=False)
    observed: Dependencies = field(
        default_factory=partial(Dependencies, Path()), repr=False, compare=False
    )  # record of what the runs of a model without such a folder depend on
    name: str = field(init=False)
    inputs: tuple[Input, ...] = field(init=False)
    outputs: tuple[Output, ...] = field(init=False)
    alternatives: tuple[tuple[str, ...], ...] = field(init=False)
    vectorized: bool = field(init=False)
    enforced_limits: Limits = field(init=False)

    def __post_init__(self) -> None:
        for name in ("inputs", "outputs", "alternatives", "vectorized", "enforced_limits"):
            object.__setattr__(self, name, getattr(self.model, name))
        object.__setattr__(self, "name", self.reference)

    @property
    def unknown_dependency(self) -> str:
        return super().unknown_dependency or self.model.unknown_dependency

    @property
    def run_limits(self) -> Limits:
        return self.model.run_limits

    def prepare(self) -> None:
        with self._in_context("prepare"):
            self.model.prepare()

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        with self._in_context("conditions"):
            runs = len(next(iter(inputs.values())))
            found = []
            for satisfied, text in self.model.conditions(inputs):
                mask = np.asarray(satisfied)
                if mask.dtype != np.bool_ or mask.shape not in ((), (runs,)):
                    kind = f"{mask.dtype} of shape {mask.shape}"
                    raise ValueError(f"a condition is {kind}, not bool of shape {(runs,)}")
                found.append((np.broadcast_to(mask, runs), str(text)))
        yield from found

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset | None:
        import xarray as xr

        try:
            with self._in_context("trajectory"):
                found = self.model.trajectory(inputs)
                if found is None or isinstance(found, xr.Dataset):
                    return found
                raise TypeError(f"it returned {type(found).__name__}, not an xarray.Dataset")
        except ModelError as error:
            raise TrajectoryError(str(error)) from None

    def evaluate(self, inputs: Arrays) -> Results:
        runs = len(next(iter(inputs.values())))
        outputs = empty_outputs(self.outputs, runs)
        status = np.full(runs, Status.FAILED, dtype=np.int8)
        reasons: dict[int, str] = {}
        files = self.record.lines_of_runs

        def call(batch: slice) -> Results | RunOutcome:
            some = {name: values[batch].copy() for name, values in inputs.items()}
            try:
                with ending_forks():
                    returned = self.model.evaluate(some)
                return self._checked(returned, batch.stop - batch.start)
            except BaseException as error:  # any exception of a black box is data
                return self.failed_run(error)

        with self._in_context("evaluate"):
            for batch, answer in batch_results(call, runs):
                if isinstance(answer, RunOutcome):
                    reasons[batch.start] = answer.reason
                    continue
                for name, values in answer.outputs.items():
                    outputs[name][batch] = values
                status[batch] = answer.status
                reasons |= {batch.start + run: text for run, text in answer.reasons.items()}
                files |= answer.files
        return Results(outputs, status, reasons, files | self.record.lines_of_runs)

    def with_folder(self, folder: Path) -> Model:
        return self._with(model=self.model.with_folder(folder))

    @property
    def uncompared(self) -> tuple[str, ...]:
        return (*self.model.uncompared, *super().uncompared)

    def files(self) -> tuple[FileSnapshot, ...]:
        return (*self.record.files(), *self.model.files())

    def identity(self) -> dict[str, str]:
        # The text of the study has its settings.
        known = {**self.model.identity(), "name": self.name}
        if self.source is not None or self.surroundings is not None:
            return known | self.source_identity
        version = package_version(type(self.model).__module__)
        return known | ({"version": version} if version else {})

    def __reduce__(self) -> tuple[Any, ...]:
        if self.surroundings is None:
            observed = Dependencies(self.observed.folder)
            return _unpickle, (pickle_by_value(self.model), self.reference, self.source, observed)
        # Another process loads the class itself: its modules cannot be sent.
        fields = getattr(self.model, "__dataclass_fields__", {}).values()
        settings = {each.name: getattr(self.model, each.name) for each in fields if each.init}
        return _restore, (self.surroundings.folder, self.reference, settings)

    @contextlib.contextmanager
    def _in_context(self, method: str) -> Iterator[None]:
        """Provide the context of a call; an exception becomes a ModelError that names the method.

        Exceptions of `evaluate` itself are data of its runs, and do not come here.
        """
        try:
            with ending_forks(), restore_streams(), self.in_folder():
                yield
        except UqpenError:
            raise
        except BaseException as error:  # a user's method can raise anything
            if is_user_interrupt(error):
                raise
            raise ModelError(f"{self.name}: {method} failed: {error_text(error)}") from None

    def _checked(self, returned: object, runs: int) -> Results:
        """Return results with the declared outputs of each run.

        UnusableOutputError if they are no `Results`, or differ from what the class declares.
        """
        if not isinstance(returned, Results):
            raise UnusableOutputError(f"returned {type(returned).__name__}, not Results")
        outputs = extract_outputs(returned.outputs, self.outputs, runs)
        status = np.asarray(returned.status)
        if status.shape != (runs,):
            raise UnusableOutputError(f"returned a status of shape {status.shape}, not {(runs,)}")
        if unknown := sorted({*status.tolist()} - {*Status}, key=str):
            expected = ", ".join(f"Status.{each.name}" for each in Status)
            raise UnusableOutputError(f"returned a status {unknown[0]!r}, not one of {expected}")
        reasons = {
            run: one_line(str(returned.reasons.get(run) or "the model gives no reason"))
            for run in np.flatnonzero(status != Status.OK).tolist()
        }
        return Results(outputs, status.astype(np.int8), reasons, frozenset(returned.files))


def _unpickle(model: bytes, reference: str, *others: Any) -> UserDefinedModel:
    """Restore a model from its pickled form, its source and its record."""
    return UserDefinedModel(pickle.loads(model), reference, None, *others)


def _restore(folder: Path, reference: str, settings: Mapping[str, Any]) -> UserDefinedModel:
    """Load the class of a model again, and make the model from its settings."""
    module, attribute, surroundings = load_module(reference, folder, "my_model.py:MyModel")
    return UserDefinedModel(getattr(module, attribute)(**settings), reference, surroundings)
