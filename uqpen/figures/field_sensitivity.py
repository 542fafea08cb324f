"""Sensitivity of curves along their dimension: indices, stacked and with their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.figures.panel import Axes, Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.curve_estimates import CurveEstimates, curves
from uqpen.results.digits import percent_text
from uqpen.results.source_statistics import best_sources
from uqpen.results.source_style import SourceStyle, source_style
from uqpen.results.texts import plain_text

__all__ = ["sensitivity_along_panels"]

_FIRST, _TOTAL = "first_order", "total_order"
# Inputs that are shown: those with the largest indices.
_MOST_INPUTS = 8
_STACK, _INTERVAL = 0.75, 0.25


def sensitivity_along_panels(view: ArchiveView) -> Iterator[Panel]:
    """Sobol' indices of curves, stacked and with intervals."""
    for output in curves(view):
        estimates = view.estimates(output, _FIRST)
        for source in best_sources(view.tree, estimates.items())[:1]:
            found = CurveEstimates(view, output, source)
            first = found.entries(_FIRST)
            if any(np.isfinite(bounds[:, 0]).any() for bounds in first.values()):
                looks = _styles(first)
                stacked = view.title(f"{output}, {source}: shares of its variance")
                yield Panel(stacked, partial(_draw_stack, found, looks), group=output)
                lines = view.title(f"{output}, {source}: first- and total-order indices")
                yield Panel(lines, partial(_draw_lines, found, looks), group=output)


def _styles(entries: Mapping[str, FloatArray]) -> dict[str, SourceStyle]:
    """Return a style of each input that is shown, that with the largest index first."""
    largest = {name: np.nanmax(bounds[:, 0], initial=0) for name, bounds in entries.items()}
    names = sorted(largest, key=lambda name: -largest[name])[:_MOST_INPUTS]
    return {name: source_style(number) for number, name in enumerate(names)}


def _draw_stack(
    found: CurveEstimates, looks: Mapping[str, SourceStyle], axes: Axes
) -> Iterator[str]:
    entries = found.entries(_FIRST)
    shares = np.stack([np.maximum(entries[name][:, 0], 0.0) for name in looks])
    axes.stackplot(
        found.places,
        shares,
        colors=[look.colour for look in looks.values()],
        labels=[plain_text(name, 40) for name in looks],
        alpha=_STACK,
        edgecolor="white",
        linewidth=0.5,
    )
    top = max(1.0, float(np.nanmax(shares.sum(axis=0))))
    _label_axes(found, axes, "first-order indices, stacked", top)
    yield "white above a stack: interactions, and the errors of the indices"
    if any((entries[name][:, 0] < 0).any() for name in looks):
        yield "an index below 0, by its error, is stacked as 0"
    if len(looks) < len(entries):
        yield f"the {len(looks)} inputs with the largest indices, of {len(entries)}"


def _draw_lines(
    found: CurveEstimates, looks: Mapping[str, SourceStyle], axes: Axes
) -> Iterator[str]:
    top = 1.0
    for statistic, width in ((_FIRST, 1.5), (_TOTAL, 0.7)):
        entries = found.entries(statistic)
        for name, look in looks.items():
            if name not in entries:
                continue
            bounds = entries[name]
            axes.plot(
                found.places, bounds[:, 0], color=look.colour, linestyle=look.line, linewidth=width
            )
            axes.fill_between(
                found.places,
                bounds[:, 1],
                bounds[:, 2],
                color=look.colour,
                alpha=_INTERVAL,
                linewidth=0,
            )
            top = max(top, float(np.nanmax(bounds[:, 0], initial=0)))
        if entries and statistic == _TOTAL:
            yield "thick: first order; thin: total order"
        if any(np.isfinite(bounds[:, 1:]).any() for bounds in entries.values()):
            level = percent_text(found.level(statistic))
            yield f"shades of lines: {level} intervals, each place by itself"
        elif entries:
            reason = plain_text(found.reason(statistic) or "no reason is known")
            yield f"no interval: {reason}"
    _label_axes(found, axes, "index", top)


def _label_axes(found: CurveEstimates, axes: Axes, label: str, top: float) -> None:
    axes.set_xlabel(found.view.axis_label(found.dimension))
    axes.set(ylabel=label, xlim=found.places[[0, -1]], ylim=(0, 1.02 * top))
