"""``[measured.<name>]``: experiments that a model is compared with."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqpen.core.arrays import BoolArray, FloatArray, IntArray
from uqpen.core.columns import Column, columns_of_table, read_columns
from uqpen.core.errors import QuantityError, TableError, counted, toml_text
from uqpen.core.files import FileSnapshot
from uqpen.core.lookup import nearest
from uqpen.core.model import Input, Model
from uqpen.core.quantities import parse_quantity
from uqpen.core.units import DIMENSIONLESS, describe, scale
from uqpen.core.variables import Output
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.measurements.errors import (
    AT_LEAST,
    AT_MOST,
    EXACTLY,
    Discrepancy,
    MeasuredOutput,
    MeasurementErrors,
    UnknownSize,
)
from uqpen.measurements.experiments import MeasuredOutputs, ValidationSettings
from uqpen.study.study import ValidatedStudy
from uqpen.study.table_reader import TableReader, named_tables

# What an input is in the face of measurements; each random input is one of them.
ROLES = {
    "conditions": "known for each experiment, a column of the table",
    "unknown": "one value, which the measurements teach",
    "varies": "a new value in each experiment, from its distribution",
    "fixed": "held at its median",
}
# The covariance of all rows is in memory.
_MOST_ROWS = 5000
# A size that follows from repeats has at least so many degrees of freedom.
_FEWEST_REPEATS = 5
_REPEATS = "repeats"
# The key with the column that tells experiments of equal conditions apart.
_EXPERIMENT = "experiment"
_HOLD_OUT = "hold_out"
# Keys with the column that marks the entries that are bounds.
_BOUNDS = {"at_least": AT_LEAST, "at_most": AT_MOST}
_NO_COLUMN = Column("", DIMENSIONLESS, lambda: np.empty(0))

_STD = (
    'the standard deviation of an error: a quantity such as "2 mm", a column, a share of the '
    'model\'s value such as "3 %", a list of these, { half-normal = "2 mm" } where its size is '
    'unknown, or "repeats"'
)


@dataclass(frozen=True, eq=False)
class _Table:
    """Rows of a file, as a section reads them."""

    section: TableReader
    columns: Mapping[str, Column]
    rows: int
    key: str  # the key that the file stands at

    def values(self, name: str, like: str, *, difference: bool = False) -> FloatArray | None:
        """Return a column in SI units, NaN for a blank; None where a mistake was noted."""
        try:
            column = self.columns[name]
            entries = column.load()
            filled = ~np.isnan(entries)
            found = np.full(self.rows, np.nan)
            found[filled] = replace(column, load=lambda: entries[filled]).values(like)
            if difference:
                found -= scale(column.unit).to_si(0.0)
        except (TableError, QuantityError) as error:
            self.section.add_problem(self.key, str(error), "a column of numbers")
            return None
        return found


def read_measured(table: TableReader, model: Model | None) -> dict[str, MeasuredOutputs | None]:
    """Read the measurements of a study; None stands for those where a mistake was noted.

    Without the model, whose mistakes are noted, none of them is read.
    """
    found = {}
    for name, section in named_tables(table):
        noted = len(table.problems)
        measured = _read_section(name, section, model) if model else None
        found[name] = measured if len(table.problems) == noted else None
    return found


def _read_section(name: str, section: TableReader, model: Model) -> MeasuredOutputs | None:
    """Read the keys of a section, its rows, and each output there; None for a mistake."""
    outputs = {each.name: each for each in model.all_outputs}
    section.know(*outputs, "source", _EXPERIMENT, "file", "table")
    tables = {
        key: inside for key in section if key in outputs and (inside := section.table(key)).is_given
    }
    source = section.text("source", "where they come from") if "source" in section else ""
    noted = len(section.problems)
    conditions = _conditions(section)
    roles = {role: _names(section, role) for role in ("unknown", "varies", "fixed")}
    expected = "a column that names the experiment of each row"
    label = section.text(_EXPERIMENT, expected) if _EXPERIMENT in section else ""
    labels = section.entries(_HOLD_OUT)
    read = _read_file(section, tables, label or "", [str(each) for each in labels])
    section.check_unknown_keys("key or output of the model")
    inputs = {variable.name: variable for variable in model.inputs}
    # A wrong entry or an unknown key may mean a column.
    is_right = len(section.problems) == noted
    given = read[0].columns.keys() - {label} if read and is_right else ()
    are_inputs = _check_inputs(section, {"conditions": [*conditions], **roles}, model, given)
    if read is None or not are_inputs:
        return None
    rows, file = read
    if label and len(_entries(rows.columns.get(label, _NO_COLUMN))) < rows.rows:
        section.add_wrong(_EXPERIMENT, label, f"a column; {section.suggest(label, rows.columns)}")
        return None
    if not tables:
        expected = f"a table [measured.{name}.<output>]; outputs: {', '.join(outputs)}"
        section.add_problem((), "no output", expected)
        return None
    found = {each: _condition(rows, each, inputs[each].unit) for each in conditions}
    columns = {key: values for key, values in found.items() if values is not None}
    if len(columns) < len(found):
        return None
    # Without a condition or a label, all rows are of one experiment.
    by_label = [_entries(rows.columns[label])] if label else [np.zeros(rows.rows)]
    experiment, first = _numbered(np.column_stack([*columns.values(), *by_label]))
    stds = {
        each: std
        for each, written in conditions.items()
        if written is not None
        and (std := _difference(section, ("conditions", each), written, inputs[each].unit))
    }
    is_left_out = _left_out_rows(rows, labels, label, file)
    of_rows = rows, experiment, {each: inputs[each] for each in conditions}, is_left_out
    read_outputs = (_read_output(inside, outputs[key], *of_rows) for key, inside in tables.items())
    measured = [of_output for of_output in read_outputs if of_output is not None]
    if len(measured) < len(tables):
        return None
    every = MeasuredOutputs(
        name,
        *(tuple(roles["unknown"]), tuple(roles["varies"]), tuple(roles["fixed"])),
        {key: values[first] for key, values in columns.items()},
        {key: np.full(len(first), std) for key, std in stds.items()},
        (),
        len(first),
        source or "",
        file,
    )
    return _divided(every, rows, tables, measured, experiment, is_left_out)


def _check_inputs(
    section: TableReader,
    roles: Mapping[str, Sequence[str]],
    model: Model,
    columns: Collection[str],
) -> bool:
    """Check that roles name inputs, and that each column with the name of one has a role."""
    inputs = [variable.name for variable in model.inputs]
    for role, names in roles.items():
        for each in names:
            if each not in inputs:
                expected = f"an input of {model.name}; {section.suggest(each, inputs)}"
                section.add_problem(role, toml_text(each), expected)
                return False
    for each in inputs:
        if each in columns and not any(each in names for names in roles.values()):
            expected = f'{each} among the conditions; or fixed = ["{each}"], not to use the column'
            section.add_problem("conditions", f'a column "{each}" that no key names', expected)
            return False
    return True


def _divided(
    every: MeasuredOutputs,
    rows: _Table,
    tables: Mapping[str, TableReader],
    measured: Sequence[MeasuredOutput],
    experiment: IntArray,
    is_left_out: BoolArray,
) -> MeasuredOutputs | None:
    """Return the rows of outputs with blank ones, those held out apart; None for a mistake."""
    fitted = [each.at(np.flatnonzero(~is_left_out[each.lines - 1])) for each in measured]
    blank = _blank_rows(rows, tables, fitted, experiment)
    made, beyond = _with_outputs(every, fitted), _with_outputs(every, blank)
    if not is_left_out.any():
        return replace(made, blank=beyond)
    noted = len(rows.section.problems)
    _check_left_out(rows.section, measured, is_left_out, blank[0].lines)
    if len(rows.section.problems) > noted:
        return None
    numbers, held = np.unique(blank[0].experiment), []
    for each in measured:
        part = each.at(np.flatnonzero(is_left_out[each.lines - 1]))
        # An error of the model itself is what a validation looks for.
        errors = replace(part.errors, discrepancy=None)
        at = np.searchsorted(numbers, part.experiment)
        held.append(replace(part, experiment=at, errors=errors))
    left_out = replace(beyond, outputs=tuple(held))
    whole = _with_outputs(every, measured)
    return replace(made, blank=beyond, left_out=left_out, whole=whole)


def _left_out_rows(
    rows: _Table, labels: Sequence[Any], label: str | None, file: FileSnapshot | None
) -> BoolArray:
    """Return True for the rows that no fit learns from."""
    found: BoolArray = np.zeros(rows.rows, dtype=np.bool_)
    numbers = _entries(rows.columns[label]) if label else np.arange(rows.rows) + 1.0
    expected = f"the number of a row, 1 to {rows.rows}; or a label, with {_EXPERIMENT}"
    expected = f'an entry of column "{label}"' if label else expected
    # A text of a file stands there by its place in the list.
    is_text = bool(label) and file is not None and file.path.suffix != ".nc"
    texts = [str(each) for each in labels]
    for place, each in enumerate(labels):
        is_number = isinstance(each, int | float) and not isinstance(each, bool)
        own = np.zeros_like(found)
        if is_number or (is_text and isinstance(each, str)):
            own = np.equal(numbers, texts.index(str(each)) if is_text else each)
        if not own.any():
            rows.section.add_wrong((_HOLD_OUT, place), each, expected)
        found = found | own
    return found


def _check_left_out(
    section: TableReader,
    measured: Sequence[MeasuredOutput],
    is_left_out: BoolArray,
    predicted: IntArray,
) -> None:
    """Note rows that cannot be held out, as they have no value or something of the others."""
    everything = np.concatenate([each.lines for each in measured])
    missing = np.setdiff1d(np.flatnonzero(is_left_out) + 1, everything)
    if len(missing):
        found = f"row {missing[0]}, in which nothing was measured"
        section.add_problem(_HOLD_OUT, found, "rows with a measured value")
    elif len(missing := np.setdiff1d(np.flatnonzero(is_left_out) + 1, predicted)):
        expected = "rows with a place along each dimension of all outputs"
        section.add_problem(_HOLD_OUT, f"row {missing[0]}, which lacks one", expected)
    experiments = [
        np.concatenate([each.experiment[is_left_out[each.lines - 1] == part] for each in measured])
        for part in (True, False)
    ]
    if (section.content.get("varies") or isinstance(section.content.get("conditions"), dict)) and (
        len(np.intersect1d(*experiments))
    ):
        found = "a part of an experiment, which has an input with a value of its own"
        section.add_problem(_HOLD_OUT, found, "whole experiments")
    for each in measured:
        if is_left_out[each.lines - 1].all():
            found = f"all values of {each.output.name}"
            section.add_problem(_HOLD_OUT, found, "at least one that a fit learns from")
        own, errors = is_left_out[each.lines - 1], replace(each.errors, discrepancy=None)
        sizes = np.array([size.scale for size in errors.sizes])
        if errors.covariance(each.values, sizes, each.correlation)[own][:, ~own].any():
            found = f"rows whose errors of {each.output.name} depend on those of rows that are left"
            section.add_problem(_HOLD_OUT, found, "all rows that share an error, or none of them")


def _with_outputs(every: MeasuredOutputs, outputs: Sequence[MeasuredOutput]) -> MeasuredOutputs:
    """Return the rows of outputs, and of all experiments those that these have a row of."""
    kept = np.unique(np.concatenate([each.experiment for each in outputs]))
    numbered = (
        replace(each, experiment=np.searchsorted(kept, each.experiment)) for each in outputs
    )
    return replace(
        every,
        conditions={key: values[kept] for key, values in every.conditions.items()},
        condition_std={key: stds[kept] for key, stds in every.condition_std.items()},
        outputs=tuple(numbered),
        experiments=len(kept),
    )


def _blank_rows(
    rows: _Table,
    tables: Mapping[str, TableReader],
    measured: Sequence[MeasuredOutput],
    experiment: IntArray,
) -> list[MeasuredOutput]:
    """Return the outputs at the rows in which nothing was measured, but which have their places."""
    blank = np.setdiff1d(
        np.arange(rows.rows), np.concatenate([each.lines for each in measured]) - 1
    )
    for each in measured:
        for dimension in each.output.dims:
            along = rows.values(dimension.name, dimension.unit)
            blank = blank if along is None else blank[~np.isnan(along[blank])]
    found, nothing = [], np.zeros(len(blank))
    for each in measured:
        of = each.errors.discrepancy
        if of is not None and (along := rows.values(of.along, of.length.unit)) is not None:
            of = replace(of, places=along[blank])
        at_blank = replace(
            each,
            experiment=experiment[blank],
            places=_places(tables[each.output.name], each.output, rows, blank),
            values=nothing + np.nan,
            censoring=np.zeros(len(blank), dtype=np.int64),
            lines=blank + 1,
            errors=MeasurementErrors(nothing, nothing, each.errors.size, discrepancy=of),
        )
        found.append(at_blank)
    return found


def _conditions(section: TableReader) -> dict[str, Any]:
    """Return the conditions, each with its standard error as it is written, or None."""
    written = section.take("conditions")
    if isinstance(written, dict):
        return written
    if written is not None and not (
        isinstance(written, list) and all(isinstance(each, str) for each in written)
    ):
        expected = 'inputs such as ["speed"], or with their errors { speed = "5 m/s" }'
        section.add_wrong("conditions", written, expected)
        return {}
    return dict.fromkeys(written or [])


def _names(section: TableReader, key: str) -> list[str]:
    names = section.entries(key)
    for place, each in enumerate(names):
        if not isinstance(each, str):
            section.add_wrong((key, place), each, "the name of an input")
    return [each for each in names if isinstance(each, str)]


def _read_file(
    section: TableReader, tables: Mapping[str, TableReader], label: str, first: Sequence[str]
) -> tuple[_Table, FileSnapshot | None] | None:
    """Return the rows of a section's file, or of its table; None where a mistake was noted.

    Texts of the column `label` are numbered, these `first`.
    """
    groups = [
        shared["group"]
        for each in tables.values()
        if isinstance(shared := each.content.get("shared"), dict)
        and isinstance(shared.get("group"), str)
    ]
    groups.append(label)
    key = "table" if "table" in section else "file"
    snapshot = None
    if key == "table" and "file" in section:
        section.add_problem("file", "file beside table", "one of both")
    try:
        if key == "table":
            inside = section.table(key)
            if not inside.is_given:
                return None
            columns = columns_of_table(inside.content, blanks=True)
        else:
            written = section.text(key, 'the name of a file, such as "shots.csv"')
            if written is None:
                return None
            known = {label: first} if label else {}
            read = read_columns(section.folder / written, known, blanks=True, groups=groups)
            columns, snapshot = read.columns, read.file
        by_name = {column.name: column for column in columns}
        if len(by_name) < len(columns):
            raise TableError("two of its columns have the same name")
        rows = max((len(_entries(column)) for column in columns), default=0)
        if not rows:
            for column in columns:
                column.load()  # an error if what it has is no number
    except (TableError, QuantityError) as error:
        section.add_problem(key, str(error), "rows of measurements under headings name [unit]")
        return None
    if not 0 < rows <= _MOST_ROWS:
        section.add_problem(key, counted(rows, "row"), f"1 to {_MOST_ROWS} rows of measurements")
        return None
    return _Table(section, by_name, rows, key), snapshot


def _entries(column: Column) -> FloatArray:
    """Return the numbers of a column; none of one with other texts, which may be notes."""
    try:
        return column.load()
    except TableError:
        return np.empty(0)


def _condition(rows: _Table, name: str, unit: str) -> FloatArray | None:
    if name not in rows.columns:
        expected = f"a column of conditions; {rows.section.suggest(name, rows.columns)}"
        rows.section.add_problem("conditions", f'no column "{name}" in its file', expected)
        return None
    found = rows.values(name, unit)
    if found is not None and np.isnan(found).any():
        row = int(np.isnan(found).argmax()) + 1
        expected = f"the value of {name} in each row"
        rows.section.add_problem("conditions", f'a blank in row {row} of column "{name}"', expected)
        return None
    return found


def _numbered(rows: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the number of each row among those that differ, and the first row of each of these."""
    _, first, numbers = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[numbers.ravel()], np.sort(first)


