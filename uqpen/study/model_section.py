"""``[model]``: a built-in model by name, or one of the user's own with its units."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from uqpen.core.errors import ModelError, toml_text
from uqpen.core.lookup import choices, resolve
from uqpen.core.model import Model
from uqpen.execution.memory_limit import CAN_LIMIT
from uqpen.models import MODELS
from uqpen.models.python_function import PythonFunction, check_signature, load_function
from uqpen.study.limits_section import read_limits
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import read_variables

__all__ = ["EXTERNAL_MODELS", "read_model"]

# The keys that name a model from outside, and who reads its table: called with the table, the
# folder of the study, and whether what it names may be executed or asked.
EXTERNAL_MODELS = {
    "python": "uqpen.study.model_section:read_function",
    "command": "uqpen.study.command_section:read_command",
    "umbridge": "uqpen.study.umbridge_section:read_umbridge",
}

_MODEL_KEYS = {
    "use": 'use = "…" (a built-in model)',
    "python": 'python = "my_model.py:function"',
    "command": 'command = ["./program", …]',
    "umbridge": 'umbridge = "http://…" (a server)',
}


def read_model(table: TableReader, folder: Path, *, trust: bool) -> Model | None:
    """The model of a study, or None where a mistake was noted.

    Parameters
    ----------
    table : TableReader
        Of the model.
    folder : Path
        Where the study lies.
    trust : bool
        Whether what it names may be executed or asked; if not, the model cannot be run.
    """
    ways = [key for key in _MODEL_KEYS if key in table]
    if len(ways) != 1:
        found = "nothing that names a model" if not ways else " and ".join(ways)
        table.add_problem((), found, f"one of {', '.join(_MODEL_KEYS.values())}")
        return None
    model: Model | None
    if ways == ["use"]:
        model = _built_in(table)
    else:
        model = resolve(EXTERNAL_MODELS[ways[0]])(table, folder, trust=trust)
    if model is not None:
        table.check_unknown_keys()
    return model


def _built_in(table: TableReader) -> Model | None:
    name = table.text("use", "the name of a model")
    if name is None:
        return None
    if name not in MODELS:
        table.add_problem("use", toml_text(name), f"a built-in model; {choices(name, MODELS)}")
        return None
    model: Model | None = table.settings(resolve(MODELS[name]))
    return model


def read_function(table: TableReader, folder: Path, *, trust: bool) -> Model | None:
    """A Python function as a model, or None where a mistake was noted."""
    noted = len(table.problems)
    reference = table.text("python", "a function")
    vectorized = table.flag("vectorized", default=False)
    limits = read_limits(table, can_limit_memory=CAN_LIMIT or not trust)
    if vectorized and limits:
        limit = "time_limit" if limits.seconds is not None else "memory_limit"
        table.add_problem(limit, "a limit of one run", "vectorized = false, so that runs are apart")
    inputs, outputs, units = read_variables(table)
    if reference is None or len(table.problems) > noted:
        return None
    load = load_function if trust else _unloaded_function
    try:
        function, surroundings = load(reference, folder)
        check_signature(function, [variable.name for variable in inputs])
    except ModelError as error:
        table.add_problem(
            "python", str(error), "a function that can be called with the model's inputs"
        )
        return None
    return PythonFunction(
        function, reference, inputs, outputs, units, vectorized, surroundings, limits
    )


def _unloaded_function(reference: str, folder: Path) -> tuple[Callable[..., Any], None]:
    """In place of a function that is not to be executed, one that says so."""

    def refuse(**inputs: float) -> Any:
        raise ModelError(f"{reference} is not executed without --trust")

    return refuse, None
