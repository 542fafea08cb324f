"""``[model] data``: runs of a model that is not here, in a file with inputs and outputs."""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from uqpen.core.errors import QuantityError, SettingsError, toml_text
from uqpen.core.labels import NAME, REPLICATE, RESERVED, WEIGHT
from uqpen.core.lookup import choices
from uqpen.core.model import Category, Input, Model, Output
from uqpen.core.units import DIMENSIONLESS, si_unit
from uqpen.designs.data import DataDesign
from uqpen.designs.design import Design
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.models.data.data_file import DataFile, data_file, read_data_file
from uqpen.models.data.data_model import (
    BLANK_INPUTS,
    REASON,
    STATUS,
    DataModel,
    data_coordinates,
    data_points,
    data_results,
    without_blank_inputs,
)
from uqpen.study.table_reader import TableReader

# The key with the file.
DATA = "data"

# The designs of a study of a data file that states none.
DEFAULT_DESIGNS: dict[str, Any] = {"data": {"kind": "data"}}

# Columns that are neither input nor output, unless a study names them so.
OTHER_COLUMNS = (STATUS, REASON, REPLICATE, WEIGHT)


def has_data(root: TableReader) -> bool:
    """Return True if a study has a data file in place of a model."""
    table = root.content.get("model")
    return isinstance(table, dict) and DATA in table


@dataclass(frozen=True)
class _Declaration:
    """Statements in the table of a model about the columns of its data file."""

    file: str
    outputs: list[str]
    inputs: list[str] | None
    ignored: list[str]
    units: Mapping[str, str]
    headings: Mapping[str, str]  # those of columns that have other names in the study
    missing: list[float | str]  # entries that stand for none
    together: bool  # whether the inputs are distributed as the rows
    drops: bool  # whether rows with a blank input are left out


def variable_name(heading: str) -> str:
    """Return a name that a variable can have, for a heading without its unit."""
    plain = unicodedata.normalize("NFKD", heading).encode("ascii", "ignore").decode()
    name = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")[:90] or "column"
    name = name if name[0].isalpha() else f"column_{name}"
    return f"{name}_value" if name in RESERVED else name


def read_data(table: TableReader) -> Model | None:
    """Read the runs of a data file; None where a mistake was noted."""
    noted = len(table.problems)
    if table.path != ("model",):
        table.add_problem(DATA, "a data file among several models", "a data file in [model]")
    file = table.text(DATA, 'the name of a file, such as "runs.csv"')
    outputs, inputs, ignored = (_names(table, key) for key in ("outputs", "inputs", "ignore"))
    if not outputs and len(table.problems) == noted:
        table.add_problem("outputs", "no output", 'columns of the file, such as ["deflection"]')
    units = table.table("units")
    for name, unit in units.content.items():
        if not isinstance(unit, str):
            units.add_wrong(name, unit, 'a unit such as "mm"')
    headings, missing = _headings(table), _missing(table)
    drop = table.take("drop")
    if (drops := drop is not None) and drop != BLANK_INPUTS:
        table.add_wrong("drop", drop, f'"{BLANK_INPUTS}", the rows without one of their inputs')
    together = table.take("together") or False
    if not isinstance(together, bool):
        table.add_wrong("together", together, "true: the inputs are distributed as the rows")
    table.check_unknown_keys()
    if len(table.problems) > noted or file is None or outputs is None:
        return None
    declared = _Declaration(
        file, outputs, inputs, ignored or [], units.content, headings, missing, together, drops
    )
    try:
        return _read_file(table, declared)
    except SettingsError as error:
        table.add_problems(error.problems, DATA)
        return None


def _headings(table: TableReader) -> Mapping[str, str]:
    """Return the headings of columns by the names of the study; note other values and names."""
    headings = table.table("columns")
    for name, heading in headings.content.items():
        if not isinstance(heading, str):
            headings.add_wrong(name, heading, 'the heading of a column, such as "Rain (mm)"')
        elif not NAME.match(name) or name in RESERVED:
            expected = f'another name, such as {variable_name(name)} = "{heading}"'
            headings.add_problem(name, f'"{name}", which no variable can be called', expected)
    return headings.content


