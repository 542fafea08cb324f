"""``[outputs.<name>]``: the quantity of interest of an output."""

from __future__ import annotations

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.lookup import choices
from uqpen.core.model import Model, Output
from uqpen.core.quantities import parse_quantity
from uqpen.core.units import are_convertible
from uqpen.statistics.quantity_of_interest import DEFAULT_QUANTILES, QuantityOfInterest, Threshold
from uqpen.study.table_reader import TableReader

__all__ = ["read_quantities_of_interest"]


def read_quantities_of_interest(
    table: TableReader | None, model: Model
) -> tuple[QuantityOfInterest, ...]:
    """Read the quantity of interest of each of the model's outputs, in the model's order."""
    known = {output.name: output for output in model.outputs}
    quantities: dict[str, QuantityOfInterest] = {}
    for name in table or ():
        assert table is not None
        if name not in known:
            expected = f"an output of {model.name}; {choices(name, known)}"
            table.take(name)
            table.add_problem(name, "an unknown output", expected)
        elif (section := table.table(name)) is not None:
            quantities[name] = _read_quantity(section, known[name])
    return tuple(
        quantities.get(output.name, QuantityOfInterest(output, output.preferred_unit))
        for output in model.outputs
    )


def _read_quantity(table: TableReader, output: Output) -> QuantityOfInterest:
    if output.categories:
        for key in table:
            table.take(key)
            table.add_problem(
                key, f'a question to "{output.name}"', "none: its kinds have shares only"
            )
        return QuantityOfInterest(output, output.preferred_unit)
    unit = _display_unit(table, output)
    exceeds = _thresholds(table, output)
    quantiles = tuple(sorted({*DEFAULT_QUANTILES, *table.probabilities("quantiles")}))
    contents = table.probabilities("hold")
    table.check_unknown_keys()
    return QuantityOfInterest(output, unit, quantiles, exceeds, contents)


def _display_unit(table: TableReader, output: Output) -> str:
    expected = f'a unit such as "{output.unit}"'
    unit = table.text("unit", expected, default=output.preferred_unit)
    try:
        if unit is not None and are_convertible(unit, output.unit):
            return unit
        if unit is not None:
            table.add_problem("unit", toml_text(unit), expected)
    except QuantityError as error:
        table.add_problem("unit", error.found, expected)
    return output.preferred_unit


def _thresholds(table: TableReader, output: Output) -> tuple[Threshold, ...]:
    found: dict[str, Threshold] = {}
    for position, value in enumerate(table.entries("exceeds")):
        path = ("exceeds", position)
        text = value.strip() if isinstance(value, str) else toml_text(value)
        if text in found:
            table.add_problem(path, f'"{text}" a second time', "each threshold once")
            continue
        try:
            found[text] = Threshold(text, parse_quantity(value, output.unit).value)
        except QuantityError as error:
            table.add_problem(path, error.found, error.expected)
    return tuple(found.values())
