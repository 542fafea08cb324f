"""``[model]``, or ``[models.<name>]`` where the same points go through several.

Of a table with mistakes, a partial model is read, so that the rest of a study can be read all the
same.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, is_finite_number
from uqpen.core.errors import ModelError, QuantityError, toml_text
from uqpen.core.labels import FINER_THAN, NAME, OUTCOME_OUTPUT, RANDOM_SEED, RESERVED, STANDS_FOR
from uqpen.core.limits import Limits
from uqpen.core.lookup import choices, nearest, resolve
from uqpen.core.model import (
    Bounds,
    Category,
    Dimension,
    Input,
    Model,
    Noise,
    Output,
    Results,
    Variable,
)
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import declared_settings, flag, text
from uqpen.core.units import ANY_DIMENSION, DIMENSIONLESS, are_convertible, si_unit
from uqpen.execution.memory_limit import CAN_LIMIT
from uqpen.models import MODELS
from uqpen.models.dependencies import Dependencies
from uqpen.models.function_source import FunctionSource, function_source
from uqpen.models.outcomes import with_outcomes
from uqpen.models.python_function import PythonFunction, check_inputs
from uqpen.models.surroundings import ModelFolder
from uqpen.models.unloaded_model import UnloadedModel
from uqpen.models.user_defined_model import UserDefinedModel
from uqpen.models.user_module import find_function, load_module, module_coordinates
from uqpen.study.document import inner_table
from uqpen.study.outcomes_section import (
    OF_FUNCTIONS,
    add_outcomes,
    find_exceptions,
    read_outcomes,
)
from uqpen.study.study import ONLY_MODEL, StandIn, Variant
from uqpen.study.table_reader import OBJECT, TableReader, check_names, named_tables
from uqpen.study.user_defined_members import MODEL, installed_names, is_reference, read_user_defined
from uqpen.study.variables_section import Variables, read_variables, refuse_grids

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
    joint = _tables(content.get("joint"))
    inputs = {
        *_keys(content.get("inputs")),
        *(name for each in published for name in _keys(each.get("uncertainties"))),
        *(name for figures in of_outputs for name in _keys(figures.get("response"))),
        *(
            str(each["largest_contribution"])
            for each in of_outputs
            if "largest_contribution" in each
        ),
        *(
            str(name)
            for group in joint
            if isinstance(group.get("inputs"), list)
            for name in group["inputs"]
        ),
        *(name.partition("[")[0].strip() for each in joint for name in _keys(each.get("sample"))),
        *(name for model in _tables(content.get("models")) for name in _keys(model.get("with"))),
        *_WORD.findall(str(content.get("constraints", ""))),
    }
    surrogates = _tables(content.get("surrogates"))
    outputs = {
        *_keys(content.get("outputs")),
        *(
            name
            for each in published
            for name, figures in each.items()
            if isinstance(figures, dict) and name not in ("uncertainties", "readings")
        ),
        *(name for each in surrogates for name in _keys(each.get("transform"))),
    }
    return PartialModel(
        "the model",
        tuple(Input(name, ANY_DIMENSION) for name in sorted(inputs)),
        tuple(Output(name, ANY_DIMENSION) for name in sorted(outputs)),
    )


def _keys(value: Any) -> Iterable[str]:
    return value if isinstance(value, dict) else ()


def _tables(value: Any) -> list[dict[str, Any]]:
    entries = value.values() if isinstance(value, dict) else ()
    return [entry for entry in entries if isinstance(entry, dict)]


# The keys that name a user-defined model, and the readers of its table.
USER_DEFINED_MODELS = {
    "python": "uqpen.study.model_section:read_function",
    "command": "uqpen.study.command_section:read_command",
    "umbridge": "uqpen.study.umbridge_section:read_umbridge",
    "object": "uqpen.study.model_section:read_object",
    "data": "uqpen.study.data_section:read_data",
}

# What a study says of the noise of a model, and the word for the generators that all code shares.
_NOISE, _SEED, _GLOBAL = "noise", "seed", "global"

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
        found = " and ".join(ways) or "nothing that names a model"
        if not ways and (close := [key for key in table if nearest(key, _MODEL_KEYS)]):
            found += f", but {', '.join(close)}"
        table.add_problem((), found, f"one of {', '.join(_MODEL_KEYS.values())}")
        return None
    model: Model | None
    noise = (
        None if table.content.get("use") in list(MODELS) or ways == ["data"] else _NoiseTable(table)
    )
    if ways == ["use"] and table.content["use"] not in list(MODELS):
        model = read_model_class(table)
        if model is None:
            return None  # whose settings nobody knows
    elif ways == ["use"]:
        model = table.settings(resolve(MODELS[table.take("use")]))
    else:
        model = resolve(USER_DEFINED_MODELS[ways[0]])(table)
    table.check_unknown_keys()
    return model if noise is None or model is None else noise.declared(model)


class _NoiseTable:
    """The keys ``noise`` and ``seed`` of a model that is not built in; mistakes are noted."""

    def __init__(self, table: TableReader) -> None:
        self._table = table
        self._noise = table.take(_NOISE)
        if self._noise is not None and not isinstance(self._noise, bool):
            expected = "true for a model that gives another result each time, or false"
            table.add_wrong(_NOISE, self._noise, expected)
        # A class of the user's may have a setting of its own with this name.
        self._seed = table.content.get(_SEED)
        if "use" not in table or isinstance(self._seed, str):
            table.take(_SEED)

    def declared(self, model: Model) -> Model:
        """Return a model with what is declared of its noise."""
        if self._seed is None or ("use" in self._table and not isinstance(self._seed, str)):
            return model if self._noise is None else model.with_noise(Noise(bool(self._noise)))
        if self._noise is False:
            self._table.add_problem(_SEED, "a seed beside noise = false", "noise = true")
        return model.with_noise(Noise(True, self._variable(model)))

    def _variable(self, model: Model) -> str:
        """Return the name of the variable with the seeds; note one that can have none."""
        inputs = {each.name: each for each in model.inputs}
        names = list(inputs)  # what stands for the seed may be no name, and without a hash
        is_called = isinstance(model, PythonFunction | UserDefinedModel) and not model.vectorized
        if self._seed == _GLOBAL and RANDOM_SEED in inputs:
            expected = f'seed = "{RANDOM_SEED}", the input with this name'
            self._table.add_wrong(_SEED, self._seed, expected)
        elif self._seed == _GLOBAL and not (is_called or isinstance(model, UnloadedModel)):
            expected = (
                "an input of the model that takes the seed: only a Python function that makes one "
                "run a call draws from generators that can be set before each run"
            )
            self._table.add_wrong(_SEED, self._seed, expected)
        elif self._seed != _GLOBAL and self._seed not in names:
            expected = (
                f'an input of the model that takes the seed, or "{_GLOBAL}"; '
                f"{self._table.suggest(str(self._seed), names)}"
            )
            self._table.add_wrong(_SEED, self._seed, expected)
        elif self._seed != _GLOBAL and inputs[self._seed].unit not in (
            DIMENSIONLESS,
            ANY_DIMENSION,
        ):
            found = f"an input in {inputs[self._seed].preferred_unit}"
            self._table.add_problem(_SEED, found, "an input without a unit, as a seed is a number")
        elif self._seed in inputs and len(inputs) == 1:
            self._table.add_problem(_SEED, "the only input", "another input beside it")
        return RANDOM_SEED if self._seed == _GLOBAL else str(self._seed)


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
    if outputs and isinstance(outcomes := table.content.get("outcomes"), dict):
        outputs = with_outcomes(outputs, [*map(str, outcomes)])
    title = name if isinstance(name, str) else "the model"
    return PartialModel(title, inputs or mentioned.inputs, outputs or mentioned.outputs)


# A Python function as a model.


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
    code = _UserCode(settings.python if settings else "", table.folder, table.trust)
    limits, variables = _read_function_table(table, is_vectorized, code.coordinates)
    outcomes = read_outcomes(table, variables, OF_FUNCTIONS)
    if settings is None or len(table.problems) > noted:
        return None
    inputs, outputs, units, fields = add_outcomes(variables, outcomes)
    try:
        function, surroundings = code.function()
        check_inputs(function, inputs)
    except ModelError as error:
        expected = error.expected or "a function that can be called with the model's inputs"
        table.add_problem("python", str(error), expected)
        return None
    if outcomes and surroundings is not None:
        outcomes = find_exceptions(table, outcomes, function, surroundings.on_import_path())
    declared = (settings.python, inputs, outputs, units, is_vectorized, surroundings, limits)
    model = PythonFunction(function, *declared, fields=fields, outcomes=outcomes)
    return model if len(table.problems) == noted else None


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


def read_limits(table: TableReader) -> Limits:
    """Read the limits of one run; with trust, note one that this system cannot keep."""
    if "memory_limit" in table and table.trust and not CAN_LIMIT:
        expected = "no limit on memory: this system cannot keep one"
        table.add_wrong("memory_limit", table.content["memory_limit"], expected)
    return table.settings(Limits) or Limits()


def _read_function_table(
    table: TableReader,
    is_vectorized: bool,
    coordinates: Callable[[str], FloatArray] | None = None,
) -> tuple[Limits, Variables]:
    """Read a function's limits and variables; note what is of one run where a call makes many."""
    each = "vectorized = false, so that each run is a call of its own"
    limits = read_limits(table)
    if is_vectorized and limits:
        limit = "time_limit" if limits.seconds is not None else "memory_limit"
        table.add_problem(limit, "a limit of one run", each)
    variables = read_variables(table, coordinates)
    if is_vectorized:
        refuse_grids(table, variables.fields, each)
    return limits, variables


