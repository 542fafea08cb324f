"""The inputs' part in an output: indices, effects, responses; tables, JSON, order of inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.estimates import array_entries
from uqpen.archive.read import group_names, read_group
from uqpen.core.catalogue import CATALOGUE, MEASURES
from uqpen.core.labels import (
    BOUND,
    DEPENDENCE,
    INPUT,
    INTERVAL,
    INTERVAL_LABEL,
    NOTE,
    OF_LOGARITHM,
    RUNS,
    THRESHOLD,
)
from uqpen.core.statistic import Statistic
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.archive_view import ArchiveView, is_logarithmic
from uqpen.results.source_statistics import SourceStatistics, best_sources
from uqpen.results.table import (
    NOTHING,
    OutputTable,
    conversion,
    cut_text,
    estimate_json,
    first_runs,
    label_with_unit,
)
from uqpen.results.texts import plain_text

_ARBITRARY_ZERO = "no per cent, as the zero of {unit} is arbitrary"


class VarianceTitles(NamedTuple):
    """Titles, order and note of the indices of a model's inputs; dependent ones overlap."""

    is_dependent: bool  # whether the random inputs depend on each other

    def title(self, of: str) -> str:
        """Return the title of indices of a variance, such as ``"its variance"``."""
        if self.is_dependent:
            return f"{of} explained by inputs that depend on each other"
        return f"shares of {of}"

    @property
    def axis(self) -> str:
        """Title of the axis of a chart."""
        return "explained part of the variance" if self.is_dependent else "share of the variance"

    def ordered(self, measures: Sequence[Statistic]) -> tuple[Statistic, ...]:
        """Return measures in the order that they are shown; first those that divide the variance.

        Of dependent inputs only Shapley effects do.
        """
        if not self.is_dependent:
            return tuple(measures)
        return tuple(sorted(measures, key=lambda each: each.measure.share != "divided"))

    @property
    def note(self) -> str:
        """Note on reading the indices of dependent inputs; empty for independent ones."""
        if not self.is_dependent:
            return ""
        return (
            "The inputs depend on each other. The first-order index of an input includes what it "
            "shares with others, so these indices can add up to more than 1. Shapley effects "
            "divide the variance and add up to 1."
        )


def index_titles(tree: xr.DataTree) -> VarianceTitles:
    """Return the titles of the indices of a model's inputs."""
    designs = (read_group(tree, RUNS, name) for name in group_names(tree, RUNS))
    return VarianceTitles(any(runs.attrs.get(DEPENDENCE) for runs in designs))


def named_tables(
    statistics: SourceStatistics, output: str, unit: str, *, everything: bool = False
) -> Iterator[tuple[str, OutputTable]]:
    """Yield a table for each type of measure of an output, behind its name, such as "shares".

    First order indices from plain samples are shown where no other source has them. The other
    measures of any sample are shown only with `everything`. Of an output that is shown by its
    logarithm, the indices of that come first.
    """
    shares = index_titles(statistics.tree)
    yield from _index_tables(statistics, output, shares, everything=everything)
    # An output in a unit with an offset has changes, as per cent of it have no meaning; an archive
    # without these has the reason.
    changes = MEASURES["changes"]
    if any(statistics.by_source(output, each.name) for each in changes):
        title = label_with_unit("change per standard deviation of an input", unit)
        tables = [("responses", title, changes)]
    else:
        tables = [("responses", "responses to its inputs", MEASURES["responses"])]
    tables.append(("effects", label_with_unit("elementary effects", unit), MEASURES["effects"]))
    tables.append(("salib", "measures by SALib", MEASURES["salib"]))
    levels = label_with_unit("half change between two levels", unit)
    tables.append(("levels", levels, MEASURES["levels"]))
    if everything:
        tables.append(("associations", "association with its inputs", MEASURES["associations"]))
    for name, title, measures in tables:
        if columns := _columns(statistics, output, measures):
            yield name, _table(f"{output}: {title}", columns, unit)
    for column in _columns(statistics, output, MEASURES["pairs"]):
        yield "pairs", _table(f"{output}: shares of its variance, by pairs", [column])
    if everything:
        columns = _columns(statistics, output, shares.ordered(MEASURES["thresholds"]))
        written = columns[0].array[THRESHOLD].values if columns else ()
        for position, threshold in enumerate(written):
            at = [each._replace(array=each.array[position]) for each in columns]
            title = shares.title(f"the variance of exceeding {threshold}")
            yield "thresholds", _table(f"{output}: {title}", at)


def noise_tables(
    statistics: SourceStatistics, output: str, unit: str
) -> Iterator[tuple[str, OutputTable]]:
    """Yield a table of the noise along the inputs by each source, behind the source."""
    for source, statistic, array in _columns(statistics, output, MEASURES["noise"]):
        columns = [
            _Column(str(name), statistic, array[:, place])
            for place, name in enumerate(array[INPUT].values)
        ]
        title = label_with_unit(f"{statistic.measure.label} by {source}", unit)
        note = "The rows are parts of an input's values, by the probability below their middle."
        yield source, _table(f"{output}: {title}", columns, unit, note)