def _half_normal(
    table: TableReader, key: str, written: Any, unit: str | None, expected: str
) -> float | None:
    """Read the scale of a half-normal prior in SI units; None for an unknown unit or a mistake."""
    if not isinstance(written, dict) or written.keys() != {"half-normal"}:
        table.add_wrong(key, written, expected)
        return None
    prior = written["half-normal"]
    return None if unit is None else _difference(table, (key, "half-normal"), prior, unit)


def _difference(
    table: TableReader, keys: str | tuple[str, ...], written: Any, unit: str, expected: str = ""
) -> float | None:
    """Read a standard deviation in SI units; None where a mistake was noted."""
    try:
        value = parse_quantity(written, unit, difference=True).value
    except QuantityError as error:
        if expected:
            table.add_wrong(keys, written, expected)
        else:
            keys = (keys,) if isinstance(keys, str) else keys
            table.add_problems(error.problems, *keys)
        return None
    if value <= 0:
        table.add_wrong(keys, written, "a standard deviation above 0")
        return None
    return value


def _read_output(
    table: TableReader,
    output: Output,
    rows: _Table,
    experiment: IntArray,
    conditions: Mapping[str, Input],
    is_left_out: BoolArray,
) -> MeasuredOutput | None:
    """Read the measurements of one output; None where a mistake was noted."""
    noted = len(table.problems)
    table.know("std", "shared", "correlation", "covariance", "discrepancy", "column", *_BOUNDS)
    name = table.text("column", "the name of a column") if "column" in table else output.name
    if output.categories or output.may_end or output.absent:
        expected = "an output that each run has, a number or a field of numbers"
        table.add_problem((), f"measurements of {output.name}", expected)
    if name is None or len(table.problems) > noted:
        return None
    for each in (name, *(dimension.name for dimension in output.dims)):
        if each not in rows.columns:
            expected = f"a column of its values; {table.suggest(each, rows.columns)}"
            where = "column" if each == name and name != output.name else ()
            table.add_problem(where, f'no column "{each}" in {rows.key} of the section', expected)
            return None
    values = rows.values(name, output.unit)
    censoring = np.zeros(rows.rows, dtype=np.int64)
    for key, kind in _BOUNDS.items():
        flags = _flags(table, key, rows) if key in table else np.zeros(rows.rows)
        censoring[flags == 1] = kind
    if values is None or len(table.problems) > noted:
        return None
    kept = np.flatnonzero(~np.isnan(values))
    if not len(kept):
        table.add_problem((), f'no value in column "{name}"', "at least one measured value")
        return None
    places = _places(table, output, rows, kept)
    if len(table.problems) > noted:
        return None
    # No bound is a repeat, and no row that is held out.
    exact = np.where((censoring == EXACTLY) & ~is_left_out, values, np.nan)
    errors = _read_errors(table, output, rows, kept, experiment, exact, places)
    discrepancy = _read_discrepancy(table, output, rows, kept, conditions)
    table.check_unknown_keys()
    if errors is None or len(table.problems) > noted:
        return None
    errors = replace(errors, discrepancy=discrepancy)
    return MeasuredOutput(
        output, experiment[kept], places, values[kept], censoring[kept], kept + 1, errors
    )


