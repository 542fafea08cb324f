"""``[outputs.<name>]``: the quantity of interest of an output."""

from __future__ import annotations

from typing import Any

from uqpen.core.model import Model, Output
from uqpen.statistics import texts
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.derived_section import is_derived, requests_table
from uqpen.study.table_reader import TableReader, check_names

__all__ = ["read_quantities_of_interest"]

# The only key of an output of any kind.
_UNIT = "unit"


def read_quantities_of_interest(
    table: TableReader, model: Model, confidence_level: float
) -> tuple[QuantityOfInterest, ...]:
    """Read the quantity of interest of each output, derived ones too, in the model's order."""
    refused = [name for name in table if is_derived(table.content[name])]
    known = [output.name for output in model.all_outputs]
    check_names(table, [*known, *refused], "output", model)
    return tuple(
        _read_quantity(requests_table(table, output, model), output, confidence_level)
        for output in model.all_outputs
    )


def _read_quantity(
    table: TableReader, output: Output, confidence_level: float
) -> QuantityOfInterest:
    given: dict[str, Any] = {
        "output": output,
        "display_unit": output.preferred_unit,
        "confidence_level": confidence_level,
    }
    default = QuantityOfInterest(**given)
    if output.categories:
        for key in table:
            table.add_problem(
                key, f'a key of "{output.name}"', "none: an output with categories has shares only"
            )
        return default
    if output.dims:
        table = _without_requests(table, output)
    quantity = table.settings(QuantityOfInterest, like=output.unit, given=given)
    table.check_unknown_keys()
    return quantity or default


def _without_requests(table: TableReader, output: Output) -> TableReader:
    """Return the table of a field without requests for statistics, which are noted."""
    for key in table:
        if key != _UNIT:
            expected = f"none: {texts.SCALARS_ONLY}, and it has dimensions"
            table.add_problem(key, f'a question to "{output.name}"', expected)
    return table.inside({key: value for key, value in table.content.items() if key == _UNIT})
