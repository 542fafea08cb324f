"""``[model.inputs]`` and ``[model.outputs]``: what a user-defined model takes and gives."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

from uqpen.core.errors import QuantityError
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.model import Input, Output
from uqpen.core.units import ANY_DIMENSION, si_unit
from uqpen.models.run_grid import FieldSources, RunGrid
from uqpen.study.dimensions_section import (
    DimensionsReader,
    ModelCoordinates,
    check_dimensions,
    read_field,
    read_grid,
)
from uqpen.study.table_reader import TableReader

__all__ = ["Variables", "read_variables"]


class Variables(NamedTuple):
    """Inputs and outputs of a model, and the unit of each in the model's own convention."""

    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: dict[str, str]
    fields: FieldSources


def read_variables(table: TableReader, from_model: ModelCoordinates | None = None) -> Variables:
    """Read the inputs and outputs that a model's table declares.

    Mistakes are noted; a variable with one is of any dimension. The model's code is asked for
    coordinates by `from_model`, where it can be.
    """
    units: dict[str, str] = {}
    inputs, outputs = (
        [(name, si_unit(unit), unit) for name, unit in _variables(table, key, units)]
        for key in ("inputs", "outputs")
    )
    section, dimensions = table.table("outputs"), DimensionsReader(from_model)
    dimensions.read_shared(table)
    fields = [
        _output(section, Output(name, si, display_unit=unit), dimensions)
        for name, si, unit in outputs
    ]
    names = [name for name, *_ in (*inputs, *outputs)]
    check_dimensions(section, fields, names)
    grids = {output.name: _grid(section, output, names) for output in fields}
    return Variables(
        tuple(Input(name, si, display_unit=unit) for name, si, unit in inputs),
        tuple(fields),
        units,
        FieldSources(
            {name: grid for name, grid in grids.items() if grid is not None},
            tuple(dimensions.files.values()),
        ),
    )


def _variables(table: TableReader, key: str, units: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield names and units of a model's inputs or outputs; add the known ones to `units`."""
    does = "takes" if key == "inputs" else "gives"
    section = table.table(key, f'what the model {does}, as name = "unit"')
    if section.is_given and not section.content:
        section.add_problem((), "an empty table", 'at least one name = "unit"')
    for name, written in section.content.items():
        is_table = key == "outputs" and isinstance(written, dict)
        unit = written.get("unit") if is_table else written
        path = (name, "unit") if is_table and "unit" in written else (name,)
        if not NAME.match(name) or name in RESERVED:
            others = ", ".join(sorted(RESERVED))
            expected = f"a name of letters, digits and _, at most 100, none of {others}"
            section.add_wrong(name, name, expected)
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


def _output(section: TableReader, output: Output, dimensions: DimensionsReader) -> Output:
    """Return an output with the dimensions that its table declares, if it is given by a table."""
    if not isinstance(section.content[output.name], dict):
        return output
    return read_field(section.table(output.name), output, dimensions)


def _grid(section: TableReader, output: Output, names: Collection[str]) -> RunGrid | None:
    """Return the grid on which every run has an output, if its table names one."""
    if not isinstance(section.content[output.name], dict):
        return None
    return read_grid(section.table(output.name), output, names)
