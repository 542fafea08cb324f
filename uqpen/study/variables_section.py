"""``[model.inputs]``, ``[model.outputs]`` and ``[model.dimensions]`` of a user-defined model.

An output may have dimensions (``along``, ``may_end``, a run's own grid). The coordinates of a
dimension may be in a file beside the study: CSV, NetCDF, or a table with blanks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import heading_parts, read_columns
from uqpen.core.errors import ModelError, Problem, QuantityError, SettingsError, TableError
from uqpen.core.files import FileSnapshot
from uqpen.core.labels import NAME
from uqpen.core.lookup import choices
from uqpen.core.model import Dimension, Input, Output
from uqpen.core.settings import (
    Context,
    as_float,
    choice,
    count,
    file,
    flag,
    number,
    setting,
    text,
    validate,
)
from uqpen.core.units import ANY_DIMENSION, DIMENSIONLESS, are_convertible, describe, scale, si_unit
from uqpen.core.variables import dimension_name_problem
from uqpen.models.command.output_readers import UnreadableError, blank_column, parse_number
from uqpen.models.run_grid import INTERPOLATIONS, NO_INTERPOLATION, FieldSources, RunGrid
from uqpen.study.document import inner_table
from uqpen.study.table_reader import TableReader, is_variable_name

# Returns the coordinates that a model's code has under a name, in the unit of the dimension; None
# where nobody knows. A ModelError says that it has none.
_ModelCoordinates = Callable[[str], FloatArray | None]


class Variables(NamedTuple):
    """Inputs and outputs of a model, and the unit of each in the model's own convention."""

    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: dict[str, str]
    fields: FieldSources


def read_variables(table: TableReader, from_model: _ModelCoordinates | None = None) -> Variables:
    """Read the inputs and outputs that a model's table declares.

    Mistakes are noted; a variable with one is of any dimension. The model's code is asked for
    coordinates by `from_model`, where it can be.
    """
    units: dict[str, str] = {}
    inputs, outputs = (
        [(name, si_unit(unit), unit) for name, unit in _variables(table, key, units)]
        for key in ("inputs", "outputs")
    )
    labels = _read_labels(table, {name: unit for name, _, unit in inputs})
    units |= dict.fromkeys(labels, DIMENSIONLESS)
    inputs += [
        (name, DIMENSIONLESS, "") for name in labels if name not in [each for each, *_ in inputs]
    ]
    section, shared = table.table("outputs"), table.table(_DIMENSIONS)
    dimensions = _DimensionsReader(from_model)
    dimensions.shared |= {name: dimensions.read(shared, name) for name in shared}
    fields = [
        _read_field(section.table(name), made, dimensions)
        if isinstance(section.content[name], dict)
        else made
        for name, si, unit in outputs
        for made in [Output(name, si, display_unit=unit)]
    ]
    names = [name for name, *_ in (*inputs, *outputs)]
    _check_dimensions(section, fields, names)
    grids = {
        output.name: _read_grid(section.table(output.name), output, names)
        for output in fields
        if isinstance(section.content[output.name], dict)
    }
    return Variables(
        tuple(
            Input(name, si, display_unit=unit, labels=labels.get(name, ()))
            for name, si, unit in inputs
        ),
        tuple(fields),
        units,
        FieldSources(
            {name: grid for name, grid in grids.items() if grid is not None},
            tuple(dimensions.files.values()),
        ),
    )


def _read_labels(table: TableReader, inputs: Mapping[str, str]) -> dict[str, tuple[str, ...]]:
    """Read the labels of inputs that are texts, in the model's own order."""
    found: dict[str, tuple[str, ...]] = {}
    section = table.table("labels")
    for name, written in section.content.items():
        is_list = isinstance(written, list) and all(isinstance(each, str) for each in written)
        if not is_variable_name(section, name):
            continue
        if (
            not is_list
            or len({*written}) < max(len(written), 2)
            or not all(map(str.strip, written))
        ):
            section.add_wrong(name, written, 'two texts or more, each once: ["M8", "M10"]')
        elif inputs.get(name, DIMENSIONLESS) not in (DIMENSIONLESS, ""):
            found_unit = f"labels of an input in {inputs[name]}"
            section.add_problem(name, found_unit, f"no unit of {name}: labels have none")
        else:
            found[name] = tuple(written)
    return found


