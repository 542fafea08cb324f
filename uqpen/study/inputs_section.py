"""``[inputs]`` and ``[constraints]``: fixed and random inputs, measured ones, admissible points."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import Column, ColumnFile, read_columns
from uqpen.core.errors import ConstraintError, QuantityError, SettingsError, TableError, toml_text
from uqpen.core.formulas import Formula, names_in, parse_formula
from uqpen.core.labels import UNCERTAIN_FIT
from uqpen.core.lookup import choices, nearest, resolve
from uqpen.core.model import Input, Model
from uqpen.core.quantities import parse_quantity, parse_spread
from uqpen.core.settings import declared_settings, file, flag, read_list, text
from uqpen.core.streams import Stream
from uqpen.core.units import ANY_DIMENSION, DIMENSIONLESS, NUMBER, are_convertible, describe, scale
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.constraints import Constraint, parse_constraint
from uqpen.distributions.distribution import Distribution, UnloadedDistribution
from uqpen.distributions.frozen import (
    LIBRARIES,
    FrozenDistribution,
    frozen_distribution,
    frozen_families,
)
from uqpen.distributions.input_group import (
    ConditionalGroup,
    ConditionalPart,
    ImplicitMarginal,
)
from uqpen.distributions.joint_distribution import (
    DerivedInput,
    FixedInput,
    IntervalInput,
    JointDistribution,
    RandomInput,
)
from uqpen.distributions.measurements import (
    FEWEST,
    FEWEST_FOR_A_FAMILY,
    Empirical,
    check_measurements,
    fit_distribution,
    fitted_families,
    parameters_text,
    value_text,
)
from uqpen.distributions.stated import STATED, Stated, from_stated, is_stated
from uqpen.distributions.univariate import Choice, Mixture, Normal, Truncated
from uqpen.distributions.unknowns import (
    DRAWS,
    ParameterBox,
    fitted_parameters,
)
from uqpen.models.data.data_model import DataModel
from uqpen.study.joint_section import Groups, Inputs
from uqpen.study.table_reader import OBJECT, SETTINGS, TableReader, check_names, read_named_object
from uqpen.study.user_defined_members import (
    DISTRIBUTION,
    Files,
    installed_names,
    is_reference,
    read_user_defined,
)

# The keys that stand where the name of a distribution would.
_FROZEN = (*LIBRARIES, OBJECT)


def _read_frozen(table: TableReader, variable: Input, library: str) -> RandomInput | None:
    """Read an input with a distribution of another library; None where a mistake was noted.

    The table has the name of the distribution, its parameters as numbers, and the unit of its
    values. In place of them, the text of a study in Python may name an object.
    """
    if library == OBJECT:
        return _read_object(table, variable)
    unit, noted = _unit(table, variable), len(table.problems)
    name = table.text("name", f"the name of a distribution of {LIBRARIES[library]}")
    parameters: dict[str, float] = {}
    for key in [each for each in table if each not in ("name", "unit")]:
        value = table.take(key)
        if isinstance(value, int | float) and not isinstance(value, bool):
            parameters[key] = float(value)
        else:
            table.add_wrong(key, value, "a number, in the unit of the values")
    if name is None or len(table.problems) > noted:
        return None
    try:
        distribution = frozen_distribution(library, name, parameters, unit)
    except ImportError:
        table.add_problem((), f"a distribution of {library}", f"{library} to be installed")
    except LookupError:
        close = nearest(name, frozen_families(library))
        hint = f'; did you mean "{close}"?' if close else ""
        expected = f"a distribution of {LIBRARIES[library]}{hint}"
        table.add_wrong("name", name, expected)
    except ValueError as error:
        table.add_problem((), f"{_listing(parameters)}: {error}", f"parameters of {name}")
    else:
        shown = "" if unit == DIMENSIONLESS else f" [{unit}]"
        text = f"{library} {name}: {_listing(parameters)}{shown}"
        return RandomInput(variable, distribution, unit, text)
    return None


def _read_object(table: TableReader, variable: Input) -> RandomInput | None:
    """Read an input whose distribution is an object of the Python program.

    One of a user's class, which has settings for a reader, may be absent.
    """
    is_own = SETTINGS in table
    unit = variable.preferred_unit if is_own else _unit(table, variable)
    expected = "a distribution that a file can state: a file cannot contain a Python object"
    found = read_named_object(table, "distribution", expected)
    if is_own:
        table.take(SETTINGS)
    table.check_unknown_keys()
    if found is None:
        return None
    distribution: Distribution
    if is_own:
        is_here = isinstance(found.value, Distribution)
        distribution = found.value if is_here else UnloadedDistribution(found.name)
    elif found.value is None:
        table.add_wrong(OBJECT, found.name, expected)
        return None
    else:
        distribution = FrozenDistribution(found.value, unit)
    return RandomInput(variable, distribution, unit, found.name)


def _unit(table: TableReader, variable: Input) -> str:
    """Read the unit of the values of a distribution."""
    unit = table.text("unit", "the unit of its values") if "unit" in table else DIMENSIONLESS
    try:
        if unit is None or variable.unit is ANY_DIMENSION or are_convertible(unit, variable.unit):
            return unit or DIMENSIONLESS
        found = unit if "unit" in table else "values without a unit"
        table.add_problem("unit", found, describe(variable.unit))
    except QuantityError as error:
        table.add_problem("unit", error.found, error.expected)
    return DIMENSIONLESS


def _listing(parameters: dict[str, float]) -> str:
    return ", ".join(f"{key} {value:g}" for key, value in parameters.items()) or "no parameters"


# Characters of an input in another form that is recognised.
_LONGEST_FORM = 100
# Keys by which other programs name a distribution beside its parameters.
_NAMING = ("distribution", "dist", "type", "kind", "family", "name")
# The key that stands where the name of a distribution would.
MEASURED = "measured"
# The key of the ends of an input that has no distribution.
INTERVAL = "interval"
# The key of a list of distributions, and that of the probability of each.
MIXTURE, _WEIGHT = "mixture", "weight"


@dataclass(frozen=True)
class _Measured:
    """Settings of measurements: a column of a file, and the family that is fitted to it.

    With `uncertain` parameters, the distribution is that of the next specimen.
    """

    file: Path = file()
    column: str | None = text(expected="the heading of a column", default=None)
    family: str | None = text(expected="the name of a distribution", default=None)
    uncertain: bool = flag(default=False)


def _read_measured(table: TableReader, variable: Input, stream: Stream) -> RandomInput | None:
    """Read an input from measurements; None where a mistake was noted.

    The test of a fit draws from `stream`, which is the input's own.
    """
    noted = len(table.problems)
    measured = table.whole_settings(_Measured)
    _check_family(table)
    if measured is None or len(table.problems) > noted:
        return None
    found = _read_column(table, measured, variable)
    if found is None:
        return None
    column, values, read = found
    source = f"{measured.file.name}, {column.heading}"
    fewest = FEWEST_FOR_A_FAMILY if measured.family else FEWEST
    for problem in check_measurements(values, column, variable, fewest=fewest):
        table.add_problem("file", f"{problem.found} in {source}", problem.expected)
    if len(table.problems) > noted:
        return None
    fit: dict[str, str | int | float] = {
        "fit_family": measured.family or "empirical",
        "fit_measurements": len(values),
        "fit_source": source,
        "fit_sha256": hashlib.sha256(values.astype("<f8").tobytes()).hexdigest(),
    }
    if measured.family is None:
        ends = (value_text(float(end), column.unit) for end in (values.min(), values.max()))
        description = f"as measured: {len(values)} values of {source}, from {' to '.join(ends)}"
        made = RandomInput(variable, Empirical(tuple(values.tolist())), column.unit, description)
    elif (of_family := _read_fit(table, measured, variable, values, column, stream)) is None:
        return None
    else:
        made = of_family
    return replace(made, fit={**fit, **made.fit}, files=(read.file,))


def _read_fit(
    table: TableReader,
    measured: _Measured,
    variable: Input,
    values: FloatArray,
    column: Column,
    stream: Stream,
) -> RandomInput | None:
    """Read an input from a family that is fitted to its measurements."""
    family, unknown = measured.family or "", None
    source = f"{measured.file.name}, {column.heading}"
    try:
        fitted = fit_distribution(family, values, stream.generator("fit"))
    except SettingsError as error:
        for problem in error.problems:
            table.add_problem("family", f"{problem.found}, in {source}", problem.expected)
        return None
    distribution = fitted.distribution
    description = (
        f"{family} fitted to {len(values)} values of {source}: "
        f"{parameters_text(distribution, column.unit)}; "
        f"Kolmogorov-Smirnov distance {fitted.distance:.3g}, p = {fitted.p_value:.2g}"
    )
    fit: dict[str, str | int | float] = {
        f"fit_{parameter.name}": getattr(distribution, parameter.name)
        for parameter, _ in declared_settings(distribution)
    }
    if measured.uncertain:
        try:
            unknown = fitted_parameters(family, values, stream.generator("parameters"))
        except SettingsError as error:
            table.add_problems(error.problems, "uncertain")
            return None
        distribution = unknown.drawn()
        description += "; its parameters uncertain, so drawn as the next specimen is"
        fit[UNCERTAIN_FIT] = (
            f"{DRAWS} draws of the parameters under which such measurements are as likely; "
            "points are draws of the predictive distribution"
        )
    fit["fit_test"] = "Kolmogorov-Smirnov distance; p value by parametric bootstrap"
    fit["fit_statistic"] = fitted.distance
    fit["fit_p_value"] = fitted.p_value
    if fitted.is_rejected:
        fit["fit_warning"] = (
            f"{family} does not fit the measurements: of samples of the fitted law, "
            f"a share of {fitted.p_value:.2g} lies as far from it (p value)"
        )
    return RandomInput(variable, distribution, column.unit, description, fit, unknown=unknown)


def _check_family(table: TableReader) -> None:
    family = table.content.get("family")
    if not isinstance(family, str) or not family.strip():
        if table.content.get("uncertain") is True and family is None:
            found = "uncertain = true for the measurements themselves"
            expected = 'a family beside it, such as family = "normal", whose parameters it means'
            table.add_problem("uncertain", found, expected)
    elif family not in DISTRIBUTIONS:
        table.add_wrong("family", family, f"a distribution; {choices(family, fitted_families())}")
    elif reason := resolve(DISTRIBUTIONS[family]).unfitted_reason:
        found = f"{toml_text(family)}, which is not fitted: {reason}"
        known = ", ".join(fitted_families())
        expected = f"one of {known}, or no family for the measurements themselves"
        table.add_problem("family", found, expected)


def _read_column(
    table: TableReader, measured: _Measured, variable: Input
) -> tuple[Column, FloatArray, ColumnFile] | None:
    unit = "cm" if variable.unit is ANY_DIMENSION else variable.unit
    expected = f'a CSV or NetCDF file beside the study, with a column such as "x [{unit}]"'
    key = "file"
    try:
        read = read_columns(measured.file)
        key, expected = "column", f"the heading of a column of {variable.title}"
        column = read.column(measured.column or "")
        expected = f'a column of numbers, with its unit: "{column.name} [{unit}]"'
        if variable.unit is not ANY_DIMENSION:
            return column, column.values(variable.unit), read
    except TableError as error:
        table.add_problem(key, str(error), expected)
    return None


Entry = FixedInput | RandomInput | DerivedInput | IntervalInput

_FAMILIES = (*DISTRIBUTIONS, MIXTURE, MEASURED, *LIBRARIES)

# Distributions of labels; `discrete` is that of the texts of a data file.
_OF_LABELS = ("choice", "discrete")

# The ends of a truncated distribution, and their names in its description.
_LIMITS = {"lower": "at least", "upper": "at most"}


def read_inputs(table: TableReader, model: Model, stream: Stream, groups: Groups) -> Inputs:
    """Read the joint distribution of a model's inputs; invalid entries are noted and left out.

    Tests of fits to measurements draw from `stream`. Inputs of `groups` have no entry in the table.
    """
    known = {variable.name: variable for variable in model.inputs}
    entries: dict[str, Entry | None] = {}
    conditional: dict[str, ConditionalPart] = {}
    for name in check_names(table, known, "input", model):
        if family := _conditional_family(table.content[name], known[name], model):
            section = table.inside(table.take(name), name)
            if part := _read_conditional_part(section, known[name], family, known):
                conditional[name] = part
            entries[name] = None
        elif _is_formula(table.content[name], known[name], model):
            entries[name] = _read_derived_input(table, known[name], known)
        else:
            entries[name] = _read_input(table, known[name], stream.child(name))
    _check_cycles(table, entries)
    entries |= groups.entries
    others = [variable for variable in model.inputs if variable.name not in groups.owners]
    for variable in others:
        if table.is_given and variable.name not in table and variable.default is not None:
            entries[variable.name] = FixedInput(variable, variable.default, variable.preferred_unit)
    chain = _conditional_group(table, conditional, known, entries, groups)
    found = (entries.get(variable.name) for variable in model.inputs)
    all_groups = (*groups.groups, chain) if chain else groups.groups
    joint = JointDistribution(tuple(filter(None, found)), model.inputs, groups=all_groups)
    unclear = groups.unclear | {name for name in table if entries.get(name) is None}
    if not table.is_given or not unclear <= known.keys():
        # What is absent may stand there under a name with a mistake.
        unclear |= known.keys() - set(table) - groups.entries.keys()
    return Inputs(joint, frozenset(unclear))


def given_inputs(model: Model, inputs: Inputs) -> frozenset[str]:
    """Return the names of the inputs that a study gives values for."""
    given = inputs.unclear.union(entry.variable.name for entry in inputs.joint.inputs)
    return frozenset(given | model.points.keys() if isinstance(model, DataModel) else given)


def read_constraints(table: TableReader, model: Model, inputs: Inputs) -> tuple[Constraint, ...]:
    """Read the comparisons of inputs that every point must satisfy."""
    given = given_inputs(model, inputs)
    units = dict.fromkeys(inputs.unclear, ANY_DIMENSION) | {
        variable.name: variable.unit
        for variable in model.inputs
        if not variable.labels and (variable.name in given or variable.unit is ANY_DIMENSION)
    }
    found = []
    for position, written in enumerate(table.entries("keep")):
        if not isinstance(written, str):
            table.add_wrong(("keep", position), written, 'a comparison such as "a > b"')
            continue
        try:
            found.append(parse_constraint(written, units))
        except ConstraintError as error:
            table.add_problems(error.problems, "keep", position)
    table.check_unknown_keys()
    return tuple(found)


def _conditional_family(value: object, variable: Input, model: Model) -> str:
    """Return the family of an input with a formula among its parameters; empty for others."""
    families = [key for key in value if key in DISTRIBUTIONS] if isinstance(value, dict) else []
    parameters = value[families[0]] if isinstance(value, dict) and families else None
    if not isinstance(parameters, dict) or variable.labels:
        return ""
    is_conditional = any(_is_formula(each, variable, model) for each in parameters.values())
    return families[0] if is_conditional else ""


def _read_conditional_part(
    table: TableReader, variable: Input, name: str, known: Mapping[str, Input]
) -> ConditionalPart | None:
    """Read a distribution with parameters that are formulas of other inputs."""
    family: type[Distribution] = resolve(DISTRIBUTIONS[name])
    noted, section = len(table.problems), table.table(name)
    for key in set(table) - {name}:
        found = "a limit or a weight of a distribution whose parameters are formulas"
        table.add_problem(key, found, "parameters alone")
    units = _units_in_formulas(known, variable.name)
    if variable.unit is ANY_DIMENSION or ANY_DIMENSION in units.values():
        return None
    formulas: dict[str, Formula | None] = {}
    for field, declared in declared_settings(family):
        written = section.content.get(field.name)
        if not isinstance(written, str) or not (named := names_in(written)):
            continue
        if named.isdisjoint(units) and not _FORMULA.fullmatch(written.strip()):
            continue
        formulas[field.name] = None
        like = variable.unit if declared.has_dimension else DIMENSIONLESS
        if not declared.has_dimension and declared.kind != "number":
            section.add_wrong(field.name, written, declared.expected)
            continue
        try:
            formulas[field.name] = _parse(written, units, like)
        except ConstraintError as error:
            section.add_problems(error.problems, field.name)
    rest = {key: each for key, each in section.content.items() if key not in formulas}
    reader = table.inside(rest, name)
    values = reader.setting_values(family, variable.unit, dict.fromkeys(formulas, 1.0))
    reader.check_unknown_keys()
    if values is None or len(table.problems) > noted:
        return None
    text = ", ".join(f"{key} {each}" for key, each in section.content.items())
    return ConditionalPart(family, {**values, **formulas}, f"{name}: {text}")


def _conditional_group(
    table: TableReader,
    parts: Mapping[str, ConditionalPart],
    known: Mapping[str, Input],
    entries: dict[str, Entry | None],
    groups: Groups,
) -> ConditionalGroup | None:
    """Return the chain of the inputs whose parameters are formulas, and of those these name.

    Their entries are added; those of inputs with a mistake are None.
    """
    noted = len(table.problems)
    named = {name: sorted(_names_of_inputs(part)) for name, part in parts.items()}
    of_them = {source: entries.get(source) for names in named.values() for source in names}
    reasons = dict.fromkeys(groups.owners, "is in [joint]")
    for source, entry in of_them.items():
        if isinstance(entry, DerivedInput | IntervalInput):
            is_derived = isinstance(entry, DerivedInput)
            reasons[source] = "follows from others" if is_derived else "is an interval"
    for name, source in [(name, x) for name, names in named.items() for x in names if x in reasons]:
        expected = "formulas of inputs with a value or a distribution of their own"
        table.add_problem(name, f"a parameter of {source}, which {reasons[source]}", expected)
    is_clear = all(each is not None or name in parts for name, each in of_them.items())
    if not parts or not is_clear or len(table.problems) > noted:
        return None
    chain: dict[str, Distribution | ConditionalPart] = {
        name: each.distribution for name, each in of_them.items() if isinstance(each, RandomInput)
    }
    sources = {name: [x for x in names if x in parts] for name, names in named.items()}
    try:
        chain |= {name: parts[name] for name in TopologicalSorter(sources).static_order()}
    except CycleError as error:
        cycle = sorted(set(error.args[1]))
        found = f"a cycle of {' and '.join(cycle)}"
        table.add_problem(cycle[0], found, "parameters of inputs before them")
        return None
    fixed = {name: each.value for name, each in of_them.items() if isinstance(each, FixedInput)}
    group = ConditionalGroup(tuple(chain), tuple(chain.values()), fixed)
    nominal = dict(zip(group.inputs, group.nominal(), strict=True))
    for name, part in parts.items():
        if np.isfinite(nominal[name]):
            of_one = ImplicitMarginal(part.text, nominal[name])
            entries[name] = RandomInput(known[name], of_one, known[name].preferred_unit, part.text)
        else:
            found = "parameters that make no distribution at the medians of the others"
            table.add_problem(name, found, f"those of a {part.text.partition(':')[0]} distribution")
    return group if len(table.problems) == noted else None


def _names_of_inputs(part: ConditionalPart) -> set[str]:
    formulas = [each for each in part.parameters.values() if isinstance(each, Formula)]
    return {name for each in formulas for name in each.names}


def _units_in_formulas(known: Mapping[str, Input], of: str) -> dict[str, str]:
    """Return the units of the inputs that a formula of another may name; labels are no numbers."""
    others = (each for name, each in known.items() if name != of and not each.labels)
    return {each.name: each.unit for each in others}


def _is_formula(value: object, variable: Input, model: Model) -> bool:
    """Check for a text that computes an input from others; a quantity is none."""
    if not isinstance(value, str) or isinstance(model, DataModel) or len(value) > _LONGEST_FORM:
        return False
    with suppress(QuantityError):
        parse_quantity(value, variable.unit)
        return False
    named = names_in(value)
    if not named:
        return False
    is_known = not named.isdisjoint(each.name for each in model.inputs)
    return is_known or _FORMULA.fullmatch(value.strip()) is not None


def _read_derived_input(
    table: TableReader, variable: Input, known: Mapping[str, Input]
) -> DerivedInput | None:
    """Read an input that follows from others, such as ``"0.1 * diameter"``."""
    written = table.take(variable.name)
    units = _units_in_formulas(known, variable.name)
    if variable.unit is ANY_DIMENSION or ANY_DIMENSION in units.values():
        return None
    try:
        formula = _parse(written, units, variable.unit)
    except ConstraintError as error:
        table.add_problems(error.problems, variable.name)
        return None
    return DerivedInput(variable, formula, variable.preferred_unit)


def _parse(written: str, units: Mapping[str, str], like: str) -> Formula:
    """Return a formula of inputs; ConstraintError unless it has the dimension of `like`."""
    formula = parse_formula(written, units, "an input of the model", "input")
    if not are_convertible(formula.unit, like):
        of = "without a unit" if formula.unit == DIMENSIONLESS else f"in {formula.unit}"
        raise ConstraintError(f"{toml_text(written)}, {of}", describe(like))
    return formula


def _check_cycles(table: TableReader, entries: dict[str, Entry | None]) -> None:
    """Note inputs that follow from themselves, with the way around; they are left out."""
    derived = {name: each for name, each in entries.items() if isinstance(each, DerivedInput)}
    while True:
        sources = {
            name: sorted(each.formula.names & derived.keys()) for name, each in derived.items()
        }
        try:
            TopologicalSorter(sources).prepare()
            return
        except CycleError as error:
            cycle = error.args[1][::-1]  # each behind what follows from it
        found = f"{' from '.join(cycle)}: a cycle"
        table.add_problem(cycle[0], found, "formulas of inputs that have values of their own")
        entries |= dict.fromkeys(cycle)
        derived = {name: each for name, each in derived.items() if name not in cycle}


def _read_input(table: TableReader, variable: Input, stream: Stream) -> Entry | None:
    value = table.take(variable.name)
    if isinstance(value, dict):
        section = table.inside(value, variable.name)
        if INTERVAL in value:
            return _read_interval(section, variable)
        return _read_random_input(section, variable, stream)
    return (_read_label if variable.labels else _read_number)(table, variable, value)


def _read_interval(table: TableReader, variable: Input) -> IntervalInput | None:
    """Read an input with two known ends and no distribution, from ``{ interval = [a, b] }``."""
    for key in [each for each in table if each != INTERVAL]:
        table.take(key)
        found = "a limit or a distribution beside an interval"
        table.add_problem(key, found, "the ends alone: nothing else is known of the input")
    written = table.take(INTERVAL)
    if variable.labels:
        found = "an interval of labels, which have no order"
        table.add_problem(INTERVAL, found, "a choice among them, or one of them")
        return None
    try:
        ends = read_list(written, lambda end: parse_quantity(end, variable.unit))
    except (SettingsError, QuantityError) as error:
        table.add_problems(error.problems, INTERVAL)
        return None
    values = [end.value for end in ends]
    if variable.unit is ANY_DIMENSION:
        return None
    if len(ends) != 2 or not values[0] < values[1]:
        expected = 'two ends, the lower one first, such as ["2 m", "3 m"]'
        table.add_problem(INTERVAL, ", ".join(map(str, written)) or "no end", expected)
        return None
    for place, value in enumerate(values):
        if not variable.bounds.contain(np.array(value)):
            table.add_wrong((INTERVAL, place), written[place], _allowed(variable))
            return None
    text = f"interval, {written[0]} to {written[1]}; no more is known of it"
    return IntervalInput(variable, values[0], values[1], ends[0].unit, text)


def _allowed(variable: Input) -> str:
    """Return the values that an input can have, for a message."""
    where = "" if variable.unit == DIMENSIONLESS else f" {variable.unit}"
    return f"a value {variable.bounds}{where}"


def _read_number(
    table: TableReader, variable: Input, value: Any
) -> FixedInput | RandomInput | None:
    """Read a fixed value, or a mean with a spread."""
    try:
        spread = parse_spread(value, variable.unit) if isinstance(value, str) else None
        if spread is None:
            quantity = parse_quantity(value, variable.unit)
            if variable.bounds.contain(np.array(quantity.value)):
                return FixedInput(variable, quantity.value, quantity.unit)
            table.add_wrong(variable.name, value, _allowed(variable))
            return None
        normal = Normal(spread.mean, spread.std)
        if _is_usable(table, variable.name, normal):
            description = f"normal {value}"
            if not value.strip().endswith(")") and (")" not in value or "%" in value):
                std = scale(spread.unit).difference_from_si(spread.std)
                unit = "" if spread.unit == DIMENSIONLESS else f" {spread.unit}"
                description += f", where ± is one standard deviation, {std:.6g}{unit}"
            return RandomInput(variable, normal, spread.unit, description)
    except QuantityError as error:
        found, expected = error.found, error.expected
        if here := _form_here(value):
            found, expected = toml_text(value), here
        elif not isinstance(value, str | int | float):
            expected += ", or a distribution such as { normal = { mean = …, std = … } }"
        table.add_problem(variable.name, found, expected)
    except SettingsError:
        table.add_wrong(variable.name, value, "a standard deviation above 0 behind the ±")
    return None


def _read_label(table: TableReader, variable: Input, value: object) -> FixedInput | None:
    """Read a fixed input that is one of the labels of the model."""
    try:
        return FixedInput(variable, variable.label_code(value), DIMENSIONLESS)
    except QuantityError as error:
        table.add_problems(error.problems, variable.name)
    return None


# Forms of an input that people bring, each a text as a whole.
_SPREAD = re.compile(rf"({NUMBER})\s*(.*?)\s*(?:±|\+/-|\+-)\s*({NUMBER})\s*(.*)")
_END = r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_RANGE = re.compile(rf"\[?\s*({_END})\s*(.*?)\s*(?:\bto\b|\.\.+|[–…]|-)\s*({_END})\s*\]?\s*(.*)")
_CALL = re.compile(rf"([NU])\w*\s*\(\s*({NUMBER})\s*,\s*({NUMBER})\s*\)\s*(.*)")
_FORMULA = re.compile(rf"{NUMBER}\s*\*.*|[A-Za-z_]\w*\s*[-+*/].*")


def _form_here(value: object) -> str:
    """Return how an input in another form is written here; empty for a form that is not known.

    A form that has two meanings has both of them in the answer.
    """
    if (
        isinstance(value, list)
        and len(value) == 2
        and all(type(each) in (int, float) for each in value)
    ):
        return _between(value[0], value[1], "", "")
    if isinstance(value, list) and len(value) == 2 and {*map(type, value)} == {str}:
        value = " to ".join(value)
    if not isinstance(value, str) or len(value) > _LONGEST_FORM:
        return ""
    text = value.strip().replace("\N{MINUS SIGN}", "-")
    if match := _SPREAD.fullmatch(text):
        mean, unit, half, other = match.groups()
        if unit and other:  # which are of different dimensions, say
            return ""
        middle, size = float(mean), float(half)
        unit = unit or other
        limits = _uniform(middle - size, middle + size, unit)
        return (
            f'"({mean} ± {size:.6g}) {unit}"'.replace(' "', '"')
            + f" if that is the standard deviation, {limits} if it is a limit"
        )
    if match := _CALL.fullmatch(text):
        kind, one, two, unit = match.groups()
        if kind == "U":
            return _uniform(float(one), float(two), unit)
        return f'"({one} ± {two}) {unit}"'.replace(' "', '"')
    if match := _RANGE.fullmatch(text.replace(",", "…") if text.startswith("[") else text):
        lower, unit, upper, other = match.groups()
        return _between(float(lower), float(upper), unit or other, other or unit)
    if _FORMULA.fullmatch(text):
        return "a value or a distribution; what follows from other columns belongs to the file"
    return ""


def _between(lower: float, upper: float, unit: str, of_upper: str) -> str:
    """Return both meanings of a range, whose ends may be in units of their own."""
    return (
        f"{_uniform(lower, upper, unit, of_upper)} if all values between them are equally likely, "
        f"or {{ interval = [{_quoted(lower, unit)}, {_quoted(upper, of_upper)}] }} if nothing but "
        "the ends is known: the first gives one answer, the second bounds"
    )


def _uniform(lower: float, upper: float, unit: str, of_upper: str = "") -> str:
    ends = _quoted(lower, unit), _quoted(upper, of_upper or unit)
    return f"{{ uniform = {{ lower = {ends[0]}, upper = {ends[1]} }} }}"


def _quoted(value: float, unit: str) -> str:
    return f'"{value:.6g} {unit}"' if unit else f"{value:.6g}"


def _read_random_input(table: TableReader, variable: Input, stream: Stream) -> RandomInput | None:
    """Read a random input from ``{ family = { … }, lower = …, upper = … }``."""
    family = _family(table)
    section = table.table(family) if family and family != MIXTURE else None
    made: RandomInput | None
    if variable.labels and family is not None and family not in _OF_LABELS:
        labels = ", ".join(map(toml_text, variable.labels))
        expected = f"{{ choice = {{ labels = [{labels}] }} }}: labels have no mean and no unit"
        table.add_problem(family, "a distribution of numbers, of labels", expected)
        return None
    if family == MIXTURE:
        made = _read_mixture(table, variable, stream)
    elif family is None or section is None or not section.is_given:
        return None
    elif family == MEASURED:
        made = _read_measured(section, variable, stream)
    elif family in _FROZEN:
        made = _read_frozen(section, variable, family)
    else:
        made = _read_distribution(section, variable, family)
    limits = {key: table.quantity(key, variable.unit) for key in _LIMITS if key in table}
    if made is None or None in limits.values() or (limits and variable.unit is ANY_DIMENSION):
        return None
    if limits and not isinstance(made.distribution, UnloadedDistribution):
        try:
            distribution = Truncated(made.distribution, **limits)  # type: ignore[arg-type]
            unknown = made.unknown and made.unknown.truncated(
                distribution.lower, distribution.upper
            )
        except SettingsError as error:
            table.add_refused(error.problems)
            return None
        written = [f"{_LIMITS[key]} {table.content[key]}" for key in table if key != family]
        description = "; ".join([made.description, *written])
        made = replace(
            made,
            distribution=unknown.drawn() if unknown else distribution,
            description=description,
            unknown=unknown,
        )
    if isinstance(made.distribution, UnloadedDistribution):
        return made
    return made if _is_usable(table, family, made.distribution) else None


def _read_mixture(table: TableReader, variable: Input, stream: Stream) -> RandomInput | None:
    """Read an input from ``{ mixture = [{ weight = 0.7, family = { … } }, …] }``."""
    parts, weights, noted = list[RandomInput](), list[float](), len(table.problems)
    for position, written in enumerate(table.entries(MIXTURE)):
        place = (MIXTURE, position)
        content = dict(written) if isinstance(written, dict) else {}
        weight = content.pop(_WEIGHT, None)
        if type(weight) not in (int, float) or not 0 < weight < np.inf:
            example = "{ weight = 0.7, normal = { … } }"
            found = "nothing" if weight is None else toml_text(weight)
            table.add_problem((*place, _WEIGHT), found, f"a number above 0: {example}")
        elif MEASURED in content:
            expected = "measurements by themselves, or a distribution in their place"
            table.add_problem((*place, MEASURED), "measurements in a mixture", expected)
        elif part := _read_random_input(table.inside(content, *place), variable, stream):
            if part.unknown is not None:
                expected = "one value of each parameter, or a distribution by itself"
                table.add_problem(place, "intervals as parameters in a mixture", expected)
            parts.append(part)
            weights.append(float(weight))
    if len(table.problems) > noted:
        return None
    described = zip(weights, parts, strict=True)
    text = ", ".join(f"{weight:g} {part.description}" for weight, part in described)
    files = tuple(file for part in parts for file in part.files)
    unit = parts[0].display_unit if parts else variable.preferred_unit
    unloaded = [each.distribution for each in parts]
    distribution: Distribution
    if any(isinstance(each, UnloadedDistribution) for each in unloaded):
        distribution = UnloadedDistribution(text)
    else:
        try:
            distribution = Mixture(tuple(each.distribution for each in parts), tuple(weights))
        except SettingsError as error:
            table.add_problems(error.problems, MIXTURE)
            return None
    return RandomInput(variable, distribution, unit, f"mixture: {text}", files=files)


def _family(table: TableReader) -> str | None:
    """Return the distribution of a random input: a name or a reference."""
    families = [key for key in table if key not in _LIMITS]
    if len(families) != 1:
        _add_wrong_keys(table, families)
        return None
    (family,) = families
    if family in (*_FAMILIES, OBJECT) or is_reference(family):
        return family
    known = dict.fromkeys((*_FAMILIES, *installed_names(DISTRIBUTION, family)))
    if family in known:
        return family
    expected = choices(family, known)
    for library in LIBRARIES:
        with suppress(ImportError):
            own = {name.casefold(): name for name in frozen_families(library)}
            if name := own.get(family.casefold().replace("_", "")):
                expected = f'{{ {library} = {{ name = "{name}", … }} }}; or {expected}'
                break
    table.add_problem(family, "an unknown distribution", expected)
    return None


def _add_wrong_keys(table: TableReader, families: list[str]) -> None:
    """Note the keys of a random input where not exactly one stands for a distribution."""
    unknown = [key for key in families if key not in _FAMILIES]
    if len(families) - len(unknown) == 1:
        for key in unknown:
            table.add_problem(key, "an unknown key", choices(key, _LIMITS))
        return
    expected = f"one distribution of {', '.join(_FAMILIES)}"
    found = " and ".join(families) or "no distribution"
    if table.content and not families:
        found = f"{' and '.join(table)} without a distribution"
        expected = f"{expected}; or {{ {INTERVAL} = [lower, upper] }}"
    for key in _NAMING:
        named = table.content.get(key)
        if isinstance(named, str) and (family := nearest(named, _FAMILIES)):
            others = (f"{each} = …" for each in families if each != key)
            expected = f"{{ {family} = {{ {', '.join(others)} }} }}"
    table.add_problem((), found, expected)


def _read_distribution(table: TableReader, variable: Input, family: str) -> RandomInput | None:
    """Read a random input with a built-in distribution, or a user-defined one if it is trusted."""
    distribution: Distribution | None
    files: Files = ()
    parameters = ", ".join(f"{name} {value}" for name, value in table.content.items())
    if variable.labels and isinstance(values := table.content.get("values"), list):
        codes = [variable.labels.index(x) if x in variable.labels else x for x in values]
        table = replace(table, content={**table.content, "values": codes})
    unknown: ParameterBox | None = None
    ends = _parameter_intervals(table, family) if family in DISTRIBUTIONS else []
    if ends:
        unknown = _read_box(table, variable, family, ends)
        distribution = unknown.drawn() if unknown else None
    elif family in DISTRIBUTIONS:
        distribution = _read_family(table, variable, resolve(DISTRIBUTIONS[family]))
    elif is_reference(family) and not table.trust:
        distribution = UnloadedDistribution(family)
    else:
        distribution, folder = read_user_defined(table, (), family, DISTRIBUTION, variable.unit)
        files = folder.files() if folder else ()
    if distribution is None:
        return None
    # The unit of the first parameter as it is written.
    unit = variable.preferred_unit
    for value in _texts(list(table.content.values())):
        with suppress(QuantityError):
            unit = parse_quantity(value, variable.unit).unit
            break
    if unknown is not None:
        parameters = ", ".join(
            f"{name} {value[0]} to {value[1]}" if name in ends else f"{name} {value}"
            for name, value in table.content.items()
        )
        parameters += "; of the intervals no more is known than the ends"
    elif family in DISTRIBUTIONS and is_stated(type(distribution), table.content):
        parameters += f"; so {parameters_text(distribution, unit)}"
    description = f"{family}: {parameters}"
    return RandomInput(variable, distribution, unit, description, files=files, unknown=unknown)


def _parameter_intervals(table: TableReader, family: str) -> list[str]:
    """Return the parameters of a family that a list gives, in place of one value."""
    return [
        field.name
        for field, setting in declared_settings(resolve(DISTRIBUTIONS[family]))
        if setting.kind in ("quantity", "difference", "number", "count")
        and isinstance(table.content.get(field.name), list)
    ]


_OF_DISCRETE = "one value: bounds are of continuous distributions, by ratios of densities"


def _read_box(
    table: TableReader, variable: Input, family: str, names: list[str]
) -> ParameterBox | None:
    """Read a distribution with parameters that are intervals, each a list of two."""
    cls, noted, ends = resolve(DISTRIBUTIONS[family]), len(table.problems), []
    for name in names:
        written = table.content[name]
        two = f'two ends, such as {name} = ["9 kN", "11 kN"], or one value'
        if expected := _OF_DISCRETE if cls.is_discrete else two * (len(written) != 2):
            table.add_wrong(name, written, expected)
    if len(table.problems) > noted or variable.unit is ANY_DIMENSION:
        return None
    for place in (0, 1):
        content = {key: x[place] if key in names else x for key, x in table.content.items()}
        reader = replace(table, content=content)
        ends.append(reader.setting_values(cls, variable.unit) or {})
        reader.check_unknown_keys()
    if len(table.problems) > noted:
        return None
    lower, upper = ends
    for name in names:
        if not lower[name] < upper[name]:
            expected = "the lower end first, and an upper one above it"
            table.add_wrong(name, table.content[name], expected)
            return None
    known = {name: value for name, value in lower.items() if name not in names}
    try:
        box = ParameterBox(cls, known, {name: (lower[name], upper[name]) for name in names})
    except SettingsError as error:
        for problem in error.problems:
            found = f"{problem.found} at a corner of the intervals"
            table.add_problem(problem.path, found, problem.expected)
        return None
    return box if all(_is_usable(table, (), corner) for corner in box.corners()) else None


def _texts(values: list[object]) -> Iterator[str]:
    """Yield the texts among values, and in lists among them."""
    for value in values:
        if isinstance(value, str):
            yield value
        elif isinstance(value, list):
            yield from _texts(value)


def _read_choice(table: TableReader, variable: Input) -> Distribution | None:
    """Read a choice among the labels of an input."""
    if not variable.labels:
        expected = (
            f'its labels in the model: [model.labels] {variable.name} = ["M8", "M10"]; '
            "values of a number, such as 8 mm, are discrete and no choice"
        )
        table.add_problem((), f"a choice of {variable.name}, which has no labels", expected)
        return None
    made = table.whole_settings(Choice)
    if made is None:
        return None
    for position, label in enumerate(made.labels):
        if label not in variable.labels:
            expected = f"a label of {variable.name}; {choices(label, variable.labels)}"
            table.add_wrong(("labels", position), label, expected)
            return None
    return replace(made, order=variable.labels)


def _read_family(
    table: TableReader, variable: Input, family: type[Distribution]
) -> Distribution | None:
    """Read a built-in distribution: its parameters, or moments and quantiles in their place."""
    noted = len(table.problems)
    if family.is_count and not are_convertible(variable.unit, DIMENSIONLESS):
        found = f"whole numbers, of an input in {variable.unit}"
        expected = "an input without a unit; a discrete distribution has values with one"
        table.add_problem((), found, expected)
        return None
    if family is Choice:
        return _read_choice(table, variable)
    if not is_stated(family, table.content):
        return table.whole_settings(family, like=variable.unit)
    stated = table.settings(Stated, like=variable.unit)
    names = [field.name for field, _ in declared_settings(family)]
    values = table.setting_values(family, variable.unit, dict.fromkeys(names, 0.0)) or {}
    table.check_unknown_keys()
    if stated is None or len(table.problems) > noted or variable.unit is ANY_DIMENSION:
        return None
    kept = {name: values[name] for name in names if name in table and name not in STATED}
    try:
        return from_stated(family, stated, kept)
    except SettingsError as error:
        table.add_refused(error.problems)
    return None


def _is_usable(table: TableReader, key: str | tuple[str, ...], distribution: Distribution) -> bool:
    """Check a distribution; note one whose draws are not all finite, or are all the same."""
    if not distribution.is_finite:
        expected = "parameters whose draws are finite and differ in double precision"
        table.add_problem(
            key, "a distribution that is too wide or too narrow to draw from", expected
        )
    return distribution.is_finite
