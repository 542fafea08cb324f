"""Distribution functions of the outputs, by source or model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from uqpen.charts.axes import CUT, ValueAxis
from uqpen.core.arrays import FloatArray
from uqpen.figures.curves import Curve, draw_band, draw_curve
from uqpen.figures.panel import Axes, Panel, set_value_axis
from uqpen.results.acceptance import Acceptance
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_text
from uqpen.results.empirical_cdf import LargestRun
from uqpen.results.source_style import GREY, source_style
from uqpen.results.statistic_entries import THRESHOLD_PROBABILITIES
from uqpen.results.texts import plain_text

__all__ = [
    "StudyLimit",
    "cdf",
    "distribution_curves",
    "labelled_limits",
    "mark_thresholds",
    "model_curves",
    "model_panels",
    "output_span",
    "scale_notes",
    "study_limits",
]

# Widths of an axis by which it is made longer, at the most, for a requested value.
_FAR = 1.5
# The part of an axis that an upright label takes.
_ROOM = 0.03


def cdf(view: ArchiveView) -> Iterator[Panel]:
    """Distribution functions of all sources, one with its band."""
    for output in view.numeric_outputs:
        if curves := distribution_curves(view, output):
            yield Panel(view.title(output), partial(_draw_cdf, view, output, curves))


def model_panels(view: ArchiveView) -> Iterator[Panel]:
    """Distribution functions by each of several models."""
    if not view.model:
        return
    for output in view.numeric_outputs:
        source = next(iter(view.estimates(output, "cdf_value")), "")
        if curves := model_curves(view, output, source):
            yield Panel(f"{output}, by {source}", partial(_draw_models, view, output, curves))


def model_curves(view: ArchiveView, output: str, source: str) -> list[Curve]:
    """Return the functions of an output by one source of each model."""
    curves = (
        Curve.from_source(each.model, each.statistics, source, output, view.scale(output))
        for each in view.model_views
    )
    return [curve for curve in curves if curve is not None]


def distribution_curves(view: ArchiveView, output: str) -> list[Curve]:
    """Return the functions of all sources; first that of the requested one, or a design."""
    statistics, measure = view.statistics, view.scale(output)
    curves = (
        Curve.from_source(source, statistics, source, output, measure)
        for source in statistics.sources
    )
    found = [curve for curve in curves if curve is not None]
    if view.source is None:
        return found
    first = [curve for curve in found if curve.name == view.source]
    return first and [*first, *(curve for curve in found if curve.name != view.source)]


def _draw_cdf(view: ArchiveView, output: str, curves: list[Curve], axes: Axes) -> Iterator[str]:
    span = output_span(view, output, [curves[0].values])
    banded = curves[0].extended(*span.ends)
    yield from draw_band(axes, banded, view.look(banded.name).colour)
    draw_curve(axes, banded, view.look(banded.name), is_thick=True)
    for curve in curves[1:]:
        thin = curve.thinned().extended(*span.ends)
        draw_curve(axes, thin, view.look(curve.name), is_thick=False)
    axes.set(xlabel=view.axis_label(output), ylabel="P(at most x)", ylim=(0, 1))
    set_value_axis(axes, span)
    yield from mark_thresholds(axes, view, output, span, at_foot=True)
    yield from scale_notes(view, output, span, curves)
    if span.is_cut:
        yield CUT
        if banded.name in view.designs:
            largest = LargestRun.of_design(view, banded.name, output)
            yield f"{plain_text(output, 30)}, {largest.name}: {largest.text}"


def _draw_models(view: ArchiveView, output: str, curves: list[Curve], axes: Axes) -> Iterator[str]:
    names = [each.model for each in view.model_views]
    span = output_span(view, output, [curve.values for curve in curves])
    for curve in curves:
        style, thin = source_style(names.index(curve.name)), curve.thinned().extended(*span.ends)
        yield from draw_band(axes, thin, style.colour)
        draw_curve(axes, thin, style, is_thick=False)
    axes.set(xlabel=view.axis_label(output), ylabel="P(at most x)", ylim=(0, 1))
    set_value_axis(axes, span)
    yield from mark_thresholds(axes, view, output, span, at_foot=True)
    yield from scale_notes(view, output, span, curves)
    if span.is_cut:
        yield CUT


class StudyLimit(NamedTuple):
    """Limit of a study on an output: a value whose probability it asks for.

    Attributes
    ----------
    text : str
        As the study writes it.
    value : float
        In the unit that is shown.
    in_si : float
        In the output's SI unit.
    acceptance : Acceptance or None
        The probabilities that the study accepts, and the verdict; None where it accepts any.
    """

    text: str
    value: float
    in_si: float
    acceptance: Acceptance | None


def study_limits(view: ArchiveView, output: str) -> list[StudyLimit]:
    """Return the limits of a study on an output; first those that it has a verdict about."""
    found: dict[str, StudyLimit] = {}
    for statistic in THRESHOLD_PROBABILITIES:
        source = next(iter(view.estimates(output, statistic.name)), None)
        entries = {} if source is None else view.statistics.entries(source, output, statistic.name)
        for label, entry in entries.items():
            in_si = float(entry.coords.variables[f"{statistic.dims[0]}_value"].values)
            text, value = str(label), float(view.scale(output).from_si(in_si))
            limit = StudyLimit(text, value, in_si, Acceptance.from_array(entry))
            if text not in found or found[text].acceptance is None:
                found[text] = limit
    return sorted(found.values(), key=lambda each: each.acceptance is None)


def output_span(
    view: ArchiveView,
    output: str,
    every: Sequence[FloatArray],
    marked: Sequence[float] = (),
    *,
    has_all_limits: bool = True,
) -> ValueAxis:
    """Return the axis of an output, past most of its values and past the limits of the study.

    Not past those so far away that nothing could be seen of the rest.

    Parameters
    ----------
    view : ArchiveView
        Of the model.
    output : str
        Its name.
    every : sequence of ndarray
        Values in the unit that is shown.
    marked : sequence of float
        Values that are on the axis in any case.
    has_all_limits : bool
        False for those alone that the study has a verdict about.
    """
    is_logarithmic = view.is_logarithmic(output)
    span = ValueAxis.of_values(every, marked, is_logarithmic=is_logarithmic)
    near = [
        limit.value
        for limit in study_limits(view, output)
        if (has_all_limits or limit.acceptance is not None)
        and (limit.value > 0 or not is_logarithmic)
        and -_FAR <= span.share(limit.value) <= 1 + _FAR
    ]
    return ValueAxis.of_values(every, [*marked, *near], is_logarithmic=is_logarithmic)


def labelled_limits(
    view: ArchiveView, output: str, span: ValueAxis, room: float
) -> tuple[list[tuple[StudyLimit, bool]], list[StudyLimit]]:
    """Return the limits on an axis, each with whether there is room for its label, and the others.

    Parameters
    ----------
    room : float
        The part of the axis that an upright label takes.
    """
    drawn: list[tuple[StudyLimit, bool]] = []
    beyond = []
    named: list[float] = []  # places of the labels
    for limit in study_limits(view, output):
        if (span.is_logarithmic and limit.value <= 0) or not span.contains(limit.value):
            beyond.append(limit)
            continue
        place = span.share(limit.value)
        is_named = all(abs(place - other) >= room for other in named)
        named += [place] * is_named
        drawn.append((limit, is_named))
    return drawn, beyond


def mark_thresholds(
    axes: Axes, view: ArchiveView, output: str, span: ValueAxis, *, at_foot: bool
) -> Iterator[str]:
    """Draw a line at each requested value, with its text in the study where there is room."""
    drawn, beyond = labelled_limits(view, output, span, _ROOM)
    for limit, is_named in drawn:
        has_verdict = limit.acceptance is not None
        dashes = (0, (5, 2)) if has_verdict else (0, (2, 2))
        width = 1.3 if has_verdict else 0.9
        axes.axvline(limit.value, color=GREY, linewidth=width, linestyle=dashes, zorder=1)
        if is_named:
            axes.annotate(
                plain_text(limit.text, 20),
                (limit.value, 0 if at_foot else 1),
                (2, 3 if at_foot else -2),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                rotation=90,
                va="bottom" if at_foot else "top",
                fontsize=6.5,
                color=GREY,
            )
    if beyond:
        named = ", ".join(plain_text(limit.text, 20) for limit in beyond)
        yield f"asked for beyond the axis of {plain_text(output, 30)}: {named}"


def scale_notes(
    view: ArchiveView, output: str, span: ValueAxis, curves: Sequence[Curve]
) -> Iterator[str]:
    """Yield why an axis is linear though the study asks for another, and what it leaves out."""
    if note := view.linear_scale_note(output):
        yield f"{plain_text(output, 30)}: {note}"
    for curve in curves if span.is_logarithmic else ():
        if curve.values[0] <= 0:
            share = percent_text(float(f"{np.mean(curve.values <= 0):.2g}"))
            yield f"{share} of the values by {curve.name} are 0 or negative, left of this axis"