def _missing(table: TableReader) -> list[float | str]:
    """Return the entries that stand for none; note what cannot be an entry."""
    missing = table.entries("missing")
    for position, each in enumerate(missing):
        if not isinstance(each, str | int | float) or isinstance(each, bool):
            table.add_wrong(("missing", position), each, 'a number or a text, such as "NA"')
    return missing


def bind_designs(table: TableReader, designs: dict[str, Design], model: Model) -> dict[str, Design]:
    """Give designs the runs of a data file; note designs of the wrong kind for the model."""
    bound: dict[str, Design] = {}
    for name, design in designs.items():
        if isinstance(design, DataDesign) and isinstance(model, DataModel):
            bound[name] = made = replace(design, model=model)
            table.add_problems(made.check_model(), name)
        elif isinstance(design, DataDesign):
            expected = 'a kind that makes runs, or [model] data = "…", the file with the runs'
            table.add_problem((name, "kind"), '"data" with a model that makes runs', expected)
        elif isinstance(model, DataModel):
            found = toml_text(table.content[name].get("kind"))
            expected = f'"data": all runs are those of {model.name}, and no other can be made'
            table.add_problem((name, "kind"), found, expected)
        else:
            bound[name] = design
    return bound


def check_fixed(table: TableReader, joint: JointDistribution, model: Model) -> None:
    """Note inputs with one value in the study, and others in its data file."""
    points = model.points if isinstance(model, DataModel) else {}
    for entry in joint.fixed:
        name = entry.variable.name
        if name in points and (points[name] != entry.value).any():
            expected = f"its distribution, or nothing: its values are those of {model.name}"
            table.add_wrong(name, table.content[name], expected)


def _names(table: TableReader, key: str) -> list[str] | None:
    """Return a list of names of columns; None where there is none, or a mistake was noted."""
    value = table.take(key)
    if value is None or (isinstance(value, list) and all(isinstance(name, str) for name in value)):
        return value
    table.add_wrong(key, value, 'names of columns in a list, such as ["load", "length"]')
    return None


def _read_file(table: TableReader, declared: _Declaration) -> DataModel | None:
    """Return the runs of a file; note what the study states otherwise than the file."""
    noted = len(table.problems)
    file, titles = _opened(table, declared)
    names = declared.inputs
    if names is None:
        no_input = {*declared.outputs, *declared.ignored, *OTHER_COLUMNS}
        names = [each.name for each in file.columns if not {each.name, each.heading} & no_input]
    _check_names(table, file, declared, names)
    units = dict(_units(table, file, declared, [*names, *declared.outputs]))
    if len(table.problems) > noted:
        return None
    columns = tuple(each.coded() if each.name in units else each for each in file.columns)
    file = replace(file, columns=columns)
    labels = {name: file.by_name[name].labels for name in units}
    coded = "; ".join(
        f"{name} as {', '.join(f'{code} {label}' for code, label in enumerate(labels[name]))}"
        for name in names
        if labels[name]
    )
    described = {
        name: (name, si_unit(unit), titles.get(name, ""), unit) for name, unit in units.items()
    }
    inputs = tuple(Input(*described[name], labels=labels[name]) for name in names)
    outputs = tuple(
        Output(
            *described[name],
            categories=tuple(
                Category(re.sub(r"\W+", "_", label) + f"_{code}", label)
                for code, label in enumerate(labels[name])
            ),
        )
        for name in declared.outputs
    )
    treatment, dropped = {"missing": json.dumps(declared.missing)} if declared.missing else {}, ""
    if declared.drops:
        file, dropped = without_blank_inputs(file, names)
        treatment["drop"] = BLANK_INPUTS
    alone = ((name, file.by_name[name].distant_text()) for name in units)
    return DataModel(
        name=file.name,
        inputs=inputs,
        outputs=outputs,
        points=data_points(file, inputs, units),
        results=data_results(file, outputs, units),
        file=file.file,
        coordinates=data_coordinates(file, (*inputs, *outputs)),
        dropped=dropped,
        distant=tuple(f"{name}: {text}" for name, text in alone if text),
        coded=coded and f"texts have codes, and no number follows their order: {coded}",
        together=declared.together,
        treatment=treatment,
    )


