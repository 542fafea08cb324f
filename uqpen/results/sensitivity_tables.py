"""Tables of the inputs' part in an output: indices, effects, responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import xarray as xr

from uqpen.archive.estimates import array_entries
from uqpen.core.statistic_dimensions import THRESHOLD
from uqpen.core.units import scale
from uqpen.results.archive_view import is_logarithmic
from uqpen.results.index_titles import VarianceTitles, index_titles
from uqpen.results.measure_labels import (
    ASSOCIATIONS,
    CHANGES,
    EFFECTS,
    EXCEEDANCE_INDICES,
    GENERALIZED_INDICES,
    INDICES,
    LOGARITHM_INDICES,
    PAIR_INDICES,
    RESPONSES,
    Measure,
)
from uqpen.results.relative_changes import without_arbitrary_zeros
from uqpen.results.source_statistics import SourceStatistics, best_sources
from uqpen.results.table import (
    NOTHING,
    Conversion,
    OutputTable,
    cut_text,
    first_runs,
    identity,
    label_with_unit,
)

__all__ = ["generalized_table", "named_tables"]


def named_tables(
    statistics: SourceStatistics, output: str, unit: str, *, everything: bool = False
) -> Iterator[tuple[str, OutputTable]]:
    """Yield a table for each type of measure of an output in the unit that is shown.

    First order indices from plain samples are shown where no other source has them. The other
    measures of any sample are shown only with `everything`. Of an output that is shown by its
    logarithm, the indices of that come first.

    Parameters
    ----------
    statistics : SourceStatistics
        Of one model.
    output, unit : str
        The name of the output, and the unit to show it in.
    everything : bool
        True for all measures.

    Yields
    ------
    tuple
        A name, such as "shares", "responses" or "effects", and a table.
    """
    shares = index_titles(statistics.tree)
    yield from _index_tables(statistics, output, shares, everything=everything)
    effects_title, as_effect = label_with_unit("elementary effects", unit), scale(unit)
    tables: list[tuple[str, str, Sequence[Measure], Conversion]] = [
        ("responses", *_response_table(statistics, output, unit)),
        ("effects", effects_title, EFFECTS, as_effect.difference_from_si),
    ]
    if everything:
        tables.append(("associations", "association with its inputs", ASSOCIATIONS, identity))
    for name, title, measures, convert in tables:
        if columns := list(_columns(statistics, output, measures)):
            yield name, _table(f"{output}: {title}", columns, convert)
    for column in _columns(statistics, output, PAIR_INDICES):
        yield "pairs", _table(f"{output}: shares of its variance, by pairs", [column])
    if everything:
        columns = list(_columns(statistics, output, shares.ordered(EXCEEDANCE_INDICES)))
        written = columns[0].array[THRESHOLD].values if columns else ()
        for position, threshold in enumerate(written):
            at = [each._replace(array=each.array[position]) for each in columns]
            title = shares.title(f"the variance of exceeding {threshold}")
            yield "exceedance", _table(f"{output}: {title}", at)


def _index_tables(
    statistics: SourceStatistics, output: str, shares: VarianceTitles, *, everything: bool
) -> Iterator[tuple[str, OutputTable]]:
    """Yield the indices of an output, and those of its logarithm if they are shown."""
    kinds = [("shares", "its variance", INDICES)]
    of_logarithm = ("shares of the logarithm", "its logarithm's variance", LOGARITHM_INDICES)
    if is_logarithmic(statistics, output):
        kinds.insert(0, of_logarithm)
    elif everything:
        kinds.append(of_logarithm)
    for name, of, measures in kinds:
        columns = list(_columns(statistics, output, shares.ordered(measures)))
        if not everything:
            shown = best_sources(statistics.tree, ((each.source, each.array) for each in columns))
            columns = [each for each in columns if each.source in shown]
        if columns:
            table = _table(f"{output}: {shares.title(of)}", columns, note=shares.note)
            if name == "shares":
                _add_claims(table, statistics, output)
            yield name, table


def generalized_table(tree: xr.DataTree, output: str) -> OutputTable | None:
    """Return the indices of a field's variance over all places; None where there are none."""
    shares = index_titles(tree)
    columns = list(_columns(SourceStatistics(tree), output, shares.ordered(GENERALIZED_INDICES)))
    place = cut_text(first_runs(tree)[output])
    over = f"the whole field, not only at {place}" if place else "all places"
    title = f"{output}: {shares.title(f'its variance over {over}')}"
    return _table(title, columns, note=shares.note) if columns else None


def _response_table(
    statistics: SourceStatistics, output: str, unit: str
) -> tuple[str, Sequence[Measure], Conversion]:
    """Return title, measures and conversion of the responses.

    An output in a unit with an offset has changes per standard deviation, as per cent of it have no
    meaning; an archive without these has the reason.
    """
    if statistics.by_source(output, CHANGES[0].statistic):
        title = label_with_unit("change per standard deviation of an input", unit)
        return title, CHANGES, scale(unit).difference_from_si
    return "responses to its inputs", RESPONSES, _percent


class _Column(NamedTuple):
    source: str
    label: str
    array: xr.DataArray


def _columns(
    statistics: SourceStatistics, output: str, measures: Sequence[Measure]
) -> Iterator[_Column]:
    for measure in measures:
        for source, array in statistics.by_source(output, measure.statistic).items():
            shown = without_arbitrary_zeros(statistics.tree, output, measure.statistic, array)
            yield _Column(source, measure.label, shown)


def _table(
    title: str, columns: Sequence[_Column], convert: Conversion = identity, note: str = ""
) -> OutputTable:
    """Return a table with a row for each input or pair of inputs, and a note on all of them."""
    table = OutputTable(title, [f"{each.label}\n{each.source}" for each in columns])
    table.title += table.note_mark(note)
    entries = [
        dict(zip(_entry_names(each.array), array_entries(each.array), strict=True))
        for each in columns
    ]
    for name in dict.fromkeys(name for of_column in entries for name in of_column):
        cells = [table.cell(of_column.get(name), convert) for of_column in entries]
        table.rows.append((name, cells))
    return table


def _entry_names(array: xr.DataArray) -> list[str]:
    return list(map(str, array.coords.variables[array.dims[0]].values))


def _add_claims(table: OutputTable, statistics: SourceStatistics, output: str) -> None:
    """Add a column for each publication that names the largest contribution."""
    for source in statistics.publications:
        if claim := statistics.largest_contribution(source, output):
            table.columns.append(f"the largest to\n{source}")
            for name, cells in table.rows:
                cells.append("this" if name == claim else NOTHING)


def _percent(values: Any) -> Any:
    return values * 100.0
