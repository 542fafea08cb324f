"""``[published.<name>]``: published estimates for comparison with a study's own."""

from __future__ import annotations

from dataclasses import replace

from uqpen.core.labels import LARGEST_CONTRIBUTION
from uqpen.core.lookup import choices
from uqpen.core.model import Model, Output
from uqpen.statistics.published import Publication, PublishedEstimates
from uqpen.study.table_reader import StudyParts, TableReader, check_names, named_tables

__all__ = ["read_published"]


def read_published(table: TableReader, parts: StudyParts) -> dict[str, Publication]:
    """Read the publications of a study; invalid entries are noted and left out."""
    found: dict[str, Publication] = {}
    for name, section in named_tables(table):
        if name in parts.sources:
            section.add_wrong((), name, "a name that no design or surrogate has")
            continue
        publication = section.settings(Publication)
        estimates = [
            _read_estimates(section, output, parts.model) for output in parts.model.all_outputs
        ]
        section.check_unknown_keys("output")
        if publication is not None:
            found[name] = replace(publication, estimates=tuple(filter(None, estimates)))
    return found


def _read_estimates(
    section: TableReader, output: Output, model: Model
) -> PublishedEstimates | None:
    if output.name not in section:
        return None
    table = section.table(output.name)
    if output.categories:
        for key in table:
            table.add_problem(
                key, "an estimate of an output with categories", "an output with numbers"
            )
        return None
    if output.dims:
        for key in table:
            expected = "an output without dimensions"
            table.add_problem(key, f'an estimate of "{output.name}"', expected)
        return None
    largest = table.content.get(LARGEST_CONTRIBUTION) or ""
    given = {"output": output, LARGEST_CONTRIBUTION: str(largest)}
    estimates = table.settings(
        PublishedEstimates,
        like=output.unit,
        allow_offset=not output.is_difference,
        given=given,
    )
    known = [variable.name for variable in model.inputs]
    check_names(table.table("response"), known, "input", model)
    if table.take(LARGEST_CONTRIBUTION) and largest not in known:
        expected = f"an input of {model.name}; {choices(str(largest), known)}"
        table.add_wrong(LARGEST_CONTRIBUTION, largest, expected)
    table.check_unknown_keys()
    return estimates if table.is_given else None