_DISCREPANCY = {
    "std": "its standard deviation, known up to a prior: { half-normal = … }",
    "length": "the length over which it changes, known up to a prior: { half-normal = … }",
}


def _read_discrepancy(
    table: TableReader,
    output: Output,
    rows: _Table,
    kept: IntArray,
    conditions: Mapping[str, Input],
) -> Discrepancy | None:
    """Read the error of the model itself along a condition or a dimension; None without one."""
    if "discrepancy" not in table:
        return None
    inside, noted = table.table("discrepancy"), len(table.problems)
    if not inside.is_given:
        return None
    units = {each.name: each.unit for each in output.dims}
    units |= {name: each.unit for name, each in conditions.items()}
    expected = f"a condition or a dimension of {output.name}: {', '.join(units) or 'it has none'}"
    along = inside.text("along", expected)
    if along is not None and along not in units:
        inside.add_wrong("along", along, expected)
    unit = units.get(along or "")
    found = {}
    for key, like in (("std", output.unit), ("length", unit)):
        written = inside.take(key)
        if written is None:
            inside.add_missing(key, _DISCREPANCY[key])
        else:
            found[key] = _half_normal(inside, key, written, like, _DISCREPANCY[key]) or 0.0
    zero_at = inside.quantity("zero_at", unit or DIMENSIONLESS)
    inside.check_unknown_keys()
    places = rows.values(str(along), unit) if unit is not None else None
    if len(table.problems) > noted or unit is None or places is None:
        return None
    of = f"discrepancy of {output.name}"
    return Discrepancy(
        str(along),
        places[kept],
        UnknownSize(of, found["std"], output.unit, output.name),
        UnknownSize(f"length of the {of}", found["length"], unit, str(along)),
        zero_at,
    )


