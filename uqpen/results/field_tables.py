"""Outputs with dimensions: their tables, their estimates along a curve, and a place of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, entry_place, field_dimensions
from uqpen.archive.groups import GROUPS, group_place, model_trees
from uqpen.archive.read import read_group
from uqpen.core.arrays import FloatArray, IntArray, evenly_spread
from uqpen.core.catalogue import CATALOGUE, MEAN, QUANTILE, REACHED, STD
from uqpen.core.errors import QuantityError, UnknownNameError, toml_text
from uqpen.core.labels import BOUND, DERIVED_FROM, LEFT_OUT_PLACES, RUNS
from uqpen.core.lookup import choices
from uqpen.core.quantities import parse_quantity
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import estimate_text, number_text
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.surrogate_tables import FITTED, fitted_outputs
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
    first_runs,
    headed_models,
    label_with_unit,
    output_names,
    quantile_label,
    shown_bounds,
    shown_unit,
)

# Fields of a model with a table of their own: the screen of a study with hundreds stays short.
_MOST_CURVES = 3

# The levels of the archive that are shown, as far as it has them.
_LEVELS = (0.05, 0.5, 0.95)


def _fields(statistics: SourceStatistics) -> Iterator[tuple[str, str, str]]:
    """Yield each field, its dimensions in words, and the first source of its mean."""
    runs = statistics.runs
    for output in statistics.fields:
        extent = ", ".join(_extent_text(runs[each]) for each in field_dimensions(runs[output]))
        yield output, extent, next(iter(statistics.by_source(output, MEAN.name)), "")


def _extent_text(coordinate: xr.DataArray) -> str:
    """Return the name of a dimension with its unit, its ends and its size."""
    unit = shown_unit(coordinate.attrs)
    first, last = scale(unit).from_si(np.asarray(coordinate.values[[0, -1]], dtype=np.float64))
    label = label_with_unit(str(coordinate.name), unit)
    return f"{label} from {number_text(first, 6)} to {number_text(last, 6)} ({coordinate.size})"


def _ends(
    statistics: SourceStatistics, source: str, output: str, statistic: str
) -> list[tuple[xr.DataArray, str]]:
    """Return the smallest and the largest estimate, each with its place; nothing without any."""
    array = statistics.get(source, output, statistic)
    if array is None or not np.isfinite(array.values[..., 0]).any():
        return []
    estimates, found = array.values[..., 0], []
    for position in (np.nanargmin(estimates), np.nanargmax(estimates)):
        index = tuple(map(int, np.unravel_index(position, estimates.shape)))
        reached = statistics.reached_text(source, output, index)
        found.append((array[index], f"{entry_place(array, index)}{reached}"))
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
        for output, extent, source in _fields(statistics):
            text = _range_text(statistics, output, source)
            yield f"{head}{statistics.label(output)}: along {extent}{text}"
        yield from (f"{head}{line}" for line in derived_lines(model))


def _range_text(statistics: SourceStatistics, output: str, source: str) -> str:
    """Return the range of the mean by a source, and the largest sd; empty without a mean."""
    texts = []
    for statistic in (MEAN, STD):
        convert = conversion(statistic, scale(statistics.unit(output)))
        ends = _ends(statistics, source, output, statistic.name)
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
        for name, extent, source in _fields(statistics):
            title = f"{head}along {extent}{f'; mean by {source}' if source else ''}"
            table = tables.setdefault(title, OutputTable(title, ["smallest mean", "largest mean"]))
            convert = conversion(MEAN, scale(statistics.unit(name)))
            cells = [
                table.cell(entry, convert)
                for entry, _ in _ends(statistics, source, name, MEAN.name)
            ]
            table.rows.append((statistics.label(name), cells or [NOTHING, NOTHING]))
        yield from tables.values()


def curve_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table for each of the first curves of each model, at five places from end to end.

    A row is a place, the columns are the mean and quantiles from the first source of a mean. Where
    curves end, the first column is the share of them that gets there. A field with several
    dimensions has no table.
    """
    for head, model in headed_models(tree).items():
        statistics = SourceStatistics(model)
        curves = [
            each for each in statistics.fields if len(field_dimensions(statistics.runs[each])) == 1
        ]
        for output in curves[:_MOST_CURVES]:
            for source in list(statistics.by_source(output, MEAN.name))[:1]:
                yield _curve_table(head, statistics, output, source)


