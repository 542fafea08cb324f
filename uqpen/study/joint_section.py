"""``[joint.<name>]`` and ``[dependence]``: joint distributions of several inputs, and copulas."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.columns import Column, columns_of_table, read_columns, read_draws
from uqpen.core.errors import (
    ArchiveError,
    ConstraintError,
    QuantityError,
    SettingsError,
    TableError,
    counted,
    toml_text,
)
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import CALIBRATIONS, IMPORTANCE_WEIGHT, WEIGHT, WEIGHTED_POSTERIOR
from uqpen.core.lookup import choices, nearest
from uqpen.core.model import Input, Model
from uqpen.core.settings import as_float, number, read_each, read_list
from uqpen.core.streams import Stream
from uqpen.core.units import ANY_DIMENSION, DIMENSIONLESS, are_convertible, describe
from uqpen.distributions import COPULAS
from uqpen.distributions.copulas import MEASURES, EllipticalCopula, score_correlation
from uqpen.distributions.frozen import frozen_families
from uqpen.distributions.input_group import (
    ChaospyJoint,
    ConditionalGroup,
    ImplicitMarginal,
    InputGroup,
    SampleDistribution,
    UnloadedGroup,
    chaospy_joint,
    conditional_joint,
)
from uqpen.distributions.joint_distribution import (
    JointDistribution,
    MeasuredDependence,
    RandomInput,
)
from uqpen.models.data.data_model import DataModel
from uqpen.study.table_reader import OBJECT, TableReader, read_named_object
from uqpen.study.user_defined_members import COPULA, read_class

_KINDS = ("sample", "posterior", "chaospy", OBJECT)
_SAMPLE = 'a CSV or NetCDF file beside the study, with a column such as "x [cm]" for each input'


@dataclass(frozen=True)
class Inputs:
    """The joint distribution of the inputs without a mistake, and the names of the others.

    The mistakes of the others are noted, and nothing more is said of them.
    """

    joint: JointDistribution
    unclear: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Groups:
    """The groups of inputs without a mistake, their inputs, and the names of all grouped inputs."""

    groups: tuple[InputGroup, ...]
    entries: Mapping[str, RandomInput]  # by the name of an input
    # For each input, also of a group with a mistake, the name of its group.
    owners: Mapping[str, str]

    @property
    def unclear(self) -> frozenset[str]:
        """Inputs of groups with a mistake."""
        return frozenset(self.owners.keys() - self.entries.keys())


def read_groups(table: TableReader, model: Model, given: TableReader) -> Groups:
    """Read the joint distributions of groups of inputs; a group with a mistake is left out.

    Parameters
    ----------
    table : TableReader
        The table ``[joint]``.
    model : Model
        The model, which has the inputs.
    given : TableReader
        The table ``[inputs]``, which has none of them.
    """
    groups: list[InputGroup] = []
    entries: dict[str, RandomInput] = {}
    owners: dict[str, str] = {}
    for name in table:
        section = table.table(name, "a table of a joint distribution")
        noted = len(section.problems)
        found = _read_group(section, model) if section.is_given else None
        names = list(found[0].inputs) if found else _named(section)
        if not names:  # any input may be one of them
            names = [each.name for each in model.inputs if each.name not in {*given, *owners}]
        for each in names:
            if each in owners or each in given:
                where = f"[joint.{owners[each]}]" if each in owners else "[inputs]"
                section.add_problem((), f"{each}, which {where} has", "each input in one place")
        owners |= {each: name for each in names if each not in owners}
        if found and len(section.problems) == noted:
            group, units = found
            groups.append(group)
            entries |= _entries(group, units, model)
    if isinstance(model, DataModel) and model.together:
        weights = model.coordinates.get(WEIGHT, np.ones(model.runs))
        # One that is the same in all rows is no random input.
        left = [
            each
            for each in model.inputs
            if each.name not in {*given, *owners}
            and np.ptp(model.points[each.name][weights > 0]) > 0
        ]
        if left:
            rows = np.column_stack([model.points[each.name] for each in left])
            of_file = tuple(each.name for each in left)
            of_rows = SampleDistribution(of_file, rows, weights, model.name, model.file)
            groups.append(of_rows)
            entries |= _entries(of_rows, tuple(each.preferred_unit for each in left), model)
            owners |= dict.fromkeys(of_file, "data")
    return Groups(tuple(groups), entries, owners)


def _entries(
    group: InputGroup, units: tuple[str, ...], model: Model
) -> Iterator[tuple[str, RandomInput]]:
    """Yield an entry of each input of a group."""
    marginals = group.marginals
    nominal = () if marginals else group.nominal()
    for position, name in enumerate(group.inputs):
        distribution = (
            marginals[position]
            if marginals
            else ImplicitMarginal(group.description, nominal[position])
        )
        variable = model.input(name)
        yield name, RandomInput(variable, distribution, units[position], group.description)


def _named(section: TableReader) -> list[str]:
    names = section.content.get("inputs")
    return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []


def _read_group(section: TableReader, model: Model) -> tuple[InputGroup, tuple[str, ...]] | None:
    """Read a group with the units of its inputs; None where a mistake was noted."""
    kinds = [kind for kind in _KINDS if kind in section]
    if len(kinds) != 1:
        found = " and ".join(kinds) or "no distribution"
        section.add_problem((), found, 'sample = "posterior.csv" or chaospy = { name = …, … }')
        return None
    if kinds[0] == "sample":
        return _read_sample(section, model)
    if kinds[0] == "posterior":
        return _read_posterior(section, model)
    noted = len(section.problems)
    variables = _inputs(section, model)
    if len(section.problems) > noted:
        return None
    units = _units(section, variables)
    if units is None:
        return None
    names = tuple(variable.name for variable in variables)
    read = _read_chaospy if kinds[0] == "chaospy" else _read_object
    group = read(section, names, units)
    section.check_unknown_keys()
    return (group, units) if group else None


def _inputs(section: TableReader, model: Model) -> list[Input]:
    """Read the inputs of a group, in the order of its dimensions."""
    known = {variable.name: variable for variable in model.inputs}
    names = section.entries("inputs")
    for position, name in enumerate(names):
        if name not in known or name in names[:position]:
            expected = f"an input, once; {choices(str(name), known)}"
            section.add_wrong(("inputs", position), name, expected)
    if len(names) < 2:
        section.add_problem("inputs", f"{len(names)} inputs", "two or more, in their order")
    return [known[name] for name in names if name in known]


def _units(section: TableReader, variables: list[Input]) -> tuple[str, ...] | None:
    """Read the units of the values of each input; without units they are plain numbers."""
    units = section.entries("units") if "units" in section else [DIMENSIONLESS] * len(variables)
    noted = len(section.problems)
    if len(units) != len(variables):
        found = f"{len(units)} units for {len(variables)} inputs"
        section.add_problem("units", found, "one for each input")
        return None
    for position, (unit, variable) in enumerate(zip(units, variables, strict=True)):
        place = ("units", position) if "units" in section else ("units",)
        try:
            is_text = isinstance(unit, str)
            if not is_text or not are_convertible(unit, variable.unit):
                section.add_wrong(place, unit, f"for {variable.name}: {describe(variable.unit)}")
        except QuantityError as error:
            section.add_problem(place, error.found, error.expected)
    return tuple(units) if len(section.problems) == noted else None


def _read_chaospy(
    section: TableReader, names: tuple[str, ...], units: tuple[str, ...]
) -> InputGroup | None:
    """Read a joint distribution of chaospy: by its name, or one of each input in their order."""
    if isinstance(section.content["chaospy"], list):
        return _read_conditional(section, names, units)
    table = section.table("chaospy", "a table with the name and the parameters of a distribution")
    name = table.text("name", 'the name of a multivariate distribution, such as "MvNormal"')
    parameters: dict[str, Any] = {key: table.take(key) for key in table if key != "name"}
    wrong = [key for key, value in parameters.items() if not _is_numeric(value)]
    for key in wrong:
        table.add_wrong(key, parameters[key], "a number, or lists of numbers")
    if name is None or wrong:
        return None
    try:
        return chaospy_joint(name, parameters, names, units)
    except LookupError:
        table.add_wrong("name", name, "a distribution of chaospy")
    except ValueError as error:
        section.add_problem("chaospy", str(error), f"parameters of {name}")
    return None


_PART = '{ name = "Normal", mu = "2 * a", sigma = 1 }'


def _read_conditional(
    section: TableReader, names: tuple[str, ...], units: tuple[str, ...]
) -> InputGroup | None:
    """Read a distribution of each input, whose parameters may be formulas of those before it."""
    noted, entries = len(section.problems), section.entries("chaospy")
    parts = [_read_part(section, number, written) for number, written in enumerate(entries)]
    if len(section.problems) == noted and len(entries) != len(names):
        found = f"{len(entries)} distributions for {len(names)} inputs"
        section.add_problem("chaospy", found, "one for each input, in their order")
    if len(section.problems) > noted:
        return None
    try:
        return conditional_joint(parts, names, units)
    except ConstraintError as error:
        section.add_problems(error.problems, "chaospy")
    except ValueError as error:
        section.add_problem("chaospy", str(error), "parameters that it takes")
    return None


def _read_part(
    section: TableReader, position: int, written: Any
) -> tuple[str, dict[str, float | str]]:
    """Read the distribution of one input: its name and its parameters; mistakes are noted."""
    if not isinstance(written, dict):
        section.add_wrong(("chaospy", position), written, f"a table such as {_PART}")
        return "", {}
    table = section.inside(written, "chaospy", position)
    family = table.text("name", 'the name of a distribution, such as "Normal"') or ""
    parameters = {key: table.take(key) for key in table if key != "name"}
    for key, value in parameters.items():
        if not isinstance(value, int | float | str) or isinstance(value, bool):
            table.add_wrong(key, value, "a number, or a formula of inputs before it in quotes")
    if family and family not in (known := frozen_families("chaospy")):
        close = nearest(family, known)
        hint = f'; did you mean "{close}"?' if close else ""
        table.add_wrong("name", family, f"a distribution of chaospy{hint}")
    return family, parameters


def _is_numeric(value: object) -> bool:
    if isinstance(value, list):
        return all(map(_is_numeric, value))
    return isinstance(value, int | float) and not isinstance(value, bool)


def _read_object(
    section: TableReader, names: tuple[str, ...], units: tuple[str, ...]
) -> InputGroup | None:
    """Read a joint distribution that is an object of the Python program; it may be absent."""
    expected = "a distribution that a file can state: a Python object is in none"
    found = read_named_object(section, "joint distribution", expected)
    if found is None:
        return None
    if found.value is None:
        return UnloadedGroup(names, found.name)
    try:
        dimensions = len(found.value)
        made = ChaospyJoint(names, found.value, units, found.name)
        is_usable = dimensions == len(names) and bool(np.isfinite(made.nominal()).all())
    except Exception as error:  # a user-defined object can raise anything
        section.add_problem(OBJECT, str(error) or type(error).__name__, "a distribution of chaospy")
        return None
    if not is_usable:
        wrong = f"{dimensions} dimensions for {len(names)} inputs"
        section.add_problem(OBJECT, wrong, "one for each input, with finite values")
        return None
    return made


def _read_sample(section: TableReader, model: Model) -> tuple[InputGroup, tuple[str, ...]] | None:
    """Read the rows of a file, or of lists in the study, as a joint distribution."""
    noted = len(section.problems)
    written = section.take("sample")
    names = section.entries("inputs") if "inputs" in section else section.take("inputs")
    section.check_unknown_keys()
    file: FileSnapshot | None = None
    try:
        if isinstance(written, dict):
            columns, source = columns_of_table(written), "a table"
        elif isinstance(written, str) and written and "\0" not in written:
            read = read_columns(section.folder / written, blanks=True)
            columns, file, source = read.columns, read.file, Path(written).name
        else:
            section.add_wrong("sample", written, _SAMPLE)
            return None
        found = _rows(columns, model, names)
    except TableError as error:
        section.add_problem("sample", str(error), _SAMPLE)
        return None
    if len(section.problems) > noted or found is None:
        return None
    taken, rows, weights, dropped = found
    inputs = tuple(column.name for column in taken)
    group = SampleDistribution(inputs, rows, weights, f"{source}{dropped}", file)
    return group, tuple(column.unit for column in taken)


_POSTERIOR = (
    'an archive and its design, such as "archives/rods.nc:fit", or a file in the form of ArviZ, '
    'such as "chains.nc", with the group posterior. units = { x = "cm" } has those that it '
    "does not state"
)


def _read_posterior(
    section: TableReader, model: Model
) -> tuple[InputGroup, tuple[str, ...]] | None:
    """Read draws of a posterior, of this program or another one, as a joint distribution.

    The rows are those of the file in their order, all chains behind each other.
    """
    noted = len(section.problems)
    written = section.text("posterior", _POSTERIOR)
    names = section.entries("inputs") if "inputs" in section else section.take("inputs")
    units = section.table("units")
    section.check_unknown_keys()
    if written is None or "\0" in written:
        return None
    name, _, design = written.rpartition(":") if ".nc:" in written else (written, "", "")
    path, known = section.folder / name, {variable.name: variable for variable in model.inputs}
    taught_by: frozenset[str] = frozenset()
    group, importance = f"{CALIBRATIONS}/{design}/posterior" if design else "posterior", None
    try:
        if design:
            # It loads xarray, which a study without one does not need.
            from uqpen.archive.read import open_archive, read_group

            archive = open_archive(path)
            kept = read_group(archive, CALIBRATIONS, design)
            taught_by = frozenset(map(str, kept["row_hash"].values if "row_hash" in kept else ()))
            if "confirmed" in kept and kept["confirmed"] == 0:
                raise TableError(f"the model does not confirm the posterior {design}")
            weighted = read_group(archive, CALIBRATIONS, design, WEIGHTED_POSTERIOR)
            if IMPORTANCE_WEIGHT in weighted:
                group = f"{CALIBRATIONS}/{design}/{WEIGHTED_POSTERIOR}"
                importance = weighted[IMPORTANCE_WEIGHT].values.ravel()
        read = read_draws(path, group)
        stated = {key: str(value) for key, value in units.content.items()}
        taken = (each for each in read.columns if each.name in {*known, *(names or [])})
        columns = tuple(replace(each, unit=stated.get(each.name, each.unit)) for each in taken)
        found = _rows(columns, model, names, fewest=1)
    except (TableError, ArchiveError) as error:
        section.add_problem("posterior", str(error), _POSTERIOR)
        return None
    if len(section.problems) > noted or found is None:
        return None
    columns_taken, rows, weights, dropped = found
    inputs = tuple(column.name for column in columns_taken)
    source = f"the posterior {design or name}{dropped}"
    weights = weights if importance is None else importance
    made = SampleDistribution(inputs, rows, weights, source, read.file, taught_by)
    return made, tuple(column.unit for column in columns_taken)


def _rows(
    columns: tuple[Column, ...], model: Model, names: list[Any] | None, fewest: int = 2
) -> tuple[list[Column], FloatArray, FloatArray, str] | None:
    """Return the columns of the inputs, their rows in SI units, and the weights of the rows.

    Rows without one of the inputs are left out, which the last text says. None where a unit of the
    model is not known yet, since a mistake was noted there.
    """
    known = {variable.name: variable for variable in model.inputs}
    headings = [column.name for column in columns]
    wanted = [name for name in headings if name in known] if names is None else names
    _check_wanted(wanted, headings, known, fewest)
    if any(known[name].unit is ANY_DIMENSION for name in wanted):
        return None
    taken = [columns[headings.index(name)] for name in wanted]
    rows = np.column_stack([column.values(known[column.name].unit) for column in taken])
    is_whole = np.asarray(np.isfinite(rows).all(axis=1))
    dropped, rows = int((~is_whole).sum()), rows[is_whole]
    if len(rows) < 2:
        raise TableError(f"number of rows: {len(rows)}, expected two or more")
    weights = np.ones(len(rows)) if WEIGHT in known else _weights(columns, is_whole)
    for column, values in zip(taken, rows[weights > 0].T, strict=True):
        bounds = known[column.name].bounds
        if not bounds.contain(values).all():
            raise TableError(f'column "{column.name}" has values outside its domain: {bounds}')
        if not np.ptp(values) > 0:
            raise TableError(f'column "{column.name}" does not vary')
    note = f" ({counted(dropped, 'row')} with a blank left out)" if dropped else ""
    return taken, rows, weights, note


def _check_wanted(
    wanted: list[Any], headings: list[str], known: Mapping[str, Input], fewest: int
) -> None:
    """Raise an error if the columns of a sample are not those of some inputs, two at least."""
    for name in wanted:
        if not isinstance(name, str) or name not in known:
            raise TableError(f"{toml_text(name)} is no input; {choices(str(name), known)}")
        if headings.count(name) != 1:
            found = "stands twice" if name in headings else "is not there"
            raise TableError(f'column "{name}" {found}')
        if wanted.count(name) > 1:
            raise TableError(f'"{name}" stands twice in inputs')
    if len(wanted) < fewest:
        what = "two or more depend on each other" if fewest > 1 else "one or more are expected"
        raise TableError(f"columns of {len(wanted)} inputs: {what}")


def _weights(columns: tuple[Column, ...], is_whole: BoolArray) -> FloatArray:
    """Return the weights of the whole rows, which are equal where no column has them."""
    found = [column for column in columns if column.name == WEIGHT]
    if not found:
        return np.ones(int(is_whole.sum()))
    if len(found) > 1:
        raise TableError(f'column "{WEIGHT}" stands twice')
    weights = found[0].values(DIMENSIONLESS)[is_whole]
    if np.isnan(weights).any():
        raise TableError(f'column "{WEIGHT}" has a blank')
    if weights.min() < 0:
        raise TableError(f'column "{WEIGHT}" is below 0: {weights.min():g}')
    if (weights > 0).sum() < 2:
        raise TableError(f'column "{WEIGHT}" is above 0 in fewer than two rows')
    return weights


_PAIR = '{ inputs = ["a", "b"], correlation = 0.6 }'


@dataclass(frozen=True)
class _Pair:
    """Correlation of a pair of inputs."""

    correlation: float = number(
        above=-1, below=1, expected="a correlation, strictly between -1 and 1"
    )


def read_dependence(
    table: TableReader, inputs: Inputs, owners: Mapping[str, str], model: Model, stream: Stream
) -> JointDistribution:
    """Return the joint distribution with dependent inputs; unchanged where a mistake was noted.

    Inputs of a group, which `owners` names, cannot be joined to others. The test of a fit to
    measurements draws from `stream`.
    """
    joint = inputs.joint
    places = {name: f"[joint.{owner}]" for name, owner in owners.items()}
    chains = (each for each in joint.groups if isinstance(each, ConditionalGroup))
    places |= {name: "that of parameters in [inputs]" for each in chains for name in each.inputs}
    if not table.is_given or _note_grouped(table, places):
        return joint
    if "measured" in table:
        return _measured_together(table, inputs, model, stream)
    copula = read_class(table, "copula", COPULA)
    if copula is None:
        return joint
    noted = len(table.problems)
    is_elliptical = issubclass(copula, EllipticalCopula)
    given = _elliptical(table, inputs, copula) if is_elliptical else _joined_inputs(table, inputs)
    parameters = table.setting_values(copula)
    table.check_unknown_keys()
    if parameters is None or len(table.problems) > noted:
        return joint
    try:
        dependence = copula(**given, **parameters)
    except SettingsError as error:
        for problem in error.problems:
            if problem.path == ("matrix",):  # of all of it, in the problem's words
                key = "matrix" if "matrix" in table else "pairs"
                table.add_problem(key, problem.found, problem.expected)
            else:
                table.add_refused([problem])
        return joint
    return joint if inputs.unclear else replace(joint, dependence=dependence)


def _measured_together(
    table: TableReader, inputs: Inputs, model: Model, stream: Stream
) -> JointDistribution:
    """Fit a copula to the rows of a file, which were measured together."""
    from uqpen.distributions.copula_fit import fit_copula  # loads scipy.stats

    noted, joint = len(table.problems), inputs.joint
    written = table.text("measured", _SAMPLE)
    names = _input_names(table, inputs) if "inputs" in table else table.take("inputs")
    family = table.take("copula")
    if family is not None and family not in list(COPULAS):
        table.add_wrong("copula", family, f"a copula; {choices(str(family), COPULAS)}")
    table.check_unknown_keys()
    if not written or len(table.problems) > noted or inputs.unclear:
        return joint
    random = [entry.variable.name for entry in joint.random if not entry.variable.labels]
    try:
        read = read_columns(table.folder / written, blanks=True)
        own = tuple(each for each in read.columns if each.name in (names or random))
        found = _rows(own, model, names)
        if found is None:
            return joint
        taken, rows, _, dropped = found
        joined = tuple(column.name for column in taken)
        families = COPULAS if family is None else [family]
        fit = fit_copula(joined, rows, stream.generator("fit"), families)
    except TableError as error:
        table.add_problem("measured", str(error), _SAMPLE)
        return joint
    except SettingsError as error:
        for problem in error.problems:
            where = f"{problem.found} in {written}"
            table.add_problem("measured", where, problem.expected)
        return joint
    source = f"fitted to {fit.rows} rows of {written}{dropped}: {fit.description}"
    warning = ""
    if fit.is_rejected:
        warning = (
            f"the {fit.copula.title} does not fit the rows of {written}: of samples of it, a share "
            f"of {fit.p_value:.2g} lies as far from their fit (p value)"
        )
    measured = MeasuredDependence(source, warning, read.file)
    return replace(joint, dependence=fit.copula, measured_dependence=measured)


def _note_grouped(table: TableReader, places: Mapping[str, str]) -> bool:
    """Note inputs whose joint distribution is given already; return True for any."""
    pairs = table.content.get("pairs")
    lists = [table.content, *(pairs if isinstance(pairs, list) else [])]
    named = [each.get("inputs") for each in lists if isinstance(each, dict)]
    joined = [name for names in named if isinstance(names, list) for name in names]
    grouped = [name for name in joined if isinstance(name, str) and name in places]
    for name in dict.fromkeys(grouped):
        found = f"{name}, whose joint distribution is {places[name]}"
        table.add_problem((), found, "inputs that [inputs] has")
    return bool(grouped)


def _joined_inputs(table: TableReader, inputs: Inputs) -> dict[str, Any]:
    if "inputs" not in table:
        table.add_missing("inputs", 'the random inputs that it joins, such as ["a", "b"]')
    return {"inputs": tuple(_input_names(table, inputs))}


def _input_names(table: TableReader, inputs: Inputs) -> list[Any]:
    """Read names of inputs; note those that do not name a random input."""
    random = _possibly_random(inputs)
    labelled = {entry.variable.name for entry in inputs.joint.random if entry.variable.labels}
    fixed = [entry.variable.name for entry in inputs.joint.fixed]
    intervals = [entry.variable.name for entry in inputs.joint.intervals]
    unknown = {entry.variable.name for entry in inputs.joint.random if entry.unknown is not None}
    names = table.entries("inputs")
    for position, name in enumerate(names):
        if name not in random:
            found = f"{toml_text(name)}{', an input that is fixed' * (name in fixed)}"
            found += ", an interval, which has no distribution" * (name in intervals)
            expected = f"a random input; {choices(str(name), random)}"
            table.add_problem(("inputs", position), found, expected)
        elif name in labelled:
            expected = "an input of numbers: labels have no order that a copula could join"
            table.add_problem(("inputs", position), f"{name}, whose values are labels", expected)
        elif name in unknown:
            found = f"{name}, whose parameters are uncertain or intervals"
            expected = "an input with one distribution: runs count by the ratio of two of its own"
            table.add_problem(("inputs", position), found, expected)
    return names


def _possibly_random(inputs: Inputs) -> list[str]:
    """Return the random inputs, and behind them those that could not be read."""
    return [*(entry.variable.name for entry in inputs.joint.random), *sorted(inputs.unclear)]


def _elliptical(
    table: TableReader, inputs: Inputs, copula: type[EllipticalCopula]
) -> dict[str, Any]:
    """Read inputs and the matrix of their scores, from a matrix or from pairs."""
    listing = "; ".join(f'"{name}": {MEASURES[name]}' for name in copula.measures)
    expected = f"the kind of the correlations: {listing}"
    measure = table.text("of", expected) or ""
    if measure and measure not in copula.measures:
        table.add_wrong("of", measure, expected)
    if ("pairs" in table) == ("matrix" in table):
        found = "both pairs and matrix" if "pairs" in table else "no correlations"
        table.add_problem((), found, f"either pairs = [{_PAIR}], or inputs with a matrix")
        for key in ("pairs", "inputs", "matrix"):
            table.take(key)
        return {}
    if "pairs" in table:
        return _pairs(table, inputs, measure)
    return {**_joined_inputs(table, inputs), "matrix": _matrix(table, measure)}


def _matrix(table: TableReader, measure: str) -> tuple[tuple[float, ...], ...]:
    def read_value(value: Any) -> float:
        number = as_float(value)
        if not isinstance(number, float):
            raise QuantityError(toml_text(value), "a number")
        # The copula refuses what is no correlation.
        return score_correlation(number, measure) if abs(number) < 1 else number

    def read_row(values: Any) -> tuple[float, ...]:
        if not isinstance(values, list):
            raise QuantityError(toml_text(values), "a row of correlations in brackets")
        return tuple(read_each(values, read_value))

    try:
        return tuple(read_list(table.take("matrix"), read_row))
    except (SettingsError, QuantityError) as error:
        table.add_problems(error.problems, "matrix")
    return ()


def _pairs(table: TableReader, inputs: Inputs, measure: str) -> dict[str, Any]:
    """Read the correlations of pairs of inputs; a pair that is not given is uncorrelated."""
    correlations: dict[frozenset[str], float] = {}
    for position, entry in enumerate(table.entries("pairs")):
        if not isinstance(entry, dict):
            table.add_wrong(("pairs", position), entry, _PAIR)
            continue
        pair = table.inside(entry, "pairs", position)
        noted = len(table.problems)
        names = _input_names(pair, inputs)
        given = pair.whole_settings(_Pair)
        if given is None or len(table.problems) > noted:
            continue
        if len(names) != 2 or names[0] == names[1]:
            found = f"{len(set(names))} of them"
            pair.add_problem("inputs", found, 'two inputs, such as ["a", "b"]')
        elif frozenset(names) in correlations:
            found = f"{names[0]} and {names[1]} for the second time"
            pair.add_problem("inputs", found, "each pair once")
        else:
            correlations[frozenset(names)] = score_correlation(given.correlation, measure)
    joined = [
        name for name in _possibly_random(inputs) if any(name in pair for pair in correlations)
    ]
    matrix = tuple(
        tuple(1.0 if a == b else correlations.get(frozenset((a, b)), 0.0) for b in joined)
        for a in joined
    )
    return {"inputs": tuple(joined), "matrix": matrix}
