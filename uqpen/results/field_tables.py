"""Fields among the outputs of an archive, as lines of text and as tables."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, field_dimensions
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import DERIVED_FROM
from uqpen.core.units import scale
from uqpen.results.digits import estimate_text, number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
    first_runs,
    headed_models,
    label_with_unit,
    quantile_label,
    shown_bounds,
    shown_unit,
)

__all__ = ["curve_tables", "derived_lines", "field_lines", "field_tables", "place_option"]

# Fields of a model with a table of their own: the screen of a study with hundreds stays short.
_MOST_CURVES = 3

# The levels of the archive that are shown, as far as it has them.
_LEVELS = (0.05, 0.5, 0.95)


def _fields(statistics: SourceStatistics) -> Iterator[tuple[str, str, str, xr.DataArray | None]]:
    """Yield each field, its dimensions in words, the first source of its mean, and this mean."""
    runs = statistics.runs
    for output in statistics.fields:
        extent = ", ".join(_extent_text(runs[each]) for each in field_dimensions(runs[output]))
        source, mean = next(iter(statistics.by_source(output, "mean").items()), ("", None))
        yield output, extent, source, mean


def _extent_text(coordinate: xr.DataArray) -> str:
    """Return the name of a dimension with its unit, its ends and its size."""
    unit = shown_unit(coordinate.attrs)
    first, last = scale(unit).from_si(np.asarray(coordinate.values[[0, -1]], dtype=np.float64))
    label = label_with_unit(str(coordinate.name), unit)
    return f"{label} from {number_text(first, 6)} to {number_text(last, 6)} ({coordinate.size})"


def _ends(array: xr.DataArray | None) -> list[tuple[xr.DataArray, str]]:
    """Return the smallest and the largest estimate, each with its place; nothing without any."""
    if array is None or not np.isfinite(array.values[..., 0]).any():
        return []
    estimates, found = array.values[..., 0], []
    for position in (np.nanargmin(estimates), np.nanargmax(estimates)):
        index = np.unravel_index(position, estimates.shape)
        places = (
            coordinate_text(array[dim], array[dim].values[at], 6)
            for dim, at in zip(array.dims, index, strict=False)
        )
        found.append((array[index], ", ".join(places)))
    return found


def field_lines(tree: xr.DataTree) -> Iterator[str]:
    """Yield a line for each field of each model, and for each number that follows from one.

    Examples
    --------
    ``infected: along time [day] from 0 to 160 (161); by mc mean from 0.00115 ± 0.00023 at time =
    160 day to 0.279 ± 0.012 at time = 31 day, sd at most 0.096 ± 0.010 at time = 32 day``

    ``peak: largest infected along time``
    """
    for head, model in headed_models(tree).items():
        statistics = SourceStatistics(model)
        for output, extent, source, _ in _fields(statistics):
            text = _range_text(statistics, output, source)
            yield f"{head}{statistics.label(output)}: along {extent}{text}"
        yield from (f"{head}{line}" for line in derived_lines(model))


def _range_text(statistics: SourceStatistics, output: str, source: str) -> str:
    """Return the range of the mean by a source, and the largest sd; empty without a mean."""
    texts = []
    for statistic in (CATALOGUE["mean"], CATALOGUE["std"]):
        convert = conversion(statistic, scale(statistics.unit(output)))
        ends = _ends(statistics.get(source, output, statistic.name))
        texts.append(
            [f"{estimate_text(*shown_bounds(each, convert))} at {place}" for each, place in ends]
        )
    means, stds = texts
    if not means:
        return ""
    text = f"; by {source} mean from {means[0]} to {means[1]}"
    return f"{text}, sd at most {stds[1]}" if stds else text


def derived_lines(model: xr.DataTree) -> Iterator[str]:
    """Yield what each number of a model is that follows from a field."""
    runs = first_runs(model)
    for derived in runs.data_vars:
        attributes = runs.variables[derived].attrs
        # The companion of a number that not all runs have is described by its shares.
        if DERIVED_FROM in attributes and "display_units" in attributes:
            label = label_with_unit(str(derived), shown_unit(attributes))
            yield f"{label}: {attributes['long_name']}"


def field_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table for the fields of each model along the same dimensions.

    Examples
    --------
    A row is ``infected: 0.00115 ± 0.00023, 0.279 ± 0.012``: the ends of the range of its mean.
    """
    for head, model in headed_models(tree).items():
        statistics = SourceStatistics(model)
        tables: dict[str, OutputTable] = {}
        for name, extent, source, mean in _fields(statistics):
            title = f"{head}along {extent}{f'; mean by {source}' if source else ''}"
            table = tables.setdefault(title, OutputTable(title, ["smallest mean", "largest mean"]))
            convert = conversion(CATALOGUE["mean"], scale(statistics.unit(name)))
            cells = [table.cell(entry, convert) for entry, _ in _ends(mean)]
            table.rows.append((statistics.label(name), cells or [NOTHING, NOTHING]))
        yield from tables.values()


def curve_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table for each of the first curves of each model, at five places from end to end.

    A row is a place, the columns are the mean and quantiles from the first source of a mean. A
    field with several dimensions has no table.
    """
    for head, model in headed_models(tree).items():
        statistics = SourceStatistics(model)
        curves = [
            each for each in statistics.fields if len(field_dimensions(statistics.runs[each])) == 1
        ]
        for output in curves[:_MOST_CURVES]:
            for source in list(statistics.by_source(output, "mean"))[:1]:
                yield _curve_table(head, statistics, output, source)


def _curve_table(head: str, statistics: SourceStatistics, output: str, source: str) -> OutputTable:
    (dimension,) = field_dimensions(statistics.runs[output])
    coordinate, convert = (
        statistics.runs[dimension],
        conversion(CATALOGUE["mean"], scale(statistics.unit(output))),
    )
    quantiles = statistics.entries(source, output, "quantile")
    columns = {"mean": statistics.by_source(output, "mean")[source]}
    columns |= {quantile_label(each): quantiles[each] for each in _LEVELS if each in quantiles}
    columns = {label: array for label, array in columns.items() if dimension in array.dims}
    title = f"{head}{statistics.label(output)} along {dimension}, by {source}"
    table = OutputTable(title, list(columns))
    last = coordinate.size - 1
    for position in dict.fromkeys(last * quarter // 4 for quarter in range(5)):
        cells = [table.cell(array[{dimension: position}], convert) for array in columns.values()]
        place = coordinate_text(coordinate, coordinate.values[position], digits=4)
        table.rows.append((place, cells))
    return table


def place_option(tree: xr.DataTree) -> str:
    """Return the command that shows the first field at any place; empty where there is none."""
    for model in headed_models(tree).values():
        statistics = SourceStatistics(model)
        for output in statistics.fields:
            runs = statistics.runs
            places = " ".join(
                f'--at "{coordinate_text(runs[each], runs[each].values[-1]).replace(" = ", "=")}"'
                for each in field_dimensions(runs[output])
            )
            return f"all statistics at any place:\n  uqpen show ARCHIVE --output {output} {places}"
    return ""
