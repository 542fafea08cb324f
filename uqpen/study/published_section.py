"""``[published.<name>]``: figures from elsewhere to stand beside a study's own."""

from __future__ import annotations

from collections.abc import Collection

from uqpen.analyses.published import Published, PublishedFigures
from uqpen.errors import as_written
from uqpen.labels import LARGEST_CONTRIBUTION
from uqpen.lookup import choices
from uqpen.model import Model, Output
from uqpen.study.section import Section, named

__all__ = ["read_published"]


def read_published(
    table: Section | None, model: Model, taken: Collection[str]
) -> dict[str, Published]:
    """The publications of a study; what could not be understood is noted and left out.

    Parameters
    ----------
    table : Section or None
        ``[published]``.
    model : Model
        Whose inputs and outputs they tell of.
    taken : collection of str
        Names of designs and surrogates.
    """
    found: dict[str, Published] = {}
    for name, section in named(table):
        if name in taken:
            section.wrong((), as_written(name), "a name that no design or surrogate has")
            continue
        source = section.text("source", "where the figures stand")
        figures = [
            _figures(section, output, model) for output in model.outputs if output.name in section
        ]
        section.close("output")
        if source is not None:
            found[name] = Published(source, tuple(each for each in figures if each is not None))
    return found


def _figures(section: Section, output: Output, model: Model) -> PublishedFigures | None:
    table = section.table(output.name)
    if table is None:
        return None
    if output.categories:
        for key in table:
            table.take(key)
            table.wrong(key, "a figure of an output that has kinds", "an output with numbers")
        return None
    mean = table.quantity("mean", output.unit)
    std = table.quantity("std", output.unit, difference=True)
    moments = {"mean": mean, "std": std}
    responses = _responses(table.table("response"), model)
    largest = table.take(LARGEST_CONTRIBUTION) or ""
    known = [variable.name for variable in model.inputs]
    if largest and largest not in known:
        expected = f"an input of {model.name}; {choices(str(largest), known)}"
        table.wrong(LARGEST_CONTRIBUTION, as_written(largest), expected)
    table.close()
    told = {moment: value for moment, value in moments.items() if value is not None}
    return PublishedFigures(output, told, responses, str(largest))


def _responses(table: Section | None, model: Model) -> dict[str, float]:
    known = [variable.name for variable in model.inputs]
    found = {}
    for name in table or ():
        assert table is not None
        value = table.quantity(name, "1")
        if name not in known:
            expected = f"an input of {model.name}; {choices(name, known)}"
            table.wrong(name, "an unknown input", expected)
        elif value is not None:
            found[name] = value
    return found
