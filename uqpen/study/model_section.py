"""``[model]``: a built-in model by name, or a function of the user's own with its units."""

from __future__ import annotations

from pathlib import Path

from uqpen.errors import ModelError, QuantityError, as_written
from uqpen.labels import NAME, RESERVED, SUFFIXES
from uqpen.lookup import choices, resolve
from uqpen.model import Input, Model, Output
from uqpen.models import MODELS
from uqpen.models.python_function import FunctionLoader, PythonFunction, check_signature
from uqpen.study.section import Section
from uqpen.units import si_unit

__all__ = ["read_model"]

_WAYS = 'use = "…" (a built-in model) or python = "my_model.py:function"'


def read_model(table: Section, folder: Path, load: FunctionLoader) -> Model | None:
    """The model of a study, or None where a mistake was noted."""
    ways = [key for key in ("use", "python") if key in table]
    if len(ways) != 1:
        found = "nothing that names a model" if not ways else " and ".join(ways)
        table.wrong((), found, f"one of {_WAYS}")
        return None
    model = _built_in(table) if ways == ["use"] else _function(table, folder, load)
    if model is not None:
        table.close()
    return model


def _built_in(table: Section) -> Model | None:
    name = table.text("use", "the name of a model")
    if name is None:
        return None
    if name not in MODELS:
        table.wrong("use", as_written(name), f"a built-in model; {choices(name, MODELS)}")
        return None
    model: Model | None = table.settings(resolve(MODELS[name]))
    return model


def _function(table: Section, folder: Path, load: FunctionLoader) -> Model | None:
    noted = len(table.problems)
    reference = table.text("python", "a function")
    vectorized = table.flag("vectorized", default=False)
    called_in: dict[str, str] = {}
    inputs = [
        Input(name, si_unit(unit), display_unit=unit)
        for name, unit in _variables(table, "inputs", called_in)
    ]
    outputs = [
        Output(name, si_unit(unit), display_unit=unit)
        for name, unit in _variables(table, "outputs", called_in)
    ]
    if reference is None or len(table.problems) > noted:
        return None
    try:
        function, surroundings = load(reference, folder)
        check_signature(function, [variable.name for variable in inputs])
    except ModelError as error:
        table.wrong("python", str(error), "a function that can be called with the model's inputs")
        return None
    return PythonFunction(
        function, reference, tuple(inputs), tuple(outputs), called_in, vectorized, surroundings
    )


def _clash(name: str, section: Section) -> str | None:
    """Another output that has a statistic by this name."""
    for other in section:
        stem, _, suffix = name.removeprefix(other).partition("_")
        if name.startswith(other) and not stem and suffix in SUFFIXES:
            return other
    return None


def _variables(table: Section, key: str, called_in: dict[str, str]) -> list[tuple[str, str]]:
    """Names and units of a model's inputs or outputs."""
    does = "takes" if key == "inputs" else "gives"
    section = table.table(key, f'what the model {does}, as name = "unit"')
    if section is None:
        return []
    if not section.content:
        section.wrong((), "an empty table", 'at least one name = "unit"')
    found = []
    for name in section:
        unit = section.take(name)
        if not NAME.match(name) or name in RESERVED:
            expected = f"a name of letters, digits and _, none of {', '.join(sorted(RESERVED))}"
            section.wrong(name, as_written(name), expected)
        elif name in called_in:
            section.wrong(name, "an output with the name of an input", "names that differ")
        elif key == "outputs" and (clash := _clash(name, section)) is not None:
            section.wrong(name, as_written(name), f'a name other than what "{clash}" brings along')
        elif not isinstance(unit, str):
            section.wrong(name, as_written(unit), 'a unit such as "cm", or "1" where there is none')
        else:
            try:
                si_unit(unit)
            except QuantityError as error:
                section.wrong(name, error.found, error.expected)
                continue
            called_in[name] = unit or "1"
            found.append((name, called_in[name]))
    return found
