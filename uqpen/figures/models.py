"""What several models say of the same points."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from uqpen.archive.read import group, names_in
from uqpen.figures.curves import Curve, draw_band, draw_curve, span
from uqpen.figures.panel import Panel
from uqpen.figures.part import Part
from uqpen.figures.style import look
from uqpen.labels import CDFS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["curves_of_models", "models"]


def models(part: Part) -> Iterator[Panel]:
    """Distribution functions by each of several models."""
    if not part.model:
        return
    source = part.source or next(iter(names_in(part.tree, CDFS)), "")
    for output in part.numbers:
        if curves := curves_of_models(part, output, source):
            yield Panel(f"{output}, by {source}", partial(_draw, part, output, curves))


def curves_of_models(part: Part, output: str, source: str) -> list[Curve]:
    """The distribution functions of an output that the models tell by one source."""
    curves = [
        Curve.of(each.model, told, output, part.measure(output))
        for each in part.others
        if output in (told := group(each.tree, CDFS, source))
    ]
    return [curve for curve in curves if np.isfinite(curve.values).any()]


def _draw(part: Part, output: str, curves: list[Curve], axes: Axes) -> Iterator[str]:
    names = [each.model for each in part.others]
    lower, upper, is_cut = span([curve.values for curve in curves])
    curves = [curve.thinned().up_to(lower, upper) for curve in curves]
    for curve in curves:
        appearance = look(names.index(curve.name))
        yield from draw_band(axes, curve, appearance.colour)
        draw_curve(axes, curve, appearance, is_thick=False)
    axes.set_xlim(lower, upper)
    axes.set(xlabel=part.axis(output), ylabel="P(at most x)", ylim=(0, 1))
    if is_cut:
        yield "axes end where all but 1 % lies inside"
