"""Outputs with dimensions: curves along one, with what drives them there, and maps along two."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.fields import entry_place, field_dimensions
from uqpen.charts.axes import ValueAxis, quantity, quantity_axis
from uqpen.charts.chart import Axis, Chart, Charts, LegendKey, PlaceReadout, PlaceSlices
from uqpen.charts.marks import (
    Band,
    Bars,
    Dots,
    HeatMap,
    Line,
    Mark,
    Rule,
    escape_text,
    series_dash,
    series_marker,
)
from uqpen.charts.scatter import thin_runs
from uqpen.core.arrays import FloatArray, evenly_spread
from uqpen.core.catalogue import CATALOGUE, MEASURES
from uqpen.core.labels import INPUT, INTERVAL_LEVEL, NOTE, RUN
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import (
    count_text,
    estimate_text,
    grouped_number,
    number_text,
    percent_text,
    typeset_unit,
)
from uqpen.results.field_tables import CurveEstimates, curves
from uqpen.results.input_measures import index_titles, input_label
from uqpen.results.source_statistics import THRESHOLD_PROBABILITIES, best_sources
from uqpen.results.table import entry_label, first_runs, quantile_label
from uqpen.results.texts import capitalized, join_names, plain_text, unit_suffix

# Dashes of lines in turn; the first is that of a median.
_DASHES = ("solid", "dot", "dash", "dashdot", "longdash")
_MEDIAN = 0.5
# Single runs that are drawn, thin, behind the others, and outlying ones.
_MOST_RUNS, _MOST_OUTLYING = 20, 10
# Shares of the curves; a line stands where fewer of them get further. Beyond this part of an axis,
# its label stands before it.
_MARKED, _NEAR_END = (0.95, 0.5, 0.05), 0.94
# Ends of the range that lines have.
_ENDS = (np.nanmin, np.nanmax)
# Characters of a label along the shorter charts, and of a reason.
_LONGEST_LABEL, _LONGEST_REASON = 28, 240
# Steps that the values of a line are rounded to, of the distance of its ends.
_STEPS = 1000.0
# Places with a histogram or with drivers of their own, at the most.
_MOST_PLACES = 21
# Inputs with an area of their own, at the most; the colours of sources are ten.
_MOST_INPUTS = 8
_CONDITIONAL = "Where curves end: {} at a place are of the curves that get there."


def fan_charts(view: ArchiveView) -> Iterator[Charts]:
    """Curves: median, mean, quantiles and bands; single runs."""
    found = [curve for each in curves(view) if (curve := _curve(view, each)) is not None]
    ends = {
        (curve.dimension, reached.tobytes()): curve
        for curve in reversed(found)
        if (reached := curve.bounds("reached")) is not None
    }
    yield from _blocks(
        [fan_chart(curve) for curve in found],
        [chart for curve in reversed(ends.values()) for chart in _reached_chart(curve)],
        [chart for curve in found for chart in quantile_chart(curve)],
        [chart for curve in found for chart in tolerance_chart(curve)],
    )


def _blocks(*kinds: Sequence[Chart]) -> Iterator[Charts]:
    """Yield charts of a kind side by side: of many outputs, a page has the first kinds of all."""
    yield from (Charts(tuple(charts)) for charts in kinds if charts)


def _curve(view: ArchiveView, output: str, most_places: int | None = None) -> CurveEstimates | None:
    """Return a curve by the leading design, or else by the first source with estimates of it."""
    found = {**view.estimates(output, "quantile"), **view.estimates(output, "mean")}
    leading = view.leading_design
    sources = [leading] if leading is not None and leading in found else [*found]
    return CurveEstimates(view, output, sources[0], most_places) if sources else None


def fan_chart(curve: CurveEstimates, readout: PlaceReadout | None = None) -> Chart:
    """Return the chart of the mean with its bands, the quantiles, and some single runs.

    A page has a readout, which says what is known of each place.
    """
    series = curve.view.series(curve.source)
    marks, keys = _single_runs(curve)
    for label, dash, bounds in _quantiles(curve):
        marks.append(_line(curve, bounds, "ink", label, dash=dash, width=1.5))
        keys.append(LegendKey(label, "ink", "line", dash))
    bands = _bands(curve, "mean")
    if (mean := curve.bounds("mean")) is not None:
        for times, (_, name) in enumerate(bands, 1):
            marks += _band(curve, curve.bounds(name), series) * times
        marks.append(_line(curve, mean, series, "mean", width=2.5))
        keys.append(LegendKey("mean", series, "line"))
        for kind, name in bands[:1]:
            text = f"{kind} {_level_text(curve.array(name))} band of the mean"
            keys.append(LegendKey(text, series, "band"))
    title = capitalized(output_title(curve.view, curve.output))
    is_thinned = curve.places.size < curve.size
    rules, end_notes = _end_rules(curve)
    return _chart(
        curve,
        f"{title} along {curve.view.axis_label(curve.dimension)}",
        "" if readout is None else readout.text(readout.start),
        (*marks, *rules),
        keys,
        (
            *[f"{curve.places.size} of {curve.size} places are shown."] * is_thinned,
            *_band_notes(curve, "mean"),
            *end_notes,
        ),
        height=400,
        place=readout,
    )


def _chart(
    curve: CurveEstimates,
    title: str,
    summary: str,
    marks: Iterable[Mark],
    keys: Iterable[LegendKey],
    notes: Iterable[str] = (),
    **others: Any,
) -> Chart:
    """Return a chart along a curve; its values are on the other axis, if no other is given.

    That has the unit alone where the label has no room.
    """
    ends = (float(curve.places[0]), float(curve.places[-1]))
    label = curve.view.axis_label(curve.output)
    if len(label) > _LONGEST_LABEL:
        label = typeset_unit(quantity(curve.view, curve.output).unit)
    content: dict[str, Any] = {
        "x": quantity_axis(curve.view, curve.dimension, ends),
        "y": Axis(label),
        "of": curve.output,
        "source": curve.source,
        "is_compared": True,
    }
    content |= {"marks": tuple(marks), "keys": tuple(keys), "notes": tuple(notes)} | others
    return Chart(title=title, summary=summary, **content)


def _single_runs(curve: CurveEstimates) -> tuple[list[Mark], list[LegendKey]]:
    """Return thin lines of some runs, and their key, which has their number; nothing without."""
    if not curve.has_runs:
        return [], []
    numbers = xr.Dataset({"number": (RUN, np.arange(len(curve.runs)))})
    runs = curve.runs[thin_runs(numbers, _MOST_RUNS)["number"].values]
    counted = f"{grouped_number(len(runs))} of {count_text(len(curve.runs), 'run')}"
    key = LegendKey(f"{counted} of {curve.source}", "quiet", "line")
    return [_thin_lines(curve, runs, "quiet", 0.6)], [key]


def _bands(curve: CurveEstimates, statistic: str) -> list[tuple[str, str]]:
    """Return the kind of each band that has bounds, and its statistic, the widest first.

    The second one is drawn twice: so it is darker than the first where that has no bounds, too.
    """
    kinds = (("simultaneous", f"{statistic}_band"), ("pointwise", statistic))
    return [(kind, name) for kind, name in kinds if _has_bounds(curve.array(name))]


def _has_bounds(array: xr.DataArray | None) -> bool:
    return array is not None and bool(np.isfinite(array.values[..., 1:]).any())


def _reason(array: xr.DataArray) -> str:
    notes = array.coords[NOTE].values.ravel().tolist() if NOTE in array.coords else []
    return plain_text(next(filter(None, map(str, notes)), "no reason is known"), _LONGEST_REASON)


def _band_notes(curve: CurveEstimates, statistic: str) -> Iterator[str]:
    """Yield which band lies within another, the places without a band, and why there is none."""
    bands = _bands(curve, statistic)
    if len(bands) > 1:
        yield f"Darker: pointwise {_level_text(curve.array(statistic))} intervals."
    yield from _left_out_notes(curve, f"{statistic}_band")
    if not bands and (array := curve.array(statistic)) is not None:
        yield f"No interval of the {CATALOGUE[statistic].title}: {_reason(array)}."


def _left_out_notes(curve: CurveEstimates, statistic: str) -> Iterator[str]:
    """Yield the places that a band leaves out, if there are any."""
    if left_out := curve.left_out(statistic):
        name = CATALOGUE[statistic].title
        yield f"Without bounds ({name}): {left_out}."


def _end_rules(curve: CurveEstimates) -> tuple[list[Rule], list[str]]:
    """Return lines where fewer curves go on, with notes; nothing if no curve ends."""
    reached = curve.bounds("reached")
    if reached is None or not (reached[:, 0] < 1).any():
        return [], []
    near_end = curve.places[0] + _NEAR_END * np.ptp(curve.places)
    rules = []
    for share in _MARKED:
        if (reached[:, 0] < share).any():
            place = float(curve.places[np.argmax(reached[:, 0] < share)])
            label, is_before = percent_text(share), bool(place > near_end)
            rules.append(Rule(place, "quiet", "dot", label=label, is_before=is_before))
    notes = [_CONDITIONAL.format("estimates")]
    return rules, notes + ["Upright lines: shares of the curves that get there."] * bool(rules)


def tolerance_chart(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield the bands that hold a new curve, behind single runs, if there are any."""
    series = curve.view.series(curve.source)
    found = {
        content: marks
        for content, bounds in curve.entries("tolerance_band").items()
        if (marks := _band(curve, bounds, series))
    }
    if not found:
        return
    lines, keys = _single_runs(curve)
    shares = join_names([percent_text(content) for content in found])
    level = _level_text(curve.array("tolerance_band"))
    text = f"holds a new curve in {shares} of cases, with {level} confidence"
    yield _chart(
        curve,
        "Tolerance band",
        f"By {curve.source}: {text}.",
        (*(mark for marks in found.values() for mark in marks), *lines),
        (LegendKey(text, series, "band"), *keys),
        _left_out_notes(curve, "tolerance_band"),
        height=320,
        is_compared=False,
    )