def unloaded_function(reference: str) -> tuple[Callable[..., Any], None]:
    """Return a replacement for a function that must not be executed."""

    def refuse(**inputs: float) -> Any:
        raise ModelError(f"{reference} is not executed without --trust")

    return refuse, None


Faults = Iterator[tuple[str, str]]


def find_variable_faults(model: Model) -> Faults:
    """Yield what is wrong with the attributes of a model, and what is expected."""
    if not isinstance(getattr(model, "name", None), str):
        yield "no name", 'an attribute such as name = "my-model"'
    if not _is(model.enforced_limits, Limits):
        yield (
            f"enforced_limits = {model.enforced_limits!r}",
            "an object of uqpen.core.limits.Limits",
        )
    known: set[str] = set()
    for key, kind in (("inputs", Input), ("outputs", Output)):
        variables = getattr(model, key, None)
        if not (isinstance(variables, tuple) and variables) or not all(
            isinstance(each, kind) for each in variables
        ):
            yield f"no {key}", f"an attribute {key}, a tuple of {kind.__name__}"
            continue
        for variable in variables:
            yield from _variable_faults(variable, known)
            known.add(variable.name)
    groups = model.alternatives
    if not (_are(groups, tuple) and all(name in known for group in groups for name in group)):
        yield f"alternatives = {groups!r}", "a tuple of tuples with names of inputs"
    yield from _dimension_faults(model, known)