def _places(
    table: TableReader, output: Output, rows: _Table, kept: IntArray
) -> dict[str, FloatArray]:
    """Return the coordinates of rows along the dimensions of an output."""
    places = {}
    for dimension in output.dims:
        along = rows.values(dimension.name, dimension.unit)
        if along is None:
            break
        ends = dimension.values[0], dimension.values[-1]
        outside = kept[~((along[kept] >= ends[0]) & (along[kept] <= ends[1]))]
        if len(outside):
            found = f"{dimension.name} {along[outside[0]]:g} {dimension.unit} in row"
            expected = f"places from {ends[0]:g} to {ends[1]:g} {dimension.unit}, as the output has"
            table.add_problem((), f"{found} {outside[0] + 1}", expected)
        places[dimension.name] = along[kept]
    return places


def _flags(table: TableReader, key: str, rows: _Table) -> FloatArray:
    """Return a column of 0 and 1; a blank is 0."""
    expected = "a column of 0 and 1: 1 where the entry is a bound"
    name = table.text(key, expected)
    if name is None:
        return np.zeros(rows.rows)
    if name not in rows.columns:
        expected = f"{expected}; {table.suggest(name, rows.columns)}"
    found = rows.values(name, DIMENSIONLESS) if name in rows.columns else None
    if found is None or not np.isin(found[~np.isnan(found)], (0, 1)).all():
        table.add_wrong(key, name, expected)
        return np.zeros(rows.rows)
    return np.nan_to_num(found)


