"""Fan chart of a curve, its quantiles, and its probabilities along the dimension."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.charts.chart import Axis, Chart, LegendKey, PlaceReadout
from uqpen.charts.marks import Mark
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import RUN
from uqpen.figures.scatter import thin_runs
from uqpen.report.counting import count_text
from uqpen.report.sections.curve_lines import (
    DASHES,
    band,
    level_text,
    line,
    place_axis,
    thin_lines,
    value_axis,
)
from uqpen.results.archive_view import output_title
from uqpen.results.curve_estimates import CurveEstimates
from uqpen.results.digits import grouped_number, number_text, percent_text
from uqpen.results.statistic_entries import THRESHOLD_PROBABILITIES
from uqpen.results.table import entry_label, quantile_label
from uqpen.results.texts import capitalized, join_names

__all__ = ["fan_chart", "probability_charts", "quantile_chart", "ranked_chart", "tolerance_chart"]

# Single runs that are drawn, thin, behind the others, and outlying ones.
_MOST_RUNS, _MOST_OUTLYING = 20, 10
# Ends of the range that lines have.
_ENDS = (np.nanmin, np.nanmax)


def fan_chart(curve: CurveEstimates, readout: PlaceReadout) -> Chart:
    """Return the chart of the mean with its band, the quantiles, and some single runs."""
    series = curve.view.series(curve.source)
    run_lines, key = _single_runs(curve)
    traces, keys = [run_lines], [key]
    for label, dash, bounds in _quantiles(curve, "quantile"):
        traces.append(line(curve, bounds, "ink", label, dash=dash, width=1.5))
        keys.append(LegendKey(label, "ink", "line", dash))
    if (mean := curve.bounds("mean")) is not None:
        kind, name = _band_of(curve, "mean")
        ends = band(curve, curve.bounds(name), series)
        traces += [*ends, line(curve, mean, series, "mean", width=2.5)]
        keys.append(LegendKey("mean", series, "line"))
        if ends:
            text = f"{kind} {level_text(curve.array(name))} band of the mean"
            keys.append(LegendKey(text, series, "band"))
    title = capitalized(output_title(curve.view, curve.output))
    return Chart(
        title=f"{title} along {curve.view.axis_label(curve.dimension)}",
        summary=readout.text(readout.start),
        x=place_axis(curve),
        y=value_axis(curve),
        marks=tuple(traces),
        keys=tuple(keys),
        notes=(*_places_notes(curve), *_left_out_notes(curve, "mean_band")),
        height=400,
        is_compared=True,
        place=readout,
    )


def _places_notes(curve: CurveEstimates) -> tuple[str, ...]:
    """Return how many places are shown, where these are not all."""
    shown = curve.places.size
    return () if shown == curve.size else (f"{shown} of {curve.size} places are shown.",)


def _left_out_notes(curve: CurveEstimates, statistic: str) -> Iterator[str]:
    """Yield the places that a band leaves out, if there are any."""
    if left_out := curve.left_out(statistic):
        name = CATALOGUE[statistic].title
        yield f"Without bounds ({name}): {left_out}."


def tolerance_chart(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield the bands that hold a new curve, behind single runs, if there are any."""
    series = curve.view.series(curve.source)
    found = {
        content: traces
        for content, bounds in curve.entries("tolerance_band").items()
        if (traces := band(curve, bounds, series))
    }
    if not found:
        return
    lines, keys = zip(*[_single_runs(curve)], strict=True) if curve.has_runs else ((), ())
    shares = join_names([percent_text(content) for content in found])
    level = level_text(curve.array("tolerance_band"))
    text = f"holds a new curve in {shares} of cases, with {level} confidence"
    yield Chart(
        title="Tolerance band",
        summary=f"By {curve.source}: {text}.",
        x=place_axis(curve),
        y=value_axis(curve),
        marks=(*(trace for traces in found.values() for trace in traces), *lines),
        keys=(LegendKey(text, series, "band"), *keys),
        notes=tuple(_left_out_notes(curve, "tolerance_band")),
        height=320,
    )


def _single_runs(curve: CurveEstimates) -> tuple[Mark, LegendKey]:
    """Return thin lines of some runs, and their key, which has their number."""
    numbers = xr.Dataset({"number": (RUN, np.arange(len(curve.runs)))})
    runs = curve.runs[thin_runs(numbers, _MOST_RUNS)["number"].values]
    counted = f"{grouped_number(len(runs))} of {count_text(len(curve.runs), 'run')}"
    key = LegendKey(f"{counted} of {curve.source}", "quiet", "line")
    return thin_lines(curve.places, runs, "quiet", 0.6), key


