"""Measures of the inputs' part: a row for each input, a dot for each source."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.charts.axes import padded_limits
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import (
    Dots,
    Line,
    Rule,
    has_interval,
    interval_notes,
    key_marker,
    series_marker,
)
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE, MEASURES
from uqpen.core.labels import BOUND, CATEGORY, INPUT, INPUT_SHARE
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import number_text
from uqpen.results.input_measures import (
    InputOrder,
    index_titles,
    input_label,
    input_order,
    input_ranking,
    noise_tables,
    without_arbitrary_zeros,
)
from uqpen.results.source_statistics import best_sources
from uqpen.results.table import (
    Conversion,
    OutputTable,
    estimate_remark,
    shown_bounds,
    shown_estimate,
)
from uqpen.results.texts import capitalized, title_with_unit, unit_suffix

# Inputs of a chart: those with the largest estimates of all.
_MOST_INPUTS = 15
# Inputs of a chart of the noise along them.
_MOST_ALONG = 4
_PARTS_OF_INPUT = "The parts of an input's values have equal probability: 0.5 is the median."
# Categories of an output with a chart of their own.
_MOST_CATEGORIES = 6
# Reasons for having no interval that are written out below a chart.
_MOST_REASONS = 3
# Heights in CSS pixels: of all but the rows, between rows, and of a dot.
_FRAME, _GAP, _DOT = 62, 14, 11

Tables = Mapping[str, Sequence[OutputTable]]
_NO_TABLES: Tables = MappingProxyType({})


class MeasureSeries(NamedTuple):
    """One measure of all inputs by one source: an array along input and bound."""

    source: str
    statistic: Statistic
    array: xr.DataArray

    @property
    def label(self) -> str:
        """Name beside other measures."""
        return self.statistic.measure.label


class _InputEstimate(NamedTuple):
    """Estimate of a series for an input, in the unit that is shown."""

    name: str
    bounds: FloatArray
    note: str
    written: str  # as in the table, with the unit

    @property
    def has_interval(self) -> bool:
        return bool(has_interval(self.bounds))


class _Plotted(NamedTuple):
    """A series with its name in the legend, its marker, and its estimates."""

    of: MeasureSeries
    name: str
    marker: str
    estimates: list[_InputEstimate]


def sensitivity_charts(view: ArchiveView) -> Iterator[Chart]:
    """Each input's share of the variance, and its effects."""
    for output in view.numeric_outputs:
        yield from index_charts(view, output)
    for output in view.numeric_outputs:
        yield from effect_charts(view, output)
    for output in view.numeric_outputs:
        yield from salib_charts(view, output)
        yield from part_charts(view, output)
        yield from noise_charts(view, output)


def response_charts(view: ArchiveView) -> Iterator[Chart]:
    """Relative responses to the inputs, and × uncertainty."""
    for output in view.numeric_outputs:
        yield from responses(view, output)


def index_charts(view: ArchiveView, output: str, tables: Tables = _NO_TABLES) -> Iterator[Chart]:
    """Yield the inputs' shares in the variance of an output, of its logarithm first if shown.

    `tables` has the numbers behind a chart, by the table of its measures.
    """
    shares = index_titles(view.tree)
    shown = [("its variance", "shares")]
    if view.is_logarithmic(output):
        shown.insert(0, ("its logarithm's variance", "shares of the logarithm"))
    shown.append(("the variance of its mean given the inputs", "shares of the mean"))
    for of, table in shown:
        measures = shares.ordered(MEASURES[table])
        every = _all_series(view, output, measures)
        if shares.is_dependent:
            every.sort(key=lambda each: measures.index(each.statistic))
        best = {each.source for each in _best(view, every)}
        ranking = input_ranking(view, output)
        if ranking is not None and ranking.statistic.measure.share:
            best.add(ranking.source)
        if found := [each for each in every if each.source in best]:
            notes = [shares.note]
            if table in tables and len(found) < len(every):
                others = "other " * any(view.is_sample_design(each.source) for each in found)
                notes.append(f"First-order indices by {others}plain samples are in the table only.")
            title = capitalized(shares.title(of))
            yield _chart(view, output, found, title, notes, tables.get(table, ()))