def _variable_faults(variable: Input | Output, known: set[str]) -> Faults:
    if not NAME.match(variable.name) or variable.name in RESERVED or variable.name in known:
        others = ", ".join(sorted(RESERVED))
        expected = f"a name of letters, digits and _, at most 100, used once, none of {others}"
        yield _text(variable), expected
    yield from _unit_faults(variable)
    what = _text(variable)
    if isinstance(variable, Output):
        if not _are(variable.categories, Category):
            yield f"{what} with other categories", "categories, a tuple of Category"
        return
    if not _is(variable.bounds, Bounds):
        yield f"{what} with bounds={variable.bounds!r}", "an object of uqpen.core.model.Bounds"
    if variable.default is not None and not is_finite_number(variable.default):
        found = f"{what} with default={variable.default!r}"
        yield found, f"a number in its SI unit, {variable.unit}"


def _unit_faults(variable: Variable) -> Faults:
    what = _text(variable)
    try:
        if (coherent := si_unit(variable.unit)) != variable.unit:
            yield what, f"its coherent SI unit, {coherent}; display_unit can be another"
        elif not are_convertible(variable.preferred_unit, variable.unit):
            yield f"{what} with display_unit={variable.display_unit!r}", f"a unit like {coherent}"
    except QuantityError as error:
        yield f"{what}: {error}", "its coherent SI unit"


