"""User's class as a model: from a file, a module or a package, or an object of this process."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import pickle
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import Arrays, BoolArray
from uqpen.core.errors import ModelError, TrajectoryError, UqpenError
from uqpen.core.files import FileSnapshot
from uqpen.core.interrupts import is_user_interrupt
from uqpen.core.limits import Limits
from uqpen.core.lookup import package_version
from uqpen.core.model import Input, Model, Output, Results, empty_outputs
from uqpen.core.status import Status
from uqpen.models.dependencies import Dependencies
from uqpen.models.failed_line import line_in_folder
from uqpen.models.function_outputs import extract_outputs
from uqpen.models.function_source import FunctionSource
from uqpen.models.observation import unseen_readers
from uqpen.models.run_grid import UnusableOutputError
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_code import (
    end_forked_child,
    error_text,
    one_line,
    pickle_by_value,
    restore_streams,
)
from uqpen.models.user_module import load_module

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["UserDefinedModel"]


@dataclass(frozen=True)
class UserDefinedModel(Model):
    """Model whose class is not one of the package's; its failures are data of its runs.

    Parameters
    ----------
    model : Model
        The model itself.
    reference : str
        ``"file.py:Class"`` or ``"package.module:Class"``, or a name for display.
    surroundings : ModelFolder, optional
        The folder that the model must be called in; a hash of its source identifies the version.
    source : FunctionSource, optional
        Source of a class that is an object of this process, without a file to load it from.
    observed : Dependencies
        Record of what the runs of a model without such a folder depend on.
    """

    model: Model
    reference: str
    surroundings: ModelFolder | None = field(default=None, repr=False, compare=False)
    source: FunctionSource | None = field(default=None, repr=False)
    observed: Dependencies = field(
        default_factory=partial(Dependencies, Path()), repr=False, compare=False
    )
    name: str = field(init=False)
    inputs: tuple[Input, ...] = field(init=False)
    outputs: tuple[Output, ...] = field(init=False)
    alternatives: tuple[tuple[str, ...], ...] = field(init=False)
    vectorized: bool = field(init=False)
    enforced_limits: Limits = field(init=False)
    is_untrusted: bool = field(default=True, init=False)

    def __post_init__(self) -> None:
        for name in ("inputs", "outputs", "alternatives", "vectorized", "enforced_limits"):
            object.__setattr__(self, name, getattr(self.model, name))
        object.__setattr__(self, "name", self.reference)

    @property
    def is_object(self) -> bool:
        return self.source is not None

    @property
    def unknown_dependency(self) -> str:
        return self.source.unknown if self.source else self.model.unknown_dependency

    @property
    def run_limits(self) -> Limits:
        return self.model.run_limits

    def prepare(self) -> None:
        with self._in_context("prepare"):
            self.model.prepare()

    def conditions(self, inputs: Arrays) -> Iterator[tuple[BoolArray, str]]:
        with self._in_context("conditions"):
            found = [
                (_mask(mask, len(next(iter(inputs.values())))), str(text))
                for mask, text in self.model.conditions(inputs)
            ]
        yield from found

    def trajectory(self, inputs: Mapping[str, float]) -> xr.Dataset | None:
        try:
            with self._in_context("trajectory"):
                return _dataset(self.model.trajectory(inputs))
        except ModelError as error:
            raise TrajectoryError(str(error)) from None

    def evaluate(self, inputs: Arrays) -> Results:
        with self._in_context("evaluate"):
            results = self._evaluate(inputs, len(next(iter(inputs.values()))))
        return dataclasses.replace(results, files=results.files | self._record.lines_of_runs)

    def evaluate_observed(self, inputs: Arrays) -> Results:
        with self._record.observed_run():
            results = self.evaluate(inputs)
        return dataclasses.replace(results, files=results.files | self._record.lines_of_runs)

    def with_folder(self, folder: Path) -> Model:
        return dataclasses.replace(self, model=self.model.with_folder(folder))

    def record_files(self, files: frozenset[str]) -> None:
        self._record.add_reported(files)

    def dependencies(self) -> frozenset[str]:
        return self._record.lines

    @property
    def uncompared(self) -> tuple[str, ...]:
        text = self.source.text if self.source else ""
        readers = unseen_readers(self.surroundings.text if self.surroundings else text)
        return (*self.model.uncompared, *readers)

    def files(self) -> tuple[FileSnapshot, ...]:
        return (*self._record.files(), *self.model.files())

    @property
    def _record(self) -> ModelFolder | Dependencies:
        return self.surroundings or self.observed

    def identity(self) -> dict[str, str]:
        # The text of the study has its settings.
        known = {**self.model.identity(), "name": self.name}
        if self.source is not None:
            return known | {"source_sha256": self.source.sha256 or "unknown"}
        if self.surroundings is None:
            version = package_version(type(self.model).__module__)
            return known | ({"version": version} if version else {})
        sources = self.surroundings.sources()
        return known | {"source_sha256": hashlib.sha256(sources).hexdigest()}

    def __reduce__(self) -> tuple[Any, ...]:
        if self.surroundings is None:
            observed = Dependencies(self.observed.folder)
            return _unpickle, (pickle_by_value(self.model), self.reference, self.source, observed)
        # Another process loads the class itself: its modules cannot be sent.
        return _restore, (self.surroundings.folder, self.reference, _settings(self.model))

    @contextlib.contextmanager
    def _in_context(self, method: str) -> Iterator[None]:
        """Provide the context of a call; an exception becomes a ModelError that names the method.

        Exceptions of `evaluate` itself are data of its runs, and do not come here.
        """
        place = self.surroundings.on_import_path() if self.surroundings else None
        process = os.getpid()
        try:
            with restore_streams(), place or contextlib.nullcontext():
                yield
        except UqpenError as error:
            end_forked_child(process, error)
            raise
        except BaseException as error:  # a user's method can raise anything
            end_forked_child(process, error)
            if is_user_interrupt(error):
                raise
            raise ModelError(f"{self.name}: {method} failed: {error_text(error)}") from None
        end_forked_child(process)

    def _evaluate(self, inputs: Arrays, runs: int) -> Results:
        """Return the results of a batch; one bad run does not spoil it."""
        process = os.getpid()
        own = {name: values.copy() for name, values in inputs.items()}
        try:
            results = self._checked(self.model.evaluate(own), runs)
        except UnusableOutputError as refused:
            reason = one_line(str(refused))
        except BaseException as error:  # any exception of a black box is data
            end_forked_child(process, error)
            if is_user_interrupt(error):
                raise
            reason = error_text(error) + self._failed_line(error)
        else:
            end_forked_child(process)
            return results
        end_forked_child(process)
        if runs == 1:
            failed = np.full(1, Status.FAILED, dtype=np.int8)
            return Results(empty_outputs(self.outputs, 1), failed, {0: reason})
        middle = runs // 2
        first, second = slice(0, middle), slice(middle, runs)
        return _join(
            self._evaluate({name: values[first] for name, values in inputs.items()}, middle),
            self._evaluate(
                {name: values[second] for name, values in inputs.items()}, runs - middle
            ),
        )

    def _failed_line(self, error: BaseException) -> str:
        return line_in_folder(error, self.surroundings) if self.surroundings else ""

    def _checked(self, returned: object, runs: int) -> Results:
        """Return results with the declared outputs of each run.

        Raises
        ------
        UnusableOutputError
            If they are no `Results`, or differ from what the class declares.
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