def _read_errors(
    table: TableReader,
    output: Output,
    rows: _Table,
    kept: IntArray,
    experiment: IntArray,
    values: FloatArray,
    places: Mapping[str, FloatArray],
) -> MeasurementErrors | None:
    """Read the errors of an output's rows; None where a mistake was noted."""
    lengths = _lengths(table, output)
    nothing = np.zeros(len(kept))
    if "covariance" in table:
        matrix = _covariance_file(table, output, len(kept))
        return None if matrix is None else MeasurementErrors(nothing, nothing, matrix=matrix)
    written = table.take("std")
    own: MeasurementErrors | None = None
    if written is None:
        table.add_missing("std", _STD)
    elif isinstance(written, dict):
        if prior := _half_normal(table, "std", written, output.unit, _STD):
            size = UnknownSize(f"std of {output.name}", prior, output.unit, output.name)
            own = MeasurementErrors(nothing, nothing, size)
    elif written == _REPEATS:
        if pooled := _pooled(table, kept, experiment, values, places):
            own = MeasurementErrors(nothing + pooled[0], nothing, freedom=pooled[1])
    elif parts := _std_parts(table, "std", written, output, rows, kept):
        own = MeasurementErrors(*parts)
    shared = _read_shared(table, output, rows, kept)
    return own and replace(own, lengths=lengths, **shared)


