"""Where the uncertainty comes from: shares of the variance, effects, responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np
import xarray as xr

from uqpen.figures.measures import Series, series
from uqpen.figures.part import Part
from uqpen.figures.responses import RESPONSES, magnitudes
from uqpen.figures.sensitivity import EFFECTS, INDICES, best
from uqpen.figures.texts import capitalized, with_unit
from uqpen.labels import INPUT, SENSITIVITY
from uqpen.report.blocks import Block, Chart, Charts, Heading, Table
from uqpen.report.sections.evidence import called
from uqpen.report.sections.measures import Asked, measures_chart
from uqpen.summary.sensitivity_tables import named_tables
from uqpen.summary.table import NOTHING, OutputTable, unchanged

__all__ = ["sensitivity"]

# Of which the summary of a chart speaks, the first that is told.
_SPOKEN = ("total order", "first order", "Shapley effect")
_SHARE = "share of the variance"
# Kinds of an output that have a chart of their own.
_MOST_KINDS = 6


def sensitivity(part: Part) -> Iterator[Block]:
    """Where the uncertainty comes from: shares of the variance, effects, responses."""
    for output in part.numbers:
        if blocks := list(_of_number(part, output)):
            yield Heading(called(part, output))
            yield from blocks
    for output in part.kinds:
        if blocks := list(_of_kinds(part, output)):
            yield Heading(called(part, output))
            yield from blocks


def _of_number(part: Part, output: str) -> Iterator[Block]:
    tables: dict[str, list[OutputTable]] = {}
    for name, table in named_tables(part.tree, output, part.unit(output), everything=True):
        tables.setdefault(name, []).append(table)
    every = series(part, output, INDICES)
    if found := best(part, every):
        left_out = "First order by plain samples stands in the table alone."
        notes = (left_out,) if len(found) < len(every) else ()
        asked = Asked("Shares of its variance", _SHARE, unchanged, _SPOKEN, notes=notes)
        yield measures_chart(part, found, asked, tables.pop("shares", ()))
    if found := series(part, output, EFFECTS):
        convert, unit = part.measure(output).difference_from_si, part.unit(output)
        axis, spoken = with_unit("effect", unit), tuple(label for _, label, _ in EFFECTS)
        asked = Asked("Elementary effects", axis, convert, spoken, unit)
        yield measures_chart(part, found, asked, tables.pop("effects", ()))
    if charts := tuple(_responses(part, output)):
        yield Charts(charts, tables=tuple(tables.pop("responses", ())))
    for table in chain.from_iterable(tables.values()):
        if _tells(table):
            yield Table(table, is_folded=True)


def _tells(table: OutputTable) -> bool:
    """Whether there is any figure in it."""
    return any(not cell.startswith(NOTHING) for _, cells in table.rows for cell in cells)


def _responses(part: Part, output: str) -> Iterator[Chart]:
    """Responses near the nominal point, and × uncertainty."""
    for suffix, label, axis in RESPONSES:
        if found := series(part, output, ((suffix, "", "o"),)):
            title = f"{capitalized(label)}, near the nominal point"
            yield measures_chart(part, found, Asked(title, axis, magnitudes, (label,), "%"))


def _of_kinds(part: Part, output: str) -> Iterator[Block]:
    """Shares of the variance of whether an output is of a kind."""
    labels = _kinds(part, output)
    charts = []
    for names, found in _by_kind(part, output, labels)[:_MOST_KINDS]:
        title = f"Shares of the variance of whether it is {' or '.join(names)}"
        charts.append(measures_chart(part, found, Asked(title, _SHARE, unchanged, _SPOKEN)))
    tables = tuple(_kind_tables(part, output, labels))
    if charts:
        yield Charts(tuple(charts), tables=tables)
    else:
        yield from (Table(table, is_folded=True) for table in tables)


def _kinds(part: Part, output: str) -> list[str]:
    for _, told in part.told(SENSITIVITY):
        if (name := f"{output}_category_label") in told.coords:
            return list(map(str, told[name].values.tolist()))
    return []


def _told_of_kind(part: Part, output: str, position: int) -> list[Series]:
    """What all sources tell of one kind."""
    return [
        Series(source, label, marker, told[name][{f"{output}_category": position}])
        for source, told in part.told(SENSITIVITY)
        for suffix, label, marker in INDICES
        if (name := f"{output}_category_{suffix}") in told
    ]


def _by_kind(
    part: Part, output: str, labels: Sequence[str]
) -> list[tuple[list[str], list[Series]]]:
    """Kinds, and what is told of them; those together of which the same is told.

    Where there are two, one comes about whenever the other does not.
    """
    kept: list[tuple[list[str], list[Series]]] = []
    for position, label in enumerate(labels):
        told = _told_of_kind(part, output, position)
        found = best(part, [each for each in told if np.isfinite(each.array.values[:, 0]).any()])
        if not found:
            continue
        same = (names for names, known in kept if _is_same(known, found))
        if (names := next(same, None)) is not None:
            names.append(label)
        else:
            kept.append(([label], found))
    return kept


def _is_same(one: Sequence[Series], other: Sequence[Series]) -> bool:
    return len(one) == len(other) and all(
        np.allclose(a.array.values, b.array.values, rtol=1e-9, atol=1e-12, equal_nan=True)
        for a, b in zip(one, other, strict=True)
    )


def _kind_tables(part: Part, output: str, labels: Sequence[str]) -> Iterator[OutputTable]:
    """A table for each kind, a row for each input."""
    for position, label in enumerate(labels):
        told = _told_of_kind(part, output, position)
        headers = [f"{each.label}\n{each.source}" for each in told]
        title = f"{output}: shares of the variance of whether it is {label}"
        table = OutputTable(title, headers)
        for name in dict.fromkeys(str(i) for each in told for i in each.array[INPUT].values):
            table.rows.append((name, [_cell(table, each.array, name) for each in told]))
        yield table


def _cell(table: OutputTable, array: xr.DataArray, name: str) -> str:
    known = array[INPUT].values.tolist()
    return table.cell(array[known.index(name)], unchanged) if name in known else NOTHING