def _opened(table: TableReader, declared: _Declaration) -> tuple[DataFile, dict[str, str]]:
    """Return a file under the names of the study, without entries that stand for none.

    Beside it is what the file itself calls the columns that have other names.
    """
    path = table.folder / Path(declared.file)
    content = (table.document.objects or {}).get(table.path)
    file = data_file(path, content) if isinstance(content, bytes) else read_data_file(path)
    given = [each.name for each in file.columns]
    file = _renamed(table, file, declared.headings)
    titles = {
        each.name: name
        for name, each in zip(given, file.columns, strict=True)
        if name not in (each.name, each.name.replace("_", " "))
    }
    if declared.missing:
        cleaned = tuple(each.without(declared.missing) for each in file.columns)
        file = replace(file, columns=cleaned)
    return file, titles


def _renamed(table: TableReader, file: DataFile, headings: Mapping[str, str]) -> DataFile:
    """Return a file with the names that the study gives to columns; note a wrong heading."""
    named: dict[str, str] = {}  # by the names in the file
    for name, heading in headings.items():
        written = [each.heading or each.name for each in file.columns]
        found = [each for each in file.columns if heading.strip() in (each.heading, each.name)]
        if not found:
            expected = choices(heading, written)
            table.add_problem(("columns", name), f'no column "{heading}" in {file.name}', expected)
        elif found[0].name in named:
            both = f'"{heading}", which is {named[found[0].name]} already'
            table.add_problem(("columns", name), both, "one name for a column")
        else:
            named[found[0].name] = name
    kept = {each.name for each in file.columns} - {*named}
    for column, name in list(named.items()):
        if name in kept:
            both = f'"{headings[name]}", and another column "{name}" in {file.name}'
            table.add_problem(("columns", name), both, "names that differ")
            del named[column]
    renamed = tuple(replace(each, name=named.get(each.name, each.name)) for each in file.columns)
    return replace(file, columns=renamed)


def _check_names(
    table: TableReader, file: DataFile, declared: _Declaration, inputs: Sequence[str]
) -> None:
    """Note names that the file has no column of, or that cannot be those of variables."""
    columns = [*file.by_name]
    by_heading = {each.heading: each.name for each in file.columns if each.heading}
    if not inputs:
        table.add_problem(DATA, f"no input in {file.name}", "a column for each input")
    for key, names in (
        ("inputs", declared.inputs or ()),
        ("outputs", declared.outputs),
        ("ignore", declared.ignored),
        ("units", declared.units),
    ):
        for position, name in enumerate(names):
            place = (key, name) if key == "units" else (key, position)
            if name in columns or (key == "ignore" and name in by_heading):
                continue
            if name in by_heading:
                found, expected = "the heading of a column", _as_variable(by_heading[name], name)
                table.add_problem(place, f'"{name}", {found} in {file.name}', expected)
            else:
                table.add_problem(
                    place, f'no column "{name}" in {file.name}', choices(name, columns)
                )
    for name in filter(columns.__contains__, [*inputs, *declared.outputs]):
        if not NAME.match(name) or name in RESERVED:
            heading = file.by_name[name].heading or name
            expected = f'{_as_variable(name, heading)}; ignore = ["{name}"] leaves it out'
            table.add_problem(DATA, f'a column "{heading}" in {file.name}', expected)
    for name in {*inputs} & {*declared.outputs}:
        table.add_problem("outputs", f'"{name}", which is an input', "names that differ")


def _as_variable(name: str, heading: str) -> str:
    """Return how a study can name a column."""
    if NAME.match(name) and name not in RESERVED:
        return f'its name, "{name}"'
    own = variable_name(name)
    return f"a name such as {own}, by [model.columns] {own} = {toml_text(heading)}"


def _units(
    table: TableReader, file: DataFile, declared: _Declaration, names: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Yield the unit of each column: the one that the study states, else that of its heading."""
    for name in filter(file.by_name.__contains__, names):
        written, stated = file.by_name[name].unit, declared.units.get(name)
        unit = stated or written or DIMENSIONLESS
        try:
            si_unit(unit)
        except QuantityError as error:
            place = ("units", name) if stated else (DATA,)
            in_heading = "" if stated else f', in the heading of "{name}"'
            table.add_problem(place, error.found + in_heading, error.expected)
        else:
            yield name, unit
