"""``[model]``: a built-in model by name, or a user-defined one with its units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import ModelError
from uqpen.core.limits import Limits
from uqpen.core.lookup import resolve
from uqpen.core.model import Model
from uqpen.core.settings import flag, text
from uqpen.execution.memory_limit import CAN_LIMIT
from uqpen.models import MODELS
from uqpen.models.python_function import PythonFunction, check_inputs
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_module import find_function, load_module, module_coordinates
from uqpen.study.dimensions_section import refuse_grids
from uqpen.study.partial_model import PartialModel
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import Variables, read_variables

__all__ = [
    "USER_DEFINED_MODELS",
    "check_function_grids",
    "read_function_limits",
    "read_limits",
    "read_model",
    "read_partial_model",
    "unloaded_function",
]

# The keys that name a user-defined model, and the readers of its table.
USER_DEFINED_MODELS = {
    "python": "uqpen.study.model_section:read_function",
    "command": "uqpen.study.command_section:read_command",
    "umbridge": "uqpen.study.umbridge_section:read_umbridge",
    "object": "uqpen.study.model_class_section:read_object",
    "data": "uqpen.study.data_section:read_data",
}

# The reader of a table whose ``use`` names no built-in model.
_CLASS_READER = "uqpen.study.model_class_section:read_model_class"

_MODEL_KEYS = {
    "use": 'use = "…" (a built-in model)',
    "python": 'python = "my_model.py:function"',
    "command": 'command = ["./program", …]',
    "umbridge": 'umbridge = "http://…" (a server)',
    "data": 'data = "runs.csv" (runs that are there)',
}


def read_model(table: TableReader) -> Model | None:
    """Read the model of a study; None where a mistake was noted.

    Without trust, none of its code is executed and no server gets requests; it cannot be run.
    """
    ways = [key for key in ("use", *USER_DEFINED_MODELS) if key in table]
    if len(ways) != 1:
        found = "nothing that names a model" if not ways else " and ".join(ways)
        table.add_problem((), found, f"one of {', '.join(_MODEL_KEYS.values())}")
        return None
    model: Model | None
    if ways == ["use"] and table.content["use"] not in list(MODELS):
        model = resolve(_CLASS_READER)(table)
        if model is None:
            return None  # whose settings nobody knows
    elif ways == ["use"]:
        model = table.settings(resolve(MODELS[table.take("use")]))
    else:
        model = resolve(USER_DEFINED_MODELS[ways[0]])(table)
    table.check_unknown_keys()
    return model


def read_partial_model(table: TableReader, mentioned: PartialModel) -> PartialModel:
    """Return a model with mistakes, as far as its table states its inputs and outputs.

    Where it does not, they are those of `mentioned`.
    """
    ways = [key for key in ("use", *USER_DEFINED_MODELS) if key in table]
    if len(ways) != 1:
        return mentioned
    name = table.content[ways[0]]
    if ways == ["data"]:
        return mentioned
    if ways == ["use"]:
        if not isinstance(name, str) or name not in MODELS:
            return mentioned
        model = resolve(MODELS[name])()
        return PartialModel(model.name, model.inputs, model.outputs, model.alternatives)
    inputs, outputs, *_ = read_variables(table, lambda name: None)
    title = name if isinstance(name, str) else "the model"
    return PartialModel(title, inputs or mentioned.inputs, outputs or mentioned.outputs)


@dataclass(frozen=True)
class _FunctionSettings:
    """Settings of a Python function as a model."""

    python: str = text(expected="a function")
    vectorized: bool = flag(default=False)


def read_function(table: TableReader) -> Model | None:
    """Read a Python function as a model; None where a mistake was noted."""
    noted = len(table.problems)
    settings = table.settings(_FunctionSettings)
    is_vectorized = settings is not None and settings.vectorized
    limits = read_function_limits(table, is_vectorized=is_vectorized)
    code = _UserCode(settings.python if settings else "", table.folder, table.trust)
    variables = read_variables(table, code.coordinates)
    check_function_grids(table, variables, is_vectorized=is_vectorized)
    if settings is None or len(table.problems) > noted:
        return None
    inputs, outputs, units, fields = variables
    try:
        function, surroundings = code.function()
        check_inputs(function, inputs)
    except ModelError as error:
        expected = "a function that can be called with the model's inputs"
        table.add_problem("python", str(error), expected)
        return None
    declared = (settings.python, inputs, outputs, units, is_vectorized, surroundings, limits)
    return PythonFunction(function, *declared, fields=fields)


@dataclass(frozen=True)
class _UserCode:
    """Code of the user's that a reference names; it is loaded once, and only if it is trusted."""

    reference: str
    folder: Path
    trust: bool

    @cached_property
    def _loaded(self) -> tuple[ModuleType, str, ModelFolder]:
        return load_module(self.reference, self.folder)

    def function(self) -> tuple[Callable[..., Any], ModelFolder | None]:
        """Return the function, or what refuses its place, and the folder to call it in."""
        if not self.trust:
            return unloaded_function(self.reference)
        module, name, surroundings = self._loaded
        return find_function(module, name, self.reference), surroundings

    def coordinates(self, name: str) -> FloatArray:
        """Return the coordinates that the module of the function has under a name."""
        if not self.trust:
            raise ModelError(f'"{name}": {self.reference} is not executed without --trust')
        module, _, surroundings = self._loaded
        return module_coordinates(module, name, surroundings)


def check_function_grids(table: TableReader, variables: Variables, *, is_vectorized: bool) -> None:
    """Note grids of a run's own where a call of the function makes many runs."""
    if is_vectorized:
        expected = "vectorized = false, so that each run is a call of its own"
        refuse_grids(table, variables.fields, expected)


def read_limits(table: TableReader) -> Limits:
    """Read the limits of one run; with trust, note one that this system cannot keep."""
    if "memory_limit" in table and table.trust and not CAN_LIMIT:
        expected = "no limit on memory: this system cannot keep one"
        table.add_wrong("memory_limit", table.content["memory_limit"], expected)
    return table.settings(Limits) or Limits()


def read_function_limits(table: TableReader, *, is_vectorized: bool) -> Limits:
    """Read the limits of one run; note one where a call of the function makes many runs."""
    limits = read_limits(table)
    if is_vectorized and limits:
        limit = "time_limit" if limits.seconds is not None else "memory_limit"
        table.add_problem(
            limit, "a limit of one run", "vectorized = false, so that each run is a call of its own"
        )
    return limits


def unloaded_function(reference: str) -> tuple[Callable[..., Any], None]:
    """Return a replacement for a function that must not be executed."""

    def refuse(**inputs: float) -> Any:
        raise ModelError(f"{reference} is not executed without --trust")

    return refuse, None
