"""User's Python function as a model, called in this process."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import os
import pickle
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, floats
from uqpen.core.errors import ModelError
from uqpen.core.files import FileSnapshot
from uqpen.core.interrupts import is_user_interrupt
from uqpen.core.limits import Limits
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.models.foreign_code import end_forked_child, error_text, restore_streams
from uqpen.models.function_source import FunctionSource
from uqpen.models.reasons import one_line
from uqpen.models.surroundings import ModelFolder

__all__ = ["PythonFunction", "check_signature", "load_function", "load_module"]


class _UnusableError(Exception):
    """Returned value that differs from the declared outputs; the message is a run's reason."""


@dataclass(frozen=True)
class PythonFunction(Model):
    """Model that calls a Python function by keyword.

    Parameters
    ----------
    function : callable
        Takes a keyword argument for each input, returns a mapping with each output; values are in
        the units of `units`.
    name : str
        Name for display; with surroundings, the reference for `load_function`.
    units : mapping of str to str
        The unit that the function takes each input and gives each output in.
    vectorized : bool
        Whether it takes and returns arrays of shape (run,); else one float for each.
    surroundings : ModelFolder, optional
        The folder that the function must be called in; a hash of its source identifies the version
        of the model.
    enforced_limits : Limits
        Limits of one run; if anything is limited, runs are made in a process of their own.
    source : FunctionSource, optional
        The source of a function that is an object of this process, without a file to load it from.
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
        outputs = {output.name: np.full(runs, np.nan) for output in self.outputs}
        status = np.full(runs, Status.OK, dtype=np.int8)
        reasons: dict[int, str] = {}
        folder = self.surroundings.on_import_path() if self.surroundings else nullcontext()
        with restore_streams(), folder:
            for batch, answer in self._batch_results(arguments, runs):
                if isinstance(answer, str):
                    status[batch] = Status.FAILED
                    reasons[batch.start] = answer
                    continue
                for name, values in answer.items():
                    outputs[name][batch] = values
        for output in self.outputs:
            measure = scale(self.units[output.name])
            outputs[output.name] = measure.array_to_si(outputs[output.name])
        imported = self.surroundings.imported if self.surroundings else frozenset()
        return Results(outputs, status, reasons, imported)

    def record_files(self, files: frozenset[str]) -> None:
        if self.surroundings:
            self.surroundings.add_imported(files)

    def files(self) -> tuple[FileSnapshot, ...]:
        return self.surroundings.files() if self.surroundings else ()

    def __reduce__(self) -> tuple[Any, ...]:
        # Another process loads the function itself: its modules cannot be sent.
        declared = (self.name, self.inputs, self.outputs, self.units, self.vectorized)
        if self.surroundings is None:
            function = _pickle_by_value(self.function)
            return _unpickle, (function, *declared, None, self.enforced_limits, self.source)
        return _restore, (self.surroundings.folder, *declared, self.enforced_limits)

    def identity(self) -> dict[str, str]:
        if self.source is not None:
            return {"name": self.name, "source_sha256": self.source.sha256 or "unknown"}
        if self.surroundings is None:
            return {"name": self.name}
        sources = self.surroundings.sources()
        return {"name": self.name, "source_sha256": hashlib.sha256(sources).hexdigest()}

    def _batch_results(
        self, arguments: Arrays, runs: int
    ) -> Iterator[tuple[slice, dict[str, FloatArray] | str]]:
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
            if isinstance(answer, str) and batch.stop - batch.start > 1:
                # One bad run must not spoil its batch: halve until it is alone.
                middle = (batch.start + batch.stop) // 2
                batches += [slice(middle, batch.stop), slice(batch.start, middle)]
            else:
                yield batch, answer

    def _call(self, arguments: Mapping[str, Any], runs: int | None) -> dict[str, FloatArray] | str:
        """Return the outputs of one call, or the reason why there are none."""
        process = os.getpid()
        answer: dict[str, FloatArray] | str
        try:
            returned = self.function(**arguments)
            answer = _check_outputs(returned, [output.name for output in self.outputs], runs)
        except _UnusableError as refused:
            answer = one_line(str(refused))
        except BaseException as error:  # any exception of a black box is data
            end_forked_child(process, error)
            if is_user_interrupt(error):
                raise
            answer = error_text(error)
        end_forked_child(process)
        return answer


def _check_outputs(returned: object, names: list[str], runs: int | None) -> dict[str, FloatArray]:
    """Extract the outputs from the value that a function returned, which can be anything."""
    if not isinstance(returned, Mapping):
        raise _UnusableError(f"returned {type(returned).__name__}, not a mapping of outputs")
    shape = () if runs is None else (runs,)
    outputs = {}
    for name in names:
        if name not in returned:
            raise _UnusableError(f'returned no "{name}"')
        try:
            values = floats(returned[name])
        except ValueError as error:
            raise _UnusableError(f'returned a "{name}" of {error}') from None
        if values.shape != shape:
            raise _UnusableError(f'returned a "{name}" of shape {values.shape}, not {shape}')
        outputs[name] = values
    return outputs


def load_function(reference: str, folder: Path) -> tuple[Callable[..., Any], ModelFolder]:
    """Load the function of ``"file.py:function"`` or ``"package.module:function"``.

    Parameters
    ----------
    reference : str
        A path ends in ``.py`` and is relative to `folder`; anything else is an importable module.
    folder : Path
        Folder of the study file; modules beside it can be imported.

    Returns
    -------
    function, surroundings
        The function, and the folder that it must be called in.

    Raises
    ------
    ModelError
        If there is no such function, or importing it fails.
    """
    module, name, surroundings = load_module(reference, folder)
    function = getattr(module, name, None)
    if not callable(function):
        known = [key for key, value in vars(module).items() if inspect.isfunction(value)]
        listing = f"; it defines {', '.join(known)}" if known else ""
        where = reference.rpartition(":")[0]
        raise ModelError(f'"{where}" has no function "{name}"{listing}')
    return function, surroundings


def load_module(
    reference: str, folder: Path, form: str = "my_model.py:function"
) -> tuple[ModuleType, str, ModelFolder]:
    """Load the module of a reference such as those of `load_function`.

    Returns
    -------
    module, name, surroundings
        The module, the name after the colon, and the folder that the module belongs to.

    Raises
    ------
    ModelError
        If the reference is not of the form, there is no such module, or importing it fails.
    """
    where, _, name = reference.rpartition(":")
    if not where or not name:
        raise ModelError(f'"{reference}" is not of the form "{form}"')
    surroundings = ModelFolder(folder)
    with surroundings.on_import_path():
        module = _import_module(where, folder)
    if where.endswith(".py"):
        # It may lie outside the folder.
        surroundings.read(str(folder / where))
    return module, name, surroundings


def _pickle_by_value(function: Callable[..., Any]) -> bytes:
    """Pickle a function that may be defined in a notebook or inside another function.

    Only processes that this one has started read it, from the pipe to them.

    Raises
    ------
    ModelError
        If it refers to something that exists in this process only.
    """
    import cloudpickle

    try:
        return bytes(cloudpickle.dumps(function))
    except Exception as error:  # a foreign object can raise anything while it is pickled
        raise ModelError(
            f"the model cannot be sent to another process: {error_text(error)}"
        ) from None


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
) -> PythonFunction:
    """Restore a model from its declaration, and load its function again."""
    function, surroundings = load_function(reference, folder)
    return PythonFunction(
        function, reference, inputs, outputs, units, vectorized, surroundings, limits
    )


def check_signature(function: Callable[..., Any], names: list[str]) -> None:
    """Check that a function takes these keywords; ModelError gives its signature if it does not."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # some compiled functions have none; the first run will show it
        return
    try:
        signature.bind(**dict.fromkeys(names, 0.0))
    except TypeError as error:
        label = getattr(function, "__name__", "the function")
        raise ModelError(f"{label}{signature} cannot take the inputs: {error}") from None


def _import_module(where: str, folder: Path) -> Any:
    try:
        if where.endswith(".py"):
            return _load_file(folder / where)
        return importlib.import_module(where)
    except ModelError:
        raise
    except ModuleNotFoundError as error:
        raise ModelError(f'"{where}": {error}') from None
    except (Exception, SystemExit) as error:  # a user's module can raise anything when imported
        place = traceback.extract_tb(error.__traceback__)[-1]
        line = getattr(error, "lineno", None) or place.lineno
        text = f'importing "{where}" failed at line {line}: {error_text(error)}'
        raise ModelError(one_line(text)) from None


def _load_file(path: Path) -> Any:
    if not path.is_file():
        raise ModelError(f'there is no file "{path.name}" beside the study')
    # Under a name of our own: a model in "random.py" must not stand in for Python's module.
    specification = importlib.util.spec_from_file_location(f"uqpen_study_{path.stem}", path)
    if specification is None or specification.loader is None:
        raise ModelError(f'"{path.name}" is not a Python file')
    module = importlib.util.module_from_spec(specification)
    sys.modules[module.__name__] = module
    specification.loader.exec_module(module)
    return module