def effect_charts(view: ArchiveView, output: str, tables: Tables = _NO_TABLES) -> Iterator[Chart]:
    """Yield the elementary effects of the inputs on an output, if there are any."""
    # The mean effect stands in the tables alone: effects of both signs cancel in it.
    measures = [each for each in MEASURES["effects"] if each.measure.marker]
    if found := _all_series(view, output, measures):
        yield _chart(view, output, found, "Elementary effects", (), tables.get("effects", ()))


def salib_charts(view: ArchiveView, output: str, tables: Tables = _NO_TABLES) -> Iterator[Chart]:
    """Yield the measures of SALib, a chart for each, as no two of them are of one scale."""
    for name in ("salib", "levels"):
        behind = tables.get(name, ())  # one table has the numbers of all its charts
        for each in MEASURES[name]:
            beside = {"salib_pawn": ["salib_pawn_floor"]}.get(each.name, [])
            shown = [each, *(CATALOGUE[other] for other in beside)]
            if each.measure.chart and (found := _all_series(view, output, shown)):
                title = f"{capitalized(each.measure.chart)}, by SALib"
                yield _chart(view, output, found, title, (), behind)
                behind = ()


def part_charts(view: ArchiveView, output: str) -> Iterator[Chart]:
    """Yield the curves of a regional sensitivity analysis: one for each input, by each source."""
    for each in MEASURES["parts"]:
        for source, array in view.estimates(output, each.name).items():
            along = array.dims[0]
            inputs = list(map(str, array[INPUT].values))
            curves = {name: array.sel({INPUT: name, BOUND: "estimate"}).values for name in inputs}
            known = {name: y for name, y in curves.items() if np.isfinite(y).all()}
            shown = input_order(view, output).sort(list(known))[:_MOST_INPUTS]
            if not shown:
                continue
            labels = [input_label(view, name) for name in shown]
            first = max(shown, key=lambda name: float(known[name].max()))
            place = float(array[along].values[known[first].argmax()])
            yield Chart(
                title=f"Inputs in parts of the distribution, by SALib's RSA of {source}",
                summary=f"{input_label(view, first)} differs most from its other values in the "
                f"runs around the {100 * place:.3g} % quantile.",
                x=Axis("part of the distribution, by its middle", (0.0, 1.0)),
                y=Axis("distance of the input's distributions"),
                marks=tuple(
                    Line(array[along].values, known[name], number, name=label)
                    for number, (name, label) in enumerate(zip(shown, labels, strict=True))
                ),
                keys=tuple(LegendKey(label, number, "line") for number, label in enumerate(labels)),
                notes=("The criterion of Cramér and von Mises. It has no interval.",),
                of=output,
            )


def noise_charts(view: ArchiveView, output: str) -> Iterator[Chart]:
    """Yield the noise of a model along its inputs, a chart for each source."""
    tables = dict(noise_tables(view.statistics, output, view.unit(output)))
    for each in MEASURES["noise"]:
        convert, unit = view.conversion(output, each), unit_suffix(view.unit(output))
        for source, array in view.estimates(output, each.name).items():
            places = array[INPUT_SHARE].values
            found = {
                str(name): np.asarray(convert(array.values[:, place]), dtype=np.float64)
                for place, name in enumerate(array[INPUT].values)
            }
            known = [
                name
                for name, bounds in found.items()
                if np.isfinite(bounds[:, 0]).all() and bounds[:, 0].any()
            ]
            # The noise changes most along the first ones.
            known.sort(key=lambda name: -float(np.ptp(found[name][:, 0])))
            shown = known[:_MOST_ALONG]
            if not shown or len(places) < 2:
                continue
            labels = [input_label(view, name) for name in shown]
            ordered = found[shown[0]][np.argsort(found[shown[0]][:, 0])]
            least, most = (f"{number_text(ordered[at, 0], 3)}{unit}" for at in (0, -1))
            is_clear = ordered[0, 2] < ordered[-1, 1]
            # Side by side, so that no interval hides another.
            step = 0.3 / len(places) / len(shown)
            notes = [*interval_notes([array], ", for each part by itself"), _PARTS_OF_INPUT]
            if len(shown) < len(found):
                notes.append(f"Shown are {len(shown)} of {len(found)} inputs.")
            yield Chart(
                title=f"Noise along the inputs, by {source}",
                summary=f"Along {labels[0]} the standard deviation of the noise changes most, from "
                f"{least} to {most}{'' if is_clear else ', which the intervals leave open'}.",
                x=Axis("part of the input's values, by its middle", (0.0, 1.0)),
                y=Axis(title_with_unit(each.measure.label, view.unit(output))),
                marks=tuple(
                    Dots(
                        found[name],
                        places + (number - (len(shown) - 1) / 2) * step,
                        number,
                        name=label,
                        marker=series_marker(number),
                        along="y",
                        is_joined=True,
                    )
                    for number, (name, label) in enumerate(zip(shown, labels, strict=True))
                ),
                keys=tuple(
                    LegendKey(label, number, series_marker(number))
                    for number, label in enumerate(labels)
                ),
                notes=tuple(notes),
                tables=(tables[source],),
                of=output,
            )


