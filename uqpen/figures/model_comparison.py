"""Distribution functions of several models at the same points."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from uqpen.figures.curves import Curve, axis_span, draw_band, draw_curve
from uqpen.figures.panel import Panel
from uqpen.results.archive_view import ArchiveView
from uqpen.results.source_style import source_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["model_curves", "model_panels"]


def model_panels(view: ArchiveView) -> Iterator[Panel]:
    """Distribution functions by each of several models."""
    if not view.model:
        return
    for output in view.numeric_outputs:
        source = next(iter(view.estimates(output, "cdf_value")), "")
        if curves := model_curves(view, output, source):
            yield Panel(f"{output}, by {source}", partial(_draw, view, output, curves))


def model_curves(view: ArchiveView, output: str, source: str) -> list[Curve]:
    """Return the distribution functions of an output by one source of each model."""
    curves = (
        Curve.from_source(each.model, each.statistics, source, output, view.scale(output))
        for each in view.model_views
    )
    return [curve for curve in curves if curve is not None]


def _draw(view: ArchiveView, output: str, curves: list[Curve], axes: Axes) -> Iterator[str]:
    names = [each.model for each in view.model_views]
    lower, upper, is_cut = axis_span([curve.values for curve in curves])
    curves = [curve.thinned().extended(lower, upper) for curve in curves]
    for curve in curves:
        appearance = source_style(names.index(curve.name))
        yield from draw_band(axes, curve, appearance.colour)
        draw_curve(axes, curve, appearance, is_thick=False)
    axes.set_xlim(lower, upper)
    axes.set(xlabel=view.axis_label(output), ylabel="P(at most x)", ylim=(0, 1))
    if is_cut:
        yield "axes end where all but 1 % lies inside"