def _index_tables(
    statistics: SourceStatistics, output: str, shares: VarianceTitles, *, everything: bool
) -> Iterator[tuple[str, OutputTable]]:
    """Yield the indices of an output, and those of its logarithm if they are shown."""
    kinds = [("shares", "its variance")]
    of_logarithm = ("shares of the logarithm", "its logarithm's variance")
    if is_logarithmic(statistics, output):
        kinds.insert(0, of_logarithm)
    elif everything:
        kinds.append(of_logarithm)
    kinds.append(("shares of the mean", "the variance of its mean given the inputs"))
    for name, of in kinds:
        columns = _columns(statistics, output, shares.ordered(MEASURES[name]))
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
    measures = shares.ordered(MEASURES["shares of the field"])
    columns = _columns(SourceStatistics(tree), output, measures)
    place = cut_text(first_runs(tree)[output])
    over = f"the whole field, not only at {place}" if place else "all places"
    title = f"{output}: {shares.title(f'its variance over {over}')}"
    return _table(title, columns, note=shares.note) if columns else None


class _Column(NamedTuple):
    source: str
    statistic: Statistic
    array: xr.DataArray


def _columns(
    statistics: SourceStatistics, output: str, measures: Sequence[Statistic]
) -> list[_Column]:
    return [
        _Column(source, each, without_arbitrary_zeros(statistics.tree, output, each, array))
        for each in measures
        for source, array in statistics.by_source(output, each.name).items()
    ]


def _table(
    title: str, columns: Sequence[_Column], unit: str = DIMENSIONLESS, note: str = ""
) -> OutputTable:
    """Return a table with a row for each input or pair of inputs, and a note on all of them."""
    labels = [f"{each.statistic.measure.label}\n{each.source}" for each in columns]
    table = OutputTable(title, labels)
    table.title += table.note_mark(note)
    converted = []
    for _, statistic, array in columns:
        names = map(str, array.coords.variables[array.dims[0]].values)
        entries = dict(zip(names, array_entries(array), strict=True))
        converted.append((entries, conversion(statistic, scale(unit))))
    for name in dict.fromkeys(name for entries, _ in converted for name in entries):
        cells = [table.cell(entries.get(name), convert) for entries, convert in converted]
        table.rows.append((name, cells))
    return table


def _add_claims(table: OutputTable, statistics: SourceStatistics, output: str) -> None:
    """Add a column for each publication that names the largest contribution."""
    for source in statistics.publications:
        if claim := statistics.largest_contribution(source, output):
            table.columns.append(f"the largest to\n{source}")
            for name, cells in table.rows:
                cells.append("this" if name == claim else NOTHING)


def without_arbitrary_zeros(
    tree: xr.DataTree, output: str, statistic: Statistic, array: xr.DataArray
) -> xr.DataArray:
    """Return a statistic without relative changes of a quantity in a unit with an offset.

    An archive has them relative to the SI value. Per cent of the kelvin say nothing of a
    temperature in degC. Each entry along ``input`` that is left out is NaN, with the reason as a
    note. Other statistics are returned as they are.
    """
    if not (relative := statistic.measure.relative_to):
        return array
    described = first_runs(tree)

    def reason(name: str) -> str:
        """Return why nothing is relative to a quantity; empty where its unit has no offset."""
        unit = described[name].attrs.get("display_units", "1") if name in described else "1"
        return _ARBITRARY_ZERO.format(unit=unit) if scale(str(unit)).offset else ""

    of_output = reason(output) if "output" in relative else ""
    names = map(str, array[INPUT].values)
    reasons = [of_output or (reason(name) if "input" in relative else "") for name in names]
    is_left_out = np.array([bool(reason) for reason in reasons])
    if not is_left_out.any():
        return array
    kept = array.where(xr.DataArray(~is_left_out, dims=INPUT))
    texts = {INTERVAL: "none", INTERVAL_LABEL: "none"}
    replaced = {
        key: (INPUT, np.where(is_left_out, texts.get(key, reasons), array[key].values))
        for key in (INTERVAL, INTERVAL_LABEL, NOTE)
    }
    return kept.assign_coords(replaced).assign_attrs(array.attrs)