def _dimension_faults(model: Model, known: set[str]) -> Faults:
    """Yield what is wrong with dimensions of outputs; each is the same in all outputs."""
    seen: dict[str, Dimension] = {}
    for output in model.outputs if _are(getattr(model, "outputs", None), Output) else ():
        if not _are(output.dims, Dimension):
            yield f"{_text(output)} with other dims", "dims, a tuple of Dimension"
            continue
        for dimension in output.dims:
            if dimension.name in known:
                yield f"{_text(dimension)} with the name of a variable", "names that differ"
            elif dimension.name not in seen:
                yield from _unit_faults(dimension)
            elif seen[dimension.name] != dimension:
                found = f"{_text(dimension)} with other coordinates in {output.name}"
                yield found, "the same in all outputs along it"
            seen.setdefault(dimension.name, dimension)


def _is(value: object, kind: type) -> bool:
    """Check the class of an attribute: a user's class can have anything in its place."""
    return isinstance(value, kind)


def _are(values: object, kind: type) -> bool:
    return isinstance(values, tuple) and all(isinstance(each, kind) for each in values)


def _text(variable: Variable) -> str:
    return f"{type(variable).__name__}({variable.name!r}, {variable.unit!r})"


# Classes and objects of the user as models.


def read_model_class(table: TableReader) -> Model | None:
    """Read a model whose class is not built in; None where a mistake was noted.

    Without trust, a class of a file or a module is not loaded. The model then has the variables
    that the caller knows from an archive, and cannot be run.
    """
    name = table.text("use", "the name of a model")
    if name is None:
        return None
    installed = [] if is_reference(name) else installed_names(MODEL, name)
    if not is_reference(name) and name not in installed:
        expected = f"a built-in model; {choices(name, [*MODEL.members, *installed])}"
        table.add_wrong("use", name, expected)
        return None
    if is_reference(name) and not table.trust:
        known = (table.document.objects or {}).get(table.path)
        if isinstance(known, UnloadedModel):
            for key in table.content:  # the class alone knows its settings
                table.take(key)
            return known
        expected = "a built-in model: the inputs of others are known by code that is not executed"
        table.add_wrong("use", name, expected)
        return None
    model, surroundings = read_user_defined(table, "use", name, MODEL)
    if model is None:
        return None
    faults = list(find_variable_faults(model))
    for found, expected in faults:
        table.add_problem("use", f"{toml_text(name)}, which has {found}", expected)
    return None if faults else UserDefinedModel(model, name, surroundings)


@dataclass(frozen=True)
class _ObjectSettings:
    """Settings of a function or a model that is an object; its source is for display only."""

    object: str = text(expected="the name of a function")
    source: str = text(expected="the source of a function", default="")
    vectorized: bool = flag(default=False)
    is_class: bool = flag(default=False, key="class")


def read_object(table: TableReader) -> Model | None:
    """Read a function or a model that is an object; None where a mistake was noted.

    The text of the table is never executed. It names the object, and shows its source to a
    reader. Where the object is not here, the model cannot be run.
    """
    noted = len(table.problems)
    settings = table.settings(_ObjectSettings)
    objects = table.document.objects
    if objects is None:
        named = table.content[OBJECT]
        expected = f'python = "my_model.py:{named}": a file cannot contain a Python object'
        table.add_wrong(OBJECT, named, expected)
    function = (objects or {}).get(table.path)
    is_vectorized = settings is not None and settings.vectorized
    limits, variables = _read_function_table(table, is_vectorized)
    outcomes = read_outcomes(table, variables, OF_FUNCTIONS)
    inputs, outputs, units, fields = add_outcomes(variables, outcomes)
    if settings is None or len(table.problems) > noted:
        return None
    name = settings.object
    observed = Dependencies(table.folder)
    if isinstance(function, UnloadedModel):
        return function
    if isinstance(function, Model):
        source = function_source(type(function))
        return UserDefinedModel(function, name, source=source, observed=observed)
    if function is None:
        function, _ = unloaded_function(name)
        source = FunctionSource.absent(name, settings.source)
    else:
        source = function_source(function)
        try:
            check_inputs(function, inputs)
        except ModelError as error:
            expected = "a function that can be called with the model's inputs"
            table.add_problem((), str(error), expected)
            return None
        outcomes = find_exceptions(table, outcomes, function, contextlib.nullcontext())
    declared = (name, inputs, outputs, units, settings.vectorized, None, limits, source, fields)
    model = PythonFunction(function, *declared, observed=observed, outcomes=outcomes)
    return model if len(table.problems) == noted else None


