"""``[outputs.<name>]``: the quantity of interest of an output."""

from __future__ import annotations

from typing import Any

from uqpen.core.catalogue import REQUESTED
from uqpen.core.model import Output
from uqpen.core.units import scale
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.derived_section import is_derived, requests_table
from uqpen.study.table_reader import StudyParts, TableReader, check_names

__all__ = ["read_quantities_of_interest"]

# Requests of which a field has none. A limit that holds a share has one side, a band has two; the
# scale of a chart is of one number.
_OF_SCALARS = {each.asked.key: each.asked.refusal for each in REQUESTED if each.asked.refusal} | {
    "scale": "a scale of charts"
}


def read_quantities_of_interest(
    table: TableReader, parts: StudyParts
) -> tuple[QuantityOfInterest, ...]:
    """Read the quantity of interest of each output, derived ones too, in the model's order."""
    model = parts.model
    refused = [name for name in table if is_derived(table.content[name])]
    known = [output.name for output in model.all_outputs]
    check_names(table, [*known, *refused], "output", model)
    return tuple(
        _read_quantity(requests_table(table, output, model), output, parts.confidence_level)
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
    if quantity is not None and quantity.is_logarithmic:
        _check_logarithms(table, quantity)
    return quantity or default


def _check_logarithms(table: TableReader, quantity: QuantityOfInterest) -> None:
    """Note what has no logarithm: a unit with a zero of its own, a threshold at or below 0."""
    if scale(quantity.display_unit).offset:
        expected = "a unit whose zero is no value, such as K; or no scale"
        table.add_wrong("scale", f"log in {quantity.display_unit}", expected)
    asked = {"exceeds": quantity.thresholds, "below": quantity.lower_thresholds}
    for key, thresholds in asked.items():
        for threshold in thresholds:
            if threshold.value <= 0:
                expected = 'a value above 0, as scale = "log" takes its logarithm'
                table.add_wrong(key, threshold.text, expected)
