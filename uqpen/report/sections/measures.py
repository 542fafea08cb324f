"""A chart of measures of the inputs' part: a row for each input, a dot for each source."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.told import told
from uqpen.figures.measures import Series, shown_inputs
from uqpen.figures.part import Part
from uqpen.figures.texts import after_number
from uqpen.labels import CHECKED, INPUT, INTERVAL_LABEL, REFUSED, UNCHECKED
from uqpen.report.axes import padded
from uqpen.report.blocks import Axis, Chart, Key
from uqpen.report.marks import Trace, crosses, dots, marker_of
from uqpen.report.notes import bars_of, has_interval
from uqpen.report.shapes import Shape, level, upright
from uqpen.summary.digits import sensible
from uqpen.summary.table import Conversion, OutputTable, remark
from uqpen.units import DIMENSIONLESS

__all__ = ["Asked", "measures_chart"]

FloatArray = npt.NDArray[np.float64]

_MARKERS = {"o": "circle", "s": "square", "D": "diamond", "^": "triangle-up"}
_VERDICTS = (CHECKED, REFUSED, UNCHECKED)
# Heights in CSS pixels: of all but the rows, between rows, and of a dot.
_FRAME, _GAP, _DOT = 62, 14, 11
# Reasons for having no interval that are written out below a chart.
_MOST_REASONS = 3


@dataclass(frozen=True)
class Asked:
    """What a chart is to show.

    Parameters
    ----------
    title, axis : str
    convert : callable
        Out of SI units, estimate and bounds.
    spoken : tuple of str
        The labels of measures of which the summary may say which input's is the largest, the
        better ones first.
    unit : str
        Of the estimates.
    notes : tuple of str
    """

    title: str
    axis: str
    convert: Conversion
    spoken: tuple[str, ...]
    unit: str = DIMENSIONLESS
    notes: tuple[str, ...] = ()


class _Estimate(NamedTuple):
    """What a series says of an input, in the unit that is shown."""

    name: str
    bounds: FloatArray
    label: str
    note: str

    @property
    def has_interval(self) -> bool:
        return bool(has_interval(self.bounds))

    def said(self, unit: str) -> str:
        return f"{sensible(*self.bounds.tolist())}{after_number(unit)}"


def measures_chart(
    part: Part, found: Sequence[Series], asked: Asked, tables: Sequence[OutputTable] = ()
) -> Chart:
    """A chart of some measures.

    Parameters
    ----------
    part : Part
    found : sequence of Series
        At least one, each with at least one estimate.
    asked : Asked
    tables : sequence of OutputTable
        The numbers behind it.
    """
    inputs, cut = shown_inputs(found)
    estimates = [_estimates(each.array, inputs, asked.convert) for each in found]
    shapes: list[Shape] = [upright(0, "quiet", "dot")]
    shapes += [level(row - 0.5, "grid") for row in range(1, len(inputs))]
    notes = [*_notes(found, estimates), *asked.notes]
    if cut:
        notes.append(f"Shown are {cut}; the table has all." if tables else f"Shown are {cut}.")
    return Chart(
        title=asked.title,
        summary=_summary(found, estimates, asked),
        x=Axis(asked.axis, _ends(estimates)),
        y=Axis("", rows=inputs),
        traces=tuple(_traces(part, found, estimates, inputs, asked)),
        shapes=tuple(shapes),
        keys=tuple(_keys(part, found, estimates)),
        notes=tuple(notes),
        tables=tuple(tables),
        height=_FRAME + len(inputs) * (_GAP + _DOT * len(found)),
    )


def _estimates(array: xr.DataArray, inputs: Sequence[str], convert: Conversion) -> list[_Estimate]:
    known = array[INPUT].values.tolist()
    return [
        _Estimate(
            name,
            np.asarray(convert(figure.values), dtype=np.float64),
            told(figure, INTERVAL_LABEL),
            remark(figure),
        )
        for name in inputs
        if name in known and np.isfinite((figure := array[known.index(name)]).values[0])
    ]


def _ends(estimates: Sequence[Sequence[_Estimate]]) -> tuple[float, float]:
    """Zero, all estimates and all of their bounds, with some room."""
    every = np.concatenate([[0.0], *(one.bounds for each in estimates for one in each)])
    return padded(float(np.nanmin(every)), float(np.nanmax(every)))


def _look(part: Part, each: Series) -> tuple[int, str]:
    """Colour and marker: of the source, or of the measure where there are several."""
    position = part.sources.index(each.source)
    return position, _MARKERS[each.marker] if each.label else marker_of(position)


def _named(each: Series) -> str:
    return f"{each.label} by {each.source}" if each.label else each.source


def _traces(
    part: Part,
    found: Sequence[Series],
    estimates: Sequence[Sequence[_Estimate]],
    inputs: Sequence[str],
    asked: Asked,
) -> Iterator[Trace]:
    room = 1 / (len(found) + 1)
    for number, (each, told_by) in enumerate(zip(found, estimates, strict=True)):
        if not told_by:
            continue
        places = [inputs.index(one.name) + (number + 1) * room - 0.5 for one in told_by]
        bounds = np.array([one.bounds for one in told_by])
        colour, marker = _look(part, each)
        hovers = [_hover(one, each, asked.unit) for one in told_by]
        name = _named(each)
        yield dots(bounds, places, colour, hovers=hovers, name=name, marker=marker)
        refused = [at for at, one in enumerate(told_by) if one.label == REFUSED]
        if refused:
            yield crosses(bounds[refused, 0], np.array(places)[refused], f"{name}, refused")


def _hover(one: _Estimate, each: Series, unit: str) -> str:
    text = f"{one.name}, {_named(each)}: {one.said(unit)}"
    verdict = one.label if one.label in _VERDICTS else ""
    known = ", ".join(filter(None, (verdict, one.note)))
    return f"{text} ({known})" if known else text


def _keys(
    part: Part, found: Sequence[Series], estimates: Sequence[Sequence[_Estimate]]
) -> Iterator[Key]:
    every = [one for each in estimates for one in each]
    for each, told_by in zip(found, estimates, strict=True):
        colour, marker = _look(part, each)
        is_hollow = told_by and not any(one.has_interval for one in told_by)
        yield Key(_named(each), colour, f"{marker}-open" if is_hollow else marker)
    if any(one.label == REFUSED for one in every):
        yield Key("refused", "ink", "x")


def _notes(found: Sequence[Series], estimates: Sequence[Sequence[_Estimate]]) -> Iterator[str]:
    """What a reader must know of bars, of hollow markers and of crosses."""
    every = [
        (_named(each), one)
        for each, told_by in zip(found, estimates, strict=True)
        for one in told_by
    ]
    yield from bars_of((each.array for each in found), ", of each estimate by itself")
    barred = [(name, one) for name, one in every if one.has_interval]
    for text, names in _by_text((name, one.note) for name, one in barred if one.note).items():
        yield f"Of the intervals of {', '.join(names)}: {text}."
    hollow = ((name, _reason(one)) for name, one in every if not one.has_interval)
    reasons = _by_text(hollow)
    if len(reasons) > _MOST_REASONS:
        yield "Hollow: no interval; the notes of the table say why."
    else:
        for text, names in reasons.items():
            yield f"Hollow, without an interval: {', '.join(names)} ({text})."
    if any(one.label == REFUSED for _, one in every):
        yield "Crossed out: refused, as independent runs contradict it."


def _by_text(pairs: Iterable[tuple[str, str]]) -> dict[str, list[str]]:
    """The names that each text is told of, each once."""
    found: dict[str, list[str]] = {}
    for name, text in pairs:
        names = found.setdefault(text, [])
        if name not in names:
            names.append(name)
    return found


def _reason(one: _Estimate) -> str:
    if one.label in _VERDICTS:
        return f"{one.label}: {one.note}"
    return one.note or "none is told"


def _summary(
    found: Sequence[Series], estimates: Sequence[Sequence[_Estimate]], asked: Asked
) -> str:
    """Which input's estimate is the largest, and whether intervals tell it from the others."""
    told_by, each, label = _spoken(found, estimates, asked)
    ordered = sorted(told_by, key=lambda one: -float(one.bounds[0]))
    first, *others = ordered
    text = f"By {each.source}, {first.name} has the largest {label}: {first.said(asked.unit)}"
    if others:
        text += f"; that of {others[0].name} comes next: {others[0].said(asked.unit)}"
    verdict = " It is refused, as independent runs contradict it." * (first.label == REFUSED)
    return f"{text}.{verdict}{_certainty(first, others)}"


