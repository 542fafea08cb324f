"""Study made from Python objects, and the content of a study file that they stand for."""

from __future__ import annotations

import dataclasses
import itertools
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar, Unpack

import numpy as np
import pandas as pd
import tomli_w
import xarray as xr

from uqpen.core.catalogue import REQUESTED
from uqpen.core.columns import heading_parts
from uqpen.core.errors import Problem, QuantityError, StudyError, TableError
from uqpen.core.lookup import family_name, resolve
from uqpen.core.model import Model
from uqpen.core.quantities import parse_any_dimension, parse_spread
from uqpen.core.settings import written_settings
from uqpen.core.units import ANY_DIMENSION, DIMENSIONLESS, are_convertible
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design
from uqpen.designs.stopping.precision import Precision
from uqpen.distributions import COPULAS, DISTRIBUTIONS
from uqpen.distributions.copulas import Dependence, EllipticalCopula
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.frozen import FrozenDistribution, as_frozen, declare, is_chaospy
from uqpen.distributions.input_group import declare_joint, is_joint
from uqpen.distributions.univariate import Choice, Mixture, Truncated
from uqpen.models import MODELS
from uqpen.models.function_source import function_source
from uqpen.models.source import BuiltInModel
from uqpen.study import SECTIONS, SectionArguments
from uqpen.study.document import ArgumentsDocument, parse_document
from uqpen.study.load import load_study as read_file
from uqpen.study.load import read_study
from uqpen.study.model_section import find_variable_faults
from uqpen.study.outputs_section import is_derived
from uqpen.study.study import ValidatedStudy
from uqpen.study.summary import study_html
from uqpen.study.table_reader import OBJECT, SETTINGS
from uqpen.study.user_defined_members import DESIGN, DISTRIBUTION, MODEL, SURROGATE, class_reference
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.surrogate import Surrogate

# Settings of an output with dimensions, which belong to the model.
_OF_MODEL = ("along", "may_end", "on", "interpolation")

_Class = TypeVar("_Class", bound=type)

Thresholds = Sequence[str | float] | Mapping[str, Mapping[str, str | float]]


@dataclass(frozen=True)
class PythonModel:
    """Python function as a model, with the units of its inputs and outputs.

    Parameters
    ----------
    function : callable
        Takes a keyword argument for each input and returns a mapping with each output. It may be
        defined in a notebook or inside another function.
    inputs, outputs : mapping of str to str
        The unit in which it takes each input and returns each output, such as ``"cm"``; ``"1"``
        for a number without a unit. For an output with dimensions an `OutputSpec` with
        `unit`, `along`, `may_end`, `on` and `interpolation`.
    vectorized : bool
        True if it takes arrays of shape ``(run,)`` and returns arrays of shape ``(run, *dims)``,
        False for the inputs and outputs of one run.
    time_limit, memory_limit : str, optional
        Limits of one run, such as ``"5 min"`` and ``"2 GB"``.
    replaced : mapping of str to str or float, optional
        In a study with several models: values of inputs that replace the study's own.
    dimensions : mapping of str to mapping, optional
        Dimensions that several outputs have, for the names in their `along`.
    outcomes : mapping of str to class, optional
        Exceptions that are results, such as ``{"unstable": UnstableError}``: a run that raises one
        is completed, with this category and without numbers. A text names a class of the
        function's module.
    labels : mapping of str to sequence of str, optional
        The labels of inputs that are texts, in the function's own order.
    """

    function: Callable[..., Mapping[str, Any]]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str | OutputSpec]
    vectorized: bool = False
    time_limit: str | None = None
    memory_limit: str | None = None
    replaced: Mapping[str, str | float] = field(default_factory=dict)
    dimensions: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    outcomes: Mapping[str, type[BaseException] | str] = field(default_factory=dict)
    labels: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def table(self) -> dict[str, Any]:
        """Return its declaration as a table of a study file, with the function itself."""
        return {
            "object": self.function,
            "vectorized": self.vectorized or None,
            "time_limit": self.time_limit,
            "memory_limit": self.memory_limit,
            "with": self.replaced or None,
            "dimensions": self.dimensions or None,
            "labels": self.labels or None,
            "inputs": self.inputs,
            "outputs": self._output_tables(),
            "outcomes": self._outcome_tables() or None,
        }

    def _outcome_tables(self) -> Any:
        given: Any = self.outcomes
        if not isinstance(given, Mapping):
            return given  # which its reader refuses
        return {
            name: each if isinstance(each, Mapping) else {"exception": each}
            for name, each in given.items()
        }

    def _output_tables(self) -> Mapping[str, str | OutputSpec]:
        """Return the outputs, all as tables if one is: TOML writes tables last."""
        if not any(isinstance(value, OutputSpec) for value in self.outputs.values()):
            return self.outputs
        return {
            name: OutputSpec(value) if isinstance(value, str) else value
            for name, value in self.outputs.items()
        }