# Several models at the same points.


@dataclass(frozen=True, eq=False)
class ModelsTogether(Model):
    """The first model of a study with the inputs that only others take; it cannot be run."""

    first: Model  # it has all outputs of the study
    further_inputs: tuple[Input, ...]  # inputs of the others that the first does not have

    def __post_init__(self) -> None:
        object.__setattr__(self, "inputs", (*self.first.inputs, *self.further_inputs))
        for name in ("name", "outputs", "alternatives", "derived"):
            object.__setattr__(self, name, getattr(self.first, name))

    def evaluate(self, inputs: Arrays) -> Results:
        """Refuse to run: each model of the study is run by itself."""
        raise NotImplementedError(self.name)


def read_models(root: TableReader) -> tuple[dict[str, Variant], Model]:
    """Read the models of a study, by name, and the one whose variables are the study's.

    That is the first, whose outputs the others have, or some of them. If others take further
    inputs, it is a `ModelsTogether`. A model with a mistake is left out; the first is then a
    `PartialModel`.
    """
    mentioned = mentioned_model(root)
    table, several = root.table("model"), root.table("models")
    if table.is_given and several.is_given:
        root.add_problem("models", "[model] and [models]", "one of them")
        return {}, mentioned
    if several.is_given:
        return _read_several(several, mentioned)
    if "model" not in root and "models" not in root:
        root.add_missing("model", "a [model] table, or [models.<name>] for several")
    model = read_model(table) if table.is_given else None
    if model is None:
        return {}, read_partial_model(table, mentioned)
    return {ONLY_MODEL: Variant(model, {})}, model


# One model at several values of some inputs.

# Most values of a sweep, or combinations of the values of several.
_MOST_COMBINATIONS = 200


def read_sweep(table: TableReader, models: dict[str, Variant], model: Model) -> dict[str, Variant]:
    """Return a variant of the only model for each combination of swept values.

    They are at the same points, and the first one is what the others are compared with. The name of
    a variant has the inputs and their values as they are written.
    """
    if not table.is_given:
        return models
    if {*models} - {ONLY_MODEL} or "models" in table.document.content:
        table.add_problem((), "[sweep] beside [models]", "a [model], which is run at each value")
        return models
    if "data" in inner_table(table.document.content, "model"):
        table.add_problem((), "[sweep] beside runs of a file", "a model, which makes the runs")
        return models
    known = {variable.name: variable for variable in model.inputs}
    columns = [
        _swept_values(table, known[name]) for name in check_names(table, known, "input", model)
    ]
    if not table.content:
        table.add_problem((), "an empty table", 'an input, such as speed = ["1 km/s", "2 km/s"]')
    combinations = math.prod(map(len, columns))
    if combinations > _MOST_COMBINATIONS:
        found = f"{combinations} combinations of values"
        table.add_problem((), found, f"at most {_MOST_COMBINATIONS}")
        return models
    if ONLY_MODEL not in models or not (columns and all(columns)):
        return models
    variants: dict[str, Variant] = {}
    for place, chosen in enumerate(itertools.product(*columns), start=1):
        written = "_".join(f"{name}_{text}" for name, text, _ in chosen)
        words = re.sub(r"[^A-Za-z0-9]+", "_", written.replace("-", "minus ")).strip("_")
        name = words if NAME.match(words) and words not in variants else f"sweep_{place}"
        given = {each: value for each, _, value in chosen}
        variants[name] = Variant(models[ONLY_MODEL].model, given)
    return variants