def _read_shared(
    table: TableReader, output: Output, rows: _Table, kept: IntArray
) -> dict[str, Any]:
    """Return the part of the errors that rows share, and the group of each row, by field."""
    if "shared" not in table:
        return {}
    inside = table.table("shared")
    if not inside.is_given:
        return {}
    group = inside.text("group", "a column") if "group" in inside else ""
    numbers = np.zeros(len(kept), dtype=np.int64)
    if group and group in rows.columns:
        _, numbers = np.unique(_entries(rows.columns[group])[kept], return_inverse=True)
    elif group:
        inside.add_wrong("group", group, f"a column; {table.suggest(group, rows.columns)}")
    written = inside.take("std")
    inside.know("group")
    inside.check_unknown_keys()
    if written is None:
        inside.add_missing("std", _STD)
        return {}
    parts = _std_parts(inside, "std", written, output, rows, kept)
    if parts is None:
        return {}
    return {"shared_std": parts[0], "shared_share": parts[1], "group": numbers}


def _std_parts(
    table: TableReader, key: str, written: Any, output: Output, rows: _Table, kept: IntArray
) -> tuple[FloatArray, FloatArray] | None:
    """Return the standard deviation of each row in SI units, and as a share of the model's value.

    Parts of a list add in squares.
    """
    absolute, share = np.zeros(len(kept)), np.zeros(len(kept))
    for each in written if isinstance(written, list) and written else [written]:
        text = each.strip() if isinstance(each, str) else ""
        if text in rows.columns:
            found = rows.values(text, output.unit, difference=True)
            if found is None:
                return None
            wrong = kept[~(found[kept] >= 0)]
            if len(wrong):
                what = f'column "{text}", row {wrong[0] + 1}'
                table.add_problem(key, f"{what}: {found[wrong[0]]:g}", "a number of 0 or more")
                return None
            absolute = absolute + found[kept] ** 2
        elif text.endswith("%") and (part := _difference(table, key, text, DIMENSIONLESS, _STD)):
            share = share + part**2
        elif not text.endswith("%"):
            expected = f"{_STD}; in {describe(output.unit)}"
            if close := nearest(text, rows.columns):
                expected = f'did you mean the column "{close}"? or {expected}'
            part = _difference(table, key, each, output.unit, expected)
            if part is None:
                return None
            absolute = absolute + part**2
        else:
            return None
    if not (absolute + share > 0).all():
        row = kept[int(np.argmin(absolute + share > 0))] + 1
        table.add_problem(key, f"an error of 0 in row {row}", "a standard deviation above 0")
        return None
    return np.sqrt(absolute), np.sqrt(share)