def responses(view: ArchiveView, output: str) -> Iterator[Chart]:
    """Yield the changes of an output near the nominal point, a chart for each measure of them.

    Those relative to a quantity in a unit with an offset have no estimates.
    """
    for each in (*MEASURES["responses"], *MEASURES["changes"]):
        if found := _all_series(view, output, [each]):
            title = f"{capitalized(each.measure.chart)}, near the nominal point"
            yield _chart(view, output, found, title)


def category_charts(view: ArchiveView, output: str) -> Iterator[Chart]:
    """Yield the inputs' shares in the variance of an output being in a category, or in another."""
    shares = index_titles(view.tree)
    for names, found in _group_categories(view, category_series(view, output))[:_MOST_CATEGORIES]:
        title = capitalized(shares.title(f"the variance of whether it is {' or '.join(names)}"))
        yield _chart(view, output, found, title, [shares.note], is_ordered=False)


def category_series(view: ArchiveView, output: str) -> dict[str, list[MeasureSeries]]:
    """Return the measures of all sources for each category of an output, by its label."""
    found: dict[str, list[MeasureSeries]] = {}
    for source in view.sources if view.source is None else [view.source]:
        for each in MEASURES["categories"]:
            if (array := view.statistics.get(source, output, each.name)) is not None:
                for place, label in enumerate(map(str, array["category_label"].values.tolist())):
                    series = MeasureSeries(source, each, array[{CATEGORY: place}])
                    found.setdefault(label, []).append(series)
    return found


def _all_series(
    view: ArchiveView, output: str, measures: Sequence[Statistic]
) -> list[MeasureSeries]:
    """Return some measures by all sources, without those that have no estimate."""
    found = [
        MeasureSeries(source, each, without_arbitrary_zeros(view.tree, output, each, array))
        for each in measures
        for source, array in view.estimates(output, each.name).items()
    ]
    known = [each for each in found if np.isfinite(each.array.values[:, 0]).any()]
    return sorted(known, key=lambda each: view.sources.index(each.source))


def _best(view: ArchiveView, found: list[MeasureSeries]) -> list[MeasureSeries]:
    """Leave plain samples out, unless one is selected or there is nothing else."""
    if view.source is not None and all(view.is_sample_design(each.source) for each in found):
        return found
    shown = best_sources(view.tree, ((each.source, each.array) for each in found))
    return [each for each in found if each.source in shown]


def _group_categories(
    view: ArchiveView, every: Mapping[str, Sequence[MeasureSeries]]
) -> list[tuple[list[str], list[MeasureSeries]]]:
    """Return categories and their measures; categories with equal measures are grouped.

    Of two categories, one occurs whenever the other does not.
    """
    kept: list[tuple[list[str], list[MeasureSeries]]] = []
    for label, series in every.items():
        known = [each for each in series if np.isfinite(each.array.values[:, 0]).any()]
        if not (found := _best(view, known)):
            continue
        same = (names for names, others in kept if _is_same(others, found))
        if (names := next(same, None)) is not None:
            names.append(label)
        else:
            kept.append(([label], found))
    return kept


def _is_same(one: Sequence[MeasureSeries], other: Sequence[MeasureSeries]) -> bool:
    return len(one) == len(other) and all(
        np.allclose(a.array.values, b.array.values, rtol=1e-9, atol=1e-12, equal_nan=True)
        for a, b in zip(one, other, strict=True)
    )