def _take_requests(declared: _Class) -> _Class:
    """Add an argument for each statistic of the catalogue that declares its request."""
    for statistic in REQUESTED:
        if statistic.asked.declared_by:
            declared.__annotations__[statistic.asked.key] = "Sequence[float]"
            setattr(declared, statistic.asked.key, ())
    return declared


@dataclass(frozen=True)
@_take_requests
class OutputSpec:
    """Quantity of interest of an output.

    Parameters
    ----------
    unit : str, optional
        Unit for display; of a bare function, the unit in which it returns the output.
    quantiles : sequence of float
        Probabilities of further quantiles, beside 0.05, 0.5 and 0.95.
    exceeds : sequence of str or mapping
        Thresholds whose probability of exceedance is estimated, such as ``"60 cm"``. A mapping
        has the acceptance limits of each: ``{"60 cm": {"at_most": 0.05}}``.
    below : sequence of str or mapping
        Thresholds; the probability that the output lies below each is estimated.
    hold, hold_above, hold_between : sequence of float
        Contents of upper tolerance limits, of lower ones, and of two-sided tolerance intervals.
    expected_shortfall, return_periods, … : sequence of float
        Entries of the other statistics that a study file can ask for, by its keys.
    scale : str, optional
        ``"log"``: charts and indices are of the logarithm of the output.
    along : mapping of str to mapping or sequence of str, optional
        Dimensions of an output of a Python function, such as
        ``{"time": {"unit": "s", "from": 0, "to": 10, "size": 101}}``,
        ``{"time": {"unit": "s", "values": [0, 1, 3]}}`` or
        ``{"time": {"file": "times.csv", "column": "time"}}``; or the names of `dimensions` of a
        `PythonModel`. Each run has values along them, in place of a number. Its
        statistics are those at each place.
    on : mapping of str to str, optional
        By dimension, the name under which each run returns coordinates of its own, such as
        ``{"time": "t"}``. Its values are then interpolated to the declared ones.
    interpolation : str, optional
        How: ``"linear"`` (default), ``"cubic"`` (monotone), ``"previous"``, or ``"none"`` if both
        have to be the same.
    may_end : bool
        Whether a curve may end before its dimension does: NaN at its end is then no failure.
    formula : str, optional
        A number that follows from others, after each run, such as ``"strength - load"``.
    of : str, optional
        An output with dimensions; this one is a number that follows from it, after each run.
    take : str, optional
        What is taken of it, such as ``"max"``; see the study file.
    at : mapping of str to str, optional
        In place of `take`: the place whose value is taken, such as ``{"time": "10 day"}``.
    threshold : str or float, optional
        Of ``take="first_above"`` and ``"first_below"``.
    """

    unit: str | None = None
    quantiles: Sequence[float] = ()
    exceeds: Thresholds = ()
    below: Thresholds = ()
    hold: Sequence[float] = ()
    hold_above: Sequence[float] = ()
    hold_between: Sequence[float] = ()
    scale: str | None = None
    along: Mapping[str, Mapping[str, Any]] | Sequence[str] | None = None
    may_end: bool = False
    on: Mapping[str, str] | None = None
    interpolation: str | None = None
    formula: str | None = None
    of: str | None = None
    take: str | None = None
    at: Mapping[str, str | float] | None = None
    threshold: str | float | None = None

    def model_part(self) -> dict[str, Any]:
        """Return the settings that the model declares, if it has any of them."""
        return {name: value for name in _OF_MODEL if (value := getattr(self, name))}

    def without_model_part(self) -> OutputSpec:
        """Return the same without what the model declares."""
        return replace(self, along=None, may_end=False, on=None, interpolation=None)

    def table(self) -> dict[str, Any]:
        """Return its declaration as a table of a study file."""
        threshold = {} if self.threshold is None else {"threshold": self.threshold}  # may be 0
        return {name: value for name, value in vars(self).items() if value} | threshold