def _lengths(table: TableReader, output: Output) -> dict[str, float]:
    """Return the lengths of correlation along the dimensions of an output, which have to be said.

    ``"none"`` is an answer.
    """
    written = table.take("correlation")
    dims = {dimension.name: dimension for dimension in output.dims}
    if not dims:
        if written not in (None, "none"):
            table.add_wrong("correlation", written, f"no correlation along {output.name}, a number")
        return {}
    example = next(iter(dims))
    expected = (
        f'{{ {example} = "<length>" }}, over which errors are correlated, or "none": a curve is '
        "not as many measurements as it has points"
    )
    if written is None and "covariance" not in table:
        table.add_missing("correlation", expected)
    if written in (None, "none"):
        return {}
    if not isinstance(written, dict) or not written.keys() <= dims.keys():
        table.add_wrong("correlation", written, expected)
        return {}
    found = {
        name: _difference(table, ("correlation", name), length, dims[name].unit)
        for name, length in written.items()
    }
    return {name: length for name, length in found.items() if length is not None}


def _pooled(
    table: TableReader,
    kept: IntArray,
    experiment: IntArray,
    values: FloatArray,
    places: Mapping[str, FloatArray],
) -> tuple[float, float] | None:
    """Return the standard deviation within repeats, and its degrees of freedom."""
    numbers, first = _numbered(np.column_stack([experiment[kept], *places.values()]))
    is_exact = ~np.isnan(values[kept])
    repeats = [values[kept][is_exact & (numbers == number)] for number in range(len(first))]
    squares = sum(float(np.var(each)) * len(each) for each in repeats if len(each))
    freedom = sum(max(len(each) - 1, 0) for each in repeats)
    if freedom < _FEWEST_REPEATS or not squares > 0:
        expected = f"at least {_FEWEST_REPEATS} repeats that differ; or {_STD}"
        table.add_problem("std", f'"{_REPEATS}" with {freedom} repeats', expected)
        return None
    return math.sqrt(squares / freedom), float(freedom)


def _covariance_file(table: TableReader, output: Output, rows: int) -> FloatArray | None:
    """Return the covariance of an output's rows from a file; None where a mistake was noted."""
    squared = DIMENSIONLESS if output.unit == DIMENSIONLESS else f"({output.unit})^2"
    expected = (
        f"a file of {counted(rows, 'column')} with {counted(rows, 'row')}, headed 1 to {rows} with "
        f"the square of their unit, such as 1 [{squared}]"
    )
    for key in ("std", "shared"):
        if table.take(key) is not None:
            either = "the covariance of all errors, or their parts, not both"
            table.add_problem(key, f"{key} beside covariance", either)
    name = table.text("covariance", expected)
    if name is None:
        return None
    try:
        columns = read_columns(table.folder / name).columns
        matrix = np.array([each.values(squared) for each in columns])
    except (TableError, QuantityError) as error:
        table.add_problem("covariance", str(error), expected)
        return None
    if matrix.shape != (rows, rows):
        found = f"{counted(matrix.shape[1], 'row')} of {counted(matrix.shape[0], 'column')}"
    elif not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0):
        found = "a matrix that is not symmetric"
    elif not np.linalg.eigvalsh(matrix)[0] > 0:
        found = "a matrix that is not positive definite"
    else:
        return matrix
    table.add_problem("covariance", f"{found} in {name}", expected)
    return None


# How far off a model may be at the experiments.


