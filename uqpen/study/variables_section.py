"""``[model.inputs]`` and ``[model.outputs]``: what a model from outside takes and gives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from uqpen.core.errors import QuantityError
from uqpen.core.labels import NAME, RESERVED
from uqpen.core.model import Input, Output
from uqpen.core.units import ANY_DIMENSION, si_unit
from uqpen.study.table_reader import TableReader

__all__ = ["Variables", "read_variables"]


class Variables(NamedTuple):
    """Inputs and outputs of a model, and the unit of each in the model's own convention."""

    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: dict[str, str]


def read_variables(table: TableReader) -> Variables:
    """Read the inputs and outputs that a model's table declares.

    Mistakes are noted; a variable with one is of any dimension.
    """
    units: dict[str, str] = {}
    inputs, outputs = (
        [(name, si_unit(unit), unit) for name, unit in _variables(table, key, units)]
        for key in ("inputs", "outputs")
    )
    return Variables(
        tuple(Input(name, si, display_unit=unit) for name, si, unit in inputs),
        tuple(Output(name, si, display_unit=unit) for name, si, unit in outputs),
        units,
    )


def _variables(table: TableReader, key: str, units: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Yield names and units of a model's inputs or outputs; add the known ones to `units`."""
    does = "takes" if key == "inputs" else "gives"
    section = table.table(key, f'what the model {does}, as name = "unit"')
    if section.is_given and not section.content:
        section.add_problem((), "an empty table", 'at least one name = "unit"')
    for name, unit in section.content.items():
        if not NAME.match(name) or name in RESERVED:
            others = ", ".join(sorted(RESERVED))
            expected = f"a name of letters, digits and _, at most 100, none of {others}"
            section.add_wrong(name, name, expected)
        elif name in units:
            section.add_problem(name, "an output with the name of an input", "names that differ")
        elif not isinstance(unit, str):
            section.add_wrong(name, unit, 'a unit such as "cm", or "1" where there is none')
        else:
            try:
                si_unit(unit)
            except QuantityError as error:
                section.add_problems(error.problems, name)
            else:
                units[name] = unit or "1"
                yield name, units[name]
                continue
        yield name, ANY_DIMENSION