# The name of the file under which an archive keeps the runs.
_NAME = "data.csv"


def is_data(value: object) -> bool:
    """Check for an object that has runs in place of a model."""
    return isinstance(value, pd.DataFrame | xr.Dataset)


def _parts(heading: str) -> tuple[str, str]:
    try:
        name, unit = heading_parts(heading, _NAME)
    except TableError:
        return heading, ""  # whoever reads the file says what is wrong with it
    return name, unit if {*"[("} & {*heading} else ""


def _frame(data: Any) -> pd.DataFrame:
    if isinstance(data, pd.DataFrame):
        return data
    columns = {}
    for name, variable in data.variables.items():
        if variable.ndim == 1 and (name not in data.dims or "units" in variable.attrs):
            unit = variable.attrs.get("units")
            columns[f"{name} [{unit}]" if unit else str(name)] = variable.values
    return pd.DataFrame(columns)


def _with_joint_tables(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a study with its joint distributions as tables.

    A distribution of chaospy under a tuple of inputs becomes an entry of ``joint``, or an entry of
    ``inputs`` for each input if these are independent.
    """
    inputs, joint = arguments.get("inputs"), arguments.get("joint")
    if not isinstance(inputs, Mapping | None) or not isinstance(joint, Mapping | None):
        return dict(arguments)
    inputs = inputs or {}
    single = {name: value for name, value in inputs.items() if not isinstance(name, tuple)}
    tables = {name: _table(value) for name, value in (joint or {}).items()}
    paths = joint_paths(inputs, tables)
    for names, value in inputs.items():
        if not isinstance(names, tuple) or _tuple_fault(names, value):
            continue
        margins = [value] if len(names) == 1 else list(value)
        is_independent = len(names) == 1 or not value.stochastic_dependent
        # An input with another entry stays in its table, whose reader refuses it.
        is_new = len({*names} - single.keys()) == len(names)
        if is_new and is_independent and all(len(each) == 1 for each in margins):
            single |= dict(zip(names, margins, strict=True))
        else:
            tables[paths[names][1]] = _table({"inputs": list(names), "chaospy": value})
    found = {**arguments, "inputs": single or None, "joint": tables or None}
    return {name: value for name, value in found.items() if value is not None}


def _tuple_fault(names: tuple[Any, ...], value: object) -> tuple[str, str] | None:
    """Return what is wrong with an entry, and what is expected; None where nothing is."""
    expected = f"a distribution of chaospy of dimension {len(names)}"
    if not names:
        return "no names of inputs", "a tuple of the inputs of a joint distribution"
    if not is_chaospy(value):
        return f"an object of class {type(value).__name__}", expected
    dimension = len(value)  # type: ignore[arg-type]
    return None if dimension == len(names) else (f"one of dimension {dimension}", expected)


def joint_paths(
    inputs: Iterable[Any], taken: Collection[str] = ()
) -> dict[tuple[Any, ...], tuple[str, str]]:
    """Return the path of the table of each joint distribution, by the tuple of its inputs.

    Parameters
    ----------
    inputs : iterable
        Names of inputs, and tuples of them.
    """
    paths: dict[tuple[Any, ...], tuple[str, str]] = {}
    for names in inputs:
        if isinstance(names, tuple):
            used = {*taken, *(path[1] for path in paths.values())}
            joined = "_".join(map(str, names))
            # ("a_b", "c") and ("a", "b_c") are two.
            numbered = (f"{joined}_{number}" for number in itertools.count(2))
            name = next(each for each in itertools.chain([joined], numbered) if each not in used)
            paths[names] = ("joint", name)
    return paths


def _table(value: Any) -> Any:
    """Return a joint distribution as a study file has it: as data, else the object by its name."""
    if not isinstance(value, Mapping) or not is_joint(value.get("chaospy")):
        return value
    joint = value["chaospy"]
    others = {key: entry for key, entry in value.items() if key != "chaospy"}
    declared = declare_joint(joint)
    return {**others, **({OBJECT: joint} if declared is None else {"chaospy": declared})}


def _joint_units(joint: Any) -> Iterator[tuple[str, str]]:
    """Yield the inputs of joint distributions with the units of their values."""
    tables = joint.values() if isinstance(joint, Mapping) else ()
    for table in tables:
        if not isinstance(table, Mapping):
            continue
        names, sample = table.get("inputs", ()), table.get("sample")
        units = [*map(str, table.get("units", ()))]
        units += [DIMENSIONLESS] * (len(names) - len(units))
        yield from zip(map(str, names), units, strict=False)
        # Both a dict of columns and a DataFrame are iterables of headings.
        for heading in (
            sample if isinstance(sample, Iterable) and not isinstance(sample, str) else ()
        ):
            try:
                name, unit = heading_parts(str(heading), "the table")
            except TableError:
                continue  # the reader of the table says what is wrong
            if name != "weight":
                yield name, unit


_VALUES = "a text, a number, true or false, a list, a dict, or an object of uqpen's"


class StudyContent:
    """Content of a study made from Python objects.

    Attributes
    ----------
    content : dict
        What a study file would contain.
    objects : dict
        Functions, designs and distributions that it only names, by the path of their table.
    problems : list of Problem
        Arguments that no study file can state.
    """

    def __init__(self, arguments: Mapping[str, Any], folder: Path) -> None:
        self.folder = folder
        self.objects: dict[tuple[str | int, ...], Any] = {}
        self.problems: list[Problem] = []
        given = {name: arguments[name] for name in SECTIONS if arguments.get(name) is not None}
        self.problems += [
            Problem(("inputs", str(names)), *fault)
            for names, value in _items(given.get("inputs"))
            if isinstance(names, tuple) and (fault := _tuple_fault(names, value))
        ]
        given = _with_joint_tables(given)
        model = given.get("model")
        units_of = {
            str(name): list(dict.fromkeys(_units(_declaration(value, folder) or value)))
            for name, value in _items(given.get("inputs"))
        }
        if is_data(model):
            self.objects["model",] = _frame(model).to_csv(index=False).encode("utf-8")
            outputs = {str(name): _output_unit(value) for name, value in _model_outputs(given)}
            units = {name: each[0] for name, each in units_of.items() if each} | outputs
            # Units of columns without one; others are units for display.
            headings = map(str, _frame(model).columns)
            bare = {name for name, unit in map(_parts, headings) if not unit}
            stated = {name: unit for name, unit in units.items() if name in bare}
            given["model"] = {"data": _NAME, "outputs": list(outputs), "units": stated or None}
        elif callable(model) and not isinstance(model, PythonModel):
            given["model"] = self._bare_function(model, given, units_of)
            if isinstance(given.get("outputs"), Mapping):
                # Without the dimensions, which the model declares.
                given["outputs"] = {
                    name: value.without_model_part() if isinstance(value, OutputSpec) else value
                    for name, value in given["outputs"].items()
                }
        self.content: dict[str, Any] = {
            name: self._value(value, (name,)) for name, value in given.items()
        }
        expanded = self.content.get("outputs")
        if isinstance(expanded, dict):
            # An output that is given by its unit alone is a table.
            units = {name: each for name, each in expanded.items() if isinstance(each, str)}
            expanded |= {name: {"unit": unit} for name, unit in units.items()}

    def _value(self, value: Any, path: tuple[str | int, ...]) -> Any:
        """Return a value of TOML; note a problem and return an empty text where there is none."""
        value = _as_builtin(value)
        if isinstance(value, str | bool | int | float):
            return value
        if isinstance(value, Path):
            return str(value)
        if isinstance(value, list | tuple):
            return [self._value(entry, (*path, position)) for position, entry in enumerate(value)]
        if isinstance(value, Mapping):
            return self._table(value, path)
        if isinstance(value, PythonModel):
            return self._table(value.table(), path)
        if isinstance(value, type) and issubclass(value, BaseException):
            self.objects[path[:-1]] = value
            return value.__name__
        faults = list(find_variable_faults(value)) if isinstance(value, Model) else []
        if faults:
            named = type(value).__name__
            self.problems += [
                Problem(path, f"{named}, which has {each[0]}", each[1]) for each in faults
            ]
            return ""
        table = _declaration(value, self.folder)
        if table is None:
            self.problems.append(
                Problem(path, f"an object of class {type(value).__name__}", _VALUES)
            )
            return ""
        return self._table(table, path)

    def _table(self, table: Mapping[Any, Any], path: tuple[str | int, ...]) -> dict[str, Any]:
        table = dict(table)
        named = table.get(OBJECT)
        if named is not None and not isinstance(named, str | Mapping):
            self.objects[path] = named
            table[OBJECT] = repr(named)
            if path[0] in ("model", "models"):
                source = function_source(type(named) if isinstance(named, Model) else named)
                table |= {OBJECT: source.name, "source": source.text or None}
        return {
            str(key): self._value(value, (*path, str(key)))
            for key, value in table.items()
            if value is not None
        }

    def _bare_function(
        self,
        function: Callable[..., Any],
        given: Mapping[str, Any],
        units_of: Mapping[str, Sequence[str]],
    ) -> PythonModel:
        """Return a model with the units in which the study states its inputs and outputs."""
        inputs = {}
        for name, units in units_of.items():
            inputs[name] = units[0] if units else DIMENSIONLESS
            if len(units) > 1 and all(are_convertible(units[0], unit) for unit in units):
                expected = "one unit, in which the function takes it; or a uqpen.PythonModel"
                found = f"values in {' and '.join(units)}"
                self.problems.append(Problem(("inputs", name), found, expected))
        inputs |= dict(_joint_units(given.get("joint")))
        outputs = {str(name): _model_output(value) for name, value in _model_outputs(given)}
        chosen = {
            str(name): value.labels
            for name, value in _items(given.get("inputs"))
            if isinstance(value, Choice)
        }
        inputs |= dict.fromkeys(chosen, DIMENSIONLESS)  # "8 mm" may be a label
        return PythonModel(function, inputs, outputs, labels=chosen)


def _as_builtin(value: Any) -> Any:
    """Return a value of NumPy or pandas as one of Python; others as they are."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if type(value).__module__.partition(".")[0] == "pandas" and hasattr(value, "ndim"):
        return value.to_dict("list") if value.ndim > 1 else value.tolist()
    return value


def _declaration(value: object, folder: Path) -> dict[str, Any] | None:
    """Return the table that declares an object in a study file; None for an unknown class."""
    if distribution := value if isinstance(value, Distribution) else as_frozen(value):
        return _distribution_table(distribution, folder)
    if isinstance(value, Dependence) and (name := family_name(COPULAS, value)):
        names = [field.name for field in dataclasses.fields(value)]  # type: ignore[arg-type]
        measure = {"of": value.measures[0]} if isinstance(value, EllipticalCopula) else {}
        return {"copula": name, **measure, **{key: getattr(value, key) for key in names}}
    if isinstance(value, OutputSpec):
        return value.table()
    if isinstance(value, Precision):
        return dict(value.targets)
    if isinstance(
        value, tuple(resolve(each.settings) for each in SECTIONS.values() if each.settings)
    ):
        return written_settings(value)
    for kind, family, key in (
        (Design, DESIGNS, "kind"),
        (Surrogate, SURROGATES, "kind"),
        (BuiltInModel, MODELS, "use"),
    ):
        if isinstance(value, kind) and (name := family_name(family, value)):
            return {key: name, **written_settings(value)}
    for defined in (DESIGN, SURROGATE):
        if isinstance(value, defined.base):
            reference = class_reference(value, folder, defined)
            return {"kind": reference, **written_settings(value)} if reference else {OBJECT: value}
    return _model_table(value, folder) if isinstance(value, Model) else None


def _model_table(model: Model, folder: Path) -> dict[str, Any]:
    """Return the table of a model whose class is not built in."""
    if reference := class_reference(model, folder, MODEL):
        table: dict[str, Any] = {"use": reference}
        return table | (written_settings(model) if dataclasses.is_dataclass(model) else {})
    variables = {"inputs": model.inputs, "outputs": model.outputs}
    units = {
        key: {variable.name: variable.preferred_unit for variable in each}
        for key, each in variables.items()
    }
    return {OBJECT: model, "class": True, **units}


def _distribution_table(distribution: Distribution, folder: Path) -> dict[str, Any]:
    """Return the table of an input with a distribution."""
    if isinstance(distribution, Truncated):
        return {
            **_distribution_table(distribution.parent, folder),
            **written_settings(distribution),
        }
    if isinstance(distribution, Mixture):
        shares = zip(distribution.shares, distribution.parts, strict=True)
        parts = [{"weight": weight, **_distribution_table(each, folder)} for weight, each in shares]
        return {"mixture": parts}
    if isinstance(distribution, FrozenDistribution):
        frozen = distribution.frozen
        library, parameters = declare(frozen) or (OBJECT, {OBJECT: frozen})
        return {library: {**parameters, "unit": distribution.unit}}
    name = family_name(DISTRIBUTIONS, distribution)
    settings = written_settings(distribution)
    if name := name or class_reference(distribution, folder, DISTRIBUTION):
        return {name: settings}
    return {OBJECT: {OBJECT: distribution, SETTINGS: settings}}


def _items(value: object) -> Iterator[tuple[Any, Any]]:
    return iter(value.items() if isinstance(value, Mapping) else ())


def _units(value: object) -> Iterator[str]:
    """Yield the units of the quantities in a value; a mistake in one is noted elsewhere."""
    if isinstance(value, Mapping) and "unit" in value:
        value = f"1 {value['unit']}"
    if isinstance(value, Mapping):
        for entry in value.values():
            yield from _units(entry)
    elif isinstance(value, list):
        for entry in value:
            yield from _units(entry)
    elif isinstance(value, str):
        try:
            spread = parse_spread(value, ANY_DIMENSION)
            yield spread.unit if spread else parse_any_dimension(value).unit
        except QuantityError:
            return


def _model_outputs(given: Mapping[str, Any]) -> Iterator[tuple[Any, Any]]:
    """Yield the outputs that the model gives, without those derived from them."""
    for name, value in _items(given.get("outputs")):
        if not is_derived(value.table() if isinstance(value, OutputSpec) else value):
            yield name, value


def _model_output(value: object) -> str | OutputSpec:
    """Return the declaration of an output in a model: its unit, and its dimensions if any."""
    unit = _output_unit(value)
    declared = value.model_part() if isinstance(value, OutputSpec) else {}
    return OutputSpec(unit, **declared) if declared else unit


def _output_unit(value: object) -> str:
    if isinstance(value, OutputSpec):
        value = value.unit
    unit = value.get("unit") if isinstance(value, Mapping) else value
    return unit if isinstance(unit, str) else DIMENSIONLESS


class Study(ValidatedStudy):
    """Study of the uncertainty of a model's outputs.

    It is checked when it is made, as a study file is when it is read.

    Parameters
    ----------
    model : callable, PythonModel, Model or str
        A function, possibly defined in a notebook, takes its inputs and returns its outputs in the
        units in which the study states them; a `PythonModel` states its own. A `Model` is a
        built-in one, or an instance of a class of your own. A text is the name of a built-in model.
        A reference such as ``"my_model.py:function"`` stands in a `dict`, as in a study file.
    inputs : mapping
        For each input a distribution such as ``uqpen.Normal("2.5 g/cm^3", "0.05 g/cm^3")``, a text
        such as ``"(2.5 ± 0.05) g/cm^3"``, or one value such as ``"30 cm"``. For a tuple of inputs
        a joint distribution of chaospy, such as ``{("a", "b"): chaospy.MvNormal(…)}``.
    outputs : mapping, optional
        For each output its unit, or an `OutputSpec`.
    designs : mapping, optional
        The designs of the runs by name, such as ``{"mc": uqpen.MonteCarlo(runs=1000)}``; a single
        one has the name of its kind. A `budget` may take their place.
    seed : int
        Seed of all random numbers.
    title : str, optional
        Title for display.
    name : str
        Name of the study.
    models : mapping, optional
        Several models by name, in place of `model`.
    sweep, joint, joint_probabilities, surrogates, published, failures, dependence : optional
        As the tables of these names in a study file.
    constraints : sequence of str
        Conditions that every point meets, such as ``"a > 2 * b"``.
    analyses : sequence of str or mapping
        References to functions that compute further statistics.
    confidence_level : float, optional
        Confidence level of all intervals; 0.95 by default.
    budget : int, optional
        Number of runs in place of designs and surrogates, which are planned.
    sensitivity, convergence : bool
        False leaves these statistics out, which are most of the work of a fast model's study.
    folder : Path
        Folder to which the paths of files are relative.

    Raises
    ------
    StudyError
        Listing every mistake with its argument, what was found and what is expected.

    Examples
    --------
    >>> import uqpen
    >>> study = uqpen.Study(
    ...     model=lambda length, width: {"area": length * width},
    ...     inputs={"length": uqpen.Normal("2 m", "0.1 m"), "width": "3 m"},
    ...     outputs={"area": "m2"},
    ...     designs={"mc": uqpen.MonteCarlo(runs=100)},
    ...     seed=1,
    ... )
    >>> tree = uqpen.run(study)
    >>> tree["statistics/mc/area"]["mean"].attrs["units"]
    'm2'
    """

    _arguments: Mapping[str, Any]

    def __init__(
        self,
        model: Callable[..., Mapping[str, Any]] | object | None = None,
        inputs: Mapping[str, object] | None = None,
        outputs: Mapping[str, object] | None = None,
        designs: Mapping[str, object] | Design | None = None,
        *,
        seed: int | None = None,
        title: str | None = None,
        name: str = "study",
        models: Mapping[str, object] | None = None,
        constraints: Sequence[str] = (),
        analyses: Sequence[str | Mapping[str, Any]] = (),
        confidence_level: float | None = None,
        budget: int | None = None,
        sensitivity: bool = True,
        convergence: bool = True,
        folder: str | Path = ".",
        **sections: Unpack[SectionArguments],
    ) -> None:
        for key in sections.keys() - SECTIONS:
            raise TypeError(f"Study.__init__() got an unexpected keyword argument '{key}'")
        if isinstance(designs, Design):
            kind = family_name(DESIGNS, designs) or "design"
            designs = {kind.replace("-", "_"): designs}
        arguments = {
            "title": title,
            "seed": seed,
            "confidence_level": confidence_level,
            "budget": budget,
            "sensitivity": sensitivity,
            "convergence": convergence,
            "model": model,
            "models": models,
            "inputs": inputs,
            "outputs": outputs,
            "designs": designs,
            "constraints": constraints,
            "analyses": analyses,
            **sections,
        }
        made = StudyContent(
            arguments
            | {
                "sensitivity": None if sensitivity is True else sensitivity,
                "convergence": None if convergence is True else convergence,
                "model": {"use": model} if isinstance(model, str) else model,
                "constraints": {"keep": list(constraints)} if constraints else None,
                "analyses": list(analyses) or None,
            },
            Path(folder).absolute(),
        )
        self._copy(_read(made, name), arguments)

    @classmethod
    def of(cls, validated: ValidatedStudy) -> Study:
        """Return a validated study with the methods of this class."""
        arguments = tomllib.loads(validated.text)
        arguments["constraints"] = arguments.get("constraints", {}).get("keep", ())
        study = cls.__new__(cls)
        study._copy(validated, arguments)
        return study

    @property
    def inputs(self) -> Mapping[Any, object]:
        """The inputs as they were stated: distributions, texts, or tables of a study file."""
        return dict(self._arguments.get("inputs") or {})

    @property
    def outputs(self) -> Mapping[str, object]:
        """The outputs as they were stated."""
        return dict(self._arguments.get("outputs") or {})

    def replace(self, **changes: Any) -> Study:
        """Return a study with other arguments, which is checked anew.

        Parameters
        ----------
        **changes
            Arguments of `Study`, each in place of the whole of this study's own; None leaves one
            out. A model that a study file names by a table, too.

        Raises
        ------
        StudyError
            Listing every mistake.

        Examples
        --------
        >>> larger = study.replace(designs={"mc": uqpen.MonteCarlo(10_000)})  # doctest: +SKIP
        >>> study.replace(inputs={**study.inputs, "load": "(5 ± 1) kN"})  # doctest: +SKIP
        """
        kept = {"name": self.name, "folder": self.folder, **self._arguments}
        return type(self)(**{**kept, **changes})

    def to_toml(self) -> str:
        """Return the text of the study, which its archive keeps.

        A function that is a Python object stands in it by its name and source, for reading only.
        """
        return self.text

    def __repr__(self) -> str:
        designs = ", ".join(self.designs)
        return f"<uqpen.Study {self.title!r}: {self.model.name}; designs {designs}>"

    def _repr_html_(self) -> str:
        return study_html(self)

    def _copy(self, study: ValidatedStudy, arguments: Mapping[str, Any]) -> None:
        for each in dataclasses.fields(ValidatedStudy):
            object.__setattr__(self, each.name, getattr(study, each.name))
        given = {name: value for name, value in arguments.items() if value is not None}
        object.__setattr__(self, "_arguments", given)


def _read(made: StudyContent, name: str) -> ValidatedStudy:
    """Read the content of a study as its text is read."""
    ordered = {key: made.content[key] for key in SECTIONS if key in made.content}
    text = tomli_w.dumps(ordered, multiline_strings=True)
    if tomllib.loads(text) != ordered:  # a multi-line text loses carriage returns
        text = tomli_w.dumps(ordered)
    document = parse_document(text, "uqpen.Study", made.objects, ArgumentsDocument)
    try:
        study = read_study(document, name, made.folder, trust=True)
    except StudyError as error:
        # Without the consequences of others: those whose path is that of another, or within it.
        further = [
            each
            for each in error.problems
            if not any(each.path[: len(other.path)] == other.path for other in made.problems)
        ]
        raise document.error([*made.problems, *further]) from None
    if made.problems:
        raise document.error(made.problems)
    return study


def load_study(path: str | Path) -> Study:
    """Read a study file.

    Parameters
    ----------
    path : str or Path
        A TOML file. The files that it names are beside it.

    Raises
    ------
    StudyError
        Listing every mistake with its line, what was found and what is expected.
    """
    return Study.of(read_file(path))


def as_study(study: object, changes: Mapping[str, Any]) -> ValidatedStudy:
    """Return a study of a study, of the path of its file, or of a model with its arguments.

    Parameters
    ----------
    study : Study, str, Path, callable, PythonModel or Model
        What is to be run.
    changes : mapping of str to object
        Arguments of `Study`: all of them beside a model, others in place of those of a study.
    """
    if isinstance(study, str | Path):
        study = load_study(study)
    if isinstance(study, Study):
        return study.replace(**changes) if changes else study
    if isinstance(study, ValidatedStudy) and not changes:
        return study
    if isinstance(study, PythonModel | Model) or callable(study):
        return Study(study, **changes)
    raise StudyError(
        f"found an object of class {type(study).__name__}; expected a uqpen.Study, the path of a "
        "study file, or a function with its inputs, outputs and designs"
    )