def _swept_values(table: TableReader, variable: Input) -> list[tuple[str, str, float]]:
    """Read the values of a swept input: its name, each as it is written, and in its SI unit."""
    name, written = variable.name, table.take(variable.name)
    if name in inner_table(table.document.content, "inputs"):
        expected = "it in one of them: a swept input has its values here alone"
        table.add_problem(name, f"{name}, which [inputs] gives, too", expected)
    if not isinstance(written, list) or len(written) < 2:
        expected = f'two values or more in a list, such as ["1 {variable.preferred_unit}", …]'
        table.add_wrong(name, written, expected)
        return []
    found = dict[float, tuple[str, str, float]]()
    for place, entry in enumerate(written):
        value: float | None = None
        if not variable.labels:
            try:
                value = parse_quantity(entry, variable.unit).value
            except QuantityError as error:
                table.add_problems(error.problems, name, place)
                continue
        elif entry in variable.labels:
            value = float(variable.labels.index(entry))
        if value is None or not variable.bounds.contain(np.array(value)):
            bounds = f"one of {', '.join(variable.labels)}" if variable.labels else ""
            table.add_wrong((name, place), entry, bounds or f"a value {variable.bounds}")
        elif value in found:
            table.add_wrong((name, place), entry, "each value once")
        else:
            found[value] = name, str(entry), value
    return [*found.values()]


def check_sweep(table: TableReader, random: set[str]) -> None:
    """Note swept inputs that a joint sample gives, or that formulas of others name.

    Formulas are computed before a swept input has a value.
    """
    inputs = inner_table(table.document.content, "inputs")
    for name in sorted(random & {*table.content} - {*inputs}):
        expected = "an input that nothing else gives"
        table.add_problem(name, f"{name}, which [joint] gives, too", expected)
    for other, written in inputs.items():
        for name in {*_WORD.findall(str(written))} & {*table.content}:
            found = f"{name}, which {other} in [inputs] follows from"
            table.add_problem(name, found, "an input that no formula names")


def check_variants(root: TableReader, variants: Mapping[str, Variant], random: set[str]) -> None:
    """Note inputs that a model sets for itself though the study draws them, and seeds it gives."""
    for name, variant in variants.items():
        place = ("models", name) if name else ("model",)
        if (seed := variant.model.noise.seed) in root.table("inputs") or seed in variant.given:
            found = f"{seed}, which the study gives a value or a distribution"
            root.add_problem((*place, _SEED), found, "an input that each run gets a seed by alone")
        for given in filter(random.__contains__, variant.given):
            found = "an input that the study draws at random"
            expected = "an input that has one value in [inputs], or a default"
            root.add_problem(("models", name, "with", given), found, expected)


def check_stand_ins(root: TableReader, models: Mapping[str, Variant]) -> None:
    """Note stand-ins for no other model, in a circle, or without a number in common."""

    def numbers(name: str) -> set[str]:
        return {each.name for each in models[name].model.all_outputs if each.is_number}

    names = list(root.table("models"))
    stand_ins = {name: each.stand_in for name, each in models.items() if each.stand_in}
    for name, stand_in in stand_ins.items():
        other, key = stand_in.stands_for, ("models", name, "stands_for")
        if other == name or other not in names:
            others = [each for each in names if each != name]
            root.add_wrong(key, other, f"another model; {root.suggest(other, others)}")
        elif name in _ancestors(name, stand_ins):
            expected = "a model that does not stand for this one in its turn"
            root.add_wrong(key, other, expected)
        elif other in models and not numbers(name) & numbers(other):
            found = f'a model that has no number in common with "{other}"'
            root.add_problem(key, found, "an output that is a number in both models")