def ranked_chart(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield the functional boxplot of the runs, if their curves are ranked."""
    region, envelope = curve.bounds("central_region"), curve.bounds("envelope")
    if region is None or envelope is None:
        return
    series = curve.view.series(curve.source)
    outlying, every = curve.outlying_count
    shown = curve.outlying_runs[:_MOST_OUTLYING]
    lines = [thin_lines(curve.places, shown, "beyond", 1)] if len(shown) else []
    count = count_text(outlying, "outlying run")
    omitted = f"{len(shown)} of them are drawn." if len(shown) < outlying else ""
    yield Chart(
        title="Ranked curves",
        summary=f"By {curve.source}: {count} of {grouped_number(every)}.",
        x=place_axis(curve),
        y=value_axis(curve),
        marks=(
            *band(curve, envelope, "quiet"),
            *band(curve, region, series),
            *lines,
            line(curve, region, series, "median curve, central region in brackets", width=2.5),
        ),
        keys=(
            LegendKey("median curve: the deepest run", series, "line"),
            LegendKey("central region: the deeper half of the runs", series, "band"),
            LegendKey("range of all runs but outlying ones", "quiet", "band"),
            LegendKey(count, "beyond", "line"),
        ),
        notes=tuple(filter(None, (omitted,))),
        height=320,
        is_compared=True,
    )


def quantile_chart(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield the chart of the quantiles with their bands, if there are any."""
    kind, name = _band_of(curve, "quantile")
    entries = _quantiles(curve, name)
    if not entries:
        return
    numbered = list(enumerate(entries))
    bands = [each for number, (_, _, bounds) in numbered for each in band(curve, bounds, number)]
    lines = [line(curve, bounds, n, label, dash=dash) for n, (label, dash, bounds) in numbered]
    level = level_text(curve.array(name))
    yield Chart(
        title=f"Quantiles with {kind} {level} bands",
        summary=f"Of {output_title(curve.view, curve.output)} by {curve.source}: "
        f"{', '.join(label for label, _, _ in entries)}.",
        x=place_axis(curve),
        y=value_axis(curve),
        marks=(*bands, *lines),
        keys=tuple(LegendKey(label, n, "line", dash) for n, (label, dash, _) in numbered),
        notes=tuple(_left_out_notes(curve, name)),
        is_compared=True,
    )


def probability_charts(curve: CurveEstimates) -> Iterator[Chart]:
    """Yield charts of the runs that reach each place, and of the probabilities of thresholds."""
    reached = curve.bounds("reached")
    if reached is not None:
        yield _probability_chart(curve, "Runs that get this far", {"reached": reached}, "reached")
    for statistic in THRESHOLD_PROBABILITIES:
        entries = {
            entry_label(statistic, text): bounds
            for text, bounds in curve.entries(statistic.name).items()
        }
        if entries:
            title = f"{', '.join(entries)} at each place"
            yield _probability_chart(curve, title, entries, statistic.name)


def _probability_chart(
    curve: CurveEstimates, title: str, entries: dict[str, FloatArray], statistic: str
) -> Chart:
    series = curve.view.series(curve.source)
    bands = [each for bounds in entries.values() for each in band(curve, bounds, series)]
    looks = list(zip(entries.items(), DASHES * len(entries), strict=False))
    ranges = (
        f"{label} from {' to '.join(number_text(end(bounds[:, 0]), 3) for end in _ENDS)}"
        for label, bounds in entries.items()
    )
    level = level_text(curve.array(statistic))
    return Chart(
        title=title,
        summary=f"By {curve.source}: {'; '.join(ranges)}.",
        x=place_axis(curve),
        y=Axis("probability", (-0.02, 1.02)),
        marks=(
            *bands,
            *(
                line(curve, bounds, series, label, dash=dash, has_unit=False)
                for (label, bounds), dash in looks
            ),
        ),
        keys=tuple(LegendKey(label, series, "line", dash) for (label, _), dash in looks),
        notes=(f"Shade: pointwise {level} intervals.",),
        height=260,
        is_compared=True,
    )


def _band_of(curve: CurveEstimates, statistic: str) -> tuple[str, str]:
    """Return the kind of the band to show of a statistic, and the statistic that has it."""
    whole = f"{statistic}_band"
    is_known = curve.array(whole) is not None
    return ("simultaneous", whole) if is_known else ("pointwise", statistic)


def _quantiles(curve: CurveEstimates, statistic: str) -> list[tuple[str, str, FloatArray]]:
    """Return the label, the dashes and the bounds of each quantile."""
    return [
        (quantile_label(p), DASHES[0 if p == 0.5 else 1 + number % (len(DASHES) - 1)], bounds)
        for number, (p, bounds) in enumerate(curve.entries(statistic).items())
    ]
