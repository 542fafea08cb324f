"""Distribution functions of an output: by its sources, its models, two archives; and the tail."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import xarray as xr

from uqpen.archive.estimates import interval_text
from uqpen.charts.axes import CUT, ValueAxis, output_axis
from uqpen.charts.chart import Axis, Chart, LegendKey
from uqpen.charts.marks import (
    END,
    Band,
    Dots,
    Line,
    Mark,
    end_of_line,
    escape_text,
    interval_notes,
    series_dash,
)
from uqpen.charts.study_limits import LimitMarks, limit_marks, output_span, study_limits
from uqpen.core.arrays import FloatArray
from uqpen.core.labels import (
    BOUND_END,
    BOUND_SEARCH,
    BOUNDED_QUANTITY,
    INTERVAL_LEVEL,
    MISSING,
    NOTE,
    STATUS,
    THRESHOLD,
)
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.units import Scale
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, estimate_text, number_text, percent_text
from uqpen.results.found_bounds import FoundBounds, found_bounds
from uqpen.results.table import OutputTable, exceedance_label
from uqpen.results.texts import capitalized, plain_text, unit_suffix

# Fewer distinct values than this are drawn as steps, all of them.
_FEW_DISTINCT = 500
# Points of a line through more values, of each spacing.
_POINTS = 150
# Lower end of the axis of a tail, as a multiple of the smallest share of the runs.
_BELOW = 0.3

_NOT_MET = "Larger values may be possible; these runs have met none."


def cdf_charts(view: ArchiveView) -> Iterator[Chart]:
    """Distribution functions of all sources, one with its band."""
    for output in view.numeric_outputs:
        if curves := distribution_curves(view, output):
            chart = cdf_chart(view, output, curves)
            yield replace(chart, notes=(*_reasons_without_band(curves[:1]), *chart.notes))


def exceedance_charts(view: ArchiveView) -> Iterator[Chart]:
    """Probability of exceeding each value, with the requested ones."""
    for output in view.numeric_outputs:
        for curve in distribution_curves(view, output)[:1]:
            yield from exceedance_chart(view, output, curve, is_alone=True)


def model_charts(view: ArchiveView) -> Iterator[Chart]:
    """Distribution functions by each of several models."""
    for output in view.numeric_outputs if view.model else ():
        source = next(iter(view.estimates(output, "cdf_value")), "")
        if (chart := model_chart(view, output, source)) is not None:
            yield chart


def bound_charts(view: ArchiveView) -> Iterator[Chart]:
    """Distribution functions at both bounds over the intervals."""
    for design in view.designs:
        if view.design(design).sampling is Sampling.OVER_BOX:
            charts = (_box_chart(view, design, output) for output in view.numeric_outputs)
            yield from (chart for chart in charts if chart is not None)
        if view.design(design).sampling is Sampling.TOWARDS_BOUNDS:
            for found in found_bounds(view.statistics, design):
                for output in view.numeric_outputs:
                    if found.range is not None and re.search(rf"\b{output}\b", found.title):
                        yield _bound_chart(view, design, found, output)


def _box_chart(view: ArchiveView, design: str, output: str) -> Chart | None:
    """Return the least and the largest function of an output over parameters that are intervals."""
    values, *ends = (
        view.statistics.get(design, output, name)
        for name in ("cdf_value", "lower_cdf", "upper_cdf")
    )
    lower, upper = ends
    if values is None or lower is None or upper is None or not np.isfinite(values.values).all():
        return None
    x = np.asarray(view.scale(output).from_si(values.values), dtype=np.float64)
    span = output_span(view, output, [x])
    limits = limit_marks(view, output, span, at_foot=True)
    marks, keys = list[Mark](), list[LegendKey]()
    outer = np.array([lower.values[:, 1], upper.values[:, 2]])
    if np.isfinite(outer).any():
        known = np.isfinite(outer).all(axis=0)
        marks.append(Band(x[known], outer[0, known], outer[1, known], 0))
        level = percent_text(lower.attrs.get(INTERVAL_LEVEL, np.nan))
        keys.append(LegendKey(f"between the limits of both, pointwise {level}", 0, "band"))
    medians = []
    for series, (which, end) in enumerate((("least", lower), ("largest", upper))):
        text, dash = f"{which} probability", series_dash(series)
        marks.append(Line(x, end.values[:, 0], series, f"%{{y:.4f}} {text}", text, dash=dash))
        keys.append(LegendKey(text, series, "line", dash))
        median = number_text(float(np.interp(0.5, end.values[:, 0], x)))
        medians.append(f"{median}{unit_suffix(view.unit(output))}")
    return Chart(
        title=f"Probability that {output_title(view, output)} is at most x, over all parameters",
        summary=f"The median is between {medians[1]} and {medians[0]}.",
        x=output_axis(view, output, span),
        y=Axis("P(at most x)", (0.0, 1.0)),
        marks=(*marks, *limits.rules),
        keys=(*keys, *limits.keys),
        notes=tuple(limits.notes),
        height=340,
        of=output,
        source=design,
        is_compared=True,
    )


def _bound_chart(view: ArchiveView, design: str, found: FoundBounds, output: str) -> Chart:
    """Return the functions of an output by the runs at both bounds of a quantity."""
    runs, measure = view.design(design).shown_runs, view.scale(output)
    search, number, end = (
        runs[name].values for name in (BOUND_SEARCH, BOUNDED_QUANTITY, BOUND_END)
    )
    used = (search == search.max()) & (number == found.number) & (runs[STATUS].values == Status.OK)
    ends = {"lower": runs[output].values[used & (end < 0)]}
    ends["upper"] = runs[output].values[used & (end > 0)]
    shown = {name: np.asarray(measure.from_si(values)) for name, values in ends.items()}
    span = output_span(view, output, [*shown.values()])
    limits = limit_marks(view, output, span, at_foot=True)
    marks, keys, medians = list[Mark](), list[LegendKey](), list[str]()
    for series, (name, values) in enumerate(shown.items()):
        text, x = f"at the {name} bound", span.thresholds(np.sort(values), limits.values)
        dash = series_dash(series)
        hover = f"%{{y:.4f}} {text}"
        share = empirical_cdf(values, x)
        marks.append(Line(x, share, series, hover, name=text, dash=dash, is_stepped=True))
        keys.append(LegendKey(f"{text}, {count_text(values.size, 'run')}", series, "line", dash))
        unit_text = unit_suffix(view.unit(output))
        medians.append(f"the median is {number_text(float(np.median(values)))}{unit_text} {text}")
    return Chart(
        title=f"Probability that {output_title(view, output)} is at most x, at both bounds of "
        f"{'the ' * bool(found.unit)}{plain_text(found.title)}",
        summary=f"{capitalized(' and '.join(medians))}.",
        x=output_axis(view, output, span),
        y=Axis("P(at most x)", (0.0, 1.0)),
        marks=(*marks, *limits.rules),
        keys=(*keys, *limits.keys),
        notes=tuple(limits.notes),
        height=340,
        of=output,
        source=design,
        is_compared=True,
    )


@dataclass(frozen=True)
class SimultaneousBand:
    """Band around the share of the completed runs at or below each value.

    The estimate is of the completed runs. A failed run could have had any result, so for the lower
    end all of them lie above the value, and for the upper end all at or below it. The half-width is
    that of as many runs as there are of both. Requested probabilities allow for failed runs in the
    same way.

    Notes
    -----
    The two ends are functions of all n runs: with every failed run at plus infinity, and with every
    one at minus infinity. The one-sided inequality of Dvoretzky, Kiefer and Wolfowitz with
    Massart's constant (1990, Ann. Probab. 18, 1269-1283) holds for each, with a half-width that
    falls with the root of n. So the band covers with at least its level.
    """

    half_width: float  # over the completed runs; NaN where no band is known
    # Share of the failed runs among the admissible ones, from 0 to below 1.
    missing_share: float = 0.0

    @classmethod
    def from_estimates(cls, band: xr.DataArray) -> SimultaneousBand:
        """Return the band of an archive's ``cdf_band``, which is of the completed runs alone.

        Parameters
        ----------
        band : DataArray
            Along ``rank`` and ``bound``, with at least one rank; the same width at all of them.
            Its attributes count the runs.
        """
        estimate, lower, _ = band.values[-1]
        used = int(band.attrs.get("runs_used", 0))
        inadmissible = int(band.attrs.get(f"runs_{Status.INADMISSIBLE.meaning}", 0))
        admissible = int(band.attrs.get("runs", used)) - inadmissible
        # Nearest to 1 no probability cuts the lower side off.
        return cls(float(estimate - lower), 1 - used / admissible if used else 0.0)

    def around(self, share: FloatArray) -> FloatArray:
        """Return the band around shares of the completed runs.

        Parameters
        ----------
        share : ndarray
            From 0 to 1.

        Returns
        -------
        ndarray, shape (..., bound)
            The share itself, and the ends of the band, which are NaN where none is known.
        """
        kept = 1.0 - self.missing_share
        half = self.half_width * math.sqrt(kept)
        lower = np.maximum(kept * share - half, 0.0)
        upper = np.minimum(kept * share + self.missing_share + half, 1.0)
        return np.stack([share, lower, upper], axis=-1)


def empirical_cdf(outputs: FloatArray, values: FloatArray) -> FloatArray:
    """Return the share of runs at or below each value.

    An archive has this function at some ranks alone. Between them, the runs decide.

    Parameters
    ----------
    outputs : ndarray, shape (run,)
        Of the completed runs.
    values : ndarray, shape (value,)
        In the unit of the outputs.

    Returns
    -------
    ndarray, shape (value,)
    """
    return np.searchsorted(np.sort(outputs), values, side="right") / outputs.size


@dataclass(frozen=True)
class Curve:
    """A distribution function of an output by one source."""

    view: ArchiveView  # the model of the source
    source: str  # its name
    output: str  # its name
    name: str  # what a legend calls it: the source, the model or the archive
    series: int  # its colour and dashes
    measure: Scale  # of the unit that is shown
    values: FloatArray  # (rank,): in this unit
    # (rank, bound): the function there, with its simultaneous bounds for any outcome of failed
    # runs.
    band: FloatArray
    limits: SimultaneousBand  # the band around any other share of the runs
    level: float  # of the band; NaN without one
    note: str  # reason why there is no band
    runs: int  # number of its runs
    is_stepped: bool  # true if steps can be seen, as there are few distinct values

    @classmethod
    def of_source(
        cls, view: ArchiveView, source: str, output: str, name: str, series: int, measure: Scale
    ) -> Curve | None:
        """Return the function of an output, which is shown in the unit of a scale.

        None where the source has no such function, or none of its values is finite.
        """
        values = view.statistics.get(source, output, "cdf_value")
        band = view.statistics.get(source, output, "cdf_band")
        if values is None or band is None or not np.isfinite(values.values).any():
            return None
        limits = SimultaneousBand.from_estimates(band)
        runs = int(band.attrs.get("runs_used", 0))
        return cls(
            view,
            source,
            output,
            name,
            series,
            measure,
            np.asarray(measure.from_si(values.values), dtype=np.float64),
            limits.around(np.asarray(band.values[:, 0], dtype=np.float64)),
            limits,
            float(band.attrs.get(INTERVAL_LEVEL, np.nan)),
            interval_text(band[0], NOTE),
            runs,
            runs < _FEW_DISTINCT or np.unique(values.values).size < _FEW_DISTINCT,
        )

    @property
    def has_band(self) -> bool:
        """True if the curve has a confidence band."""
        return bool(np.isfinite(self.band[:, 1:]).any())

    def quantile(self, p: float) -> float:
        """Return a quantile, by the equally spaced ranks of the archive."""
        return float(self.values[round(p * (self.values.size - 1))])

    def at(self, values: FloatArray) -> Curve:
        """Return the function at other values: from its runs or, without all, between its ranks.

        Limits of the study among the values are taken as it states them, to the last bit.
        """
        if self.source in self.view.designs and self.view.design(self.source).shows_all_runs:
            limits = [limit.in_si for limit in study_limits(self.view, self.output)]
            exact = {float(self.measure.from_si(limit)): limit for limit in limits}
            in_si = [exact.get(each, self.measure.to_si(each)) for each in values.tolist()]
            outputs = self.view.design(self.source).completed_values(self.output)
            share = empirical_cdf(outputs, np.array(in_si))
        else:
            share = np.interp(values, self.values, self.band[:, 0], left=0.0, right=1.0)
        return replace(self, values=values, band=self.limits.around(share))

    def marks(self, dash: str, width: float = 2, *, has_band: bool = True) -> Iterator[Mark]:
        """Yield the function, which a pointer reads off, above its band if that is shown."""
        estimate, lower, upper = self.band.T
        has_band = has_band and self.has_band
        if has_band:
            yield Band(self.values, lower, upper, self.series, is_stepped=self.is_stepped)
        bounds = " (%{customdata[0]:.4f} … %{customdata[1]:.4f})"
        yield Line(
            self.values,
            estimate,
            self.series,
            hover=f"%{{y:.4f}}{bounds * has_band} {escape_text(self.name, 40)}",
            name=self.name,
            beside=[lower, upper] if has_band else (),
            dash=dash,
            width=width,
            is_stepped=self.is_stepped,
        )


def distribution_curves(view: ArchiveView, output: str) -> list[Curve]:
    """Return the functions of all sources; first that of the requested one, or a design."""
    measure = view.scale(output)
    every = (
        Curve.of_source(view, source, output, source, view.series(source), measure)
        for source in view.sources
    )
    found = [curve for curve in every if curve is not None]
    if view.source in (None, *(curve.source for curve in found)):
        return sorted(found, key=lambda curve: curve.source != view.source)
    return []


@dataclass(frozen=True)
class LargestRun:
    """The largest value of an output among the completed runs of a design."""

    value: float  # in the unit that is shown
    runs: int  # number of the completed runs
    unit: str  # the text behind a number

    @classmethod
    def of_design(cls, view: ArchiveView, design: str, output: str) -> LargestRun:
        """Return the largest run of a design with at least one completed run."""
        if view.design(design).shows_all_runs:
            runs = view.design(design).shown_runs
            completed = runs[output].values[runs[STATUS].values == Status.OK]
            completed = completed[~np.isnan(completed)]
            largest, count = completed.max(), int(completed.size)
        else:
            # A distribution function ends at the largest run.
            largest = view.estimates(output, "cdf_value")[design].values[-1]
            count = int(view.estimates(output, "cdf_band")[design].attrs["runs_used"])
        value = float(view.scale(output).from_si(largest))
        return cls(value, count, unit_suffix(view.unit(output)))

    @property
    def name(self) -> str:
        """Name in the row of a table."""
        return f"largest of {count_text(self.runs, 'run')}"

    @property
    def text(self) -> str:
        """Value with the unit."""
        return f"{number_text(self.value)}{self.unit}"

    @property
    def sentence(self) -> str:
        """A sentence on it."""
        return f"The {self.name} is {self.text}."


def cdf_chart(view: ArchiveView, output: str, curves: Sequence[Curve]) -> Chart:
    """Return the functions of some sources: the first thick and with its band, thin the others."""
    first = curves[0]
    span = output_span(view, output, [first.values])
    limits = limit_marks(view, output, span, at_foot=True)
    values = span.thresholds(first.values, limits.values)
    marks: list[Mark] = []
    keys: list[LegendKey] = []
    over = view.statistics.get(first.source, output, "fitted_cdf")
    if over is not None and np.isfinite(over.values).all():
        _, lower, upper = over.values.T
        marks.append(Band(first.values, lower, upper, first.series))
        level = percent_text(over.attrs.get(INTERVAL_LEVEL, np.nan))
        keys.append(LegendKey(f"{level} of all parameters that fit as well", first.series, "band"))
    for curve in curves:
        is_first = curve is first
        dash, width = ("solid", 2.5) if is_first else (series_dash(curve.series), 1.5)
        # The sampling error is within that of the parameters, and two bands cannot be told apart.
        has_band = is_first and over is None
        marks += curve.at(values).marks(dash, width, has_band=has_band)
        if has_band and curve.has_band:
            text = f"simultaneous {percent_text(curve.level)} band of {curve.name}"
            keys.append(LegendKey(text, curve.series, "band"))
        keys.append(LegendKey(curve.name, curve.series, "line", dash))
    notes = [*_missing_runs_note(first), *limits.notes, *scale_notes(view, output, span, curves)]
    if span.is_cut:
        is_design = first.source in view.designs
        largest = LargestRun.of_design(view, first.source, output).sentence if is_design else ""
        notes.append(f"{capitalized(CUT)}. {largest}".rstrip())
    low, middle, high = (number_text(first.quantile(p)) for p in (0.05, 0.5, 0.95))
    unit_text = unit_suffix(view.unit(output))
    return Chart(
        title=f"Probability that {output_title(view, output)} is at most x",
        summary=f"By {first.name} it rises from 5 % at {low}{unit_text} through one half at "
        f"{middle}{unit_text} to 95 % at {high}{unit_text}. The table below has the numbers.",
        x=output_axis(view, output, span),
        y=Axis("P(at most x)", (0.0, 1.0)),
        marks=(*marks, *limits.rules),
        keys=(*keys, *limits.keys),
        notes=tuple(notes),
        height=380,
        of=output,
        is_compared=True,
    )


def model_chart(view: ArchiveView, output: str, source: str) -> Chart | None:
    """Return the functions of an output by a source of each model; None without any."""
    measure = view.scale(output)
    every = (
        Curve.of_source(each, source, output, each.model, series, measure)
        for series, each in enumerate(view.model_views)
    )
    curves = [curve for curve in every if curve is not None]
    if not curves:
        return None
    span = output_span(view, output, [curve.values for curve in curves])
    limits = limit_marks(view, output, span, at_foot=True)
    notes = (*scale_notes(view, output, span, curves), *limits.notes)
    return overlaid_chart(view, output, curves, span, limits._replace(notes=notes))


def overlaid_chart(
    view: ArchiveView,
    output: str,
    curves: Sequence[Curve],
    span: ValueAxis,
    limits: LimitMarks | None = None,
    each: Literal["model", "archive"] = "model",
) -> Chart:
    """Return the functions of an output by the same source of several models or archives.

    There is at least one. The unit is that of the first one's view.
    """
    limits = limits or LimitMarks()
    values = span.thresholds(np.concatenate([curve.values for curve in curves]), limits.values)
    marks = [mark for c in curves for mark in c.at(values).marks(series_dash(c.series))]
    keys = [LegendKey(c.name, c.series, "line", series_dash(c.series)) for c in curves]
    levels = [f"{percent_text(curve.level)} bands" for curve in curves if curve.has_band]
    shades = [f"Shades: simultaneous {text}, for each {each} by itself." for text in levels[:1]]
    cut = [f"{capitalized(CUT)}."] * span.is_cut
    preposition, unit_text = "By" if each == "model" else "In", unit_suffix(view.unit(output))
    return Chart(
        title=f"Probability that {output_title(view, output)} is at most x, by {curves[0].source}",
        summary=" ".join(
            f"{preposition} {curve.name}, the median is "
            f"{number_text(curve.quantile(0.5))}{unit_text}."
            for curve in curves
        ),
        x=output_axis(view, output, span),
        y=Axis("P(at most x)", (0.0, 1.0)),
        marks=(*marks, *limits.rules),
        keys=(*keys, *limits.keys),
        notes=(*_reasons_without_band(curves), *shades, *limits.notes, *cut),
        height=340,
        of=output,
        is_of_all_models=True,
        is_compared=True,
    )


def exceedance_chart(
    view: ArchiveView, output: str, curve: Curve, *, is_alone: bool = False
) -> Iterator[Chart]:
    """Yield the probability of exceeding each value, if any run exceeds another.

    A chart that is alone says what the distribution function and the table of the requested
    probabilities say beside others.
    """
    values, band = exceedance_tail(curve)
    if not values.size:
        return
    span = output_span(view, output, [values], [values[0], values[-1]])
    limits = limit_marks(view, output, span)
    is_design = curve.source in view.designs
    probabilities = view.statistics.get(curve.source, output, "exceedance")
    least = _least_probability(curve, probabilities, is_design=is_design)
    # An end at 0 has no logarithm.
    marks, keys = _tail_marks(curve, values, np.maximum(band, least))
    notes, summary = _missing_runs_note(curve), ""
    if is_design:
        largest = LargestRun.of_design(view, curve.source, output)
        text = f"{largest.name}: {largest.text}"
        end = max(float(band[-1, 0]), least)
        marks.append(end_of_line(float(values[-1]), end, curve.series, text))
        keys.append(LegendKey(text, curve.series, END))
        notes = [_NOT_MET, *notes]
        runs = f"{count_text(curve.runs, 'run')} of {curve.name}"
        summary = f"It falls from 1 to the smallest share of {runs}. {largest.sentence}"
    tables: tuple[OutputTable, ...] = ()
    if probabilities is not None:
        rows = _probability_rows(probabilities)
        asked = "; ".join(f"{label}: {cells[0]}" for label, cells in rows)
        places = view.scale(output).from_si(probabilities[f"{THRESHOLD}_value"].values)
        is_near = [span.contains(place) for place in places.tolist()]
        is_shown = np.array(is_near) & (probabilities.values[:, 0] > 0)
        if is_shown.any():
            marks.append(_requested_dots(probabilities[is_shown], places[is_shown]))
            keys.append(LegendKey("requested in the study", "ink", "circle"))
        notes = [*interval_notes([probabilities[is_shown]]), *notes]
        if is_alone:
            notes.append(f"{asked}.")
        else:
            tables = (OutputTable(f"Requested probabilities, by {curve.name}", [curve.name], rows),)
            if hidden := [label for label, _ in _probability_rows(probabilities[~is_shown])]:
                notes.append(f"In the table only: {', '.join(hidden)}.")
        summary = f"{asked}. {largest.sentence}" if is_design else f"{asked}."
    if is_alone:
        keys += limits.keys
        scale = scale_notes(view, output, span, [curve])
        notes = [*_reasons_without_band([curve]), *notes, *limits.notes, *scale]
    yield Chart(
        title=f"Probability that {output_title(view, output)} is more than x",
        summary=summary,
        x=output_axis(view, output, span),
        y=Axis("P(more than x)", (np.log10(least).item(), 0.0), is_logarithmic=True),
        marks=(*marks, *limits.rules),
        keys=tuple(keys),
        notes=tuple(notes),
        tables=tables,
        height=280,
        of=output,
    )


def _least_probability(
    curve: Curve, probabilities: xr.DataArray | None, *, is_design: bool
) -> float:
    """Return the end of the axis, below the share of a run and what the study requests."""
    # A surrogate's function has ranks in place of runs, and its small probabilities have not.
    least = _BELOW / max(curve.runs if is_design else curve.values.size, 10)
    if probabilities is None or is_design:
        return least
    requested = probabilities.values[:, 0]
    return float(min(least, _BELOW * requested[requested > 0].min(initial=1.0)))


def exceedance_tail(curve: Curve) -> tuple[FloatArray, FloatArray]:
    """Return values of an output, and the probability of exceeding each by the completed runs.

    Of many values some are taken, spaced evenly by that probability and by its logarithm: an
    archive's function has equally spaced ranks, and few of them lie in the tail. The last value is
    the largest run. No run exceeds it, so the probability there is that of all values from the run
    before it.

    Returns
    -------
    values : ndarray, shape (value,)
        Ascending, in the unit that is shown; empty where all runs are equal.
    band : ndarray, shape (value, bound)
        The probability, and the simultaneous band for any outcome of failed runs.
    """
    if curve.source in curve.view.designs:
        outputs = np.sort(curve.view.shown_values(curve.source, curve.output))
        largest = LargestRun.of_design(curve.view, curve.source, curve.output).value
    else:
        outputs = np.array([curve.measure.to_si(value) for value in curve.values.tolist()])
        largest = float(curve.values[-1])
    values = np.unique(outputs)
    if values.size >= _FEW_DISTINCT:
        spaced = [space(1, outputs.size, _POINTS) for space in (np.geomspace, np.linspace)]
        left = np.concatenate(spaced).round().astype(np.int64)
        values = np.unique(outputs[outputs.size - left])
    # The largest value leaves nothing above it, which has no logarithm.
    values = values[values < outputs[-1]]
    # The probability of exceeding is least where the distribution function is greatest.
    band = (1 - curve.limits.around(empirical_cdf(outputs, values)))[:, [0, 2, 1]]
    if not values.size:
        return values, band
    return np.append(curve.measure.from_si(values), largest), np.append(band, band[-1:], axis=0)


def _tail_marks(
    curve: Curve, values: FloatArray, band: FloatArray
) -> tuple[list[Mark], list[LegendKey]]:
    """Return the tail with its band, and their entries of the legend."""
    estimate, lower, upper = band.T
    unit = escape_text(unit_suffix(curve.view.unit(curve.output)))
    hover = f"P(more than %{{x:.4~g}}{unit}) = %{{y:.3~g}}"
    name, series, is_stepped = curve.name, curve.series, curve.is_stepped
    function = Line(values, estimate, series, hover, name, is_stepped=is_stepped)
    key = LegendKey(name, series, "line")
    if not curve.has_band:
        return [function], [key]
    text = f"simultaneous {percent_text(curve.level)} band"
    shade = Band(values, lower, upper, series, is_stepped=is_stepped)
    return [shade, function], [LegendKey(text, series, "band"), key]


def _requested_dots(probabilities: xr.DataArray, places: FloatArray) -> Dots:
    hovers = [f"{label} = {cells[0]}" for label, cells in _probability_rows(probabilities)]
    # An end at 0 has no logarithm.
    bounds = np.where(probabilities.values > 0, probabilities.values, np.nan)
    return Dots(bounds, places, "ink", hovers=hovers, name="requested", along="y")


def _probability_rows(probabilities: xr.DataArray) -> list[tuple[str, list[str]]]:
    labels = [exceedance_label(str(text)) for text in probabilities[THRESHOLD].values]
    return [
        (label, [estimate_text(*row)])
        for label, row in zip(labels, probabilities.values, strict=True)
    ]


def scale_notes(
    view: ArchiveView, output: str, span: ValueAxis, curves: Sequence[Curve]
) -> Iterator[str]:
    """Yield why an axis is linear though the study asks for another, and what it leaves out."""
    if note := view.linear_scale_note(output):
        yield f"{capitalized(f'{plain_text(output, 30)}: {note}')}."
    for curve in curves if span.is_logarithmic else ():
        if curve.values[0] <= 0:
            share = percent_text(float(f"{np.mean(curve.values <= 0):.2g}"))
            yield f"{share} of the values by {curve.name} are 0 or negative, left of this axis."


def _reasons_without_band(curves: Sequence[Curve]) -> list[str]:
    return [
        f"no band of {curve.name}: {curve.note or 'no reason is known'}"
        for curve in curves
        if not curve.has_band
    ]


def _missing_runs_note(curve: Curve) -> list[str]:
    """Return a note on the runs that a distribution function leaves out, if any."""
    probability = curve.view.statistics.failures(curve.source).get("probability")
    missing = None if probability is None else probability.attrs.get(MISSING)
    if not missing:
        return []
    return [
        f"The curve uses the completed runs; {missing} failed. A band includes every result that "
        "they could have had."
    ]
