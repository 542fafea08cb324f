"""``[outputs.<name>]``: the quantity of interest of an output."""

from __future__ import annotations

from typing import Any

from uqpen.core.model import Model, Output
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.derived_section import is_derived, requests_table
from uqpen.study.table_reader import TableReader, check_names

__all__ = ["read_quantities_of_interest"]

# Requests of which a field has none: a value that holds a share has one side, a band has two. The
# mean beyond a quantile and a fitted tail are of one number.
_OF_SCALARS = {
    "hold": "a tolerance limit",
    "hold_above": "a tolerance limit",
    "expected_shortfall": "an expected shortfall",
    "return_periods": "a return level",
}


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
    for key in _OF_SCALARS if output.dims else ():
        if key in table:
            expected = "an output without dimensions"
            if "tolerance" in _OF_SCALARS[key]:
                expected += "; a field has hold_between"
            table.add_problem(key, f'{_OF_SCALARS[key]} of "{output.name}"', expected)
    quantity = table.settings(
        QuantityOfInterest,
        like=output.unit,
        allow_offset=not output.is_difference,
        given=given,
    )
    table.check_unknown_keys()
    return quantity or default
