"""``[outputs.<name>]``: what is asked of an output, beyond what is always told."""

from __future__ import annotations

from uqpen.analyses.question import USUAL_QUANTILES, Question, Threshold
from uqpen.errors import QuantityError, as_written
from uqpen.lookup import choices
from uqpen.model import Model, Output
from uqpen.quantities import parse_quantity
from uqpen.study.section import Section
from uqpen.units import are_alike

__all__ = ["read_questions"]


def read_questions(table: Section | None, model: Model) -> tuple[Question, ...]:
    """A question for each of the model's outputs, in the model's order."""
    known = {output.name: output for output in model.outputs}
    asked: dict[str, Question] = {}
    for name in table or ():
        assert table is not None
        if name not in known:
            expected = f"an output of {model.name}; {choices(name, known)}"
            table.take(name)
            table.wrong(name, "an unknown output", expected)
        elif (section := table.table(name)) is not None:
            asked[name] = _question(section, known[name])
    return tuple(
        asked.get(output.name, Question(output, output.shown_unit)) for output in model.outputs
    )


def _question(table: Section, output: Output) -> Question:
    if output.categories:
        for key in table:
            table.take(key)
            table.wrong(key, f'a question to "{output.name}"', "none: its kinds have shares only")
        return Question(output, output.shown_unit)
    unit = _display_unit(table, output)
    exceeds = _thresholds(table, output)
    quantiles = tuple(sorted({*USUAL_QUANTILES, *table.probabilities("quantiles")}))
    hold = table.probabilities("hold")
    table.close()
    return Question(output, unit, quantiles, exceeds, hold)


def _display_unit(table: Section, output: Output) -> str:
    expected = f'a unit such as "{output.unit}"'
    unit = table.text("unit", expected, default=output.shown_unit)
    try:
        if unit is not None and are_alike(unit, output.unit):
            return unit
        if unit is not None:
            table.wrong("unit", as_written(unit), expected)
    except QuantityError as error:
        table.wrong("unit", error.found, expected)
    return output.shown_unit


def _thresholds(table: Section, output: Output) -> tuple[Threshold, ...]:
    found: dict[str, Threshold] = {}
    for position, value in enumerate(table.entries("exceeds")):
        path = ("exceeds", position)
        text = value.strip() if isinstance(value, str) else as_written(value)
        if text in found:
            table.wrong(path, f'"{text}" a second time', "each threshold once")
            continue
        try:
            found[text] = Threshold(text, parse_quantity(value, output.unit).value)
        except QuantityError as error:
            table.wrong(path, error.found, error.expected)
    return tuple(found.values())
