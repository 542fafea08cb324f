"""``[model.inputs]`` and ``[model.outputs]``: what a model from outside takes and gives."""

from __future__ import annotations

from typing import NamedTuple

from uqpen.errors import QuantityError, as_written
from uqpen.labels import NAME, RESERVED, SUFFIXES
from uqpen.model import Input, Output
from uqpen.study.section import Section
from uqpen.units import si_unit

__all__ = ["Variables", "read_variables"]


class Variables(NamedTuple):
    """What a model takes and gives, and the unit that it wants or tells each of them in."""

    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    called_in: dict[str, str]


def read_variables(table: Section) -> Variables:
    """The inputs and outputs that a model's table declares; mistakes are noted."""
    called_in: dict[str, str] = {}
    inputs = tuple(
        Input(name, si_unit(unit), display_unit=unit)
        for name, unit in _variables(table, "inputs", called_in)
    )
    outputs = tuple(
        Output(name, si_unit(unit), display_unit=unit)
        for name, unit in _variables(table, "outputs", called_in)
    )
    return Variables(inputs, outputs, called_in)


def _clash(name: str, section: Section) -> str | None:
    """Another output that has a statistic by this name."""
    for other in section:
        stem, _, suffix = name.removeprefix(other).partition("_")
        if name.startswith(other) and not stem and suffix in SUFFIXES:
            return other
    return None


def _variables(table: Section, key: str, called_in: dict[str, str]) -> list[tuple[str, str]]:
    """Names and units of a model's inputs or outputs."""
    does = "takes" if key == "inputs" else "gives"
    section = table.table(key, f'what the model {does}, as name = "unit"')
    if section is None:
        return []
    if not section.content:
        section.wrong((), "an empty table", 'at least one name = "unit"')
    found = []
    for name in section:
        unit = section.take(name)
        if not NAME.match(name) or name in RESERVED:
            others = ", ".join(sorted(RESERVED))
            expected = f"a name of letters, digits and _, at most 100, none of {others}"
            section.wrong(name, as_written(name), expected)
        elif name in called_in:
            section.wrong(name, "an output with the name of an input", "names that differ")
        elif key == "outputs" and (clash := _clash(name, section)) is not None:
            section.wrong(name, as_written(name), f'a name other than what "{clash}" brings along')
        elif not isinstance(unit, str):
            section.wrong(name, as_written(unit), 'a unit such as "cm", or "1" where there is none')
        else:
            try:
                si_unit(unit)
            except QuantityError as error:
                section.wrong(name, error.found, error.expected)
                continue
            called_in[name] = unit or "1"
            found.append((name, called_in[name]))
    return found