def check_finer(root: TableReader, models: Mapping[str, Variant]) -> None:
    """Note models that are finer than another one than the first, or that stand for one."""
    first, *others = [*root.table("models")] or [ONLY_MODEL]
    for name, variant in models.items():
        key = ("models", name, FINER_THAN)
        if not variant.finer_than:
            continue
        if name not in others or variant.finer_than != first:
            expected = f'"{first}" in another model: all are compared with the first one'
            root.add_wrong(key, variant.finer_than, expected)
        elif variant.stand_in is not None:
            expected = "one of both: a finer model is no cheap one"
            root.add_problem(key, f"{FINER_THAN} beside {STANDS_FOR}", expected)


def _ancestors(name: str, stand_ins: Mapping[str, StandIn]) -> list[str]:
    """Return the models that one stands for, directly and through others; a circle ends."""
    found: list[str] = []
    while name in stand_ins and stand_ins[name].stands_for not in found:
        name = stand_ins[name].stands_for
        found.append(name)
    return found


def _read_several(table: TableReader, mentioned: PartialModel) -> tuple[dict[str, Variant], Model]:
    found: dict[str, Variant] = {}
    first: Model | None = None
    inputs: dict[str, Input] = {}
    if not table.content:
        table.add_problem((), "an empty table", "a [models.<name>]")
    for name, section in named_tables(table):
        replaced = section.table("with")
        # A model with none of these keys stands for no other.
        is_stand_in = any(field.name in section for field, _ in declared_settings(StandIn))
        stand_in = section.settings(StandIn) if is_stand_in else None
        finer_than = ""
        if FINER_THAN in section:
            finer_than = section.text(FINER_THAN, "the name of the first model") or ""
        model = read_model(section)
        known = model or read_partial_model(section, mentioned)
        if name == next(iter(table)):
            first = known
        if first is not None and mentioned not in (first, known):
            _check_inputs(section, inputs, known)
            _check_outputs(section, first, known)
        if known is not mentioned:
            inputs = {each.name: each for each in known.inputs} | inputs
        given = _read_given_inputs(replaced, known)
        if model is not None:
            found[name] = Variant(model, given, stand_in, finer_than)
    if first is None or first is mentioned:
        return found, mentioned
    own = {each.name for each in first.inputs}
    further = tuple(each for name, each in inputs.items() if name not in own)
    return found, ModelsTogether(first, further) if further else first


def _read_given_inputs(table: TableReader, model: Model) -> dict[str, float]:
    """Read inputs that replace the study's for a model, in SI units."""
    known = {variable.name: variable for variable in model.inputs}
    found = {}
    for name in check_names(table, known, "input", model):
        value = table.quantity(name, known[name].unit)
        if value is None:
            continue
        if not known[name].bounds.contain(np.array(value)):
            table.add_wrong(name, table.content[name], f"a value {known[name].bounds}")
        found[name] = value
    return found


def _check_inputs(table: TableReader, inputs: Mapping[str, Input], model: Model) -> None:
    """Note an input of a model that models above it have in another dimension."""
    for variable in model.inputs:
        same = inputs.get(variable.name)
        if same is not None and not are_convertible(variable.unit, same.unit):
            found = f'an input "{variable.name}" [{variable.unit}]'
            expected = f"a unit of the same dimension as in the models above it, [{same.unit}]"
            table.add_problem((), found, expected)


def _check_outputs(table: TableReader, first: Model, model: Model) -> None:
    """Note an output that the study's first model does not have, or has in another form."""
    known = {output.name: output for output in first.outputs}
    for output in model.outputs:
        same = known.get(output.name)
        if output.name == OUTCOME_OUTPUT and output.categories != (same and same.categories):
            expected = "those of the first model in the same order, as an event names them for all"
            table.add_problem("outcomes", "outcomes of its own", expected)
        elif same is None or not are_convertible(output.unit, same.unit):
            found = f'an output "{output.name}" [{output.unit}]'
            expected = "only outputs of the first model, in units of the same dimension"
            table.add_problem((), found, expected)
        elif output.dims != same.dims:
            found = f'an output "{output.name}" with other dimensions or coordinates'
            table.add_problem((), found, "those that it has in the first model")
