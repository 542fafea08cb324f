"""``[model.inputs]`` and ``[model.outputs]``: what a model from outside takes and gives."""

from __future__ import annotations

from typing import NamedTuple

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.labels import NAME, RESERVED, SUFFIXES
from uqpen.core.model import Input, Output
from uqpen.core.units import si_unit
from uqpen.study.table_reader import TableReader

__all__ = ["Variables", "read_variables"]


class Variables(NamedTuple):
    """What a model takes and gives, and the unit that it wants or tells each of them in."""

    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: dict[str, str]


def read_variables(table: TableReader) -> Variables:
    """The inputs and outputs that a model's table declares; mistakes are noted."""
    units: dict[str, str] = {}
    inputs = tuple(
        Input(name, si_unit(unit), display_unit=unit)
        for name, unit in _variables(table, "inputs", units)
    )
    outputs = tuple(
        Output(name, si_unit(unit), display_unit=unit)
        for name, unit in _variables(table, "outputs", units)
    )
    return Variables(inputs, outputs, units)


def _clash(name: str, section: TableReader) -> str | None:
    """Another output that has a statistic by this name."""
    for other in section:
        stem, _, suffix = name.removeprefix(other).partition("_")
        if name.startswith(other) and not stem and suffix in SUFFIXES:
            return other
    return None


def _variables(table: TableReader, key: str, units: dict[str, str]) -> list[tuple[str, str]]:
    """Names and units of a model's inputs or outputs."""
    does = "takes" if key == "inputs" else "gives"
    section = table.table(key, f'what the model {does}, as name = "unit"')
    if section is None:
        return []
    if not section.content:
        section.add_problem((), "an empty table", 'at least one name = "unit"')
    found = []
    for name in section:
        unit = section.take(name)
        if not NAME.match(name) or name in RESERVED:
            others = ", ".join(sorted(RESERVED))
            expected = f"a name of letters, digits and _, at most 100, none of {others}"
            section.add_problem(name, toml_text(name), expected)
        elif name in units:
            section.add_problem(name, "an output with the name of an input", "names that differ")
        elif key == "outputs" and (clash := _clash(name, section)) is not None:
            section.add_problem(
                name, toml_text(name), f'a name other than what "{clash}" brings along'
            )
        elif not isinstance(unit, str):
            section.add_problem(
                name, toml_text(unit), 'a unit such as "cm", or "1" where there is none'
            )
        else:
            try:
                si_unit(unit)
            except QuantityError as error:
                section.add_problem(name, error.found, error.expected)
                continue
            units[name] = unit or "1"
            found.append((name, units[name]))
    return found