def _chart(
    view: ArchiveView,
    output: str,
    found: Sequence[MeasureSeries],
    title: str,
    further_notes: Sequence[str] = (),
    tables: Sequence[OutputTable] = (),
    *,
    is_ordered: bool = True,
) -> Chart:
    """Return a chart of at least one series; the inputs stand in the order of the page if asked."""
    first, shares = found[0].statistic, index_titles(view.tree)
    names, notes = _ranked_inputs(found, "; the table has all" * bool(tables))
    inputs = (input_order(view, output) if is_ordered else InputOrder()).sort(names)
    rows = tuple(input_label(view, name) for name in inputs)
    every = [_plotted(view, output, each, inputs) for each in found]
    bounds = np.concatenate([[0.0], *(one.bounds for each in every for one in each.estimates)])
    rules = [Rule(0, "quiet", "dot")]
    rules += [Rule(row - 0.5, "grid", is_horizontal=True) for row in range(1, len(inputs))]
    axis = title_with_unit(first.measure.axis, _unit(view, output, first)) or shares.axis
    return Chart(
        title=title,
        summary=_summary(every, is_dependent=shares.is_dependent),
        x=Axis(axis, padded_limits(float(np.nanmin(bounds)), float(np.nanmax(bounds)))),
        y=Axis("", rows=rows),
        marks=(*_dots(view, every, rows), *rules),
        keys=tuple(_keys(view, every)),
        notes=(*_notes(every), *filter(None, further_notes), *notes),
        tables=tuple(tables),
        height=_FRAME + len(inputs) * (_GAP + _DOT * len(found)),
        of=output,
    )


def _unit(view: ArchiveView, output: str, statistic: Statistic) -> str:
    if statistic.measure.relative_to:
        return "%"
    return DIMENSIONLESS if statistic.unit is UnitRule.NONE else view.unit(output)


def _ranked_inputs(found: Sequence[MeasureSeries], remark: str) -> tuple[list[str], list[str]]:
    """Return the inputs of a chart by their largest estimates, and notes on those left out.

    Shapley effects rank them if there are any: these divide a variance, also where inputs depend on
    each other.
    """
    shares = [each.statistic.measure.share for each in found]
    largest: dict[str, float] = {}
    reasons: dict[str, str] = {}
    for each, share in zip(found, shares, strict=True):
        sizes = np.nan_to_num(np.abs(each.array.values[:, 0]), nan=-1.0)
        if "divided" in shares and share != "divided":
            sizes = np.minimum(sizes, 0.0)
        for name, size in zip(map(str, each.array[INPUT].values), sizes.tolist(), strict=True):
            largest[name] = max(size, largest.get(name, -1.0))
        for entry in each.array:
            reasons.setdefault(str(entry[INPUT].item()), estimate_remark(entry))
    ranked = sorted(largest, key=lambda name: -largest[name])
    known, notes = [name for name in ranked if largest[name] >= 0], []
    if len(shown := known[:_MOST_INPUTS]) < len(known):
        of = f"the {len(shown)} inputs with the largest estimates, of {len(known)}"
        notes.append(f"Shown are {of}{remark}.")
    without = _names_by_text((name, reasons[name]) for name in ranked if name not in known)
    if without:
        texts = (f"{', '.join(n)}{f' ({reason})' * bool(reason)}" for reason, n in without.items())
        notes.append(f"Not shown: {'; '.join(texts)}.")
    return shown, notes


def _plotted(
    view: ArchiveView, output: str, series: MeasureSeries, inputs: Sequence[str]
) -> _Plotted:
    """Name a series by its source, and by its measure where a chart has several of them."""
    of, known = series.statistic, series.array[INPUT].values.tolist()
    convert, unit = view.conversion(output, of), unit_suffix(_unit(view, output, of))
    if of.measure.chart:
        convert = partial(_magnitudes, convert=convert)
    entries = {name: series.array[known.index(name)] for name in inputs if name in known}
    estimates = [
        _InputEstimate(
            input_label(view, name),
            np.array(shown_bounds(entry, convert)),
            estimate_remark(entry),
            f"{shown_estimate(entry, convert)}{unit}",
        )
        for name, entry in entries.items()
        if np.isfinite(entry.values[0])
    ]
    if of.measure.chart:
        marker = series_marker(view.series(series.source))
        return _Plotted(series, series.source, marker, estimates)
    return _Plotted(series, f"{series.label} by {series.source}", of.measure.marker, estimates)