def sensitivity_json(
    arrays: Mapping[str, xr.DataArray], *, field: Sequence[str] = ()
) -> dict[str, Any]:
    """Return all measures out of the statistics that a source has of an output.

    They are ``sensitivity.<input>.<measure>``; ``sensitivity_of_exceedance.<threshold>`` and
    ``sensitivity_of_shares.<kind>`` likewise; ``sensitivity_of_pairs.<pair>.second_order``. Without
    the keys of no measure. `field` are the dimensions of a field.
    """
    found: dict[str, Any] = {}
    for statistic in (CATALOGUE[name] for name in arrays if name in CATALOGUE):
        if not statistic.measure.label:
            continue
        # Indices of an event have the same names as those of the output itself.
        key = statistic.measure.json
        name = (key and statistic.of) or statistic.name
        array = arrays[statistic.name]
        dims = [dim for dim in array.dims[:-1] if dim not in field]
        for place in np.ndindex(*(array.sizes[dim] for dim in dims)):
            entry = found.setdefault(key or "sensitivity", {})
            for dim, position in zip(dims, place, strict=True):
                entry = entry.setdefault(str(array[dim].values[position]), {})
            entry[name] = estimate_json(array[dict(zip(dims, place, strict=True))])
    return found


# Inputs by their importance for an output: the measure that ranks them, and their order.

# Measures that the inputs can be ordered by, the most telling first.
_MEASURES = sorted(
    (each for each in CATALOGUE.values() if each.measure.reason),
    key=lambda each: each.measure.rank,
)


class Ranking(NamedTuple):
    """Estimates of one measure of all inputs by one source, the largest first."""

    statistic: Statistic
    source: str
    estimates: Mapping[str, xr.DataArray]

    @property
    def is_of_logarithm(self) -> bool:
        """True if it is of the logarithm of the output."""
        return self.statistic.prefix == OF_LOGARITHM

    @property
    def divides(self) -> bool:
        """True if its estimates add up to the variance, also where inputs depend on each other."""
        return self.statistic.measure.share == "divided"


class InputOrder(NamedTuple):
    """Names of inputs, the most important first, and the statistic that this goes by."""

    names: tuple[str, ...] = ()
    reason: str = ""

    def sort(self, inputs: Sequence[str]) -> list[str]:
        """Return some inputs in this order; those that it lacks come last."""
        places = {name: place for place, name in enumerate(self.names)}
        return sorted(inputs, key=lambda name: places.get(name, len(places)))


def input_label(view: ArchiveView, name: str) -> str:
    """Return the title of an input for a reader, which no other input of the model has."""
    title = view.input_titles.get(name, name)
    is_alone = list(view.input_titles.values()).count(title) < 2
    return plain_text(title if is_alone else f"{title} ({name})", 50)


def input_ranking(view: ArchiveView, output: str) -> Ranking | None:
    """Return the inputs by the first measure that the archive has, with its best-known source.

    Of an output that is shown by its logarithm, the measures of that come first. What divides a
    variance comes first where the inputs depend on each other. Where they do not, the parts that
    they cause alone add up as well, and nothing is ranked by it.
    """
    shares = index_titles(view.tree)
    for prefix in (OF_LOGARITHM, "") if view.is_logarithmic(output) else ("",):
        for statistic in shares.ordered(_MEASURES):
            is_telling = shares.is_dependent or statistic.measure.share != "divided"
            if statistic.prefix != prefix or not is_telling:
                continue
            if ranking := best_ranking(view, output, statistic):
                return ranking
    return None


def best_ranking(view: ArchiveView, output: str, statistic: Statistic) -> Ranking | None:
    """Return the inputs by a measure, by the source with the narrowest interval of the largest.

    One without intervals is taken only where there is no other. None where no source has an
    estimate of its own.
    """
    found: list[tuple[float, Ranking]] = []
    for source in view.estimates(output, statistic.name):
        entries = view.statistics.entries(source, output, statistic.name)
        known = {name: each for name, each in entries.items() if np.isfinite(each.values[0])}
        if not known or view.statistics.citation(source):
            continue
        ordered = sorted(known, key=lambda name: -abs(float(known[name].values[0])))
        _, lower, upper = known[ordered[0]].values.tolist()
        width = upper - lower if np.isfinite([lower, upper]).all() else np.inf
        estimates = {str(name): known[name] for name in ordered}
        found.append((width, Ranking(statistic, source, estimates)))
    return min(found, key=lambda each: each[0])[1] if found else None


def input_order(view: ArchiveView, output: str) -> InputOrder:
    """Return the inputs in the order of their importance; without names if it is unknown."""
    if ranking := input_ranking(view, output):
        of = " of the logarithm" * ranking.is_of_logarithm
        reason = f"{ranking.statistic.measure.reason}{of} by {ranking.source}"
        return InputOrder(tuple(ranking.estimates), reason)
    of_category = MEASURES["categories"][0]
    for source, array in view.estimates(output, of_category.name).items():
        largest = np.nan_to_num(array.isel({BOUND: 0})).max(axis=0)
        if largest.any():
            names = array[INPUT].values[np.argsort(-largest, kind="stable")]
            return InputOrder(tuple(names.tolist()), f"{of_category.measure.reason} by {source}")
    return InputOrder()