def read_validations(
    table: TableReader,
    sections: TableReader,
    measured: Mapping[str, MeasuredOutputs | None],
    model: Model | None,
) -> dict[str, ValidationSettings]:
    """Read what is accepted of a model, by the names of measurements.

    Parameters
    ----------
    table, sections : TableReader
        The tables ``validation`` and ``measured``.
    measured, model
        What was read of the latter, and the model; None where a mistake was noted.
    """
    found = {}
    for name, section in named_tables(table):
        if name not in measured:
            expected = f"the name of a [measured.<name>]; {section.suggest(name, measured)}"
            section.add_wrong((), name, expected)
        elif model is not None and measured[name] is not None:
            accept = _by_output(section.table("accept"), model)
            numerical = _by_output(section.table("numerical_std"), model)
            fitted = None
            if (written := section.take("fitted")) is not None:
                content = {**sections.content[name], "file": written}
                for key in ("table", _HOLD_OUT):
                    content.pop(key, None)
                other = section.inside(content, "fitted")
                fitted = _read_section(name, replace(other, path=section.path), model)
            inputs = section.take("fitted_inputs") or 0
            if not isinstance(inputs, int) or isinstance(inputs, bool) or inputs < 0:
                expected = "the number of inputs that were fitted to these rows"
                section.add_wrong("fitted_inputs", inputs, expected)
            section.check_unknown_keys()
            found[name] = ValidationSettings(accept, numerical, fitted, inputs)
    return found


def _by_output(table: TableReader, model: Model) -> dict[str, float]:
    """Return a difference for each output of a table, in SI units."""
    outputs, found = {each.name: each for each in model.all_outputs}, {}
    for name, written in table.content.items():
        if name not in outputs:
            expected = f"an output of {model.name}; {table.suggest(name, outputs)}"
            table.add_problem(name, "an unknown output", expected)
        elif value := _difference(table, name, written, outputs[name].unit):
            found[name] = value
    return found


# Each random input is one of four.


def check_roles(
    table: TableReader, measured: Mapping[str, MeasuredOutputs], joint: JointDistribution
) -> None:
    """Note inputs without a role in the face of measurements, or with two, or with a wrong one."""
    random = {entry.variable.name: entry for entry in joint.random}
    constant = {entry.variable.name for entry in joint.fixed}
    for name, each in measured.items():
        section = table.table(name)
        said: dict[str, str] = {}
        for role in ROLES:
            for entry in getattr(each, role):
                if entry in said:
                    found = f"{entry}, which is among {said[entry]}, too"
                    section.add_problem(role, found, "each input once")
                said[entry] = role
                if role in ("unknown", "varies") and entry not in random:
                    what = "an input with one value" if entry in constant else "no random input"
                    section.add_problem(role, f"{entry}, {what}", "an input with a distribution")
        left = [entry for entry in random if entry not in said]
        if left:
            meanings = "; ".join(f"{role} ({text})" for role, text in ROLES.items())
            section.add_problem((), f"nothing of {', '.join(left)}", f"each among {meanings}")
        for interval in joint.intervals:
            found = f"{interval.variable.name}, an interval, beside measurements"
            section.add_problem((), found, "a value or a distribution of it")
        joined = {*joint.dependence.inputs} if joint.dependence else set[str]()
        if joined & {*each.varies} and (mixed := joined - {*each.varies}):
            found = f"{min(mixed)} depends on an input that varies"
            section.add_problem("varies", found, "inputs that vary independently of the others")


def role_lines(study: ValidatedStudy) -> Iterator[str]:
    """Yield what each input is in the face of measurements, in a line for each section."""
    for name, each in study.measured.items():
        rows = sum(len(of_output.values) for of_output in each.outputs)
        parts = [f"{counted(each.experiments, 'experiment')}, {counted(rows, 'value')}"]
        held = {line for of in each.left_out.outputs for line in of.lines} if each.left_out else ()
        if held:
            parts.append(f"{counted(len(held), 'row')} held out")
        if each.blank and (blank := len(each.blank.outputs[0].values) - len(held)):
            parts.append(f"{counted(blank, 'blank row')}, which a posterior predicts")
        named = ((role, ", ".join(getattr(each, role))) for role in ROLES)
        parts += [f"{role} {names}" for role, names in named if names]
        yield f"measured {name}: {'; '.join(parts)}"