def _magnitudes(bounds: FloatArray, convert: Conversion) -> FloatArray:
    """Return converted magnitudes; of a negative estimate the bounds change their places."""
    if bounds[0] < 0:
        bounds = -bounds[[0, 2, 1]]
    converted: FloatArray = convert(bounds)
    return converted


def _dots(view: ArchiveView, every: Sequence[_Plotted], rows: Sequence[str]) -> Iterator[Dots]:
    room = 1 / (len(every) + 1)
    for number, (of, name, marker, estimates) in enumerate(every, 1):
        if not estimates:
            continue
        places = np.array([rows.index(one.name) + number * room - 0.5 for one in estimates])
        bounds = np.array([one.bounds for one in estimates])
        hovers = [
            f"{one.name}, {name}: {one.written}{f' ({one.note})' * bool(one.note)}"
            for one in estimates
        ]
        colour = view.series(of.source)
        yield Dots(bounds, places, colour, hovers=hovers, name=name, marker=marker)


def _keys(view: ArchiveView, every: Sequence[_Plotted]) -> Iterator[LegendKey]:
    for of, name, marker, estimates in every:
        if estimates:
            marker = key_marker(marker, np.array([one.bounds for one in estimates]))
        yield LegendKey(name, view.series(of.source), marker)


def _notes(every: Sequence[_Plotted]) -> Iterator[str]:
    named = [(each.name, one) for each in every for one in each.estimates]
    yield from interval_notes((each.of.array for each in every), ", for each estimate by itself")
    barred = ((name, one.note) for name, one in named if one.has_interval and one.note)
    for text, names in _names_by_text(barred).items():
        yield f"Note on {', '.join(names)}: {text}."
    hollow = (
        (name, one.note or "no reason is known") for name, one in named if not one.has_interval
    )
    reasons = _names_by_text(hollow)
    if len(reasons) > _MOST_REASONS:
        yield "Hollow: no interval; the reasons are notes of the table."
    else:
        for text, names in reasons.items():
            yield f"Hollow, no interval: {', '.join(names)} ({text})."


def _names_by_text(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """Return the names that each text applies to, each once."""
    found: dict[str, dict[str, None]] = {}
    for name, text in pairs:
        found.setdefault(text, {})[name] = None
    return {text: list(names) for text, names in found.items()}


def _summary(every: Sequence[_Plotted], *, is_dependent: bool) -> str:
    """Return a sentence on the largest estimate and on the intervals that overlap with it.

    It is of a series with intervals if any has; of shares the total one is preferred, or that which
    divides the variance where inputs depend on each other.
    """
    kinds = ("divided", "total", "alone") if is_dependent else ("total", "alone", "divided")

    def rank(each: _Plotted) -> tuple[bool, int]:
        measure = each.of.statistic.measure
        place = kinds.index(measure.share) if measure.share else measure.rank
        return not all(one.has_interval for one in each.estimates), place

    each = min((each for each in every if each.estimates), key=rank)
    label = each.of.statistic.measure.chart or each.of.label
    first, *others = sorted(each.estimates, key=lambda one: -float(one.bounds[0]))
    text = f"By {each.of.source}, {first.name} has the largest {label}: {first.written}"
    if others:
        text += f"; {others[0].name} comes next: {others[0].written}"
    return f"{text}.{_order_certainty(first, others)}"


def _order_certainty(first: _InputEstimate, others: Sequence[_InputEstimate]) -> str:
    """Return a sentence on the order of the first input and the others, by their intervals."""
    every = (first, *others)
    if not others:
        return ""
    if not any(one.has_interval for one in every):
        return " None has an interval, so this order is uncertain."
    if not all(np.isfinite(one.bounds).all() for one in every):
        return " Not all have an interval, so this order is uncertain."
    near = [one.name for one in others if one.bounds[2] >= first.bounds[1]]
    remark = f" Note on this interval: {first.note}." if first.note else ""
    if not near:
        return f" Its interval overlaps with no other's.{remark}"
    names = ", ".join(near)
    return f" Its interval overlaps with that of {names}, so this order is uncertain.{remark}"