def _curve_table(head: str, statistics: SourceStatistics, output: str, source: str) -> OutputTable:
    (dimension,) = field_dimensions(statistics.runs[output])
    coordinate = statistics.runs[dimension]
    shown = conversion(MEAN, scale(statistics.unit(output)))
    quantiles = statistics.entries(source, output, QUANTILE.name)
    columns = {MEAN.shown.label: statistics.by_source(output, MEAN.name)[source]}
    columns |= {quantile_label(each): quantiles[each] for each in _LEVELS if each in quantiles}
    columns = {label: array for label, array in columns.items() if dimension in array.dims}
    reached = statistics.get(source, output, REACHED.name)
    if reached is not None and (reached.values[..., 0] < 1).any():
        columns = {REACHED.shown.label: reached, **columns}
    converted = {REACHED.shown.label: conversion(REACHED, scale(DIMENSIONLESS))}
    title = f"{head}{statistics.label(output)} along {dimension}, by {source}"
    table = OutputTable(title, list(columns))
    last = coordinate.size - 1
    for position in dict.fromkeys(last * quarter // 4 for quarter in range(5)):
        cells = [
            table.cell(array[{dimension: position}], converted.get(label, shown))
            for label, array in columns.items()
        ]
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


# Estimates of a curve by one source at all of its places, in the units that are shown.


def curves(view: ArchiveView) -> list[str]:
    """Return the outputs along one dimension; only the selected one, if any."""
    runs = first_runs(view.tree)
    return [name for name in view.fields if len(field_dimensions(runs[name])) == 1]


@dataclass(frozen=True)
class CurveEstimates:
    """Estimates of an output along one dimension."""

    view: ArchiveView  # the part of an archive on one model
    output: str  # the curve
    source: str  # the design or surrogate whose estimates they are
    # Places at the most, evenly spread over the curve; all of them by default.
    most_places: int | None = None

    @cached_property
    def dimension(self) -> str:
        """The dimension of the curve."""
        return field_dimensions(first_runs(self.view.tree)[self.output])[0]

    @property
    def size(self) -> int:
        """Number of all places of the curve."""
        return int(self._coordinates.size)

    @cached_property
    def positions(self) -> IntArray:
        """Positions of the places among all of the curve."""
        return evenly_spread(self.size, self.most_places or self.size)

    @cached_property
    def places(self) -> FloatArray:
        """The coordinates, shape (place,)."""
        coordinates = self._coordinates.values[self.positions]
        return np.asarray(self.view.scale(self.dimension).from_si(coordinates), dtype=np.float64)

    @property
    def _coordinates(self) -> xr.DataArray:
        return first_runs(self.view.tree)[self.dimension]

    @property
    def has_runs(self) -> bool:
        """True if the source is a design and the archive has its runs."""
        return self.source in self.view.designs and self.view.design(self.source).keeps_runs

    @cached_property
    def runs(self) -> FloatArray:
        """The curves of the completed runs of a design, shape (run, place); NaN behind an end."""
        return self._shown_runs(self.view.design(self.source).completed_values(self.output))

    @property
    def outlying_runs(self) -> FloatArray:
        """The curves of the outlying runs of a design, shape (run, place); of those kept alone."""
        mask = self.view.statistics.get(self.source, self.output, "outlying")
        if not self.has_runs:
            mask = None
        every = read_group(self.view.tree, RUNS, self.source)[self.output].values
        numbers = [] if mask is None else mask["curve"].values[mask.values == 1]
        return self._shown_runs(every[np.asarray(numbers, dtype=np.int64)])

    @property
    def outlying_count(self) -> tuple[int, int]:
        """The numbers of outlying runs and of all that are ranked."""
        mask = self.view.statistics.get(self.source, self.output, "outlying")
        return (0, 0) if mask is None else (int((mask.values == 1).sum()), mask.size)

    def _shown_runs(self, values: FloatArray) -> FloatArray:
        shown = self.view.scale(self.output).from_si(values[:, self.positions])
        return np.asarray(shown, dtype=np.float64)

    def array(self, statistic: str, source: str = "") -> xr.DataArray | None:
        """Return an estimate array at the places, in SI units; None without one.

        It is of another source, if one is named.
        """
        found = self.view.statistics.get(source or self.source, self.output, statistic)
        if found is None or self.dimension not in found.dims:
            return None
        return found.isel({self.dimension: self.positions})

    def bounds(self, statistic: str) -> FloatArray | None:
        """Return a statistic of one value at each place, shape (place, bound); None without it."""
        found = self.array(statistic)
        return None if found is None else self._shown(found, statistic)

    def entries(self, statistic: str) -> dict[Any, FloatArray]:
        """Return a statistic by its labels, shape (place, bound) each; empty without it."""
        found = self.array(statistic)
        if found is None:
            return {}
        (own,) = (dim for dim in found.dims if dim not in (self.dimension, BOUND))
        return {
            each[own].item(): self._shown(each, statistic) for each in found.transpose(own, ...)
        }

    def _shown(self, array: xr.DataArray, statistic: str) -> FloatArray:
        convert = self.view.conversion(self.output, CATALOGUE[statistic])
        values = array.transpose(self.dimension, BOUND).values
        return np.asarray(convert(values), dtype=np.float64)

    def left_out(self, statistic: str) -> str:
        """Return the places that a band leaves out, and why; empty for none."""
        found = self.array(statistic)
        return "" if found is None else str(found.attrs.get(LEFT_OUT_PLACES, ""))


# An archive cut down to one output, and to places of it where that is a field.


class FieldPlace(NamedTuple):
    """A coordinate along a dimension of a field."""

    dimension: str  # the dimension
    position: int  # the position among the coordinates
    remark: str  # sentence on a place that is not where it was asked for; else empty


def find_place(field: xr.DataArray, text: str) -> FieldPlace:
    """Return the coordinate of a field that is nearest to a text such as ``"time=10 day"``.

    Without a unit it is in that of the study.

    Raises
    ------
    UnknownNameError
        If the field has no such dimension.
    QuantityError
        If it is no quantity, or lies outside the coordinates.
    """
    name, _, asked = (part.strip() for part in text.partition("="))
    along = field_dimensions(field)
    if name not in along:
        known = choices(name, along) if along else "it is a single number or category"
        raise UnknownNameError(f'{field.name} has no dimension "{name}"; {known}')
    coordinate = field[name]
    values, unit = coordinate.values, shown_unit(coordinate.attrs)
    if not asked:
        raise QuantityError(toml_text(text), f"a place, such as {name}=1")
    try:
        value = scale(unit).to_si(float(asked))
    except ValueError:
        value = parse_quantity(asked, unit).value
    if not values[0] <= value <= values[-1]:
        first, last = (coordinate_text(coordinate, end) for end in values[[0, -1]])
        raise QuantityError(toml_text(text), f"{first} to {last.partition('= ')[2]}")
    position = int(np.abs(values - value).argmin())
    is_there = np.isclose(values[position], value, rtol=1e-9, atol=0)
    nearest = f"{coordinate_text(coordinate, values[position])} is the nearest to {asked}"
    return FieldPlace(name, position, "" if is_there else nearest)


def select_output(
    tree: xr.DataTree, output: str, at: Sequence[str] = ()
) -> tuple[xr.DataTree, list[FieldPlace]]:
    """Return an archive as if its models had one output, the values of a field at some places.

    A field at a place is a number there, and so has the tables and the JSON of one. `at` has a
    place along each dimension to cut, see `find_place`; these remain as scalar coordinates, and are
    returned as well.

    Raises
    ------
    UnknownNameError
        If no model has this output, or the output has no such dimension.
    QuantityError
        If a place is not inside the coordinates, or a dimension has two.
    """
    described = {
        name: runs[name]
        for model in reversed(model_trees(tree).values())
        for runs in (first_runs(model),)
        for name in output_names(runs)
    }
    if output not in described:
        known = choices(output, described)
        raise UnknownNameError(f'the archive has no output "{output}"; {known}')
    places = [find_place(described[output], text) for text in at]
    positions = {place.dimension: place.position for place in places}
    if len(positions) < len(places):
        raise QuantityError(", ".join(at), "one place along each dimension")
    others = described.keys() - {output}
    groups = {}
    for node in tree.subtree:
        kind, names = group_place(node.relative_to(tree))
        if names.get("output") in others:
            continue
        dataset = node.to_dataset(inherit=False)
        if kind == RUNS:
            dataset = dataset.drop_vars(others, errors="ignore")
        if kind in GROUPS and GROUPS[kind].is_along_fields:
            dataset = dataset.isel(positions, missing_dims="ignore")
        if FITTED in dataset.attrs:
            kept = [name for name in fitted_outputs(node) if name == output]
            dataset = dataset.assign_attrs({FITTED: " ".join(kept)})
        groups[node.path] = dataset
    return xr.DataTree.from_dict(groups), places