def ranked_chart(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield the functional boxplot of the runs, if their curves are ranked."""
    region, envelope = curve.bounds("central_region"), curve.bounds("envelope")
    if region is None or envelope is None:
        return
    series = curve.view.series(curve.source)
    outlying, every = curve.outlying_count
    shown = curve.outlying_runs[:_MOST_OUTLYING]
    lines = [_thin_lines(curve, shown, "beyond", 1)] if len(shown) else []
    count = count_text(outlying, "outlying run")
    omitted = [f"{len(shown)} of them are drawn."] * (len(shown) < outlying)
    yield _chart(
        curve,
        "Ranked curves",
        f"By {curve.source}: {count} of {grouped_number(every)}.",
        (
            *_band(curve, envelope, "quiet"),
            *_band(curve, region, series),
            *lines,
            _line(curve, region, series, "median curve, central region in brackets", width=2.5),
        ),
        (
            LegendKey("median curve: the deepest run", series, "line"),
            LegendKey("central region: the deeper half of the runs", series, "band"),
            LegendKey("range of all runs but outlying ones", "quiet", "band"),
            LegendKey(count, "beyond", "line"),
        ),
        omitted,
        height=320,
    )


def quantile_chart(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield the chart of the quantiles with their bands, if there are any."""
    entries = list(enumerate(_quantiles(curve)))
    if not entries:
        return
    bands = _bands(curve, "quantile")
    shades = [
        mark
        for times, (_, name) in enumerate(bands, 1)
        for number, bounds in enumerate(curve.entries(name).values())
        for mark in _band(curve, bounds, number) * times
    ]
    heads = [f" with {kind} {_level_text(curve.array(name))} bands" for kind, name in bands]
    yield _chart(
        curve,
        "".join(["Quantiles", *heads[:1]]),
        f"Of {output_title(curve.view, curve.output)} by {curve.source}: "
        f"{', '.join(label for _, (label, _, _) in entries)}.",
        (
            *shades,
            *(_line(curve, bounds, n, label, dash=dash) for n, (label, dash, bounds) in entries),
        ),
        (LegendKey(label, n, "line", dash) for n, (label, dash, _) in entries),
        _band_notes(curve, "quantile"),
    )


def _quantiles(curve: CurveEstimates) -> list[tuple[str, str, FloatArray]]:
    return [
        (quantile_label(p), _DASHES[0 if p == _MEDIAN else 1 + n % (len(_DASHES) - 1)], bounds)
        for n, (p, bounds) in enumerate(curve.entries("quantile").items())
    ]


def probability_charts(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield charts of the runs that reach each place, and of the probabilities of thresholds."""
    yield from _reached_chart(curve)
    for statistic in THRESHOLD_PROBABILITIES:
        entries = {
            entry_label(statistic, text): bounds
            for text, bounds in curve.entries(statistic.name).items()
        }
        if entries:
            title = f"{', '.join(entries)} at each place"
            yield _probability_chart(curve, title, entries, statistic.name)


def _reached_chart(curve: CurveEstimates) -> Iterator[Chart]:
    if (reached := curve.bounds("reached")) is not None:
        yield _probability_chart(curve, "Runs that get this far", {"reached": reached}, "reached")


def _probability_chart(
    curve: CurveEstimates, title: str, entries: dict[str, FloatArray], statistic: str
) -> Chart:
    series = curve.view.series(curve.source)
    bands = [each for bounds in entries.values() for each in _band(curve, bounds, series)]
    looks = list(zip(entries.items(), _DASHES * len(entries), strict=False))
    ranges = (
        f"{label} from {' to '.join(number_text(end(bounds[:, 0]), 3) for end in _ENDS)}"
        for label, bounds in entries.items()
    )
    return _chart(
        curve,
        title,
        f"By {curve.source}: {'; '.join(ranges)}.",
        (
            *bands,
            *(
                _line(curve, bounds, series, label, dash=dash, has_unit=False)
                for (label, bounds), dash in looks
            ),
        ),
        (LegendKey(label, series, "line", dash) for (label, _), dash in looks),
        (f"Shade: pointwise {_level_text(curve.array(statistic))} intervals.",),
        y=Axis("probability", (-0.02, 1.02)),
        height=260,
    )


def model_curve_charts(view: ArchiveView) -> Iterator[Charts]:
    """Curves by each of several models: medians and quantiles."""
    if shown := [each for each in ordered_curves(view) if len(each) > 1]:
        yield median_charts(view, shown)


def ordered_curves(
    view: ArchiveView, most_places: int | None = None
) -> list[dict[int, CurveEstimates]]:
    """Return the curves with a median, each by the numbers of its models, those by most first."""
    found: dict[str, dict[int, CurveEstimates]] = {}
    for number, each in enumerate(view.model_views if view.model else [view]):
        for output in curves(each):
            curve = _curve(each, output, most_places)
            if curve is not None and _MEDIAN in curve.entries("quantile"):
                found.setdefault(output, {})[number] = curve
    return sorted(found.values(), key=len, reverse=True)


def median_charts(view: ArchiveView, entries: Sequence[dict[int, CurveEstimates]]) -> Charts:
    """Return curves at a glance: the median by each model, and the quantiles around it."""
    every = [curve for by_model in entries for curve in by_model.values()]
    numbered = sorted({number: curve for each in entries for number, curve in each.items()}.items())
    keys = [
        LegendKey(f"median by {curve.view.model or curve.source}", *_median_look(curve, number))
        for number, curve in numbered
    ]
    pairs = dict.fromkeys(pair for curve in every for pair in _quantile_pairs(curve))
    texts = [f"the {percent_text(p)} and the {percent_text(q)} quantile" for p, q in pairs]
    notes = [f"Shades: between {join_names(texts)} at each place."] if texts else []
    if any(curve.bounds("reached") is not None for curve in every):
        notes.append(_CONDITIONAL.format("quantiles"))
    charts = tuple(_median_chart(view, by_model) for by_model in entries)
    return Charts(charts, keys=tuple(keys), notes=tuple(notes))


def _median_look(curve: CurveEstimates, number: int) -> tuple[int, str, str]:
    """Return the colour and the dashes: of one of several models, otherwise of the design."""
    if curve.view.model:
        return number, "line", series_dash(number)
    return curve.view.series(curve.source), "line", "solid"


def _quantile_pairs(curve: CurveEstimates) -> list[tuple[float, float]]:
    """Return the outermost quantiles around the median, then others with their counterparts."""
    known = sorted(curve.entries("quantile"))
    pairs = [(p, q) for p in known for q in known if p < _MEDIAN and np.isclose(p + q, 1)]
    outer = [(known[0], known[-1])] if known[0] < _MEDIAN < known[-1] else []
    return list(dict.fromkeys(outer + pairs))


def _median_chart(view: ArchiveView, by_model: dict[int, CurveEstimates]) -> Chart:
    first = next(iter(by_model.values()))
    shades: list[Mark] = []
    lines = []
    for number, curve in by_model.items():
        series, _, dash = _median_look(curve, number)
        quantiles = curve.entries("quantile")
        shades += [
            Band(curve.places, quantiles[low][:, 0], quantiles[high][:, 0], series)
            for low, high in _quantile_pairs(curve)
        ]
        name = curve.view.model or "median"
        lines.append(_line(curve, quantiles[_MEDIAN], series, name, dash=dash))
    is_alone = len(by_model) == 1 < len(view.model_views)
    ends = (float(first.places[0]), float(first.places[-1]))
    return Chart(
        title=capitalized(first.view.axis_label(first.output)),
        summary=" ".join(_ends_sentence(curve) for curve in by_model.values()),
        x=Axis(first.view.axis_label(first.dimension), ends),
        # The name, long as it may be, is the title.
        y=Axis(typeset_unit(quantity(first.view, first.output).unit)),
        marks=(*shades, *lines),
        notes=(f"By {first.view.model} alone.",) if is_alone else (),
        height=220,
        of=first.output,
        source=first.source,
        is_of_all_models=True,
        is_compared=True,
    )


def _ends_sentence(curve: CurveEstimates) -> str:
    by = curve.view.model or curve.source
    known = curve.entries("quantile")[_MEDIAN][:, 0]
    there = np.flatnonzero(np.isfinite(known))
    if not there.size:
        return f"By {by}, no run has a value."
    place = (int(curve.positions[there[-1]]),)
    reached = curve.view.statistics.reached_text(curve.source, curve.output, place)
    first, last = (number_text(known[at]) for at in there[[0, -1]])
    return f"By {by}, the median goes from {first} to {last}{reached}."


# Indices of an output along the places of its curve: label, source and array, which has the
# dimensions place, ``input`` and ``bound``.
_Index = tuple[str, str, xr.DataArray]


def driver_charts(view: ArchiveView) -> Iterator[Charts]:
    """Sobol' indices of curves, stacked and with intervals."""
    every = [CurveEstimates(view, output, "") for output in curves(view)]
    found = [(curve, measures_along(curve)) for curve in every]
    most = max((len(indices) for _, indices in found), default=0)
    yield from _blocks(
        [chart for each in found for chart in driver_areas(*each)],
        *(
            [chart for curve, indices in found for chart in driver_lines(curve, indices[n : n + 1])]
            for n in range(most)
        ),
    )


def measures_along(curve: CurveEstimates) -> list[_Index]:
    """Return the indices along the places: label, source and array of each that is known."""
    found = []
    for each in index_titles(curve.view.tree).ordered(MEASURES["shares"]):
        arrays = {
            source: array
            for source in curve.view.estimates(curve.output, each.name)
            if (array := curve.array(each.name, source)) is not None
        }
        best = best_sources(curve.view.tree, arrays.items())[:1]
        known = (source for source in best if np.isfinite(arrays[source].values[..., 0]).any())
        found += [(each.measure.label, source, arrays[source]) for source in known]
    return found


def driver_areas(curve: CurveEstimates, indices: Sequence[_Index]) -> Iterator[Chart]:
    """Yield a chart of the inputs' shares of the variance, stacked, and of the remainder."""
    if not indices:
        return
    label, source, array = indices[0]
    known = np.isfinite(array.values[..., 0]).all(axis=1)
    shares = np.clip(array.values[known, :, 0], 0.0, None)
    shown = curve.places[known]
    names = [str(name) for name in array[INPUT].values]
    order = np.argsort(-shares.mean(axis=0), kind="stable")[:_MOST_INPUTS]
    marks: list[Mark] = []
    keys: list[LegendKey] = []
    below = np.zeros(len(shares))
    for series, position in enumerate(order.tolist()):
        above = below + shares[:, position]
        marks.append(Band(shown, below, above, series))
        keys.append(LegendKey(input_label(curve.view, names[position]), series, "band"))
        below = above
    rest = "others and interactions" if len(names) > len(order) else "interactions"
    marks.append(Band(shown, below, np.maximum(below, 1.0), "quiet"))
    keys.append(LegendKey(rest, "quiet", "band"))
    largest = input_label(curve.view, names[int(order[0])])
    is_negative = bool((array.values[known][:, order, 0] < 0).any())
    yield _chart(
        curve,
        f"Shares of the variance, {label} by {source}",
        f"The largest share over all places is that of {largest}.",
        marks,
        keys,
        (
            f"What remains ({rest}) also has the errors of the indices.",
            *["An index below 0, by its error, is stacked as 0."] * is_negative,
            *_input_notes(order.size, len(names)),
        ),
        y=Axis("share of the variance", (0.0, max(1.0, float(below.max(initial=1.0))))),
        height=320,
        is_compared=False,
    )


def driver_lines(curve: CurveEstimates, indices: Sequence[_Index]) -> Iterator[Chart]:
    """Yield a chart for each measure, with a line and its band for each input."""
    for label, source, array in indices:
        mean = np.nanmean(np.where(np.isfinite(array.values), array.values, np.nan)[..., 0], axis=0)
        order = np.argsort(-np.nan_to_num(mean), kind="stable")[:_MOST_INPUTS].tolist()
        names = [input_label(curve.view, str(array[INPUT].values[each])) for each in order]
        rows = list(enumerate(order))
        has_bounds = _has_bounds(array)
        shades = f", pointwise {_level_text(array)} intervals" if has_bounds else ""
        yield _chart(
            curve,
            f"{label.capitalize()} by {source}{shades}",
            f"The largest is that of {names[0]}.",
            (
                *(each for n, at in rows for each in _band(curve, array.values[:, at], n)),
                *(_line(curve, array.values[:, at], n, names[n], has_unit=False) for n, at in rows),
            ),
            (LegendKey(name, number, "line") for number, name in enumerate(names)),
            (
                *([] if has_bounds else [f"No interval of the {label}: {_reason(array)}."]),
                *_input_notes(len(order), array.sizes[INPUT]),
            ),
            y=Axis("share of the variance", (-0.1, 1.1)),
        )


def _input_notes(shown: int, every: int) -> Iterator[str]:
    """Yield how many inputs are shown, if these are not all."""
    if shown < every:
        yield f"The {shown} inputs with the largest indices, of {every}."


def place_histogram(curve: CurveEstimates, first_place: int) -> Chart:
    """Return the runs in bins at the place that is chosen."""
    series = curve.view.series(curve.source)

    def bars(number: int) -> list[Mark]:
        values = curve.runs[:, number]
        known = values[np.isfinite(values)]
        counts, edges = np.zeros(1, dtype=np.int64), np.array([0.0, 1.0])
        if known.size:
            counts, edges = ValueAxis.of_values([known]).bins(known)
        return [Bars(edges, counts, series, hover="%{y} runs around %{x:.4~g}", is_even=True)]

    return Chart(
        title="Runs at the chosen place",
        summary=f"{count_text(len(curve.runs), 'run')} of {curve.source} in bins.",
        x=Axis(curve.view.axis_label(curve.output)),
        y=Axis("runs in a bin"),
        keys=(LegendKey(f"runs of {curve.source}", series, "bar"),),
        height=280,
        **_slices(curve, first_place, bars),
    )


def place_drivers(
    curve: CurveEstimates, first_place: int, indices: Sequence[_Index]
) -> Iterator[Chart]:
    """Yield the shares of the variance at the place that is chosen."""
    if not indices:
        return
    rows = tuple(input_label(curve.view, str(name)) for name in indices[0][2][INPUT].values)
    sources = ", ".join(dict.fromkeys(source for _, source, _ in indices))

    def dots(number: int) -> list[Mark]:
        return [
            _dots(array.values[number], place, rows, label, source)
            for place, (label, source, array) in enumerate(indices)
        ]

    yield Chart(
        title="Shares of the variance at the chosen place",
        summary=f"{', '.join(label for label, _, _ in indices)} by {sources}.",
        x=Axis("share of the variance", (-0.1, 1.1)),
        y=Axis("", rows=rows),
        keys=tuple(
            LegendKey(f"{label}, {source}", place, series_marker(place))
            for place, (label, source, _) in enumerate(indices)
        ),
        height=110 + 34 * len(rows),
        **_slices(curve, first_place, dots),
    )


def _slices(
    curve: CurveEstimates, first_place: int, draw: Callable[[int], list[Mark]]
) -> dict[str, Any]:
    """Return the marks of a chart at some places, those that are shown first, and a note."""
    numbers = evenly_spread(curve.places.size, _MOST_PLACES)
    marks = [draw(number) for number in numbers.tolist()]
    along, values = quantity(curve.view, curve.dimension), curve.places[numbers].tolist()
    note = f"At the nearest of {len(numbers)} of {curve.size} places."
    return {
        "marks": tuple(marks[int(np.abs(numbers - first_place).argmin())]),
        "notes": (note,) * (len(numbers) < curve.places.size),
        "slices": PlaceSlices(along, values, marks),
    }


def _dots(bounds: FloatArray, place: int, rows: tuple[str, ...], label: str, source: str) -> Mark:
    offsets = [row + 0.22 * (place - 0.5) for row in range(len(rows))]
    texts = [estimate_text(*each) for each in bounds.tolist()]
    return Dots(
        bounds,
        offsets,
        place,
        hovers=texts,
        name=label,
        marker=series_marker(place),
        hover=f"%{{customdata}}, {escape_text(label)} by {escape_text(source, 40)}: %{{text}}",
        labels=rows,
    )


def moment_maps(view: ArchiveView) -> Iterator[Chart]:
    """Fields along two dimensions: mean and standard deviation."""
    for field in view.fields:
        if field not in curves(view):
            for source in islice(view.estimates(field, "mean"), 1):
                yield from map_charts(view, field, source, has_quantiles=False)


def map_charts(
    view: ArchiveView, field: str, source: str, *, has_quantiles: bool = True
) -> Iterator[Chart]:
    """Yield maps of the mean, the standard deviation and the quantiles of a field.

    The last two dimensions are the axes. Along a third one, the map is at the largest mean.
    """
    found = view.statistics.statistics(source, field)
    if "mean" not in found or not np.isfinite(found["mean"].values[..., 0]).any():
        return
    mean = found["mean"]
    dims = field_dimensions(first_runs(view.tree)[field])
    largest = np.unravel_index(int(np.nanargmax(mean.values[..., 0])), mean.shape[:-1])
    at = dict(zip(dims[:-2], map(int, largest), strict=False))
    place = entry_place(mean, tuple(at.values()))
    notes = [f"At {place}, the place of the largest mean."] if at else []
    for statistic, label in (("mean", "mean"), ("std", "standard deviation")):
        if statistic in found:
            yield _map(view, field, source, label, found[statistic][at], notes)
    if has_quantiles and "quantile" in found:
        for number, p in enumerate(found["quantile"]["probability"].values.tolist()):
            array = found["quantile"][{**at, "probability": number}]
            yield _map(view, field, source, quantile_label(p), array, notes)


def _map(
    view: ArchiveView, field: str, source: str, label: str, array: xr.DataArray, notes: list[str]
) -> Chart:
    """Return the map of a statistic along two dimensions and ``bound``."""
    convert = view.conversion(field, CATALOGUE[str(array.name)])
    bounds = np.asarray(convert(array.values), dtype=np.float64)
    across, along = (str(dim) for dim in array.dims[:2])
    x, y = (np.asarray(view.scale(dim).from_si(array[dim].values)) for dim in (along, across))
    unit = unit_suffix(view.unit(field))
    shown = HeatMap(x, y, bounds, unit)
    lowest, highest = map(number_text, shown.limits)
    across_ends, along_ends = shown.ends
    name, told = output_title(view, field), "no intervals"
    if np.isfinite(widths := np.ptp(bounds[..., 1:], axis=-1) / 2).any():
        most = f"{number_text(float(np.nanmax(widths)), 3)}{unit}"
        told = f"half-widths of {_level_text(array)} intervals up to {most}"
    return Chart(
        title=f"{capitalized(name)}: {label}{f' [{unit.strip()}]' * bool(unit)}",
        summary=f"From {lowest} to {highest}{unit}.",
        x=quantity_axis(view, along, across_ends),
        y=quantity_axis(view, across, along_ends),
        marks=(shown,),
        notes=(*notes, f"{capitalized(label)} of {name}: {told}."),
        height=340,
        of=field,
        source=source,
    )


def _band(curve: CurveEstimates, bounds: FloatArray | None, series: int | str) -> list[Mark]:
    """Return the band between the bounds of a statistic at each place; nothing without any."""
    if bounds is None or not np.isfinite(bounds[:, 1:]).any():
        return []
    lower, upper = _drawn(curve, bounds[:, 1:]).T
    return [Band(curve.places, lower, upper, series)]


def _line(
    curve: CurveEstimates,
    bounds: FloatArray,
    series: int | str,
    name: str,
    *,
    dash: str = "solid",
    width: float = 2,
    has_unit: bool = True,
) -> Mark:
    """Return the line of a statistic; a pointer reads off its estimates with their intervals."""
    unit = unit_suffix(curve.view.unit(curve.output)) if has_unit else ""
    return Line(
        curve.places,
        _drawn(curve, bounds[:, 0]),
        series,
        hover=f"%{{text}}{escape_text(unit)} {escape_text(name, 40)}",
        name=name,
        texts=[estimate_text(*row) for row in bounds.tolist()],
        dash=dash,
        width=width,
    )


def _thin_lines(curve: CurveEstimates, runs: FloatArray, colour: str, width: float) -> Mark:
    """Return lines of single runs, shape (run, place), as one trace with gaps between them."""
    values = np.column_stack([_drawn(curve, runs), np.full(len(runs), np.nan)])
    along = np.tile(np.append(curve.places, curve.places[-1]), len(runs))
    return Line(along, values.ravel(), colour, hover="", width=width)


def _drawn(curve: CurveEstimates, values: FloatArray) -> FloatArray:
    """Return values rounded to what can be seen of them, unless all places are shown."""
    known = values[np.isfinite(values)]
    # Halves, as the difference of large numbers may overflow.
    span = 2 * (float(known.max()) / 2 - float(known.min()) / 2) if known.size else 0.0
    # Powers of ten beyond are no numbers.
    if curve.most_places is None or not 1e-290 < span < 1e290:
        return values
    return np.round(values, math.ceil(math.log10(_STEPS / span)))


def _level_text(array: xr.DataArray | None) -> str:
    level = None if array is None else array.attrs.get(INTERVAL_LEVEL)
    return "" if level is None else percent_text(float(level))