def _spoken(
    found: Sequence[Series], estimates: Sequence[Sequence[_Estimate]], asked: Asked
) -> tuple[Sequence[_Estimate], Series, str]:
    """What is spoken of: what has an interval if anything does, else what is not refused."""
    ranked = []
    for position, (each, told_by) in enumerate(zip(found, estimates, strict=True)):
        label = each.label or asked.spoken[0]
        if told_by and label in asked.spoken:
            lacks = not all(one.has_interval for one in told_by)
            is_refused = any(one.label == REFUSED for one in told_by)
            rank = (lacks, is_refused, asked.spoken.index(label), position)
            ranked.append((rank, (told_by, each, label)))
    return min(ranked, key=lambda entry: entry[0])[1]


def _certainty(first: _Estimate, others: Sequence[_Estimate]) -> str:
    """What the intervals tell of the order of the first and all others."""
    every = (first, *others)
    if not others:
        return ""
    if not any(one.has_interval for one in every):
        return " None has an interval, so nothing tells how sure this order is."
    if not all(np.isfinite(one.bounds).all() for one in every):
        return " Not all have an interval, so nothing tells how sure this order is."
    near = [one.name for one in others if one.bounds[2] >= first.bounds[1]]
    said = f" Of it must be known: {first.note}." if first.note else ""
    if not near:
        return f" Its interval overlaps with no other's.{said}"
    names = ", ".join(near)
    return f" Its interval overlaps with that of {names}, which leaves open which is larger.{said}"
