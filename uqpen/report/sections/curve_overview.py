"""Curves at a glance: the median by each model, and the quantiles around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from uqpen.charts.axes import quantity
from uqpen.charts.chart import Axis, Block, Chart, Charts, LegendKey
from uqpen.charts.marks import Band, Mark, series_dash
from uqpen.report.blocks import Heading
from uqpen.report.sections.curve_lines import MOST_PLACES, line
from uqpen.report.sections.leading_design import leading_design
from uqpen.results.archive_view import ArchiveView
from uqpen.results.curve_estimates import CurveEstimates, curves
from uqpen.results.digits import number_text, percent_text
from uqpen.results.texts import capitalized, join_names

__all__ = ["first_curves", "further_curves"]

# Curves among the main results; these fit in one row.
_MOST = 4
_MEDIAN = 0.5


def first_curves(view: ArchiveView) -> Iterator[Block]:
    """Yield the charts of the first curves, those by several models before others."""
    if charts := _ordered_curves(view)[:_MOST]:
        yield _side_by_side(view, charts)


def further_curves(view: ArchiveView) -> Iterator[Block]:
    """Yield the charts of all curves that are not among the first ones."""
    if charts := _ordered_curves(view)[_MOST:]:
        yield Heading("Further curves")
        yield _side_by_side(view, charts)


def _ordered_curves(view: ArchiveView) -> list[dict[int, CurveEstimates]]:
    """Return the curves with quantiles, each by the numbers of its models."""
    found: dict[str, dict[int, CurveEstimates]] = {}
    for number, each in enumerate(view.model_views):
        design = leading_design(each)
        for output in curves(each) if design else ():
            curve = CurveEstimates(each, output, design or "", MOST_PLACES)
            if _MEDIAN in curve.entries("quantile"):
                found.setdefault(output, {})[number] = curve
    return sorted(found.values(), key=len, reverse=True)


def _side_by_side(view: ArchiveView, entries: Sequence[dict[int, CurveEstimates]]) -> Charts:
    every = [curve for by_model in entries for curve in by_model.values()]
    numbered = sorted({number: curve for each in entries for number, curve in each.items()}.items())
    keys = [
        LegendKey(f"median by {curve.view.model or curve.source}", series, "line", dash)
        for number, curve in numbered
        for series, dash in (_look(curve, number),)
    ]
    notes = [_shades_note(every)]
    if any(curve.bounds("reached") is not None for curve in every):
        notes.append("Where curves end: quantiles at a place are of the curves that get there.")
    return Charts(
        tuple(_chart(view, by_model) for by_model in entries),
        keys=tuple(keys),
        notes=tuple(filter(None, notes)),
    )


def _look(curve: CurveEstimates, number: int) -> tuple[int, str]:
    """Return the colour and the dashes: of one of several models, otherwise of the design."""
    return (
        (number, series_dash(number))
        if curve.view.model
        else (curve.view.series(curve.source), "solid")
    )


def _shades_note(every: Sequence[CurveEstimates]) -> str:
    """Return what the shades are."""
    limits = dict.fromkeys(_outer_quantiles(curve) for curve in every)
    texts = [
        f"{percent_text(ends[0])} and the {percent_text(ends[1])} quantile"
        for ends in limits
        if ends is not None
    ]
    return f"Shades: between the {join_names(texts)} at each place." if texts else ""


def _outer_quantiles(curve: CurveEstimates) -> tuple[float, float] | None:
    """Return the outermost quantiles on both sides of the median; None without any."""
    known = sorted(curve.entries("quantile"))
    return (known[0], known[-1]) if known[0] < _MEDIAN < known[-1] else None


def _chart(view: ArchiveView, by_model: dict[int, CurveEstimates]) -> Chart:
    first = next(iter(by_model.values()))
    looks = [(curve, *_look(curve, number)) for number, curve in by_model.items()]
    is_alone = len(by_model) == 1 < len(view.model_views)
    return Chart(
        title=capitalized(first.view.axis_label(first.output)),
        summary=" ".join(_ends_sentence(curve) for curve in by_model.values()),
        x=Axis(
            first.view.axis_label(first.dimension),
            (float(first.places[0]), float(first.places[-1])),
        ),
        y=Axis(
            quantity(first.view, first.output).unit
        ),  # its name, long as it may be, is the title
        marks=(
            *(each for curve, series, _ in looks for each in _shade(curve, series)),
            *(_median(curve, series, dash) for curve, series, dash in looks),
        ),
        notes=(f"By {first.view.model} alone.",) if is_alone else (),
        height=220,
        is_compared=True,
    )


def _shade(curve: CurveEstimates, series: int) -> list[Mark]:
    ends = _outer_quantiles(curve)
    if ends is None:
        return []
    lower, upper = (curve.entries("quantile")[p][:, 0] for p in ends)
    return [Band(curve.places, lower, upper, series)]


def _median(curve: CurveEstimates, series: int, dash: str) -> Mark:
    median = curve.entries("quantile")[_MEDIAN]
    return line(curve, median, series, curve.view.model or "median", dash=dash)


def _ends_sentence(curve: CurveEstimates) -> str:
    by = curve.view.model or curve.source
    known = curve.entries("quantile")[_MEDIAN][:, 0]
    known = known[np.isfinite(known)]
    if not known.size:
        return f"By {by}, no run has a value."
    return f"By {by}, the median goes from {number_text(known[0])} to {number_text(known[-1])}."
