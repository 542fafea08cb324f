"""``[published.<name>]``: published estimates for comparison with a study's own."""

from __future__ import annotations

from collections.abc import Collection

from uqpen.core.errors import toml_text
from uqpen.core.labels import LARGEST_CONTRIBUTION
from uqpen.core.lookup import choices
from uqpen.core.model import Model, Output
from uqpen.statistics.published import Publication, PublishedEstimates
from uqpen.study.table_reader import TableReader, named_tables

__all__ = ["read_published"]


def read_published(
    table: TableReader | None, model: Model, taken: Collection[str]
) -> dict[str, Publication]:
    """Read the publications of a study; invalid entries are noted and left out.

    Parameters
    ----------
    table : TableReader or None
        ``[published]``.
    model : Model
        The model of their inputs and outputs.
    taken : collection of str
        Names of designs and surrogates.
    """
    found: dict[str, Publication] = {}
    for name, section in named_tables(table):
        if name in taken:
            section.add_problem((), toml_text(name), "a name that no design or surrogate has")
            continue
        source = section.text("source", "where the figures stand")
        estimates = [
            _read_estimates(section, output, model)
            for output in model.outputs
            if output.name in section
        ]
        section.check_unknown_keys("output")
        if source is not None:
            found[name] = Publication(source, tuple(each for each in estimates if each is not None))
    return found


def _read_estimates(
    section: TableReader, output: Output, model: Model
) -> PublishedEstimates | None:
    table = section.table(output.name)
    if table is None:
        return None
    if output.categories:
        for key in table:
            table.take(key)
            table.add_problem(key, "a figure of an output that has kinds", "an output with numbers")
        return None
    mean = table.quantity("mean", output.unit)
    std = table.quantity("std", output.unit, difference=True)
    moments = {"mean": mean, "std": std}
    responses = _responses(table.table("response"), model)
    largest = table.take(LARGEST_CONTRIBUTION) or ""
    known = [variable.name for variable in model.inputs]
    if largest and largest not in known:
        expected = f"an input of {model.name}; {choices(str(largest), known)}"
        table.add_problem(LARGEST_CONTRIBUTION, toml_text(largest), expected)
    table.check_unknown_keys()
    values = {moment: value for moment, value in moments.items() if value is not None}
    return PublishedEstimates(output, values, responses, str(largest))


def _responses(table: TableReader | None, model: Model) -> dict[str, float]:
    known = [variable.name for variable in model.inputs]
    found = {}
    for name in table or ():
        assert table is not None
        value = table.quantity(name, "1")
        if name not in known:
            expected = f"an input of {model.name}; {choices(name, known)}"
            table.add_problem(name, "an unknown input", expected)
        elif value is not None:
            found[name] = value
    return found
