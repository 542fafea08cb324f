"""``[model]``: a built-in model by name, or a user-defined one with its units.

Of a table with mistakes, a partial model is read, so that the rest of a study can be read all the
same.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.errors import ModelError
from uqpen.core.limits import Limits
from uqpen.core.lookup import resolve
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.settings import flag, text
from uqpen.core.units import ANY_DIMENSION
from uqpen.execution.memory_limit import CAN_LIMIT
from uqpen.models import MODELS
from uqpen.models.python_function import PythonFunction, check_inputs
from uqpen.models.surroundings import ModelFolder
from uqpen.models.user_module import find_function, load_module, module_coordinates
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import Variables, read_variables, refuse_grids

__all__ = [
    "USER_DEFINED_MODELS",
    "PartialModel",
    "check_function_grids",
    "mentioned_model",
    "read_function_limits",
    "read_limits",
    "read_model",
    "read_partial_model",
    "unloaded_function",
]

_WORD = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True, eq=False)
class PartialModel(Model):
    """The inputs and outputs of a model that could not be read in full; it cannot be run.

    A variable whose unit is not known is of `ANY_DIMENSION`.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    alternatives: tuple[tuple[str, ...], ...] = ()

    def evaluate(self, inputs: Arrays) -> Results:
        """Refuse to run: the study has mistakes."""
        raise NotImplementedError(self.name)


def mentioned_model(root: TableReader) -> PartialModel:
    """Return a model with all variables that a study mentions, of any dimension."""
    content = root.content
    published = _tables(content.get("published"))
    of_outputs = [figures for each in published for figures in _tables(each)]
    inputs = {
        *_keys(content.get("inputs")),
        *(name for figures in of_outputs for name in _keys(figures.get("response"))),
        *(
            str(each["largest_contribution"])
            for each in of_outputs
            if "largest_contribution" in each
        ),
        *(str(name) for group in _tables(content.get("joint")) for name in _list(group, "inputs")),
        *(name for model in _tables(content.get("models")) for name in _keys(model.get("with"))),
        *_WORD.findall(str(content.get("constraints", ""))),
    }
    surrogates = _tables(content.get("surrogates"))
    outputs = {
        *_keys(content.get("outputs")),
        *(name for each in published for name in each if name != "source"),
        *(name for each in surrogates for name in _keys(each.get("transform"))),
    }
    return PartialModel(
        "the model",
        tuple(Input(name, ANY_DIMENSION) for name in sorted(inputs)),
        tuple(Output(name, ANY_DIMENSION) for name in sorted(outputs)),
    )


def _keys(value: Any) -> Iterable[str]:
    return value if isinstance(value, dict) else ()


def _list(table: dict[str, Any], key: str) -> list[Any]:
    value = table.get(key)
    return value if isinstance(value, list) else []


def _tables(value: Any) -> list[dict[str, Any]]:
    entries = value.values() if isinstance(value, dict) else ()
    return [entry for entry in entries if isinstance(entry, dict)]


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