def _mask(satisfied: object, runs: int) -> BoolArray:
    """Return the mask of a condition; ValueError for anything but a truth value for each run."""
    mask = np.asarray(satisfied)
    if mask.dtype != np.bool_ or mask.shape not in ((), (runs,)):
        found = f"{mask.dtype} of shape {mask.shape}"
        raise ValueError(f"a condition is {found}, not bool of shape {(runs,)}")
    return np.broadcast_to(mask, runs)


def _dataset(found: object) -> xr.Dataset | None:
    """Return the trajectory of a run; TypeError for anything but a dataset or None."""
    import xarray as xr

    if found is None or isinstance(found, xr.Dataset):
        return found
    raise TypeError(f"it returned {type(found).__name__}, not an xarray.Dataset")


def _join(first: Results, second: Results) -> Results:
    """Return the results of two batches as those of one."""
    runs = len(first.status)
    outputs = {
        name: np.concatenate([values, second.outputs[name]])
        for name, values in first.outputs.items()
    }
    reasons = {runs + run: reason for run, reason in second.reasons.items()}
    status = np.concatenate([first.status, second.status])
    return Results(outputs, status, {**first.reasons, **reasons}, first.files | second.files)


def _settings(model: Model) -> dict[str, Any]:
    """Return the settings of a model whose class is a dataclass; none of another class."""
    fields = getattr(model, "__dataclass_fields__", {}).values()
    return {each.name: getattr(model, each.name) for each in fields if each.init}


def _unpickle(model: bytes, reference: str, *others: Any) -> UserDefinedModel:
    """Restore a model from its pickled form, its source and its record."""
    return UserDefinedModel(pickle.loads(model), reference, None, *others)


def _restore(folder: Path, reference: str, settings: Mapping[str, Any]) -> UserDefinedModel:
    """Load the class of a model again, and make the model from its settings."""
    module, attribute, surroundings = load_module(reference, folder, "my_model.py:MyModel")
    return UserDefinedModel(getattr(module, attribute)(**settings), reference, surroundings)
