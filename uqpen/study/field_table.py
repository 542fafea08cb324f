"""Outputs with dimensions in ``[model.outputs]``: ``along``, ``may_end`` and a run's own grid."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from uqpen.core.columns import heading_parts
from uqpen.core.errors import QuantityError, SettingsError, TableError
from uqpen.core.labels import NAME
from uqpen.core.lookup import choices
from uqpen.core.model import Dimension, Output
from uqpen.core.settings import choice, flag
from uqpen.core.units import are_convertible, describe
from uqpen.models.run_grid import INTERPOLATIONS, NO_INTERPOLATION, FieldSources, RunGrid
from uqpen.study.dimensions_section import DimensionsReader
from uqpen.study.table_reader import TableReader

__all__ = ["check_dimensions", "read_field", "read_grid", "refuse_grids"]

_ALONG, _ON, _INTERPOLATION = "along", "on", "interpolation"

_OWN_NAME = 'the name of a run\'s own coordinates, which no input or output has: "t" or "t [s]"'

# Values of an output in one run at most.
_MOST_VALUES = 10_000_000


@dataclass(frozen=True)
class _Field:
    """Settings of an output beside its unit and its dimensions."""

    may_end: bool = flag(default=False)
    interpolation: str | None = choice(*INTERPOLATIONS, NO_INTERPOLATION, default=None)


def read_field(table: TableReader, output: Output, dimensions: DimensionsReader) -> Output:
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


def _dimensions_text(written: object, dimensions: DimensionsReader) -> str:
    """Return what is expected of dimensions where there is neither a table nor a list."""
    name = written if isinstance(written, str) and NAME.match(written) else "time"
    if name in dimensions.shared:
        return f'a list of dimensions, ["{name}"]'
    return (
        f'a table, such as {{ {name} = {{ unit = "s", from = 0, to = 1, size = 101 }} }}, '
        f'or a list, ["{name}"], of those in [model.dimensions]'
    )


def _read_dimensions(
    table: TableReader, dimensions: DimensionsReader
) -> tuple[Dimension, ...] | None:
    """Read the dimensions of an output, often none; None where one is not known."""
    found: list[Dimension | None]
    if isinstance(table.content.get(_ALONG), list):
        names = enumerate(table.entries(_ALONG))
        found = [_shared(table, position, name, dimensions) for position, name in names]
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


def _shared(
    table: TableReader, position: int, name: object, dimensions: DimensionsReader
) -> Dimension | None:
    """Return the shared dimension that an entry of a list names; None where it is not known."""
    if isinstance(name, str) and name in dimensions.shared:
        return dimensions.shared[name]
    known = choices(str(name), dimensions.shared) if dimensions.shared else "there is none"
    table.add_wrong((_ALONG, position), name, f"a dimension of [model.dimensions]; {known}")
    return None


def read_grid(table: TableReader, output: Output, variables: Collection[str]) -> RunGrid | None:
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
        is_alike = "[" not in str(written) or are_convertible(unit, dimension.unit)
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


def check_dimensions(
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