def _variables(table: TableReader, key: str, units: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield names and units of a model's inputs or outputs; add the known ones to `units`."""
    does = "takes" if key == "inputs" else "gives"
    has_labels = key == "inputs" and bool(table.content.get("labels"))
    section = table.table(key, "" if has_labels else f'what the model {does}, as name = "unit"')
    if section.is_given and not section.content:
        section.add_problem((), "an empty table", 'at least one name = "unit"')
    for name, written in section.content.items():
        is_table = key == "outputs" and isinstance(written, dict)
        unit = written.get("unit") if is_table else written
        path = (name, "unit") if is_table and "unit" in written else (name,)
        if not is_variable_name(section, name):
            pass  # of any dimension
        elif name in units:
            section.add_problem(name, "an output with the name of an input", "names that differ")
        elif not isinstance(unit, str):
            found = written if unit is None else unit
            section.add_wrong(path, found, 'a unit such as "cm", or "1" where there is none')
        else:
            try:
                si_unit(unit)
            except QuantityError as error:
                section.add_problems(error.problems, *path)
            else:
                units[name] = unit or "1"
                yield name, units[name]
                continue
        yield name, ANY_DIMENSION


# Coordinates in a file.

_WITH_UNITS = (".csv", ".nc")


def _read_coordinates_file(path: Path, column: str | int | None, unit: str | None) -> _Found:
    """Read a column of a file.

    Parameters
    ----------
    path : Path
        Ends in ``.csv`` for CSV and in ``.nc`` for NetCDF. Any other file is a table with blanks
        between its columns.
    column : str or int, optional
        Its heading, or its position in a table; may be left out where there is one column.
    unit : str, optional
        The unit to show the coordinates in. It is also that of a column without a unit.

    Raises
    ------
    TableError
        If there is no such file or column, or an entry is no number.
    """
    if path.suffix not in _WITH_UNITS:
        return _read_table(path, column, unit or DIMENSIONLESS)
    if isinstance(column, int):
        raise TableError(f'"{path.name}" has columns with headings')
    read = read_columns(path)
    found = read.column(column or "")
    place = f'column "{found.heading}" of "{path.name}"'
    if unit is not None and found.unit == DIMENSIONLESS:
        values = np.asarray(scale(unit).array_to_si(found.load()))
        return _Found(values, unit, "file", place, read.file)
    shown = unit or found.unit
    return _Found(found.values(shown), shown, "file", place, read.file)


def _read_table(path: Path, column: str | int | None, unit: str) -> _Found:
    try:
        content = path.read_bytes()
        text = content.decode("utf-8-sig")
    except FileNotFoundError:
        raise TableError(f'there is no file "{path}"') from None
    except (OSError, UnicodeDecodeError):
        raise TableError(f'"{path.name}" cannot be read as a text') from None
    file = f'"{path.name}"'
    if column is None and any(blank_column(text, 1, file)):
        raise TableError(f"{file} has several columns")
    place = f"column {column or 0} of {file}"
    try:
        entries = blank_column(text, 0 if column is None else column, file)
        numbers = [
            parse_number(entry or "", f"row {row} of {place}") for row, entry in enumerate(entries)
        ]
    except UnreadableError as error:
        raise TableError(str(error)) from None
    values = np.asarray(scale(unit).array_to_si(np.array(numbers, dtype=np.float64)))
    return _Found(values, unit, "file", place, FileSnapshot.from_content(path, content))


_DIMENSIONS, _FROM_MODEL = "dimensions", "from_model"

# Coordinates of one dimension at most.
_MOST = 1_000_000

_SOURCES = (["from", "to", "size"], ["values"], ["file"], ["file", "column"], [_FROM_MODEL])
_COORDINATES = f"either from, to and size, or values, or file, or {_FROM_MODEL}"

_NO_CODE = "values or a file: only a Python function of a file or a module can be asked"


# Dimensions, whose coordinates are given, in a file, or asked of a model.


def _read_unit(written: object, context: Context) -> Any:
    if isinstance(written, str):
        si_unit(written)
    return written


def _read_numbers(written: object, context: Context) -> Any:
    return tuple(map(as_float, written)) if isinstance(written, list) else written


def _are_numbers(values: Any) -> bool:
    is_list = isinstance(values, tuple) and bool(values)
    return is_list and all(isinstance(value, float) for value in values)


@dataclass(frozen=True)
class _Coordinates:
    """Coordinates of a dimension as a study states them, in the unit that it names."""

    unit: str | None = setting(
        "unit", 'a unit such as "s"', lambda unit: isinstance(unit, str), _read_unit, default=None
    )
    first: float | None = number(key="from", default=None)
    last: float | None = number(key="to", default=None)
    size: int | None = count(minimum=2, maximum=_MOST, default=None)
    values: tuple[float, ...] | None = setting(
        "coordinates", "a list of numbers", _are_numbers, _read_numbers, default=None
    )
    file: Path | None = file(default=None)
    column: str | int | None = setting(
        "column",
        "the heading of a column, or its position from 0",
        lambda value: type(value) is int or (isinstance(value, str) and bool(value.strip())),
        default=None,
    )
    from_model: str | None = text(expected="a name in the model's file or module", default=None)
    long_name: str | None = text(expected="a name for display", default=None)

    def __post_init__(self) -> None:
        validate(self, self._problems())

    def _problems(self) -> Iterator[Problem]:
        ends = {"from": self.first, "to": self.last, "size": self.size}
        rest = (self.values, self.file, self.column, self.from_model)
        sources = ends | dict(zip(("values", "file", "column", _FROM_MODEL), rest, strict=True))
        given = [key for key, value in sources.items() if value is not None]
        if given not in _SOURCES:
            yield Problem((), " and ".join(given) or "no coordinates", _COORDINATES)
        elif self.first is not None and self.last is not None and not self.first < self.last:
            yield Problem(("to",), f"{self.last:g}", f"a number above {self.first:g}")

    def stated(self) -> FloatArray:
        """Return coordinates that the study states itself, in its unit."""
        if self.first is not None and self.last is not None and self.size is not None:
            return np.linspace(self.first, self.last, self.size)
        return np.array(self.values)


class _Found(NamedTuple):
    """Coordinates in SI units, the unit to show them in, and the key and place that they are of.

    The place is text for a message; `file` is the file that they stand in, if they do.
    """

    values: FloatArray
    unit: str
    key: str
    place: str = ""
    file: FileSnapshot | None = None


@dataclass(eq=False)
class _DimensionsReader:
    """Reader of the dimensions of a model's outputs."""

    # Asks the model's code for coordinates; None for a model without such code.
    from_model: _ModelCoordinates | None
    # The files with coordinates, by path.
    files: dict[Path, FileSnapshot] = field(default_factory=dict)
    # The dimensions of ``[model.dimensions]`` by name; None for one with a mistake.
    shared: dict[str, Dimension | None] = field(default_factory=dict)

    def read(self, table: TableReader, name: str) -> Dimension | None:
        """Read a dimension in a table of them; None where it is not known."""
        if expected := dimension_name_problem(name):
            table.add_wrong(name, name, expected)
            return None
        section = table.table(name, f"a table with a unit and {_COORDINATES}")
        settings = section.whole_settings(_Coordinates) if section.is_given else None
        if settings is None:
            return None
        archived = (section.document.objects or {}).get(section.path)
        if isinstance(archived, Dimension):
            return archived
        found = self._find(section, settings)
        if found is None:
            return None
        if len(found.values) > _MOST:
            size = f"{len(found.values):_} coordinates"
            section.add_problem(found.key, size, f"at most {_MOST:_}")
            return None
        unit, title = found.unit, settings.long_name or ""
        try:
            return Dimension(name, si_unit(unit), title, unit, tuple(found.values.tolist()))
        except SettingsError as error:
            _note_refused(section, found, error)
        return None

    def _find(self, section: TableReader, settings: _Coordinates) -> _Found | None:
        """Find the coordinates where the settings say; None where a mistake was noted."""
        unit = settings.unit or DIMENSIONLESS
        if settings.file is not None:
            try:
                found = _read_coordinates_file(settings.file, settings.column, settings.unit)
            except TableError as error:
                expected = "a CSV, NetCDF or blank-separated file with a column of coordinates"
                section.add_problem("file", str(error), expected)
                return None
            if found.file is not None:
                self.files[settings.file] = found.file
            return found
        if settings.from_model is None:
            return _Found(_in_si(settings.stated(), unit), unit, "")
        if self.from_model is None:
            section.add_wrong(_FROM_MODEL, settings.from_model, _NO_CODE)
            return None
        try:
            values = self.from_model(settings.from_model)
        except ModelError as error:
            expected = "coordinates in the model's file or module, or a function that returns them"
            section.add_problem(_FROM_MODEL, str(error), expected)
            return None
        if values is None:
            return None
        return _Found(_in_si(values, unit), unit, _FROM_MODEL, f'"{settings.from_model}"')


def dimensions_from_model(model: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the paths, in the table of a model, of dimensions whose coordinates its code has."""
    for path in [
        (_DIMENSIONS,),
        *(("outputs", name, "along") for name in inner_table(model, "outputs")),
    ]:
        for name, declared in inner_table(model, *path).items():
            if isinstance(declared, dict) and _FROM_MODEL in declared:
                yield (*path, str(name))


def _in_si(values: FloatArray, unit: str) -> FloatArray:
    return np.asarray(scale(unit).array_to_si(values))


def _note_refused(section: TableReader, found: _Found, error: SettingsError) -> None:
    """Note coordinates that make no dimension: those that the study does not state by place."""
    if not found.place:
        section.add_refused(error.problems)
        return
    for problem in error.problems:
        place = problem.path[-1]
        shown = "no coordinate"
        if isinstance(place, int):
            shown = f"{scale(found.unit).from_si(found.values[place]):.10g} at position {place}"
        section.add_problem(found.key, f"{shown} of {found.place}", problem.expected)


_ALONG, _ON, _INTERPOLATION = "along", "on", "interpolation"

_OWN_NAME = 'the name of a run\'s own coordinates, which no input or output has: "t" or "t [s]"'

# Values of an output in one run at most.
_MOST_VALUES = 10_000_000


@dataclass(frozen=True)
class _Field:
    """Settings of an output beside its unit and its dimensions."""

    may_end: bool = flag(default=False)
    interpolation: str | None = choice(*INTERPOLATIONS, NO_INTERPOLATION, default=None)


def _read_field(table: TableReader, output: Output, dimensions: _DimensionsReader) -> Output:
    """Return an output with the dimensions that its table declares; mistakes are noted.

    An output with a mistake has no dimensions.
    """
    table.take("unit")
    table.take(_ON)
    dims = _read_dimensions(table, dimensions)
    settings = table.settings(_Field) or _Field()
    table.check_unknown_keys()
    if dims is None:
        return output
    try:
        return replace(output, dims=dims, may_end=settings.may_end)
    except SettingsError as error:
        keys = {"dims": _ALONG, "may_end": "may_end"}
        for problem in error.problems:
            table.add_problem(keys[str(problem.path[0])], problem.found, problem.expected)
    return output


def _dimensions_text(written: object, dimensions: _DimensionsReader) -> str:
    """Return what is expected of dimensions where there is neither a table nor a list."""
    name = written if isinstance(written, str) and NAME.match(written) else "time"
    if name in dimensions.shared:
        return f'a list of dimensions, ["{name}"]'
    return (
        f'a table, such as {{ {name} = {{ unit = "s", from = 0, to = 1, size = 101 }} }}, '
        f'or a list, ["{name}"], of those in [model.dimensions]'
    )


def _read_dimensions(
    table: TableReader, dimensions: _DimensionsReader
) -> tuple[Dimension, ...] | None:
    """Read the dimensions of an output, often none; None where one is not known."""
    found: list[Dimension | None]
    if isinstance(table.content.get(_ALONG), list):
        found = []
        for position, name in enumerate(table.entries(_ALONG)):
            is_known = isinstance(name, str) and name in dimensions.shared
            found.append(dimensions.shared[name] if is_known else None)
            if not is_known:
                shared = dimensions.shared
                known = choices(str(name), shared) if shared else "there is none"
                expected = f"a dimension of [model.dimensions]; {known}"
                table.add_wrong((_ALONG, position), name, expected)
    else:
        written = table.content.get(_ALONG)
        if written is not None and not isinstance(written, dict):
            table.take(_ALONG)
            table.add_wrong(_ALONG, written, _dimensions_text(written, dimensions))
            return None
        along = table.table(_ALONG)
        if not along.is_given:
            return ()
        found = [dimensions.read(along, name) for name in along]
    if not found:
        kind = "list" if isinstance(table.content[_ALONG], list) else "table"
        table.add_problem(_ALONG, f"an empty {kind}", "a dimension, such as time")
    dims = tuple(dimension for dimension in found if dimension is not None)
    if (values := math.prod(len(dimension.values) for dimension in dims)) > _MOST_VALUES:
        table.add_problem(_ALONG, f"{values:_} values", f"at most {_MOST_VALUES:_} in one run")
        return None
    return dims if len(dims) == len(found) else None


def _read_grid(table: TableReader, output: Output, variables: Collection[str]) -> RunGrid | None:
    """Return the grid on which every run has an output, if its table names one; see `RunGrid`."""
    on = table.table(_ON)
    interpolation = table.content.get(_INTERPOLATION)
    if not on.is_given:
        if interpolation is not None:
            table.add_missing(_ON, 'coordinates of the run\'s own, such as on = { time = "t" }')
        return None
    if _ALONG not in table:
        table.add_problem(_ON, "coordinates of an output without dimensions", "along beside them")
    along = {dimension.name: dimension for dimension in output.dims}
    names: dict[str, str] = {}
    units: dict[str, str] = {}
    for dimension, written in on.content.items():
        if output.dims and dimension not in along:
            expected = f"a dimension of {output.name}: {', '.join(along)}"
            on.add_wrong(dimension, dimension, expected)
        elif output.dims:
            names[dimension], unit = _own_name(on, along[dimension], written, variables)
            units |= {dimension: unit} if unit else {}
    return RunGrid(names, units, interpolation or RunGrid.interpolation) if names else None


def _own_name(
    on: TableReader, dimension: Dimension, written: object, variables: Collection[str]
) -> tuple[str, str]:
    """Return the name of a run's own coordinates, and their unit if it is written behind it."""
    try:
        name, unit = heading_parts(written if isinstance(written, str) else "", "")
        is_alike = not {*"[("} & {*str(written)} or are_convertible(unit, dimension.unit)
    except (TableError, QuantityError):
        name, unit, is_alike = "", "", True
    if not NAME.match(name) or name in variables:
        on.add_wrong(dimension.name, written, _OWN_NAME)
    elif not is_alike:
        on.add_wrong(dimension.name, written, describe(dimension.unit))
    return name, unit if "[" in str(written) else ""


def refuse_grids(table: TableReader, fields: FieldSources, expected: str) -> None:
    """Note the grids that runs have of their own where there can be none."""
    for name in fields.grids:
        table.add_problem(("outputs", name, _ON), "coordinates of the run's own", expected)


def _check_dimensions(
    section: TableReader, outputs: Sequence[Output], variables: Collection[str]
) -> None:
    """Note dimensions with the name of a variable, or with other coordinates than before."""
    known: dict[str, Dimension] = {}
    for output in outputs:
        for dimension in output.dims:
            name, path = dimension.name, (output.name, _ALONG, dimension.name)
            if name in variables:
                found = f'a dimension with the name of the variable "{name}"'
                section.add_problem(path, found, "names that differ")
            elif known.setdefault(name, dimension) != dimension:
                found = f'other coordinates of "{name}" than above'
                section.add_problem(path, found, "the same in all outputs along it")
